/* Angles against double, over all directions. */
#include "common/fx/turn.h"

#include <math.h>
#include <unity.h>

#include "tests/unit/synth.h"

void setUp(void) {}
void tearDown(void) {}

/* Distance of two angles round the turn, in 1/65536. */
static double apart(double a, double b)
{
    return fabs(remainder(a - b, 65536));
}

static double exact_turn(double y, double x)
{
    return atan2(y, x) * 65536 / (2 * SYNTH_PI);
}

/* The header's bound: 3 / 65536 turn. */
static const double atan_tolerance = 3.0;

static void angles_of_all_directions_are_within_the_stated_error(void)
{
    const double lengths[] = {1e3, 1e6, 1e9, 1e15, 4e18};
    for (unsigned k = 0; k < 5; k++) {
        for (unsigned i = 0; i < 65536; i += 5) {
            const double a = (i + 0.37) * 2 * SYNTH_PI / 65536;
            const int64_t x = llrint(lengths[k] * cos(a));
            const int64_t y = llrint(lengths[k] * sin(a));
            const double exact = exact_turn((double)y, (double)x);
            SYNTH_NEAR(atan_tolerance, 0, apart(turn_atan2_q16(y, x), exact));
        }
    }
}

static void angles_of_every_short_vector_are_within_the_stated_error(void)
{
    for (int64_t y = -40; y <= 40; y++) {
        for (int64_t x = -40; x <= 40; x++) {
            if (x != 0 || y != 0) {
                SYNTH_NEAR(atan_tolerance, 0,
                           apart(turn_atan2_q16(y, x), exact_turn((double)y, (double)x)));
            }
        }
    }
}

static void vectors_of_the_largest_lengths_and_lopsided_ones_are_right(void)
{
    const int64_t big = ((int64_t)1 << 62) - 1;
    const int64_t xs[] = {big, -big, 0, 1, -1, 1000003};
    for (unsigned i = 0; i < 6; i++) {
        for (unsigned j = 0; j < 6; j++) {
            if (xs[i] != 0 || xs[j] != 0) {
                const double exact = exact_turn((double)xs[j], (double)xs[i]);
                SYNTH_NEAR(atan_tolerance, 0, apart(turn_atan2_q16(xs[j], xs[i]), exact));
            }
        }
    }
}

static void no_direction_gives_zero(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, turn_atan2_q16(0, 0));
}

/* The header's bound, 1e-6; and at the quarter turns the exact values within it. */
static void cosine_and_sine_of_every_angle_are_within_the_stated_error(void)
{
    for (unsigned i = 0; i < 65536; i++) {
        int32_t c;
        int32_t s;
        turn_cos_sin_q30((uint16_t)i, &c, &s);
        const double a = i * 2 * SYNTH_PI / 65536;
        SYNTH_NEAR(1e-6, cos(a), c / 1073741824.0);
        SYNTH_NEAR(1e-6, sin(a), s / 1073741824.0);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(angles_of_all_directions_are_within_the_stated_error);
    RUN_TEST(angles_of_every_short_vector_are_within_the_stated_error);
    RUN_TEST(vectors_of_the_largest_lengths_and_lopsided_ones_are_right);
    RUN_TEST(no_direction_gives_zero);
    RUN_TEST(cosine_and_sine_of_every_angle_are_within_the_stated_error);
    return UNITY_END();
}
