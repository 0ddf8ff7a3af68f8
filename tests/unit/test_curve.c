/* The blurred edge of an ellipse by curve.h against discs that were blurred exactly, and the bounds that the
 * 32-bit arithmetic of rimrow_loops.h lives by. */
#include "firmware/detect/curve.h"

#include <math.h>
#include <stdlib.h>
#include <unity.h>

#include "tests/unit/synth.h"

void setUp(void) {}
void tearDown(void) {}

/* The nodes of curve.h; the first and last are the range. */
static const double aspects[CURVE_ASPECTS] = {0.32, 0.42, 0.54, 0.68, 0.84, 1.0};
#define EPS_MAX 0.9

static int64_t q16(double value)
{
    return llround(value * 65536);
}

static double polynomial(const int32_t terms_q14[CURVE_TERMS], double tau, double y)
{
    static const int powers[CURVE_TERMS][2] = {{0, 0}, {0, 1}, {0, 2}, {0, 3}, {1, 0},
                                               {1, 1}, {1, 2}, {1, 3}, {2, 0}, {2, 1},
                                               {2, 2}, {2, 3}, {3, 0}, {3, 1}, {4, 0}};
    double sum = 0;
    for (unsigned i = 0; i < CURVE_TERMS; i++) {
        sum += terms_q14[i] / 16384.0 * pow(tau, powers[i][0]) * pow(y, powers[i][1]);
    }
    return sum;
}

/* Semi-axes alpha^-1/2 and alpha^1/2 (R = 1), blurred by a Gaussian of eps; disc: numerical integrals at the place
 * tau blurs inside the edge, in the direction of this angle of the unit frame. */
struct known {
    double eps;
    double alpha;
    double tau;
    double angle_deg;
    double disc;
};

static void blurred_discs_are_met(void)
{
    static const struct known all[] = {
        {0.05, 1.00, 0.00, 0, 0.490023},   {0.05, 0.60, -1.00, 30, 0.149741},
        {0.10, 0.45, 1.00, 75, 0.836527},  {0.20, 1.00, 0.50, 45, 0.653154},
        {0.25, 0.50, 0.00, 0, 0.377620},   {0.25, 0.50, 0.00, 90, 0.482020},
        {0.35, 0.75, -1.50, 60, 0.050823}, {0.45, 1.00, 1.50, 20, 0.859427},
        {0.50, 0.60, 0.00, 15, 0.335715},  {0.55, 0.90, -0.75, 120, 0.163911},
        {0.40, 0.36, 0.50, 80, 0.666125},  {0.70, 1.00, 0.00, 0, 0.347616},
        {0.70, 0.70, -1.25, 40, 0.056174}, {0.65, 0.55, 0.75, 160, 0.508686},
    };
    for (unsigned i = 0; i < sizeof all / sizeof all[0]; i++) {
        const struct known *at = &all[i];
        const double angle = at->angle_deg * SYNTH_PI / 180;
        const double v = at->alpha * cos(angle) * cos(angle) + sin(angle) * sin(angle) / at->alpha;
        const double y = v - (at->alpha + 1 / at->alpha) / 2;
        int32_t terms_q14[CURVE_TERMS];
        curve_at(q16(at->eps), q16(at->alpha), terms_q14);
        const double t = at->tau + at->eps / sqrt(v) * polynomial(terms_q14, at->tau, y);
        /* The table's error is 0.0008 RMS, 0.002 where alpha is below 0.42: twice that and a half. */
        SYNTH_NEAR(at->alpha < 0.42 ? 0.005 : 0.0015, at->disc, erfc(-t / sqrt(2)) / 2);
    }
}

/* At a node the table's own entries come out; half way between two their mean, down to the roundings of two
 * steps downwards. Nodes of eps are cut to Q16, which is 2^-17 of a step: below the rounding. */
static void nodes_come_out_and_middles_are_means(void)
{
    int32_t terms_q14[CURVE_TERMS];
    for (unsigned i = 0; i < CURVE_BLURS; i++) {
        for (unsigned k = 0; k < CURVE_ASPECTS; k++) {
            curve_at((int64_t)i * 9830, q16(aspects[k]), terms_q14);
            for (unsigned term = 0; term < CURVE_TERMS; term++) {
                TEST_ASSERT_INT_WITHIN(1, curve_table_q14[i][k][term], terms_q14[term]);
            }
            if (i + 1 < CURVE_BLURS && k + 1 < CURVE_ASPECTS) {
                curve_at((int64_t)i * 9830 + 4915, q16((aspects[k] + aspects[k + 1]) / 2), terms_q14);
                for (unsigned term = 0; term < CURVE_TERMS; term++) {
                    const double mean =
                        (curve_table_q14[i][k][term] + curve_table_q14[i][k + 1][term] +
                         curve_table_q14[i + 1][k][term] + curve_table_q14[i + 1][k + 1][term]) / 4.0;
                    /* Roundings of 1 each, and alpha's of 2^-17 of a tenth: 1e-4 of at most 2^15. */
                    SYNTH_NEAR(2 + 3.3, mean, terms_q14[term]);
                }
            }
        }
    }
}

static void check_same(double eps, double alpha, double eps_cut, double alpha_cut)
{
    int32_t terms_q14[CURVE_TERMS];
    int32_t cut_q14[CURVE_TERMS];
    curve_at(q16(eps), q16(alpha), terms_q14);
    curve_at(q16(eps_cut), q16(alpha_cut), cut_q14);
    TEST_ASSERT_EQUAL_INT32_ARRAY(cut_q14, terms_q14, CURVE_TERMS);
}

static void beyond_the_table_its_border_holds(void)
{
    for (double inside = 0.1; inside < 1; inside += 0.2) {
        check_same(-0.3, inside, 0, inside);
        check_same(EPS_MAX + 0.001, inside, EPS_MAX, inside);
        check_same(1000, inside, EPS_MAX, inside);
        check_same(inside * 0.9, 0, inside * 0.9, aspects[0]);
        check_same(inside * 0.9, -3, inside * 0.9, aspects[0]);
        check_same(inside * 0.9, 1.001, inside * 0.9, 1);
        check_same(inside * 0.9, 1000, inside * 0.9, 1);
    }
    check_same(5, 0.01, EPS_MAX, aspects[0]);
}

/* |sum * by| in 32 bits; what is left of it, rounded away from zero. */
static int64_t product(int64_t sum, int64_t by, unsigned shift)
{
    TEST_ASSERT_TRUE(sum * by <= INT32_MAX);
    return ((sum * by) >> shift) + 1;
}

/* The largest |value| of a cubic by Horner's rule, |y| <= 1.41. */
static int64_t largest_cubic(const int16_t c_q14[4])
{
    int64_t sum = abs(c_q14[3]);
    for (int k = 2; k >= 0; k--) {
        sum = product(sum, CURVE_Y_MAX_Q14, 14) + abs(c_q14[k]);
    }
    return sum;
}

/* Sizes only, so every sign is covered; between nodes coefficients are between theirs. */
static void sums_of_the_polynomial_stay_within_32_bits(void)
{
    const int64_t tau_q13 = 2 << 13;
    for (unsigned i = 0; i < CURVE_BLURS; i++) {
        for (unsigned k = 0; k < CURVE_ASPECTS; k++) {
            const int16_t *c_q14 = curve_table_q14[i][k];
            int64_t sum = abs(c_q14[14]);
            sum = product(sum, tau_q13, 13) + abs(c_q14[12]) +
                  product(abs(c_q14[13]), CURVE_Y_MAX_Q14, 14);
            sum = product(sum, tau_q13, 13) + largest_cubic(c_q14 + 8);
            sum = product(sum, tau_q13, 13) + largest_cubic(c_q14 + 4);
            sum = product(sum, tau_q13, 13) + largest_cubic(c_q14);
            TEST_ASSERT_TRUE(sum <= INT32_MAX);
        }
    }
}

/* The largest h / R for which a node counts at this y: (R / h)^2 = y + (alpha + 1 / alpha) / 2, which is at least
 * alpha, up to the neighbouring nodes. Below the first one alpha goes down to 1/8, where y is cut. */
static double largest_h(unsigned aspect, double y)
{
    const double y_max = CURVE_Y_MAX_Q14 / 16384.0;
    const double next = aspects[aspect + 1 < CURVE_ASPECTS ? aspect + 1 : aspect];
    const double least = aspect > 0 ? aspects[aspect - 1] : y <= -y_max ? 0.125 : aspects[0];
    return 1 / sqrt(fmax(least, aspect == 0 && y <= -y_max ? 0 : y + (next + 1 / next) / 2));
}

/* The polynomial, which rimrow_loops.h cuts at 4, times eps h / R: both Q14, eps up to the next node's. */
static void bend_times_its_share_stays_within_32_bits(void)
{
    double largest = 0;
    for (unsigned i = 0; i < CURVE_BLURS; i++) {
        const double eps = i + 1 < CURVE_BLURS ? 0.15 * (i + 1) : 1;
        for (unsigned k = 0; k < CURVE_ASPECTS; k++) {
            int32_t terms_q14[CURVE_TERMS];
            for (unsigned term = 0; term < CURVE_TERMS; term++) {
                terms_q14[term] = curve_table_q14[i][k][term];
            }
            for (int at_tau = -32; at_tau <= 32; at_tau++) {
                for (int at_y = -47; at_y <= 47; at_y++) {
                    const double y = at_y / 47.0 * CURVE_Y_MAX_Q14 / 16384;
                    const double sum = fabs(polynomial(terms_q14, at_tau / 16.0, y));
                    largest = fmax(largest, fmin(sum, 4) * eps * largest_h(k, y));
                }
            }
        }
    }
    /* Between the points of the grid, which holds the corners, at most 2 % more. */
    TEST_ASSERT_TRUE(1.02 * largest * (1 << 28) < INT32_MAX);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(blurred_discs_are_met);
    RUN_TEST(nodes_come_out_and_middles_are_means);
    RUN_TEST(beyond_the_table_its_border_holds);
    RUN_TEST(sums_of_the_polynomial_stay_within_32_bits);
    RUN_TEST(bend_times_its_share_stays_within_32_bits);
    return UNITY_END();
}
