/* The generated filters against the Gaussian and its derivatives, and the bounds that dsp.h builds on. */
#include "firmware/detect/taps.h"

#include <math.h>
#include <stdlib.h>
#include <unity.h>

#include "tests/unit/synth.h"

void setUp(void) {}
void tearDown(void) {}

static void radii_and_widths_are_two_to_five_and_a_third_of_it(void)
{
    for (unsigned i = 0; i < TAPS_KERNELS; i++) {
        TEST_ASSERT_EQUAL_UINT(i + 2, taps_table[i].radius);
        SYNTH_NEAR(0.5 / 65536, (i + 2) / 3.0, taps_table[i].sigma_px_q16 / 65536.0);
    }
}

static void sums_are_exact(void)
{
    for (unsigned i = 0; i < TAPS_KERNELS; i++) {
        const struct taps *t = &taps_table[i];
        int smooth = t->smooth_q15[0];
        int second = t->second_q14[0];
        for (unsigned k = 1; k <= t->radius; k++) {
            smooth += 2 * t->smooth_q15[k];
            second += 2 * t->second_q14[k];
        }
        TEST_ASSERT_EQUAL_INT(32768, smooth);
        TEST_ASSERT_EQUAL_INT(0, second);
        TEST_ASSERT_EQUAL_INT(0, t->first_q15[0]); /* antisymmetric: the rest cancels in pairs */
    }
}

/* Slope 1 gives 1, and x^2 gives 2. Each tap is off by half a step at most, and is weighted by 2 k or
 * 2 k^2: sums 30 and 110 for radius 5, in halves of a step. */
static void moments_are_those_of_the_derivatives(void)
{
    for (unsigned i = 0; i < TAPS_KERNELS; i++) {
        const struct taps *t = &taps_table[i];
        int first = 0;
        int second = 0;
        for (int k = 1; k <= (int)t->radius; k++) {
            first += 2 * k * t->first_q15[k];
            second += 2 * k * k * t->second_q14[k];
        }
        TEST_ASSERT_INT_WITHIN(15, 32768, first);
        TEST_ASSERT_INT_WITHIN(55, 2 * 16384, second);
    }
}

/* Nothing else than the Gaussian. Cutting at three sigma leaves 0.3 % of its weight, the corrections for the
 * moments spread that; sampling it at sigma 2/3 is off by 4 %. Hence 5 % of the largest value. */
static void taps_follow_the_gaussian_and_its_derivatives(void)
{
    for (unsigned i = 0; i < TAPS_KERNELS; i++) {
        const struct taps *t = &taps_table[i];
        const double s = t->radius / 3.0;
        const double top = 1 / (s * sqrt(2 * SYNTH_PI));
        for (int k = 0; k <= (int)t->radius; k++) {
            const double g = top * exp(-k * k / (2 * s * s));
            SYNTH_NEAR(0.05 * top, g, t->smooth_q15[k] / 32768.0);
            SYNTH_NEAR(0.05 * top / s, k / (s * s) * g, t->first_q15[k] / 32768.0);
            SYNTH_NEAR(0.12 * top / (s * s), (k * k / (s * s) - 1) / (s * s) * g,
                       t->second_q14[k] / 16384.0);
        }
    }
}

/* What keeps the rows of dsp.h in 16 bits. */
static void positive_taps_sum_to_less_than_the_claimed_bounds(void)
{
    for (unsigned i = 0; i < TAPS_KERNELS; i++) {
        const struct taps *t = &taps_table[i];
        double first = 0;
        double second = t->second_q14[0] > 0 ? t->second_q14[0] : 0;
        double second_negative = t->second_q14[0] < 0 ? -t->second_q14[0] : 0;
        for (unsigned k = 1; k <= t->radius; k++) {
            TEST_ASSERT_TRUE(t->smooth_q15[k] >= 0);
            first += abs(t->first_q15[k]);
            second += t->second_q14[k] > 0 ? 2 * t->second_q14[k] : 0;
            second_negative += t->second_q14[k] < 0 ? -2 * t->second_q14[k] : 0;
        }
        TEST_ASSERT_TRUE(first / 32768 < 0.55);
        TEST_ASSERT_TRUE(second / 16384 < 1.5);
        TEST_ASSERT_TRUE(second_negative / 16384 < 1.5);
        TEST_ASSERT_TRUE(4095 * 0.55 * 8 < 32767);
        TEST_ASSERT_TRUE(4095 * 1.5 * 4 < 32767);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(radii_and_widths_are_two_to_five_and_a_third_of_it);
    RUN_TEST(sums_are_exact);
    RUN_TEST(moments_are_those_of_the_derivatives);
    RUN_TEST(taps_follow_the_gaussian_and_its_derivatives);
    RUN_TEST(positive_taps_sum_to_less_than_the_claimed_bounds);
    return UNITY_END();
}
