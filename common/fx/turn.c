/* atan2: fold into the first octant, where t = min/max is in [0, 1], and use
 * atan(t) / (2 pi) ~ t (a1 + a3 t^2 + a5 t^4 + a7 t^6 + a9 t^8), Abramowitz and Stegun 4.4.49
 * divided by a full turn; its error there, 1e-5 radian, is 0.1/65536 turn.
 *
 * Sine: fold into [-1/8, 1/8] turn, where the Taylor polynomials to the 7th and 8th power of the
 * angle in radians err by less than 4e-7. */
#include "common/fx/turn.h"

#include "common/fx/fx.h"

uint16_t turn_atan2_q16(int64_t y, int64_t x)
{
    uint64_t big = (uint64_t)fx_abs_i64(x);
    uint64_t small = (uint64_t)fx_abs_i64(y);
    const bool steep = small > big;
    if (steep) {
        const uint64_t swap = big;
        big = small;
        small = swap;
    }
    if (big == 0) {
        return 0;
    }
    /* The ratio in Q30 with a numerator below 2^62. */
    const unsigned bits = fx_bits_u64(big);
    if (bits > 32) {
        big >>= bits - 32;
        small >>= bits - 32;
    }
    const int64_t t_q30 = (int64_t)((small << 30) / big);
    const int64_t t2_q30 = fx_mul_q30(t_q30, t_q30);
    int64_t sum_q30 = FX_Q(0.0208351 / 6.283185307179586, 30);
    sum_q30 = fx_mul_q30(sum_q30, t2_q30) + FX_Q(-0.0851330 / 6.283185307179586, 30);
    sum_q30 = fx_mul_q30(sum_q30, t2_q30) + FX_Q(0.1801410 / 6.283185307179586, 30);
    sum_q30 = fx_mul_q30(sum_q30, t2_q30) + FX_Q(-0.3302995 / 6.283185307179586, 30);
    sum_q30 = fx_mul_q30(sum_q30, t2_q30) + FX_Q(0.9998660 / 6.283185307179586, 30);
    int64_t angle_q16 = fx_round_shift_i64(fx_mul_q30(sum_q30, t_q30), 14);
    if (steep) {
        angle_q16 = 16384 - angle_q16;
    }
    if (x < 0) {
        angle_q16 = 32768 - angle_q16;
    }
    if (y < 0) {
        angle_q16 = -angle_q16;
    }
    return (uint16_t)angle_q16;
}

void turn_cos_sin_q30(uint16_t angle_turn_q16, int32_t *cos_q30, int32_t *sin_q30)
{
    /* Quarter turns counted from -1/8, and what is left of the angle, within 1/8 turn. */
    const uint16_t shifted = (uint16_t)(angle_turn_q16 + 8192u);
    const unsigned quarter = shifted >> 14;
    const int64_t rest_q16 = (int64_t)(shifted & 16383u) - 8192;
    const int64_t a_q30 = rest_q16 * FX_Q(6.283185307179586, 26) >> 12;
    const int64_t a2_q30 = fx_mul_q30(a_q30, a_q30);

    int64_t s_q30 = FX_Q(-1.0 / 5040, 30);
    s_q30 = fx_mul_q30(s_q30, a2_q30) + FX_Q(1.0 / 120, 30);
    s_q30 = fx_mul_q30(s_q30, a2_q30) + FX_Q(-1.0 / 6, 30);
    s_q30 = fx_mul_q30(s_q30, a2_q30) + FX_Q(1.0, 30);
    s_q30 = fx_mul_q30(s_q30, a_q30);

    int64_t c_q30 = FX_Q(1.0 / 40320, 30);
    c_q30 = fx_mul_q30(c_q30, a2_q30) + FX_Q(-1.0 / 720, 30);
    c_q30 = fx_mul_q30(c_q30, a2_q30) + FX_Q(1.0 / 24, 30);
    c_q30 = fx_mul_q30(c_q30, a2_q30) + FX_Q(-1.0 / 2, 30);
    c_q30 = fx_mul_q30(c_q30, a2_q30) + FX_Q(1.0, 30);

    switch (quarter) {
    case 0:
        *cos_q30 = (int32_t)c_q30;
        *sin_q30 = (int32_t)s_q30;
        break;
    case 1:
        *cos_q30 = (int32_t)-s_q30;
        *sin_q30 = (int32_t)c_q30;
        break;
    case 2:
        *cos_q30 = (int32_t)-c_q30;
        *sin_q30 = (int32_t)-s_q30;
        break;
    default:
        *cos_q30 = (int32_t)s_q30;
        *sin_q30 = (int32_t)-c_q30;
        break;
    }
}
