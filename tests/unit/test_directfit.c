/* The direct fit: exact on exact points, right on average on noisy ones, and silent on what is no ellipse. */
#include "firmware/detect/directfit.h"

#include <math.h>
#include <unity.h>

#include "tests/unit/synth.h"

static int32_t xs[DIRECTFIT_POINTS_MAX];
static int32_t ys[DIRECTFIT_POINTS_MAX];

void setUp(void) {}
void tearDown(void) {}

/* `count` points of an ellipse's arc, each off by noise px both ways. */
static void points(double x, double y, double major, double minor, double angle, double from, double to,
                   uint32_t count, double noise, uint64_t *seed)
{
    for (uint32_t i = 0; i < count; i++) {
        const double a = from + (to - from) * i / count;
        const double p = major * cos(a);
        const double q = minor * sin(a);
        xs[i] = (int32_t)lrint(65536 * (x + cos(angle) * p - sin(angle) * q + synth_normal(seed, noise)));
        ys[i] = (int32_t)lrint(65536 * (y + sin(angle) * p + cos(angle) * q + synth_normal(seed, noise)));
    }
}

static void check_shape(double tolerance, double major, double minor, double angle,
                        const struct ellipse *e)
{
    const double c = cos(angle);
    const double s = sin(angle);
    const double a = major * major;
    const double b = minor * minor;
    SYNTH_NEAR(tolerance, c * c * a + s * s * b, e->shape_xx_px2_q12 / 4096.0);
    SYNTH_NEAR(tolerance, c * s * (a - b), e->shape_xy_px2_q12 / 4096.0);
    SYNTH_NEAR(tolerance, s * s * a + c * c * b, e->shape_yy_px2_q12 / 4096.0);
}

/* The header: arithmetic errs below 2e-5 of the size. The points' own rounding to 2^-16, uniform, averages
 * to less than 2^-17; formats add half a step each. In the shape (r^2) an error e r becomes 2 e r^2. */
static void whole_ellipses_of_all_sizes_and_places_come_back(void)
{
    uint64_t seed = 41;
    for (unsigned i = 0; i < 2000; i++) {
        const double major = 1.5 * exp(synth_uniform(&seed) * log(330));
        const double minor = fmax(1.2, major * (0.2 + 0.8 * synth_uniform(&seed)));
        const double angle = SYNTH_PI * synth_uniform(&seed);
        const double x = 8191 * synth_uniform(&seed);
        const double y = 8191 * synth_uniform(&seed);
        const double large = fmax(major, minor);
        const uint32_t count = (uint32_t)fmin(DIRECTFIT_POINTS_MAX, fmax(8, 4 * (large + minor)));
        struct ellipse e;
        points(x, y, large, minor, angle, 0, 2 * SYNTH_PI, count, 0, &seed);
        TEST_ASSERT_TRUE(directfit_ellipse(xs, ys, count, &e));
        const double off = 2e-5 * large + 1.0 / 65536;
        SYNTH_NEAR(off, x, e.x_px_q16 / 65536.0);
        SYNTH_NEAR(off, y, e.y_px_q16 / 65536.0);
        check_shape(2 * off * large + 1.0 / 4096, large, minor, angle, &e);
    }
}

/* Noise of s px a coordinate on n points of a whole circle: centre's variance 2 s^2 / n; its mean over m fits
 * strays by sqrt(2 / (n m)) s. Four of those, for the mean; the spread within 15 % (m = 600: 3 % a sigma). */
static void noisy_circle_is_centred_right_on_average(void)
{
    uint64_t seed = 42;
    const double noise = 0.1;
    const uint32_t count = 64;
    const unsigned fits = 600;
    double sum_x = 0;
    double sum_y = 0;
    double squares = 0;
    for (unsigned i = 0; i < fits; i++) {
        struct ellipse e;
        points(100, 80, 8, 8, 0, 0, 2 * SYNTH_PI, count, noise, &seed);
        TEST_ASSERT_TRUE(directfit_ellipse(xs, ys, count, &e));
        const double dx = e.x_px_q16 / 65536.0 - 100;
        const double dy = e.y_px_q16 / 65536.0 - 80;
        sum_x += dx;
        sum_y += dy;
        squares += dx * dx + dy * dy;
    }
    const double deviation = noise * sqrt(2.0 / count);
    SYNTH_NEAR(4 * deviation / sqrt(fits), 0, sum_x / fits);
    SYNTH_NEAR(4 * deviation / sqrt(fits), 0, sum_y / fits);
    SYNTH_NEAR(0.15 * deviation, deviation, sqrt(squares / (2 * fits)));
}

/* 225 degrees are the least that a feature needs (ellipses.h: 10 sectors of 16). */
static void arcs_of_five_eighths_come_back_in_every_direction(void)
{
    uint64_t seed = 43;
    for (unsigned i = 0; i < 144; i++) {
        const double from = 2 * SYNTH_PI * i / 72;
        const double minor = i < 72 ? 18 : 30;
        struct ellipse e;
        points(200, 300, 30, minor, 0.7, from, from + 1.25 * SYNTH_PI, 100, 0, &seed);
        TEST_ASSERT_TRUE(directfit_ellipse(xs, ys, 100, &e));
        /* An arc determines its ellipse a few times worse than the whole does: five times 2e-5 of 30. */
        SYNTH_NEAR(0.003, 200, e.x_px_q16 / 65536.0);
        SYNTH_NEAR(0.003, 300, e.y_px_q16 / 65536.0);
    }
}

static void noisy_arcs_of_five_eighths_are_fitted_in_every_direction(void)
{
    uint64_t seed = 47;
    for (unsigned i = 0; i < 720; i++) {
        const double from = 2 * SYNTH_PI * i / 72;
        struct ellipse e;
        points(200, 300, 10, 8, 0.7, from, from + 1.25 * SYNTH_PI, 48, 0.05, &seed);
        TEST_ASSERT_TRUE(directfit_ellipse(xs, ys, 48, &e));
        /* sigma of the centre: 0.05 sqrt(2 / 48) = 0.01 for points all round; some four times that across the
         * gap; five sigma. */
        SYNTH_NEAR(0.2, 200, e.x_px_q16 / 65536.0);
        SYNTH_NEAR(0.2, 300, e.y_px_q16 / 65536.0);
    }
}

static void too_few_points_and_lines_are_refused(void)
{
    uint64_t seed = 44;
    struct ellipse e;
    points(50, 50, 10, 10, 0, 0, 2 * SYNTH_PI, DIRECTFIT_POINTS_MIN, 0, &seed);
    TEST_ASSERT_TRUE(directfit_ellipse(xs, ys, DIRECTFIT_POINTS_MIN, &e));
    for (uint32_t n = 0; n < DIRECTFIT_POINTS_MIN; n++) {
        TEST_ASSERT_FALSE(directfit_ellipse(xs, ys, n, &e));
    }
    for (uint32_t i = 0; i < 100; i++) { /* a line, with noise across it below a third of a pixel */
        xs[i] = (int32_t)(65536 * i);
        ys[i] = (int32_t)lrint(65536 * (20 + 0.5 * i + synth_normal(&seed, 0.1)));
    }
    TEST_ASSERT_FALSE(directfit_ellipse(xs, ys, 100, &e));
    for (uint32_t i = 0; i < 100; i++) { /* one point a hundred times */
        xs[i] = ys[i] = 5 << 16;
    }
    TEST_ASSERT_FALSE(directfit_ellipse(xs, ys, 100, &e));
    points(50, 50, 40, 4, 0.3, 0, 2 * SYNTH_PI, 100, 0, &seed); /* spread ratio 1 / 10 */
    TEST_ASSERT_FALSE(directfit_ellipse(xs, ys, 100, &e));
}

static void largest_ellipse_of_the_most_points_stays_in_range(void)
{
    uint64_t seed = 45;
    struct ellipse e;
    points(4000, 4000, 511, 505, 1.0, 0, 2 * SYNTH_PI, DIRECTFIT_POINTS_MAX, 0, &seed);
    TEST_ASSERT_TRUE(directfit_ellipse(xs, ys, DIRECTFIT_POINTS_MAX, &e));
    SYNTH_NEAR(511 * 2e-5, 4000, e.x_px_q16 / 65536.0);
    SYNTH_NEAR(511 * 2e-5, 4000, e.y_px_q16 / 65536.0);
    points(4000, 4000, 1500, 1500, 1.0, 0, 2 * SYNTH_PI, DIRECTFIT_POINTS_MAX, 0, &seed);
    TEST_ASSERT_FALSE(directfit_ellipse(xs, ys, DIRECTFIT_POINTS_MAX, &e));
}

/* Whitened points of four corners have the largest fourth powers; and junk over the whole image. Only that
 * nothing overflows (sanitizers see it) and that an answer is a shape in range. */
static void junk_gives_a_shape_in_range_or_none(void)
{
    uint64_t seed = 46;
    for (unsigned i = 0; i < 3000; i++) {
        const uint32_t count = 6 + (uint32_t)(synth_u64(&seed) % 60);
        const unsigned kind = i % 3;
        const double spread = exp(synth_uniform(&seed) * log(8000));
        for (uint32_t k = 0; k < count; k++) {
            const double u = kind == 1 ? (double)(synth_u64(&seed) & 1) : synth_uniform(&seed);
            const double v = kind == 1 ? (double)(synth_u64(&seed) & 1) : synth_uniform(&seed);
            /* Kind 2: one point far off the others. */
            xs[k] = (int32_t)(65536 * (kind == 2 && k > 0 ? 4 * u : spread * u));
            ys[k] = (int32_t)(65536 * (kind == 2 && k > 0 ? 4 * v : spread * v));
        }
        struct ellipse e;
        if (directfit_ellipse(xs, ys, count, &e)) {
            struct ellipse_root root;
            TEST_ASSERT_TRUE(ellipse_take_root(&e, &root));
            TEST_ASSERT_TRUE(e.shape_xx_px2_q12 <= ELLIPSE_SHAPE_MAX_PX2_Q12);
            TEST_ASSERT_TRUE(e.shape_yy_px2_q12 <= ELLIPSE_SHAPE_MAX_PX2_Q12);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(whole_ellipses_of_all_sizes_and_places_come_back);
    RUN_TEST(noisy_circle_is_centred_right_on_average);
    RUN_TEST(arcs_of_five_eighths_come_back_in_every_direction);
    RUN_TEST(noisy_arcs_of_five_eighths_are_fitted_in_every_direction);
    RUN_TEST(too_few_points_and_lines_are_refused);
    RUN_TEST(largest_ellipse_of_the_most_points_stays_in_range);
    RUN_TEST(junk_gives_a_shape_in_range_or_none);
    return UNITY_END();
}
