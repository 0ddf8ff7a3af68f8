/* Small closed forms on a 2x2 symmetric positive definite matrix. */
#include "firmware/detect/ellipse.h"

#include "common/fx/fx.h"
#include "common/fx/root.h"
#include "common/fx/turn.h"

#define ROOT_MIN_PX_Q16 16384

bool ellipse_take_root(const struct ellipse *ellipse, struct ellipse_root *root)
{
    if (ellipse->shape_xx_px2_q12 <= 0 || ellipse->shape_yy_px2_q12 <= 0) {
        return false;
    }
    /* Q12 -> Q32 under the root gives Q16. */
    root->xx_px_q16 = (int32_t)root_u64((uint64_t)ellipse->shape_xx_px2_q12 << 20);
    if (root->xx_px_q16 < ROOT_MIN_PX_Q16) {
        return false;
    }
    root->yx_px_q16 = fx_narrow_i32(fx_saturate_i32(
        fx_scale_i64(ellipse->shape_xy_px2_q12, 20) / root->xx_px_q16));
    const int64_t rest_q32 = fx_scale_i64(ellipse->shape_yy_px2_q12, 20) -
                             (int64_t)root->yx_px_q16 * root->yx_px_q16;
    if (rest_q32 <= 0) {
        return false;
    }
    root->yy_px_q16 = (int32_t)root_u64((uint64_t)rest_q32);
    return root->yy_px_q16 >= ROOT_MIN_PX_Q16;
}

void ellipse_axes(const struct ellipse *ellipse, uint32_t *major_px_q16, uint32_t *minor_px_q16,
                  uint16_t *angle_turn_q16)
{
    /* Eigenvalues: mean +- sqrt(difference^2 + xy^2), with halves kept in Q13. */
    const int64_t sum_q13 = (int64_t)ellipse->shape_xx_px2_q12 + ellipse->shape_yy_px2_q12;
    const int64_t difference_q13 = (int64_t)ellipse->shape_xx_px2_q12 - ellipse->shape_yy_px2_q12;
    const int64_t cross_q13 = 2 * (int64_t)ellipse->shape_xy_px2_q12;
    const int64_t swing_q13 = root_u64((uint64_t)(difference_q13 * difference_q13) +
                                       (uint64_t)(cross_q13 * cross_q13));
    const int64_t small_q13 = sum_q13 > swing_q13 ? sum_q13 - swing_q13 : 0;
    *major_px_q16 = root_u64((uint64_t)(sum_q13 + swing_q13) << 19);
    *minor_px_q16 = root_u64((uint64_t)small_q13 << 19);
    /* The double angle of the major axis, halved: [0, 1/2) turn. */
    *angle_turn_q16 = turn_atan2_q16(cross_q13, difference_q13) / 2;
}

uint32_t ellipse_size_px_q16(const struct ellipse *ellipse)
{
    /* (det S)^(1/4): det in Q24 -> root Q12 -> root of Q32. */
    const int64_t det_q24 =
        (int64_t)ellipse->shape_xx_px2_q12 * ellipse->shape_yy_px2_q12 -
        (int64_t)ellipse->shape_xy_px2_q12 * ellipse->shape_xy_px2_q12;
    const uint64_t area_q12 = det_q24 > 0 ? root_u64((uint64_t)det_q24) : 0;
    return root_u64(area_q12 << 20);
}

bool ellipse_step(struct ellipse *ellipse, const struct ellipse_root *b,
                  const int64_t step_q36[ELLIPSE_UNKNOWNS])
{
    for (unsigned i = 0; i < ELLIPSE_UNKNOWNS; i++) {
        if (fx_abs_i64(step_q36[i]) > (int64_t)1 << 34) { /* a quarter of the size */
            return false;
        }
    }
    const int64_t bx = b->xx_px_q16;
    const int64_t by = b->yx_px_q16;
    const int64_t bz = b->yy_px_q16;
    const int64_t dx = fx_round_shift_i64(bx * (step_q36[0] >> 4), 32);
    const int64_t dy = fx_round_shift_i64(by * (step_q36[0] >> 4) + bz * (step_q36[1] >> 4), 32);

    const int64_t one_q24 = (int64_t)1 << 24;
    const int64_t uxx = one_q24 + fx_round_shift_i64(step_q36[2] + step_q36[3], 11);
    const int64_t uxy = fx_round_shift_i64(step_q36[4], 11);
    const int64_t uyy = one_q24 + fx_round_shift_i64(step_q36[2] - step_q36[3], 11);
    const int64_t r0x = fx_round_shift_i64(bx * uxx, 20); /* Q20 px, below 2^30 */
    const int64_t r0y = fx_round_shift_i64(bx * uxy, 20);
    const int64_t r1x = fx_round_shift_i64(by * uxx + bz * uxy, 20);
    const int64_t r1y = fx_round_shift_i64(by * uxy + bz * uyy, 20);
    const int64_t sxx = fx_round_shift_i64(r0x * bx, 24);
    const int64_t sxy = fx_round_shift_i64(r0x * by + r0y * bz, 24);
    const int64_t syy = fx_round_shift_i64(r1x * by + r1y * bz, 24);
    if (sxx < ELLIPSE_SHAPE_MIN_PX2_Q12 || syy < ELLIPSE_SHAPE_MIN_PX2_Q12 ||
        sxx > ELLIPSE_SHAPE_MAX_PX2_Q12 || syy > ELLIPSE_SHAPE_MAX_PX2_Q12) {
        return false;
    }
    ellipse->x_px_q16 = fx_saturate_i32(ellipse->x_px_q16 + dx);
    ellipse->y_px_q16 = fx_saturate_i32(ellipse->y_px_q16 + dy);
    ellipse->shape_xx_px2_q12 = (int32_t)sxx;
    ellipse->shape_xy_px2_q12 = fx_saturate_i32(sxy);
    ellipse->shape_yy_px2_q12 = (int32_t)syy;
    return true;
}
