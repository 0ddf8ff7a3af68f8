/* Codes of sigma and size, against the logarithm itself. */
#include "common/wire/codes.h"

#include "unity.h"

#include <math.h>

void setUp(void) {}
void tearDown(void) {}

/* The distance in codes between a value and its code is at most one half: that is what nearest means.
 * Where a value lies within 1e-6 of a boundary either side will do (constants have 30 bits). */
static void the_nearest_code_is_chosen(void)
{
    for (double octave = 0.0; octave < 10.33; octave += 0.0007) {
        const double size = exp2(octave);
        const double sigma = exp2(octave - 11);
        /* Rounding the value to its format moves it by less than 2^-13 / ln 2 of itself. */
        const double slack = 3 * 1.45 / 8192 / 2 + 1e-6;
        TEST_ASSERT_TRUE(fabs(codes_of_size((uint32_t)lround(size * 65536)) - 3 * octave) <
                         0.5 + slack);
        TEST_ASSERT_TRUE(fabs(codes_of_sigma((uint32_t)lround(sigma * 16777216)) - 3 * octave) <
                         0.5 + slack);
    }
}

static void what_lies_beyond_takes_the_last_code(void)
{
    TEST_ASSERT_EQUAL_UINT32(0, codes_of_sigma(0));
    TEST_ASSERT_EQUAL_UINT32(0, codes_of_size(0));
    TEST_ASSERT_EQUAL_UINT32(31, codes_of_sigma(UINT32_MAX));
    TEST_ASSERT_EQUAL_UINT32(31, codes_of_size(UINT32_MAX));
}

static void a_codes_value_is_that_of_the_formula_and_has_that_code(void)
{
    for (uint32_t code = 0; code < CODES_COUNT; code++) {
        /* Half a unit from rounding, and 30-bit constants shifted by at most 10: below 0.51. */
        const double sigma = exp2(code / 3.0 - 11) * 16777216;
        const double size = exp2(code / 3.0) * 65536;
        TEST_ASSERT_TRUE(fabs(codes_sigma_px_q24(code) - sigma) < 0.51);
        TEST_ASSERT_TRUE(fabs(codes_size_px_q16(code) - size) < 0.51);
        TEST_ASSERT_EQUAL_UINT32(code, codes_of_sigma(codes_sigma_px_q24(code)));
        TEST_ASSERT_EQUAL_UINT32(code, codes_of_size(codes_size_px_q16(code)));
    }
}

static void codes_never_descend(void)
{
    uint32_t last = 0;
    for (uint64_t value = 0; value <= UINT32_MAX; value += 1 + value / 5000) {
        const uint32_t code = codes_of_size((uint32_t)value);
        TEST_ASSERT_TRUE(code >= last && code <= last + 1);
        last = code;
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(the_nearest_code_is_chosen);
    RUN_TEST(what_lies_beyond_takes_the_last_code);
    RUN_TEST(a_codes_value_is_that_of_the_formula_and_has_that_code);
    RUN_TEST(codes_never_descend);
    return UNITY_END();
}
