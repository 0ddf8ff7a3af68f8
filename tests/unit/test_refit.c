/* The geometric refit: where noisy points put the centre, and how well. */
#include "firmware/detect/refit.h"

#include <math.h>
#include <unity.h>

#include "firmware/detect/directfit.h"
#include "tests/unit/synth.h"

#define COUNT 96u

static int32_t xs[COUNT];
static int32_t ys[COUNT];

void setUp(void) {}
void tearDown(void) {}

/* Points at even steps of arc from `from` to `to`, off by noise px along the normal. */
static void points(double x, double y, double major, double minor, double angle, double from, double to,
                   double noise, uint64_t *seed)
{
    for (uint32_t i = 0; i < COUNT; i++) {
        const double a = from + (to - from) * i / COUNT;
        const double off = synth_normal(seed, noise) / hypot(cos(a) / major, sin(a) / minor);
        const double p = major * cos(a) + off * cos(a) / major;
        const double q = minor * sin(a) + off * sin(a) / minor;
        xs[i] = (int32_t)lrint(65536 * (x + cos(angle) * p - sin(angle) * q));
        ys[i] = (int32_t)lrint(65536 * (y + sin(angle) * p + cos(angle) * q));
    }
}

static struct ellipse circle(double x, double y, double r)
{
    return (struct ellipse){(int32_t)lrint(x * 65536), (int32_t)lrint(y * 65536),
                            (int32_t)lrint(r * r * 4096), 0, (int32_t)lrint(r * r * 4096)};
}

static void start_that_is_a_little_off_is_drawn_to_the_points(void)
{
    uint64_t seed = 51;
    struct refit_quality quality;
    points(100, 80, 12, 12, 0, 0, 2 * SYNTH_PI, 0, &seed);
    struct ellipse e = circle(100.15, 79.9, 12.1);
    TEST_ASSERT_TRUE(refit_ellipse(xs, ys, COUNT, &e, &quality));
    /* One Gauss-Newton step leaves what is of second order: 0.2^2 / 12 = 0.004 px. */
    SYNTH_NEAR(0.006, 100, e.x_px_q16 / 65536.0);
    SYNTH_NEAR(0.006, 80, e.y_px_q16 / 65536.0);
    SYNTH_NEAR(0.006, 12, ellipse_size_px_q16(&e) / 65536.0);
}

/* Centre of a circle from n points with normal errors s: variance 2 s^2 / n an axis. RMS distance after a fit of
 * five: s sqrt(1 - 5 / n), or s where the divisor allows for it. Fits: 500, so the spread of the spread is 1 /
 * sqrt(2 x 1000) = 2.2 %: 10 % is more than four of those. */
static void residual_and_spread_agree_with_theory_on_a_circle(void)
{
    uint64_t seed = 52;
    const double noise = 0.08;
    double squares = 0;
    double residual = 0;
    const unsigned fits = 500;
    for (unsigned i = 0; i < fits; i++) {
        struct refit_quality quality;
        points(100, 80, 10, 10, 0, 0, 2 * SYNTH_PI, noise, &seed);
        struct ellipse e = circle(100, 80, 10);
        TEST_ASSERT_TRUE(refit_ellipse(xs, ys, COUNT, &e, &quality));
        TEST_ASSERT_EQUAL_HEX16(0xffff, quality.sectors);
        squares += pow(e.x_px_q16 / 65536.0 - 100, 2) + pow(e.y_px_q16 / 65536.0 - 80, 2);
        residual += quality.residual_px_q16 / 65536.0 / fits;
    }
    const double theory = sqrt(2.0 / COUNT);
    SYNTH_NEAR(0.10 * theory * noise, theory * noise, sqrt(squares / (2 * fits)));
    SYNTH_NEAR(0.05 * noise, noise, residual);
}

/* The covariance of the likeliest ellipse, per axis of the centre, over that of one point: (J' J)^-1 for the slopes
 * J of the distances, which are the normal's parts and the ellipse's own three. */
static double theory_of_spread(double major, double minor, double from, double to)
{
    double n[5][6] = {{0}};
    for (uint32_t i = 0; i < COUNT; i++) {
        const double a = from + (to - from) * i / COUNT;
        const double steep = hypot(cos(a) / major, sin(a) / minor);
        const double row[5] = {cos(a) / major / steep, sin(a) / minor / steep, 1 / steep,
                               cos(2 * a) / steep, sin(2 * a) / steep};
        for (unsigned r = 0; r < 5; r++) {
            for (unsigned c = 0; c < 5; c++) {
                n[r][c] += row[r] * row[c];
            }
        }
    }
    double sum = 0;
    for (unsigned axis = 0; axis < 2; axis++) { /* Gauss and Jordan, for one column of the inverse */
        double m[5][6];
        for (unsigned r = 0; r < 5; r++) {
            for (unsigned c = 0; c < 5; c++) {
                m[r][c] = n[r][c];
            }
            m[r][5] = r == axis;
        }
        for (unsigned k = 0; k < 5; k++) {
            for (unsigned r = 0; r < 5; r++) {
                const double factor = m[r][k] / m[k][k];
                for (unsigned c = 0; c < 6 && r != k; c++) {
                    m[r][c] -= factor * m[k][c];
                }
            }
        }
        sum += m[axis][5] / m[axis][axis];
    }
    return sqrt(sum / 2);
}

/* On ellipses and arcs the spread that comes out is the least that there can be: 300 fits, both axes: 4 % a sigma,
 * so 16 %, and a little for the step's second order. */
static void spread_is_the_likeliest_fits_on_ellipses_and_arcs(void)
{
    static const double cases[][4] = {
        {14, 7, 0, 2 * SYNTH_PI}, {14, 5, 0, 2 * SYNTH_PI}, {12, 12, 0, 1.5 * SYNTH_PI},
        {14, 9, 1, 1 + 1.5 * SYNTH_PI}};
    uint64_t seed = 53;
    const double noise = 0.03;
    for (unsigned k = 0; k < 4; k++) {
        double squares = 0;
        const unsigned fits = 300;
        for (unsigned i = 0; i < fits; i++) {
            struct refit_quality quality;
            struct ellipse e;
            points(60, 70, cases[k][0], cases[k][1], 0.6, cases[k][2], cases[k][3], noise, &seed);
            TEST_ASSERT_TRUE(directfit_ellipse(xs, ys, COUNT, &e));
            TEST_ASSERT_TRUE(refit_ellipse(xs, ys, COUNT, &e, &quality));
            squares += pow(e.x_px_q16 / 65536.0 - 60, 2) + pow(e.y_px_q16 / 65536.0 - 70, 2);
        }
        const double spread = sqrt(squares / (2 * fits));
        const double theory = noise * theory_of_spread(cases[k][0], cases[k][1], cases[k][2], cases[k][3]);
        SYNTH_NEAR(0.18 * spread, spread, theory);
    }
}

static unsigned ones(unsigned bits)
{
    unsigned count = 0;
    for (; bits != 0; bits &= bits - 1) {
        count++;
    }
    return count;
}

static void sectors_show_how_much_is_covered(void)
{
    uint64_t seed = 54;
    struct refit_quality quality;
    for (unsigned quarters = 2; quarters <= 4; quarters++) {
        points(60, 70, 12, 12, 0, 0.01, 0.01 + quarters * SYNTH_PI / 2, 0, &seed);
        struct ellipse e = circle(60, 70, 12);
        TEST_ASSERT_TRUE(refit_ellipse(xs, ys, COUNT, &e, &quality));
        const unsigned covered = ones(quality.sectors);
        /* An arc that starts inside a sector touches one more. */
        TEST_ASSERT_TRUE(covered == 4 * quarters || covered == (quarters < 4 ? 4 * quarters + 1 : 16));
    }
}

static void points_that_are_no_ellipse_near_it_are_refused(void)
{
    uint64_t seed = 55;
    struct refit_quality quality;
    points(100, 80, 12, 12, 0, 0, 2 * SYNTH_PI, 0, &seed);
    struct ellipse e = circle(112, 80, 12); /* a radius off */
    TEST_ASSERT_FALSE(refit_ellipse(xs, ys, COUNT, &e, &quality));
    e = circle(100, 80, 40);
    TEST_ASSERT_FALSE(refit_ellipse(xs, ys, COUNT, &e, &quality));
    points(100, 80, 12, 12, 0, 0, 0.05, 0, &seed); /* three degrees of it */
    e = circle(100, 80, 12);
    TEST_ASSERT_FALSE(refit_ellipse(xs, ys, COUNT, &e, &quality));
}

static void junk_never_leaves_the_range(void)
{
    uint64_t seed = 56;
    for (unsigned i = 0; i < 3000; i++) {
        const double spread = exp(synth_uniform(&seed) * log(8000));
        for (unsigned k = 0; k < COUNT; k++) {
            xs[k] = (int32_t)(65536 * spread * synth_uniform(&seed));
            ys[k] = (int32_t)(65536 * spread * synth_uniform(&seed));
        }
        struct refit_quality quality;
        struct ellipse e = circle(spread / 2, spread / 2, fmin(500, 0.7 + spread * synth_uniform(&seed)));
        if (refit_ellipse(xs, ys, COUNT, &e, &quality)) {
            struct ellipse_root root;
            TEST_ASSERT_TRUE(ellipse_take_root(&e, &root));
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(start_that_is_a_little_off_is_drawn_to_the_points);
    RUN_TEST(residual_and_spread_agree_with_theory_on_a_circle);
    RUN_TEST(spread_is_the_likeliest_fits_on_ellipses_and_arcs);
    RUN_TEST(sectors_show_how_much_is_covered);
    RUN_TEST(points_that_are_no_ellipse_near_it_are_refused);
    RUN_TEST(junk_never_leaves_the_range);
    return UNITY_END();
}
