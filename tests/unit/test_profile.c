/* The photometric fit's functions against the mathematics, over their whole range. */
#include "firmware/detect/profile.h"

#include <math.h>
#include <unity.h>

#include "tests/unit/synth.h"

/* The tables' entries are rounded to half of 2^-15, as is what is interpolated between them, and linear
 * interpolation errs by h^2 / 8 times the second derivative (tools/gen/profile_table.py). */
#define STEP_Q15  (1.0 / 32768)
#define EDGE_ERROR (STEP_Q15 + 8e-6)
#define BELL_ERROR (STEP_Q15 + 1.3e-5)

void setUp(void) {}
void tearDown(void) {}

static void edge_and_bell_are_the_normal_integral_and_density(void)
{
    /* Every 37th of all t within 4, both ends and the middle among them. */
    double sum = 0;
    unsigned count = 0;
    for (int32_t t_q16 = -(4 << 16) + 1; t_q16 < 4 << 16; t_q16 += 37) {
        int32_t bell_q15;
        const double t = t_q16 / 65536.0;
        const double edge = profile_edge(t_q16, &bell_q15) / 32768.0;
        SYNTH_NEAR(EDGE_ERROR, 0.5 * erfc(-t / sqrt(2)), edge);
        SYNTH_NEAR(BELL_ERROR, exp(-t * t / 2) / sqrt(2 * SYNTH_PI), bell_q15 / 32768.0);
        sum += (edge - 0.5 * erfc(-t / sqrt(2))) * (edge - 0.5 * erfc(-t / sqrt(2)));
        count++;
    }
    /* Two roundings of 1/root(12) steps each. */
    TEST_ASSERT_TRUE(sqrt(sum / count) < 0.5 * STEP_Q15);
}

static void edge_is_over_beyond_four_sigmas(void)
{
    static const int32_t far[] = {(4 << 16) - 1, 4 << 16, (4 << 16) + 1, 1 << 30, INT32_MAX};
    for (unsigned i = 0; i < 5; i++) {
        int32_t bell_q15;
        /* "but for 3e-5": 1 - P(4) = 3.2e-5, and its density is 1.3e-4. */
        SYNTH_NEAR(3.2e-5 + EDGE_ERROR, 1, profile_edge(far[i], &bell_q15) / 32768.0);
        SYNTH_NEAR(1.4e-4 + BELL_ERROR, 0, bell_q15 / 32768.0);
        SYNTH_NEAR(3.2e-5 + EDGE_ERROR, 0, profile_edge(-far[i], &bell_q15) / 32768.0);
    }
    int32_t bell_q15;
    SYNTH_NEAR(3.2e-5 + EDGE_ERROR, 0, profile_edge(INT32_MIN, &bell_q15) / 32768.0);
}

static void edge_never_falls_and_is_odd_about_its_middle(void)
{
    int32_t bell_q15;
    int32_t bell_other_q15;
    int32_t before_q15 = 0;
    for (int32_t t_q16 = -327680; t_q16 <= 327680; t_q16 += 61) {
        const int32_t edge_q15 = profile_edge(t_q16, &bell_q15);
        TEST_ASSERT_TRUE(edge_q15 >= before_q15);
        TEST_ASSERT_EQUAL_INT32(32768, edge_q15 + profile_edge(-t_q16, &bell_other_q15));
        TEST_ASSERT_EQUAL_INT32(bell_q15, bell_other_q15);
        before_q15 = edge_q15;
    }
}

/* "relative error 7e-5", and below one unit of the result, which is cut and not rounded. */
static void check_root(uint32_t x_q24)
{
    const double root = sqrt(x_q24 * 16777216.0);
    SYNTH_NEAR(7e-5 * root + 1, root, profile_root_q24(x_q24));
}

static void root_is_right_from_nothing_to_256(void)
{
    TEST_ASSERT_EQUAL_UINT32(0, profile_root_q24(0));
    uint64_t seed = 71;
    for (unsigned bit = 0; bit < 32; bit++) {
        const uint32_t x = (uint32_t)1 << bit;
        check_root(x);
        check_root(x - (x > 1));
        check_root(x + (x - 1));
        for (unsigned i = 0; i < 500; i++) {
            check_root(x + (uint32_t)(synth_u64(&seed) % x));
        }
    }
    check_root(UINT32_MAX);
}

static void check_inverse(uint32_t x_q24)
{
    const double inverse = 65536 / sqrt(x_q24 / 16777216.0);
    SYNTH_NEAR(7e-5 * inverse + 1, inverse, profile_inverse_q16(x_q24));
}

static void inverse_is_right_from_its_least_to_256(void)
{
    uint64_t seed = 72;
    for (unsigned bit = 12; bit < 32; bit++) {
        const uint32_t x = (uint32_t)1 << bit;
        check_inverse(x);
        check_inverse(x + (x - 1));
        for (unsigned i = 0; i < 500; i++) {
            check_inverse(x + (uint32_t)(synth_u64(&seed) % x));
        }
    }
    check_inverse(UINT32_MAX);
}

/* The places in the tables that are entries themselves have no error but the entries' rounding. */
static void tables_are_read_to_their_last_entry(void)
{
    TEST_ASSERT_EQUAL_INT32(profile_root_q14[191], profile_between(profile_root_q14, 191u << 16));
    SYNTH_NEAR(1, profile_root_q14[192], profile_between(profile_root_q14, (192u << 16) - 1));
    SYNTH_NEAR(1, profile_edge_q15[256], profile_between(profile_edge_q15, (256u << 16) - 1));
    TEST_ASSERT_EQUAL_UINT16(32768, profile_root_q14[192]); /* root of 4 */
    TEST_ASSERT_EQUAL_UINT16(16384, profile_inverse_q15[192]);
    TEST_ASSERT_EQUAL_UINT16(16384, profile_edge_q15[0]);
}

/* "a^3 / (a^3 + b^3) by a^2 / (a^2 + b^2)": entries and result are rounded to 1.5e-5 each. */
static void share_of_third_powers_is_right_from_none_to_all(void)
{
    for (uint32_t share_q16 = 0; share_q16 <= 65536; share_q16++) {
        const double a = pow(share_q16 / 65536.0, 1.5);
        const double b = pow(1 - share_q16 / 65536.0, 1.5);
        const bool inner = share_q16 >= 4096 && share_q16 <= 65536 - 4096;
        SYNTH_NEAR((3e-5 + (inner ? 8e-6 : 4e-5)) * 65536, 65536 * a / (a + b),
                   profile_cube_share_q16(share_q16));
    }
    TEST_ASSERT_EQUAL_UINT32(65536, profile_cube_share_q16(65537));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(edge_and_bell_are_the_normal_integral_and_density);
    RUN_TEST(edge_is_over_beyond_four_sigmas);
    RUN_TEST(edge_never_falls_and_is_odd_about_its_middle);
    RUN_TEST(root_is_right_from_nothing_to_256);
    RUN_TEST(inverse_is_right_from_its_least_to_256);
    RUN_TEST(share_of_third_powers_is_right_from_none_to_all);
    RUN_TEST(tables_are_read_to_their_last_entry);
    return UNITY_END();
}
