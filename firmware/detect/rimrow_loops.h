/* The loops of rimrow.h, in plain C. Every dsp_*.c includes them and its compiler flags decide how wide they
 * become; there is one source, so all give the same bits. No loop calls, branches or looks up a table. */
#ifndef TESSERA_FIRMWARE_DETECT_RIMROW_LOOPS_H
#define TESSERA_FIRMWARE_DETECT_RIMROW_LOOPS_H

#include <stddef.h>

#include "firmware/detect/rimrow.h"
#include "firmware/detect/rimrow_table.h"

#define RIMROW_INLINE static inline __attribute__((always_inline))

#define RIMROW_LIMIT_Q15   ((2 << 15) - 64) /* below 2 in Q11 after rounding */
#define RIMROW_REST_LIMIT  4095

RIMROW_INLINE int32_t rimrow_least(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

RIMROW_INLINE int32_t rimrow_most(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

/* All bits where a < b, none elsewhere: comparisons make branches of which no vectors come. |a - b| < 2^31. */
RIMROW_INLINE int32_t rimrow_below(int32_t a, int32_t b)
{
    return (a - b) >> 31;
}

RIMROW_INLINE int32_t rimrow_cut(int32_t value, int32_t limit)
{
    return rimrow_most(rimrow_least(value, limit), -limit);
}

RIMROW_INLINE int32_t rimrow_round(int32_t value, unsigned shift)
{
    return (value + (1 << (shift - 1))) >> shift;
}

/* 1 / sqrt(x) for x in [1/8, 8), Q15; relative error 4e-5: the polynomial's and roundings of 2^-15. */
RIMROW_INLINE int32_t rimrow_inverse_root_q15(int32_t x_q28)
{
    /* Brought into [1/2, 2) by powers of 4, so that nothing jumps near 1. */
    const int32_t low = rimrow_below(x_q28, 1 << 27);
    const int32_t high = ~rimrow_below(x_q28, 1 << 29);
    int32_t n = x_q28 + 3 * (x_q28 & low);
    n -= (n - (n >> 2)) & high;

    const int32_t n_q15 = n >> 13;
    const int32_t y_q15 = n_q15 - 40960; /* 5/4 */
    int32_t root_q15 = rimrow_root_q15[4];
    root_q15 = ((root_q15 * y_q15) >> 15) + rimrow_root_q15[3];
    root_q15 = ((root_q15 * y_q15) >> 15) + rimrow_root_q15[2];
    root_q15 = ((root_q15 * y_q15) >> 15) + rimrow_root_q15[1];
    root_q15 = ((root_q15 * y_q15) >> 15) + rimrow_root_q15[0];
    /* Newton: y (3 - n y^2) / 2. */
    const uint32_t square_q15 = ((uint32_t)root_q15 * (uint32_t)root_q15) >> 15;
    const uint32_t left_q14 = ((3u << 30) - (uint32_t)n_q15 * square_q15) >> 16;
    root_q15 = (int32_t)((uint32_t)root_q15 * left_q14) >> 15;

    root_q15 += root_q15 & low;
    return root_q15 - ((root_q15 >> 1) & high);
}

/* phi(t) by v = t^2 / 4 in [0, 1]; Q16. */
RIMROW_INLINE int32_t rimrow_bell_of_q16(int32_t v_q15)
{
    int32_t bell_q16 = rimrow_bell_q16[5];
    bell_q16 = ((bell_q16 * v_q15) >> 15) + rimrow_bell_q16[4];
    bell_q16 = ((bell_q16 * v_q15) >> 15) + rimrow_bell_q16[3];
    bell_q16 = ((bell_q16 * v_q15) >> 15) + rimrow_bell_q16[2];
    bell_q16 = ((bell_q16 * v_q15) >> 15) + rimrow_bell_q16[1];
    return ((bell_q16 * v_q15) >> 15) + rimrow_bell_q16[0];
}

/* phi(0)^4 exp(-8 v) for v in [0, 1), Q18. */
RIMROW_INLINE int32_t rimrow_fourth_q18(int32_t v_q15)
{
    const int32_t first_q16 = rimrow_bell_of_q16(v_q15);
    const int32_t second_q18 = (first_q16 * first_q16) >> 14;
    return (second_q18 * second_q18) >> 18;
}

/* What lies beyond a straight edge t in [0, 4) blurs away: 1 - Phi(t) in *tail_q15; and phi(t). */
RIMROW_INLINE void rimrow_tail(int32_t t_q13, int32_t *tail_q15, int32_t *bell_q15)
{
    /* phi(t) = phi(t / 2)^4 / phi(0)^3, and phi(0)^-3 = 15.750. */
    const int32_t fourth_q18 = rimrow_fourth_q18((t_q13 * t_q13) >> 15);
    *bell_q15 = rimrow_round(fourth_q18 * 32256, 14);
    const int32_t y_q14 = t_q13 - (1 << 14);
    int32_t mills_q15 = rimrow_mills_q15[7];
    mills_q15 = ((mills_q15 * y_q14) >> 14) + rimrow_mills_q15[6];
    mills_q15 = ((mills_q15 * y_q14) >> 14) + rimrow_mills_q15[5];
    mills_q15 = ((mills_q15 * y_q14) >> 14) + rimrow_mills_q15[4];
    mills_q15 = ((mills_q15 * y_q14) >> 14) + rimrow_mills_q15[3];
    mills_q15 = ((mills_q15 * y_q14) >> 14) + rimrow_mills_q15[2];
    mills_q15 = ((mills_q15 * y_q14) >> 14) + rimrow_mills_q15[1];
    mills_q15 = ((mills_q15 * y_q14) >> 14) + rimrow_mills_q15[0];
    *tail_q15 = (mills_q15 * *bell_q15) >> 15;
}

/* A cubic of the curve's, by y; Q14. */
RIMROW_INLINE int32_t rimrow_cubic_q14(const int32_t terms_q14[4], int32_t y_q14)
{
    int32_t sum_q14 = terms_q14[3];
    sum_q14 = ((sum_q14 * y_q14) >> 14) + terms_q14[2];
    sum_q14 = ((sum_q14 * y_q14) >> 14) + terms_q14[1];
    return ((sum_q14 * y_q14) >> 14) + terms_q14[0];
}

/* From the distance tau to the t of which the blurred disc is Phi: curve.h. */
RIMROW_INLINE int32_t rimrow_bend_q13(const struct rimrow_view *view, int32_t tau_q13, int32_t y_q14,
                                      int32_t h_q14)
{
    const int32_t *c_q14 = view->curve_q14;
    int32_t sum_q14 = c_q14[14];
    sum_q14 = ((sum_q14 * tau_q13) >> 13) + c_q14[12] + ((c_q14[13] * y_q14) >> 14);
    sum_q14 = ((sum_q14 * tau_q13) >> 13) + rimrow_cubic_q14(c_q14 + 8, y_q14);
    sum_q14 = ((sum_q14 * tau_q13) >> 13) + rimrow_cubic_q14(c_q14 + 4, y_q14);
    sum_q14 = ((sum_q14 * tau_q13) >> 13) + rimrow_cubic_q14(c_q14, y_q14);
    const int32_t share_q14 = (view->eps_q14 * h_q14) >> 14;
    const int32_t added_q13 = (rimrow_cut(sum_q14, 4 << 14) * share_q14) >> 15;
    return rimrow_cut(tau_q13 + added_q13, (4 << 13) - 1);
}

/* The blurred Gaussian of the circle, which is not cut at its rim; Q15. */
RIMROW_INLINE int32_t rimrow_peak_q15(const struct rimrow_view *view, int32_t square_q28,
                                      int32_t y_q14)
{
    const int32_t n_q11 = view->peak_n0_q11 - ((view->peak_n1_q11 * y_q14) >> 14);
    const int32_t u_q22 = (square_q28 >> 17) * rimrow_most(n_q11, 0);
    const int32_t v_q15 = rimrow_least(u_q22 >> 10, 32767);
    return (rimrow_fourth_q18(v_q15) * view->peak_q8) >> 11;
}

RIMROW_INLINE void rimrow_pixel(const struct rimrow_view *view, unsigned edge_count,
                                struct rimrow_batch *batch, unsigned i)
{
    const int32_t p_q14 = batch->p_q14[i];
    const int32_t q_q14 = batch->q_q14[i];
    const uint32_t whole_q28 =
        (uint32_t)p_q14 * (uint32_t)p_q14 + (uint32_t)q_q14 * (uint32_t)q_q14;
    int32_t kept = ~((int32_t)whole_q28 >> 31) & ~rimrow_below((int32_t)(whole_q28 >> 1), 1 << 24);
    const int32_t square_q28 = ((int32_t)whole_q28 & kept) | (1 << 28 & ~kept);

    /* Directions: cos and sin of the single and double angle. */
    const int32_t over_q15 = rimrow_inverse_root_q15(square_q28);
    const int32_t cos_q14 = ((p_q14 & kept) * over_q15) >> 15;
    const int32_t sin_q14 = ((q_q14 & kept) * over_q15) >> 15;
    const int32_t cos2_q14 = (cos_q14 * cos_q14 - sin_q14 * sin_q14) >> 14;
    const int32_t sin2_q14 = (cos_q14 * sin_q14) >> 13;

    /* rho = rho^2 / rho, and another step of Newton's for its last digits. */
    const int32_t rough_q14 = ((square_q28 >> 14) * over_q15) >> 15;
    const int32_t miss_q24 =
        (int32_t)((uint32_t)square_q28 - (uint32_t)rough_q14 * (uint32_t)rough_q14) >> 4;
    const int32_t rho_q24 = rough_q14 * 1024 + ((miss_q24 * over_q15) >> 16);

    /* Distance inside the edge, in blurs. */
    const int32_t swing_q29 =
        view->inverse_cos_q15 * cos2_q14 + view->inverse_sin_q15 * sin2_q14;
    const int32_t h_q14 = rimrow_inverse_root_q15(view->inverse_q28 + (swing_q29 >> 1)) >> 1;
    const int32_t depth = rimrow_cut(((1 << 24) - rho_q24) >> view->depth_shift, 23000);
    const int32_t along = rimrow_cut((depth * h_q14) >> 14, 16383);
    const int32_t far_q13 = (along * view->depth_q14) >> 14;
    const int32_t outwards_q13 =
        rimrow_most(((view->gap_q10 * h_q14) >> 11) - view->clear_q13, view->near_q13);
    kept &= ~(rimrow_below(view->band_q13, far_q13) | rimrow_below(far_q13, -view->band_q13) |
              rimrow_below(outwards_q13, -far_q13));
    const int32_t tau_q13 = rimrow_cut(far_q13, RIMROW_BAND_MAX_Q13);

    /* The edge's profile with the peak inside, and its slope. */
    const int32_t y_q14 = rimrow_cut(swing_q29 >> 15, CURVE_Y_MAX_Q14);
    const int32_t t_q13 = rimrow_bend_q13(view, tau_q13, y_q14, h_q14);
    const int32_t t_size_q13 = t_q13 < 0 ? -t_q13 : t_q13;
    const int32_t outside = t_q13 >> 31;
    int32_t tail_q15;
    int32_t bell_q15;
    rimrow_tail(t_size_q13, &tail_q15, &bell_q15);
    const int32_t phi_q15 = (tail_q15 & outside) | (((1 << 15) - tail_q15) & ~outside);
    const int32_t shown_q15 = rimrow_most(phi_q15, view->peak_shown_q15);
    int32_t edge_q15 = ((phi_q15 * view->edge_q14) >> 14) +
                       ((rimrow_least(rimrow_peak_q15(view, square_q28, y_q14), 65535) *
                         (shown_q15 >> 1)) >> 14);
    bell_q15 = (bell_q15 * view->edge_q14) >> 14;
    int32_t blur_q15 = -((t_q13 * bell_q15) >> 13);

    /* Beyond a neighbouring edge lies the circle's own colour in full. */
    int32_t others_q15 = 0;
    int32_t growth_q15 = 0;
    if (edge_count == RIMROW_GIVEN) {
        others_q15 = batch->others_q15[i];
        growth_q15 = batch->growth_q15[i];
        kept &= rimrow_below(others_q15, RIMROW_BEYOND_Q15);
        others_q15 &= kept;
    }
    for (unsigned k = 0; k < edge_count && edge_count <= RIMROW_EDGES; k++) {
        const struct rimrow_edge *at = &view->edges[k];
        const int32_t apart_q11 =
            at->t0_q11 + ((at->tp * p_q14 + at->tq * q_q14) >> view->edge_shift);
        kept &= ~(apart_q11 >> 31);
        const int32_t near = rimrow_below(apart_q11, 4 << 11);
        const int32_t apart_q13 = rimrow_most(rimrow_least(apart_q11 * 4, (4 << 13) - 1), 0);
        int32_t beyond_q15;
        int32_t slope_q15;
        rimrow_tail(apart_q13, &beyond_q15, &slope_q15);
        others_q15 += beyond_q15 & near;
        growth_q15 += ((apart_q13 * slope_q15) >> 13) & near;
    }
    if (edge_count > 0) {
        edge_q15 += (others_q15 * view->over_rim_q11) >> 11;
        blur_q15 += (growth_q15 * view->over_rim_q11) >> 11;
    }
    kept &= ~(rimrow_below(RIMROW_LIMIT_Q15, edge_q15) | rimrow_below(RIMROW_LIMIT_Q15, blur_q15) |
              rimrow_below(blur_q15, -RIMROW_LIMIT_Q15));
    edge_q15 = rimrow_least(edge_q15, RIMROW_LIMIT_Q15);

    /* What the model leaves of the brightness. */
    const int32_t level_q5 =
        view->level_q5 + ((view->level_p_q5 * p_q14 + view->level_q_q5 * q_q14) >> 14);
    const int32_t contrast_q2 = rimrow_cut(
        view->contrast_q2 + ((view->contrast_p_q2 * p_q14 + view->contrast_q_q2 * q_q14) >> 14),
        32767);
    const int32_t model_q5 = level_q5 + ((contrast_q2 * edge_q15) >> 12);
    const int32_t rest = rimrow_cut((batch->grey_q4[i] * 32 - model_q5) >> view->rest_shift,
                                    RIMROW_REST_LIMIT);

    const int32_t push_q15 = rimrow_least((bell_q15 * h_q14) >> 14, RIMROW_LIMIT_Q15) & kept;
    int16_t *at = batch->columns + i;
    at[0 * RIMROW_PIXELS] = (int16_t)rimrow_round(push_q15 * cos_q14, 18);
    at[1 * RIMROW_PIXELS] = (int16_t)rimrow_round(push_q15 * sin_q14, 18);
    at[2 * RIMROW_PIXELS] = (int16_t)rimrow_round(push_q15, 4);
    at[3 * RIMROW_PIXELS] = (int16_t)rimrow_round(push_q15 * cos2_q14, 18);
    at[4 * RIMROW_PIXELS] = (int16_t)rimrow_round(push_q15 * sin2_q14, 18);
    at[5 * RIMROW_PIXELS] = (int16_t)((1 << 11) & kept);
    at[6 * RIMROW_PIXELS] = (int16_t)(rimrow_round(edge_q15, 4) & kept);
    at[7 * RIMROW_PIXELS] = (int16_t)(rimrow_round(blur_q15, 4) & kept);
    at[8 * RIMROW_PIXELS] = (int16_t)(rest & kept);
    const int32_t p_size = p_q14 < 0 ? -p_q14 : p_q14;
    const int32_t q_size = q_q14 < 0 ? -q_q14 : q_q14;
    const int32_t octant = ((p_q14 >> 31) & 1) | ((q_q14 >> 31) & 2) |
                           (rimrow_below(p_size, q_size) & 4);
    batch->octant[i] = (int16_t)((octant & kept) | (8 & ~kept));
}

/* Pixels along a row: their places and, from bytes of grey levels of 256 where there are any, their brightness.
 * Whole steps of RIMROW_RAMP are read and written. */
static void rimrow_span(const struct rimrow_steps *steps, int32_t p_q24, int32_t q_q24,
                        const uint8_t *bytes, unsigned count, int32_t *restrict p_q14,
                        int32_t *restrict q_q14, uint16_t *restrict grey_q4)
{
    for (unsigned x = 0; x < count; x += RIMROW_RAMP) {
        for (unsigned i = 0; i < RIMROW_RAMP; i++) {
            p_q14[x + i] = rimrow_round(p_q24 + steps->p_q24[i], 10);
            q_q14[x + i] = rimrow_round(q_q24 + steps->q_q24[i], 10);
        }
        p_q24 += steps->p_q24[RIMROW_RAMP];
        q_q24 += steps->q_q24[RIMROW_RAMP];
    }
    for (unsigned x = 0; bytes != NULL && x < count; x += RIMROW_RAMP) {
        for (unsigned i = 0; i < RIMROW_RAMP; i++) {
            grey_q4[x + i] = (uint16_t)(bytes[x + i] << 4);
        }
    }
}

/* The loop for so many edges; the number is known where this is inlined. */
RIMROW_INLINE void rimrow_rows_of(const struct rimrow_view *view, unsigned edge_count, unsigned count,
                                  struct rimrow_batch *batch)
{
    const unsigned whole = (count + RIMROW_STEP - 1) / RIMROW_STEP * RIMROW_STEP;
    for (unsigned i = 0; i < whole; i++) {
        rimrow_pixel(view, edge_count, batch, i);
    }
}

/* Computes whole steps of `count` pixels; the caller pads with p = q = 0, which is never kept. */
static void rimrow_rows(const struct rimrow_view *given, unsigned count, struct rimrow_batch *batch)
{
    const struct rimrow_view view = *given; /* a copy: stores to the batch do not change it */
    switch (view.edge_count) {
    case 0:
        rimrow_rows_of(&view, 0, count, batch);
        break;
    case 1:
        rimrow_rows_of(&view, 1, count, batch);
        break;
    case 2:
        rimrow_rows_of(&view, 2, count, batch);
        break;
    case RIMROW_EDGES:
        rimrow_rows_of(&view, RIMROW_EDGES, count, batch);
        break;
    default:
        rimrow_rows_of(&view, RIMROW_GIVEN, count, batch);
        break;
    }
}

/* Adds up the squares of the rests, and the pixels, by octant. */
static void rimrow_octants(const struct rimrow_batch *batch, unsigned count, uint32_t squares[8],
                           uint32_t counts[8])
{
    const unsigned whole = (count + RIMROW_STEP - 1) / RIMROW_STEP * RIMROW_STEP;
    const int16_t *rest = batch->columns + (RIMROW_COLUMNS - 1) * RIMROW_PIXELS;
    for (int16_t octant = 0; octant < 8; octant++) {
        int32_t square = 0; /* 128 of 2^24 at most, but for all 4095 and so below 2^31 */
        int16_t pixels = 0;
        for (unsigned i = 0; i < whole; i++) {
            const int16_t own = (int16_t)-(batch->octant[i] == octant);
            const int16_t one = (int16_t)(rest[i] & own);
            square += rest[i] * one;
            pixels = (int16_t)(pixels - own);
        }
        squares[octant] = (uint32_t)square;
        counts[octant] = (uint32_t)pixels;
    }
}

#endif
