/* Wide products and their sums as compilers without 128-bit integers build them, against those integers where the
 * compiler has them: the header is read with their macro hidden. */
#if defined(__SIZEOF_INT128__)
#define HAS_INT128
__extension__ typedef __int128 exact_int;
#undef __SIZEOF_INT128__
#endif
#include "common/fx/fx.h"

#include <unity.h>

#include "tests/unit/synth.h"

void setUp(void) {}
void tearDown(void) {}

static const int64_t one = (int64_t)1 << 30;

/* floor(a b / 2^30 + 1/2): halves upwards, for either sign. */
static void known_products_come_out(void)
{
    TEST_ASSERT_EQUAL_INT64(one, fx_mul_wide_q30(one, one));
    TEST_ASSERT_EQUAL_INT64(1, fx_mul_wide_q30(one / 2, 1));
    TEST_ASSERT_EQUAL_INT64(0, fx_mul_wide_q30(-one / 2, 1));
    TEST_ASSERT_EQUAL_INT64(-1, fx_mul_wide_q30(-one / 2 - 1, 1));
    TEST_ASSERT_EQUAL_INT64(2, fx_mul_wide_q30(one / 2, 3));
    TEST_ASSERT_EQUAL_INT64(-1, fx_mul_wide_q30(one / 2, -3));
    TEST_ASSERT_EQUAL_INT64(0, fx_mul_wide_q30(0, -INT64_MAX));
    TEST_ASSERT_EQUAL_INT64(-INT64_MAX, fx_mul_wide_q30(-INT64_MAX, one));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, fx_mul_wide_q30(one, INT64_MAX));
    /* (2^45 + 1)(2^46 - 1) = 2^91 - 2^45 + 2^46 - 1: 2^61 + 2^15 and just less, rounded. */
    TEST_ASSERT_EQUAL_INT64(((int64_t)1 << 61) + (1 << 15),
                            fx_mul_wide_q30(((int64_t)1 << 45) + 1, ((int64_t)1 << 46) - 1));
}

static void narrow_products_are_those_of_64_bits(void)
{
    uint64_t seed = 4;
    for (int i = 0; i < 20000; i++) {
        const int64_t a = (int64_t)synth_u64(&seed) >> (33 + i % 30);
        const int64_t b = (int64_t)synth_u64(&seed) >> (33 + i / 30 % 30);
        TEST_ASSERT_EQUAL_INT64(fx_mul_q30(a, b), fx_mul_wide_q30(a, b));
    }
}

#if defined(HAS_INT128)
/* Sizes of up to 62 and 30, 61 and 31, ... bits, the product below 2^92; ends of many ones or many zeros make
 * carries. */
static void wide_products_are_exact(void)
{
    uint64_t seed = 5;
    for (int i = 0; i < 100000; i++) {
        const unsigned bits = 29 + (unsigned)(synth_u64(&seed) % 35);
        const unsigned rest = 92 - bits > 63 ? 63 : 92 - bits;
        int64_t a = (int64_t)(synth_u64(&seed) >> (64 - bits));
        int64_t b = (int64_t)(synth_u64(&seed) >> (64 - rest));
        a |= i % 3 == 0 ? (int64_t)(UINT32_MAX & (((uint64_t)1 << bits) - 1)) : 0;
        b = i % 5 == 0 ? b & ~(int64_t)UINT32_MAX : b;
        a = i % 2 ? -a : a;
        b = i % 4 < 2 ? -b : b;
        const exact_int exact = ((exact_int)a * b + (1 << 29)) >> 30;
        TEST_ASSERT_EQUAL_INT64((int64_t)exact, fx_mul_wide_q30(a, b));
    }
}

/* As a solve takes eight products from a value. */
static void sums_of_wide_products_are_exact(void)
{
    uint64_t seed = 6;
    for (int i = 0; i < 20000; i++) {
        const int64_t start = (int64_t)synth_u64(&seed) >> 20;
        fx_wide sum = fx_wide_product(start, one);
        exact_int exact = (exact_int)start * one;
        for (int k = 0; k < 8; k++) {
            const int64_t a = (int64_t)synth_u64(&seed) >> 32;
            const int64_t b = (int64_t)synth_u64(&seed) >> (4 + i % 60);
            sum = fx_wide_difference(sum, fx_wide_product(a, b));
            exact -= (exact_int)a * b;
        }
        TEST_ASSERT_EQUAL_INT64((int64_t)((exact + (1 << 29)) >> 30), fx_wide_shift_30(sum));
    }
}
#endif

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(known_products_come_out);
    RUN_TEST(narrow_products_are_those_of_64_bits);
#if defined(HAS_INT128)
    RUN_TEST(wide_products_are_exact);
    RUN_TEST(sums_of_wide_products_are_exact);
#endif
    return UNITY_END();
}
