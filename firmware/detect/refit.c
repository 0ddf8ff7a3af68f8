/* See refit.h. Unit-frame coordinates are Q24 with |p| <= 2, Jacobian entries and weights Q20. */
#include "firmware/detect/refit.h"

#include "common/fx/fx.h"
#include "common/fx/root.h"
#include "common/fx/smallsolve.h"

#define UNKNOWNS        5
#define UNIT_LIMIT_Q24  ((int64_t)2 << 24)
#define SLOPE_LIMIT     64
/* J' W J / n has entries near 1/2 for a whole circle. Below this pivot the arc is too short. */
#define PIVOT_FLOOR_Q30 ((int64_t)1 << 16)
/* The right-hand side is small; it is solved 2^6 times larger. */
#define RHS_BITS        6

/* The map to the unit frame and the scaled gradient there. */
struct unit_frame {
    int64_t x_px_q16;
    int64_t y_px_q16;
    int64_t over_xx_q50;  /* 2^50 / B_xx */
    int64_t over_yy_q50;
    int64_t slope_q24;    /* B_yx / B_xx */
    int64_t grad_xp_q20;  /* m grad f = (xp p - xq q, yq q), m = the smaller of B_xx, B_yy */
    int64_t grad_xq_q20;
    int64_t grad_yq_q20;
    int64_t steepest_q40; /* the smallest |m grad f|^2 on the ellipse, so that weights are at most 1 */
};

struct sums {
    int64_t normal_q40[UNKNOWNS][UNKNOWNS]; /* lower triangle of J' W J */
    int64_t right_q44[UNKNOWNS];            /* J' W f */
    int64_t squares_q48;                    /* f' W f */
    uint16_t sectors;
};

static bool make_frame(const struct ellipse *ellipse, const struct ellipse_root *b,
                       uint32_t major_px_q16, struct unit_frame *frame)
{
    if (fx_abs_i64(b->yx_px_q16) > (int64_t)SLOPE_LIMIT * b->xx_px_q16) {
        return false;
    }
    const int64_t m = b->xx_px_q16 < b->yy_px_q16 ? b->xx_px_q16 : b->yy_px_q16;
    frame->x_px_q16 = ellipse->x_px_q16;
    frame->y_px_q16 = ellipse->y_px_q16;
    frame->over_xx_q50 = ((int64_t)1 << 50) / b->xx_px_q16;
    frame->over_yy_q50 = ((int64_t)1 << 50) / b->yy_px_q16;
    frame->slope_q24 = b->yx_px_q16 * ((int64_t)1 << 24) / b->xx_px_q16;
    frame->grad_xp_q20 = (m << 20) / b->xx_px_q16;
    frame->grad_yq_q20 = (m << 20) / b->yy_px_q16;
    frame->grad_xq_q20 = frame->grad_xp_q20 * b->yx_px_q16 / b->yy_px_q16;
    const int64_t ratio_q20 = (m << 20) / major_px_q16;
    frame->steepest_q40 = ratio_q20 * ratio_q20;
    return frame->steepest_q40 > 0;
}

/* Which 16th of the circumference: the octant by signs and by |p| < |q|, halved at 22.5 degrees. */
static unsigned sector_of(int64_t p, int64_t q)
{
    const int64_t ap = fx_abs_i64(p);
    const int64_t aq = fx_abs_i64(q);
    const int64_t large = ap > aq ? ap : aq;
    const int64_t small = ap > aq ? aq : ap;
    const unsigned half = small * 1024 > large * 424 ? 1 : 0; /* tan 22.5 degrees = 0.4142 */
    return (p < 0 ? 8u : 0u) + (q < 0 ? 4u : 0u) + (aq > ap ? 2u : 0u) + half;
}

static bool gather_sums(const int32_t x_px_q16[], const int32_t y_px_q16[], uint32_t count,
                        const struct unit_frame *frame, struct sums *sums)
{
    *sums = (struct sums){0};
    for (uint32_t i = 0; i < count; i++) {
        const int64_t dx_q16 = x_px_q16[i] - frame->x_px_q16;
        const int64_t dy_q16 = y_px_q16[i] - frame->y_px_q16;
        /* |d| < 2^29 and the inverse of an axis of 1/4 px is 2^36: keep the product below 2^62. */
        if (fx_abs_i64(dx_q16) * 4 > fx_abs_i64(INT64_MAX / frame->over_xx_q50)) {
            return false;
        }
        const int64_t p = fx_round_shift_i64(dx_q16 * frame->over_xx_q50, 26);
        const int64_t rest_q16 = dy_q16 - fx_round_shift_i64(dx_q16 * frame->slope_q24, 24);
        if (fx_abs_i64(rest_q16) * 4 > INT64_MAX / frame->over_yy_q50) {
            return false;
        }
        const int64_t q = fx_round_shift_i64(rest_q16 * frame->over_yy_q50, 26);
        if (fx_abs_i64(p) > UNIT_LIMIT_Q24 || fx_abs_i64(q) > UNIT_LIMIT_Q24) {
            return false;
        }
        const int64_t gx_q20 =
            fx_round_shift_i64(frame->grad_xp_q20 * p - frame->grad_xq_q20 * q, 24);
        const int64_t gy_q20 = fx_round_shift_i64(frame->grad_yq_q20 * q, 24);
        const int64_t square_q40 = gx_q20 * gx_q20 + gy_q20 * gy_q20;
        if (square_q40 < frame->steepest_q40 / 4) {
            return false; /* deep inside: not a point of this ellipse */
        }
        const int64_t weight_q20 = frame->steepest_q40 * ((int64_t)1 << 20) / square_q40;

        const int64_t pp_q24 = fx_round_shift_i64(p * p, 24);
        const int64_t qq_q24 = fx_round_shift_i64(q * q, 24);
        const int64_t f_q24 = (pp_q24 + qq_q24 - ((int64_t)1 << 24)) / 2;
        const int64_t j_q20[UNKNOWNS] = {
            p >> 4, q >> 4, (int64_t)1 << 20, (pp_q24 - qq_q24) >> 4,
            fx_round_shift_i64(p * q, 27),
        };
        for (unsigned row = 0; row < UNKNOWNS; row++) {
            const int64_t wj_q20 = fx_round_shift_i64(weight_q20 * j_q20[row], 20);
            for (unsigned col = 0; col <= row; col++) {
                sums->normal_q40[row][col] += wj_q20 * j_q20[col];
            }
            sums->right_q44[row] += wj_q20 * f_q24;
        }
        sums->squares_q48 += fx_round_shift_i64(weight_q20 * f_q24, 20) * f_q24;
        sums->sectors |= (uint16_t)(1u << sector_of(p, q));
    }
    return true;
}

bool refit_ellipse(const int32_t x_px_q16[], const int32_t y_px_q16[], uint32_t count,
                   struct ellipse *ellipse, struct refit_quality *quality)
{
    assert(count >= 1);
    struct ellipse_root root;
    struct unit_frame frame;
    struct sums sums;
    uint32_t major_px_q16;
    uint32_t minor_px_q16;
    uint16_t angle;
    ellipse_axes(ellipse, &major_px_q16, &minor_px_q16, &angle);
    if (!ellipse_take_root(ellipse, &root) || major_px_q16 == 0 ||
        !make_frame(ellipse, &root, major_px_q16, &frame) ||
        !gather_sums(x_px_q16, y_px_q16, count, &frame, &sums)) {
        return false;
    }
    struct smallsolve normal = {.size = UNKNOWNS};
    int64_t step_q36[UNKNOWNS];
    int64_t right_q36[UNKNOWNS];
    for (unsigned row = 0; row < UNKNOWNS; row++) {
        for (unsigned col = 0; col <= row; col++) {
            normal.at_q30[row][col] = fx_round_shift_i64(sums.normal_q40[row][col] / count, 10);
        }
        right_q36[row] = fx_round_shift_i64(sums.right_q44[row] / count, 14 - RHS_BITS);
        step_q36[row] = right_q36[row];
        if (fx_abs_i64(right_q36[row]) > (int64_t)2 << 30) {
            return false;
        }
    }
    if (!smallsolve_factor(&normal, PIVOT_FLOOR_Q30) || !smallsolve_solve(&normal, step_q36) ||
        !ellipse_step(ellipse, &root, step_q36)) {
        return false;
    }
    /* What the step explains of the squares is d' J' W f. */
    int64_t mean_q48 = sums.squares_q48 / count;
    for (unsigned i = 0; i < UNKNOWNS; i++) {
        mean_q48 -= fx_round_shift_i64((step_q36[i] >> 4) * (right_q36[i] >> 4), 16);
    }
    const uint64_t relative_q24 = mean_q48 > 0 ? root_u64((uint64_t)mean_q48) : 0;
    quality->residual_px_q16 = (uint32_t)((relative_q24 * major_px_q16) >> 24);
    quality->sectors = sums.sectors;
    return true;
}
