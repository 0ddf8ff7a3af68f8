/* The profile of a rim in 16-bit lanes: what rimrow.h wants of each pixel once its distance from the edge is known.
 *
 * One source for all processors. A dsp_*.c that has vectors says what a lane's operations are before it includes
 * this (RV and RV_...); else they are those of plain C, one lane at a time. All are exact, so all give the same bits:
 *   RV_MULR(a, b)  (a b + 2^14) >> 15, the rounded product of Q15 numbers; never of -2^15 with itself
 *   RV_ADDS, RV_SUBS  saturate; RV_ADD and RV_SUB wrap, and are used where nothing does
 *   RV_SHL, RV_SHR    by a number that all lanes share; RV_SHR keeps the sign
 *   RV_GT(a, b)       all bits where a > b
 * Polynomials are by a w in [-1, 1); every step of Horner's rule stays below 1, or below 2 where it is in Q14, and errs
 * by half of its last digit. */
#ifndef TESSERA_FIRMWARE_DETECT_RIMROW_LANES_H
#define TESSERA_FIRMWARE_DETECT_RIMROW_LANES_H

#include "firmware/detect/rimrow.h"
#include "firmware/detect/rimrow_table.h"

#define RIMROW_INLINE static inline __attribute__((always_inline))

#if !defined(RV)
RIMROW_INLINE int16_t rimrow_saturate(int32_t value)
{
    return (int16_t)(value > INT16_MAX ? INT16_MAX : value < INT16_MIN ? INT16_MIN : value);
}

#define RV             int16_t
#define RV_LANES       1u
#define RV_LOAD(p)     (*(p))
#define RV_STORE(p, v) ((void)(*(p) = (v)))
#define RV_SET(x)      ((int16_t)(x))
#define RV_ADD(a, b)   ((int16_t)((a) + (b)))
#define RV_SUB(a, b)   ((int16_t)((a) - (b)))
#define RV_ADDS(a, b)  rimrow_saturate((a) + (b))
#define RV_SUBS(a, b)  rimrow_saturate((a) - (b))
#define RV_MULR(a, b)  ((int16_t)(((a) * (b) + (1 << 14)) >> 15))
#define RV_MIN(a, b)   ((int16_t)((a) < (b) ? (a) : (b)))
#define RV_MAX(a, b)   ((int16_t)((a) > (b) ? (a) : (b)))
#define RV_AND(a, b)   ((int16_t)((a) & (b)))
#define RV_ANDNOT(a, b) ((int16_t)(~(a) & (b)))
#define RV_OR(a, b)    ((int16_t)((a) | (b)))
#define RV_SHL(a, n)   ((int16_t)((uint16_t)(a) << (n)))
#define RV_SHR(a, n)   ((int16_t)((a) >> (n)))
#define RV_GT(a, b)    ((int16_t)-((a) > (b)))
#endif

/* Below 2 in Q14 and Q12, so that it is below 2 in Q11 after rounding. */
#define RIMROW_EDGE_LIMIT_Q14 ((2 << 14) - 16)
#define RIMROW_LIMIT_Q12      ((2 << 12) - 2)
#define RIMROW_ROOT8_Q13      23169

/* sum of c_k w^k, in the coefficients' format. */
RIMROW_INLINE RV rimrow_horner(const int16_t c[], unsigned degree, RV w_q15)
{
    RV sum = RV_SET(c[degree]);
    for (unsigned k = degree; k-- > 0;) {
        sum = RV_ADD(RV_MULR(sum, w_q15), RV_SET(c[k]));
    }
    return sum;
}

/* A value times a number that may be larger than 1; saturates. */
RIMROW_INLINE RV rimrow_scaled(const struct rimrow_gain *gain, RV value)
{
    const RV part = RV_MIN(RV_MULR(value, RV_SET(gain->mantissa_q15)), RV_SET(gain->limit));
    return RV_SHR(RV_SHL(part, gain->up), gain->down);
}

/* phi(0) exp(-8 v), v in [0, 1). */
RIMROW_INLINE RV rimrow_falling_q15(RV v_q15)
{
    const RV fourth_q15 =
        rimrow_horner(rimrow_fourth_q15, 5, RV_SHL(RV_SUB(v_q15, RV_SET(1 << 14)), 1));
    const RV half_q15 = RV_MULR(fourth_q15, fourth_q15);
    return RV_MULR(half_q15, half_q15);
}

/* One of the cubics of curve.h, by y / 2. */
RIMROW_INLINE RV rimrow_cubic_q11(const int16_t c_q11[4], RV y_q14)
{
    RV sum_q11 = RV_ADDS(RV_MULR(RV_SET(c_q11[3]), y_q14), RV_SET(c_q11[2]));
    sum_q11 = RV_ADDS(RV_MULR(sum_q11, y_q14), RV_SET(c_q11[1]));
    return RV_ADDS(RV_MULR(sum_q11, y_q14), RV_SET(c_q11[0]));
}

/* From the distance tau to the t of which the blurred disc is Phi: curve.h. */
RIMROW_INLINE RV rimrow_bend_q13(const struct rimrow_view *view, RV tau_q14, RV y_q14, RV h_q13)
{
    const int16_t *c_q11 = view->bend_q11;
    RV sum_q11 = RV_SET(c_q11[14]);
    sum_q11 = RV_ADDS(RV_MULR(sum_q11, tau_q14),
                      RV_ADDS(RV_MULR(RV_SET(c_q11[13]), y_q14), RV_SET(c_q11[12])));
    sum_q11 = RV_ADDS(RV_MULR(sum_q11, tau_q14), rimrow_cubic_q11(c_q11 + 8, y_q14));
    sum_q11 = RV_ADDS(RV_MULR(sum_q11, tau_q14), rimrow_cubic_q11(c_q11 + 4, y_q14));
    sum_q11 = RV_ADDS(RV_MULR(sum_q11, tau_q14), rimrow_cubic_q11(c_q11, y_q14));
    const RV most_q11 = RV_SET((4 << 11) - 1);
    const RV cut_q13 = RV_SHL(RV_MAX(RV_MIN(sum_q11, most_q11), RV_SUB(RV_SET(0), most_q11)), 2);
    /* eps h / R, shifted down to below 1. */
    const RV share_q15 = RV_MULR(RV_SET(view->bend_share_q15), h_q13);
    const RV added_q13 = RV_MULR(cut_q13, share_q15);
    const RV limit = RV_SET(INT16_MAX >> view->bend_shift);
    const RV within = RV_MAX(RV_MIN(added_q13, limit), RV_SUB(RV_SET(0), limit));
    return RV_ADDS(RV_SHR(tau_q14, 1), RV_SHL(within, view->bend_shift));
}

/* What neighbouring edges bring: the share of the full swing, and t phi(t), both in Q14. */
RIMROW_INLINE void rimrow_others(const struct rimrow_batch *batch, unsigned edge_count, unsigned i,
                                 RV *others_q14, RV *growth_q14)
{
    *others_q14 = RV_SET(0);
    *growth_q14 = RV_SET(0);
    if (edge_count == RIMROW_GIVEN) {
        *others_q14 = RV_LOAD(batch->others_q14 + i);
        *growth_q14 = RV_LOAD(batch->growth_q14 + i);
        return;
    }
    for (unsigned k = 0; k < edge_count; k++) {
        const RV apart_q13 = RV_LOAD(batch->apart_q13[k] + i);
        const RV bell_q15 = rimrow_falling_q15(RV_MULR(apart_q13, apart_q13));
        const RV mills_q14 =
            rimrow_horner(rimrow_mills_q14, 7, RV_SHL(RV_SUB(apart_q13, RV_SET(2 << 13)), 1));
        *others_q14 = RV_ADD(*others_q14, RV_MULR(mills_q14, bell_q15));
        *growth_q14 = RV_ADD(*growth_q14, RV_SHL(RV_MULR(apart_q13, bell_q15), 1));
    }
}

/* Which pixels are in the band: tau in Q14, h in Q13. */
RIMROW_INLINE RV rimrow_in_band(const struct rimrow_view *view, RV tau_q14, RV h_q13)
{
    const RV gap_q9 = RV_MIN(RV_MULR(RV_SET(view->gap_q11), h_q13), RV_SET(15 << 9));
    const RV outwards_q11 =
        RV_MAX(RV_SUB(RV_SHL(gap_q9, 2), RV_SET(view->clear_q11)), RV_SET(view->near_q11));
    const RV depth_q11 = RV_SHR(tau_q14, 3);
    const RV outside = RV_OR(RV_GT(tau_q14, RV_SET(view->band_q14)),
                             RV_GT(RV_SET(-view->band_q14), tau_q14));
    return RV_ANDNOT(outside, RV_GT(RV_ADD(depth_q11, outwards_q11), RV_SET(-1)));
}

/* 0..7 around the circle, by the signs of both parts of the direction and by which is the smaller. */
RIMROW_INLINE RV rimrow_octant(RV cos_q14, RV sin_q14)
{
    const RV zero = RV_SET(0);
    const RV cos_size = RV_MAX(cos_q14, RV_SUB(zero, cos_q14));
    const RV sin_size = RV_MAX(sin_q14, RV_SUB(zero, sin_q14));
    return RV_OR(RV_OR(RV_AND(RV_GT(zero, cos_q14), RV_SET(1)), RV_AND(RV_GT(zero, sin_q14), RV_SET(2))),
                 RV_AND(RV_GT(sin_size, cos_size), RV_SET(4)));
}

/* h / R in Q13, as 1 / sqrt of (R / h)^2 from 1/8 to 8, in Q13 or, where the view is wide, Q12. It is brought into
 * [1/2, 2) by powers of 4. */
RIMROW_INLINE RV rimrow_over_root_q13(const struct rimrow_view *view, RV v_q13)
{
    const RV low = RV_GT(RV_SET((1 << 12) >> view->wide), v_q13);
    const RV high = RV_GT(v_q13, RV_SET(((1 << 14) >> view->wide) - 1));
    const RV middle = RV_ANDNOT(RV_OR(low, high), RV_SHL(v_q13, 1 + view->wide));
    const RV n_q14 = RV_OR(RV_OR(RV_AND(low, RV_SHL(v_q13, 3 + view->wide)), middle),
                           RV_AND(high, RV_SHR(v_q13, 1 - view->wide)));
    const RV root_q14 =
        rimrow_horner(rimrow_over_root_q14, 7, RV_SHL(RV_SUB(n_q14, RV_SET(5 << 12)), 1));
    const RV half_q14 = RV_SHR(RV_ADD(root_q14, RV_SET(1)), 1);
    const RV quarter_q14 = RV_SHR(RV_ADD(root_q14, RV_SET(2)), 2);
    return RV_OR(RV_OR(RV_AND(low, root_q14), RV_AND(high, quarter_q14)),
                 RV_ANDNOT(RV_OR(low, high), half_q14));
}

/* A value within +-limit. */
RIMROW_INLINE RV rimrow_within(RV value, int32_t limit)
{
    return RV_MAX(RV_MIN(value, RV_SET(limit)), RV_SET(-limit));
}

/* The columns but for the rest; the profile itself is kept for that. Pixels whose numbers leave the range are no
 * longer kept. */
RIMROW_INLINE void rimrow_profile(const struct rimrow_view *view, unsigned edge_count,
                                  struct rimrow_batch *batch, unsigned i)
{
    /* The direction's double angle, and the distance from the edge. */
    const RV cos_q14 = RV_LOAD(batch->cos_q14 + i);
    const RV sin_q14 = RV_LOAD(batch->sin_q14 + i);
    const RV cos2_q14 = RV_SHL(RV_SUB(RV_MULR(cos_q14, cos_q14), RV_MULR(sin_q14, sin_q14)), 1);
    const RV sin2_q14 = RV_SHL(RV_MULR(cos_q14, sin_q14), 2);
    const RV swing_q13 = RV_ADD(RV_MULR(cos2_q14, RV_SET(view->inverse_cos_q14)),
                                RV_MULR(sin2_q14, RV_SET(view->inverse_sin_q14)));
    const RV y_q14 = RV_SHL(rimrow_within(swing_q13, CURVE_Y_MAX_Q14 >> (1 + view->wide)), 1 + view->wide);
    const RV h_q13 = rimrow_over_root_q13(view, RV_ADD(swing_q13, RV_SET(view->inverse_q13)));
    const RV tau_q11 = rimrow_within(RV_MULR(RV_LOAD(batch->depth_q13 + i), h_q13), INT16_MAX >> (3 + view->wide));
    const RV tau_q14 = RV_SHL(tau_q11, 3 + view->wide);
    const RV bent_q13 = rimrow_bend_q13(view, tau_q14, y_q14, h_q13);

    /* The edge, and its slope. */
    const RV t_q13 = RV_MAX(RV_MIN(bent_q13, RV_SET(RIMROW_ROOT8_Q13)), RV_SET(-RIMROW_ROOT8_Q13));
    const RV w_q15 = RV_SHL(RV_SUB(RV_MULR(t_q13, t_q13), RV_SET(1 << 13)), 2);
    const RV bell_q15 = rimrow_horner(rimrow_bell_q15, 6, w_q15);
    const RV step_q14 = RV_MULR(t_q13, rimrow_horner(rimrow_step_q15, 6, w_q15));
    const RV phi_q15 = RV_SHL(RV_ADD(step_q14, RV_SET(1 << 13)), 1);
    const RV swing_q14 = RV_SET(view->edge_q14);
    const RV slope_q14 = RV_MULR(bell_q15, swing_q14);

    /* The peak inside: the blurred Gaussian of the circle, which is not cut at its rim. */
    const RV narrow = RV_MAX(RV_SUBS(RV_SET(view->peak_n0), RV_SHL(RV_MULR(RV_SET(view->peak_n1), y_q14), 1)),
                             RV_SET(0));
    const RV fall = RV_MIN(RV_MULR(RV_LOAD(batch->square_q12 + i), narrow), RV_SET(INT16_MAX >> view->peak_shift));
    const RV peak_q14 = rimrow_scaled(&view->peak, rimrow_falling_q15(RV_SHL(fall, view->peak_shift)));
    const RV shown_q15 = RV_MAX(phi_q15, RV_SET(view->peak_shown_q15));
    RV edge_q14 = RV_ADDS(RV_MULR(phi_q15, swing_q14), RV_MULR(peak_q14, shown_q15));
    RV blur_q12 = RV_SUB(RV_SET(0), RV_MULR(t_q13, slope_q14));

    /* Beyond a neighbouring edge lies the circle's own colour in full. */
    if (edge_count > 0) {
        RV others_q14;
        RV growth_q14;
        rimrow_others(batch, edge_count, i, &others_q14, &growth_q14);
        edge_q14 = RV_ADDS(edge_q14, rimrow_scaled(&view->over_rim, others_q14));
        blur_q12 = RV_ADD(blur_q12, RV_SHR(rimrow_scaled(&view->over_rim, growth_q14), 2));
    }
    RV kept = RV_AND(RV_LOAD(batch->kept + i), rimrow_in_band(view, tau_q14, h_q13));
    kept = RV_ANDNOT(RV_GT(edge_q14, RV_SET(RIMROW_EDGE_LIMIT_Q14)), kept);
    kept = RV_ANDNOT(RV_GT(blur_q12, RV_SET(RIMROW_LIMIT_Q12)), kept);
    kept = RV_ANDNOT(RV_GT(RV_SET(-RIMROW_LIMIT_Q12), blur_q12), kept);

    const RV push_q12 =
        RV_AND(RV_MIN(RV_MULR(slope_q14, h_q13), RV_SET(RIMROW_LIMIT_Q12)), kept);
    int16_t *at = batch->columns + i;
    RV_STORE(at + 0 * RIMROW_PIXELS, RV_MULR(push_q12, cos_q14));
    RV_STORE(at + 1 * RIMROW_PIXELS, RV_MULR(push_q12, sin_q14));
    RV_STORE(at + 2 * RIMROW_PIXELS, RV_SHR(RV_ADD(push_q12, RV_SET(1)), 1));
    RV_STORE(at + 3 * RIMROW_PIXELS, RV_MULR(push_q12, cos2_q14));
    RV_STORE(at + 4 * RIMROW_PIXELS, RV_MULR(push_q12, sin2_q14));
    RV_STORE(at + 5 * RIMROW_PIXELS, RV_AND(RV_SET(1 << 11), kept));
    RV_STORE(at + 6 * RIMROW_PIXELS, RV_AND(RV_SHR(RV_ADDS(edge_q14, RV_SET(4)), 3), kept));
    RV_STORE(at + 7 * RIMROW_PIXELS, RV_AND(RV_SHR(RV_ADD(blur_q12, RV_SET(1)), 1), kept));
    RV_STORE(batch->edge_q14 + i, edge_q14);
    RV_STORE(batch->kept + i, kept);
    RV_STORE(batch->octant + i,
             RV_OR(RV_AND(rimrow_octant(cos_q14, sin_q14), kept), RV_ANDNOT(kept, RV_SET(8))));
}

#endif
