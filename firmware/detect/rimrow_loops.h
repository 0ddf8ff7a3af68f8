/* The loops of rimrow.h. Every dsp_*.c includes them. Those of 32-bit numbers are plain C, and its compiler flags
 * decide how wide they become; that of 16-bit numbers is rimrow_lanes.h. There is one source, so all give the same
 * bits. No loop calls, branches or looks up a table. */
#ifndef TESSERA_FIRMWARE_DETECT_RIMROW_LOOPS_H
#define TESSERA_FIRMWARE_DETECT_RIMROW_LOOPS_H

#include <stddef.h>

#include "firmware/detect/rimrow.h"
#include "firmware/detect/rimrow_lanes.h"

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

/* A pixel's place: how far from the unit circle, in which direction, and whether it is looked at. */
RIMROW_INLINE void rimrow_place(const struct rimrow_view *view, unsigned edge_count,
                                struct rimrow_batch *batch, unsigned i)
{
    const int32_t p_q14 = batch->p_q14[i];
    const int32_t q_q14 = batch->q_q14[i];
    const uint32_t whole_q28 =
        (uint32_t)p_q14 * (uint32_t)p_q14 + (uint32_t)q_q14 * (uint32_t)q_q14;
    int32_t kept = ~((int32_t)whole_q28 >> 31) & ~rimrow_below((int32_t)(whole_q28 >> 1), 1 << 24);
    const int32_t square_q28 = ((int32_t)whole_q28 & kept) | (1 << 28 & ~kept);
    batch->square_q12[i] = (int16_t)(square_q28 >> 16);

    const int32_t over_q15 = rimrow_inverse_root_q15(square_q28);
    batch->cos_q14[i] = (int16_t)(((p_q14 & kept) * over_q15) >> 15);
    batch->sin_q14[i] = (int16_t)(((q_q14 & kept) * over_q15) >> 15);

    /* rho = rho^2 / rho, and another step of Newton's for its last digits. */
    const int32_t rough_q14 = ((square_q28 >> 14) * over_q15) >> 15;
    const int32_t miss_q24 =
        (int32_t)((uint32_t)square_q28 - (uint32_t)rough_q14 * (uint32_t)rough_q14) >> 4;
    const int32_t rho_q24 = rough_q14 * 1024 + ((miss_q24 * over_q15) >> 16);
    const int32_t depth = rimrow_cut(((1 << 24) - rho_q24) >> view->depth_shift, 23000);
    batch->depth_q13[i] = (int16_t)rimrow_cut((depth * view->depth_q14) >> (14 + view->wide), INT16_MAX);

    for (unsigned k = 0; k < edge_count && edge_count <= RIMROW_EDGES; k++) {
        const struct rimrow_edge *at = &view->edges[k];
        const int32_t apart_q11 =
            at->t0_q11 + ((at->tp * p_q14 + at->tq * q_q14) >> view->edge_shift);
        kept &= ~(apart_q11 >> 31);
        batch->apart_q13[k][i] =
            (int16_t)rimrow_most(rimrow_least(4 * rimrow_least(apart_q11, 4 << 11), INT16_MAX), 0);
    }
    if (edge_count == RIMROW_GIVEN) {
        kept &= rimrow_below(batch->others_q14[i], RIMROW_BEYOND_Q14);
    }
    batch->kept[i] = (int16_t)kept;
}

/* What the model leaves of the brightness. */
RIMROW_INLINE void rimrow_rest(const struct rimrow_view *view, struct rimrow_batch *batch, unsigned i)
{
    const int32_t p_q14 = batch->p_q14[i];
    const int32_t q_q14 = batch->q_q14[i];
    const int32_t level_q5 =
        view->level_q5 + ((view->level_p_q5 * p_q14 + view->level_q_q5 * q_q14) >> 14);
    const int32_t contrast_q2 = rimrow_cut(
        view->contrast_q2 + ((view->contrast_p_q2 * p_q14 + view->contrast_q_q2 * q_q14) >> 14),
        32767);
    const int32_t model_q5 = level_q5 + ((contrast_q2 * batch->edge_q14[i]) >> 11);
    const int32_t rest = rimrow_cut((batch->grey_q4[i] * 32 - model_q5) >> view->rest_shift,
                                    RIMROW_REST_LIMIT);
    batch->columns[(RIMROW_COLUMNS - 1) * RIMROW_PIXELS + i] = (int16_t)(rest & batch->kept[i]);
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

/* The loops for so many edges; the number is known where this is inlined. */
RIMROW_INLINE void rimrow_rows_of(const struct rimrow_view *view, unsigned edge_count, unsigned count,
                                  struct rimrow_batch *batch)
{
    const unsigned whole = (count + RIMROW_STEP - 1) / RIMROW_STEP * RIMROW_STEP;
    for (unsigned i = 0; i < whole; i++) {
        rimrow_place(view, edge_count, batch, i);
    }
    for (unsigned i = 0; i < whole; i += RV_LANES) {
        rimrow_profile(view, edge_count, batch, i);
    }
    for (unsigned i = 0; i < whole; i++) {
        rimrow_rest(view, batch, i);
    }
}

/* Computes whole steps of `count` pixels; the caller pads with p = q = 0, which is never kept. */
static void rimrow_rows(const struct rimrow_view *restrict view, unsigned count,
                        struct rimrow_batch *restrict batch)
{
    switch (view->edge_count) {
    case 0:
        rimrow_rows_of(view, 0, count, batch);
        break;
    case 1:
        rimrow_rows_of(view, 1, count, batch);
        break;
    case 2:
        rimrow_rows_of(view, 2, count, batch);
        break;
    case RIMROW_EDGES:
        rimrow_rows_of(view, RIMROW_EDGES, count, batch);
        break;
    default:
        rimrow_rows_of(view, RIMROW_GIVEN, count, batch);
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
