/* The fixed-point vocabulary: rounding, narrowing and scaling, each named for what it does.
 *
 * A value x held as x * 2^F in an integer is written x_qF. Shifts of negative numbers are
 * arithmetic on every compiler we support; tests/unit/test_fx.c holds that. */
#ifndef TESSERA_COMMON_FX_FX_H
#define TESSERA_COMMON_FX_FX_H

#include <assert.h>
#include <stdbool.h>
#include <stdint.h>

#include "common/fx/wide.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A constant in QF. For initialisers only: the compiler folds it, nothing floats at run time. */
#define FX_Q(value, f) \
    ((int64_t)((value) * (double)(1LL << (f)) + ((value) < 0 ? -0.5 : 0.5)))

/* value / 2^shift, rounded to nearest, halves upwards. shift 1..62; value + half must not
 * overflow. */
static inline int64_t fx_round_shift_i64(int64_t value, unsigned shift)
{
    assert(shift >= 1 && shift <= 62);
    return (value + ((int64_t)1 << (shift - 1))) >> shift;
}

static inline int32_t fx_round_shift_i32(int32_t value, unsigned shift)
{
    assert(shift >= 1 && shift <= 30);
    return (value + ((int32_t)1 << (shift - 1))) >> shift;
}

/* value * 2^shift for either sign of shift; rounds to nearest when it divides. */
static inline int64_t fx_scale_i64(int64_t value, int shift)
{
    if (shift > 0) {
        return (int64_t)((uint64_t)value << shift);
    } else if (shift < 0) {
        return fx_round_shift_i64(value, (unsigned)-shift);
    } else {
        return value;
    }
}

/* The same value in a narrower type; the caller has shown that it fits. */
static inline int32_t fx_narrow_i32(int64_t value)
{
    assert(value >= INT32_MIN && value <= INT32_MAX);
    return (int32_t)value;
}

static inline int16_t fx_narrow_i16(int32_t value)
{
    assert(value >= INT16_MIN && value <= INT16_MAX);
    return (int16_t)value;
}

/* The nearest value of the narrower type. */
static inline int32_t fx_saturate_i32(int64_t value)
{
    return (int32_t)(value > INT32_MAX ? INT32_MAX : value < INT32_MIN ? INT32_MIN : value);
}

static inline uint16_t fx_saturate_u16(int64_t value)
{
    return (uint16_t)(value > UINT16_MAX ? UINT16_MAX : value < 0 ? 0 : value);
}

/* |value|; the most negative value is not allowed. */
static inline int64_t fx_abs_i64(int64_t value)
{
    assert(value > INT64_MIN);
    return value < 0 ? -value : value;
}

/* numerator / denominator rounded to nearest, halves away from zero; denominator > 0,
 * |numerator| + denominator / 2 must not overflow. */
static inline int64_t fx_div_round(int64_t numerator, int64_t denominator)
{
    assert(denominator > 0);
    const int64_t half = denominator / 2;
    return (numerator < 0 ? numerator - half : numerator + half) / denominator;
}

/* The number of bits that |value| needs: 0 for 0, 1 for 1, 11 for 1024. */
static inline unsigned fx_bits_u64(uint64_t value)
{
    return value == 0 ? 0 : 64u - (unsigned)__builtin_clzll(value);
}

static inline unsigned fx_bits_i64(int64_t value)
{
    return fx_bits_u64((uint64_t)fx_abs_i64(value));
}

/* a * b in Q30, rounded. |a * b| below 2^62. */
static inline int64_t fx_mul_q30(int64_t a_q30, int64_t b_q30)
{
    return fx_round_shift_i64(a_q30 * b_q30, 30);
}

/* The same for |a * b| below 2^92, rounded alike. */
static inline int64_t fx_mul_wide_q30(int64_t a_q30, int64_t b_q30)
{
    return fx_wide_shift_30(fx_wide_product(a_q30, b_q30));
}

#ifdef __cplusplus
}
#endif

#endif
