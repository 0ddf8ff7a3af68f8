/* The fixed-point vocabulary against exact arithmetic and at its limits. */
#include "common/fx/fx.h"

#include <math.h>
#include <unity.h>

#include "tests/unit/synth.h"

void setUp(void) {}
void tearDown(void) {}

static void constants_are_the_nearest_integer_for_both_signs(void)
{
    TEST_ASSERT_EQUAL_INT64(32768, FX_Q(0.5, 16));
    TEST_ASSERT_EQUAL_INT64(-32768, FX_Q(-0.5, 16));
    TEST_ASSERT_EQUAL_INT64(1, FX_Q(0.5, 0)); /* halves go away from zero */
    TEST_ASSERT_EQUAL_INT64(-1, FX_Q(-0.5, 0));
    TEST_ASSERT_EQUAL_INT64(3373259426, FX_Q(3.14159265358979, 30));
}

/* The shifts of negative numbers that C leaves to the compiler. */
static void shifts_of_negative_numbers_are_arithmetic(void)
{
    TEST_ASSERT_EQUAL_INT64(-2, fx_round_shift_i64(-7, 2));  /* -1.75 */
    TEST_ASSERT_EQUAL_INT64(-1, fx_round_shift_i64(-6, 2));  /* -1.5: halves upwards */
    TEST_ASSERT_EQUAL_INT64(2, fx_round_shift_i64(6, 2));    /*  1.5 */
    TEST_ASSERT_EQUAL_INT64(0, fx_round_shift_i64(-2, 2));   /* -0.5 */
    TEST_ASSERT_EQUAL_INT32(-2, fx_round_shift_i32(-7, 2));
    TEST_ASSERT_EQUAL_INT32(-1, fx_round_shift_i32(-6, 2));
}

static void rounding_shift_is_the_floor_of_the_value_plus_a_half(void)
{
    uint64_t seed = 1;
    for (int i = 0; i < 20000; i++) {
        const int64_t value = (int64_t)synth_u64(&seed) >> 12; /* 52 bits: exact in double */
        const unsigned shift = 1 + (unsigned)(synth_u64(&seed) % 50);
        const double exact = floor(ldexp((double)value, -(int)shift) + 0.5);
        TEST_ASSERT_EQUAL_INT64((int64_t)exact, fx_round_shift_i64(value, shift));
        const int32_t small = (int32_t)(value >> 22); /* 30 bits */
        const unsigned few = 1 + shift % 28;
        TEST_ASSERT_EQUAL_INT32((int32_t)floor(ldexp(small, -(int)few) + 0.5),
                                fx_round_shift_i32(small, few));
    }
    TEST_ASSERT_EQUAL_INT64(-2, fx_round_shift_i64(INT64_MIN, 62));
    TEST_ASSERT_EQUAL_INT64(1, fx_round_shift_i64((int64_t)1 << 61, 62));
}

static void scaling_takes_either_sign_of_shift_and_none(void)
{
    TEST_ASSERT_EQUAL_INT64(-40, fx_scale_i64(-5, 3));
    TEST_ASSERT_EQUAL_INT64(-5, fx_scale_i64(-40, -3));
    TEST_ASSERT_EQUAL_INT64(-5, fx_scale_i64(-5, 0));
    TEST_ASSERT_EQUAL_INT64(1, fx_scale_i64(5, -3)); /* 0.625 */
}

static void saturation_stops_at_the_narrower_limits(void)
{
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, fx_saturate_i32((int64_t)INT32_MAX + 1));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, fx_saturate_i32((int64_t)INT32_MIN - 1));
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, fx_saturate_i32(INT64_MAX));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, fx_saturate_i32(INT64_MIN));
    TEST_ASSERT_EQUAL_INT32(-7, fx_saturate_i32(-7));
    TEST_ASSERT_EQUAL_UINT16(UINT16_MAX, fx_saturate_u16(65536));
    TEST_ASSERT_EQUAL_UINT16(0, fx_saturate_u16(-1));
    TEST_ASSERT_EQUAL_UINT16(65535, fx_saturate_u16(65535));
}

static void narrowing_keeps_the_extreme_values(void)
{
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, fx_narrow_i32(INT32_MIN));
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, fx_narrow_i32(INT32_MAX));
    TEST_ASSERT_EQUAL_INT16(INT16_MIN, fx_narrow_i16(INT16_MIN));
    TEST_ASSERT_EQUAL_INT16(INT16_MAX, fx_narrow_i16(INT16_MAX));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, fx_abs_i64(-INT64_MAX));
}

static void division_rounds_halves_away_from_zero(void)
{
    uint64_t seed = 2;
    for (int i = 0; i < 20000; i++) {
        const int64_t n = (int64_t)synth_u64(&seed) >> 24; /* 40 bits */
        const int64_t d = 1 + (int64_t)(synth_u64(&seed) % 1000);
        /* round() goes away from zero at halves; a quotient of 40 bits by 10 that is no half is
         * at least 1 / 2000 away from one, far more than the rounding of double. */
        TEST_ASSERT_EQUAL_INT64((int64_t)round((double)n / (double)d), fx_div_round(n, d));
    }
    TEST_ASSERT_EQUAL_INT64(2, fx_div_round(3, 2));
    TEST_ASSERT_EQUAL_INT64(-2, fx_div_round(-3, 2));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, fx_div_round(INT64_MAX, 1));
}

static void bit_counts_are_right_at_every_power_of_two(void)
{
    TEST_ASSERT_EQUAL_UINT(0, fx_bits_u64(0));
    for (unsigned i = 0; i < 64; i++) {
        TEST_ASSERT_EQUAL_UINT(i + 1, fx_bits_u64((uint64_t)1 << i));
        TEST_ASSERT_EQUAL_UINT(i, fx_bits_u64(((uint64_t)1 << i) - 1));
    }
    TEST_ASSERT_EQUAL_UINT(11, fx_bits_i64(-1024));
    TEST_ASSERT_EQUAL_UINT(63, fx_bits_i64(-INT64_MAX));
}

static void q30_products_are_rounded(void)
{
    const int64_t one = (int64_t)1 << 30;
    TEST_ASSERT_EQUAL_INT64(one, fx_mul_q30(one, one));
    TEST_ASSERT_EQUAL_INT64(-one / 4, fx_mul_q30(one / 2, -one / 2));
    TEST_ASSERT_EQUAL_INT64(1, fx_mul_q30(one / 2, 1)); /* half a step: upwards */
    TEST_ASSERT_EQUAL_INT64(0, fx_mul_q30(-one / 2, 1));
}

/* test_fx_portable.c has more, for compilers without 128-bit integers. Products of 2^bits and odd numbers of 45 bits
 * are known: the power shifts. */
static void wide_q30_products_are_rounded(void)
{
    const int64_t one = (int64_t)1 << 30;
    TEST_ASSERT_EQUAL_INT64(1, fx_mul_wide_q30(one / 2, 1)); /* half a step: upwards */
    TEST_ASSERT_EQUAL_INT64(0, fx_mul_wide_q30(-one / 2, 1));
    TEST_ASSERT_EQUAL_INT64(-INT64_MAX, fx_mul_wide_q30(-INT64_MAX, one));
    uint64_t seed = 3;
    for (int i = 0; i < 20000; i++) {
        const int64_t odd = ((int64_t)synth_u64(&seed) >> 19) | 1;
        const unsigned shift = (unsigned)(synth_u64(&seed) % 47);
        const int64_t expected =
            shift > 30 ? odd * ((int64_t)1 << (shift - 30)) : fx_scale_i64(odd, (int)shift - 30);
        TEST_ASSERT_EQUAL_INT64(expected, fx_mul_wide_q30(odd, (int64_t)1 << shift));
        TEST_ASSERT_EQUAL_INT64(expected, fx_mul_wide_q30((int64_t)1 << shift, odd));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(constants_are_the_nearest_integer_for_both_signs);
    RUN_TEST(shifts_of_negative_numbers_are_arithmetic);
    RUN_TEST(rounding_shift_is_the_floor_of_the_value_plus_a_half);
    RUN_TEST(scaling_takes_either_sign_of_shift_and_none);
    RUN_TEST(saturation_stops_at_the_narrower_limits);
    RUN_TEST(narrowing_keeps_the_extreme_values);
    RUN_TEST(division_rounds_halves_away_from_zero);
    RUN_TEST(bit_counts_are_right_at_every_power_of_two);
    RUN_TEST(q30_products_are_rounded);
    RUN_TEST(wide_q30_products_are_rounded);
    return UNITY_END();
}
