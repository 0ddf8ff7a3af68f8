/* The fit by area: exact on exact points, as good as least squares on noisy ones, and right about how far they are
 * off. */
#include "firmware/detect/areafit.h"

#include <math.h>
#include <stdlib.h>
#include <unity.h>

#include "tests/unit/synth.h"

static int32_t xs[AREAFIT_POINTS_MAX];
static int32_t ys[AREAFIT_POINTS_MAX];
static uint32_t count;

void setUp(void)
{
    count = 0;
}
void tearDown(void) {}

static void push(double x, double y)
{
    TEST_ASSERT_TRUE(count < AREAFIT_POINTS_MAX);
    xs[count] = (int32_t)lrint(65536 * x);
    ys[count++] = (int32_t)lrint(65536 * y);
}

struct shape {
    double x, y, major, minor, angle;
};

/* The point at an angle of the unit frame, off along the normal. */
static void push_at(const struct shape *s, double a, double off)
{
    const double over = off / hypot(cos(a) / s->major, sin(a) / s->minor);
    const double p = s->major * cos(a) + over * cos(a) / s->major;
    const double q = s->minor * sin(a) + over * sin(a) / s->minor;
    push(s->x + cos(s->angle) * p - sin(s->angle) * q, s->y + sin(s->angle) * p + cos(s->angle) * q);
}

static void push_evenly(const struct shape *s, uint32_t points, bool clockwise)
{
    count = 0;
    for (uint32_t i = 0; i < points; i++) {
        push_at(s, (clockwise ? 2 : -2) * SYNTH_PI * (i + 0.3) / points, 0);
    }
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a;
    const double y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Where the ellipse crosses the lines of the pixel grid, as edge points do; sums of its steps' powers. */
static void push_crossings(const struct shape *s, double *third, double *fifth)
{
    static double angles[AREAFIT_POINTS_MAX];
    uint32_t n = 0;
    for (unsigned axis = 0; axis < 2; axis++) {
        /* The coordinate is centre + reach cos(a - lag). */
        const double across = axis == 0 ? s->major * cos(s->angle) : s->major * sin(s->angle);
        const double along = axis == 0 ? -s->minor * sin(s->angle) : s->minor * cos(s->angle);
        const double centre = axis == 0 ? s->x : s->y;
        const double reach = hypot(across, along);
        const double lag = atan2(along, across);
        for (double line = ceil(centre - reach); line <= centre + reach; line++) {
            const double half = acos((line - centre) / reach);
            for (int side = -1; side <= 1; side += 2) {
                TEST_ASSERT_TRUE(n < AREAFIT_POINTS_MAX);
                angles[n++] = fmod(lag + side * half + 4 * SYNTH_PI, 2 * SYNTH_PI);
            }
        }
    }
    qsort(angles, n, sizeof angles[0], by_value);
    count = 0;
    for (uint32_t i = 0; i < n; i++) {
        const double step = i > 0 ? angles[i] - angles[i - 1] : angles[0] + 2 * SYNTH_PI - angles[n - 1];
        *third += pow(step, 3);
        *fifth += pow(step, 5);
        push_at(s, angles[i], 0);
    }
}

static struct shape draw_shape(uint64_t *seed, double largest)
{
    struct shape s = {.x = 8191 * synth_uniform(seed), .y = 8191 * synth_uniform(seed)};
    s.major = 1.5 * exp(synth_uniform(seed) * log(largest / 1.5));
    s.minor = fmax(1.2, s.major * (0.2 + 0.8 * synth_uniform(seed)));
    s.major = fmax(s.major, s.minor);
    s.angle = SYNTH_PI * synth_uniform(seed);
    return s;
}

static void check_shape(double tolerance, const struct shape *s, const struct ellipse *e)
{
    const double c = cos(s->angle);
    const double n = sin(s->angle);
    const double a = s->major * s->major;
    const double b = s->minor * s->minor;
    SYNTH_NEAR(tolerance, c * c * a + n * n * b, e->shape_xx_px2_q12 / 4096.0);
    SYNTH_NEAR(tolerance, c * n * (a - b), e->shape_xy_px2_q12 / 4096.0);
    SYNTH_NEAR(tolerance, n * n * a + c * c * b, e->shape_yy_px2_q12 / 4096.0);
}

/* The header: arithmetic errs below 2e-5 of the size; evenly spaced points have no other error. Formats add half a step
 * each. In the shape (r^2) an error e r becomes 2 e r^2. */
static void evenly_spaced_points_come_back_exactly(void)
{
    uint64_t seed = 31;
    for (unsigned i = 0; i < 2000; i++) {
        const struct shape s = draw_shape(&seed, 500);
        const bool clockwise = i % 2 == 0;
        struct areafit fit;
        push_evenly(&s, (uint32_t)fmax(12, 8 * s.major), clockwise);
        TEST_ASSERT_TRUE(areafit_ellipse(xs, ys, count, &fit));
        const double off = 2e-5 * s.major + 1.0 / 65536;
        SYNTH_NEAR(off, s.x, fit.ellipse.x_px_q16 / 65536.0);
        SYNTH_NEAR(off, s.y, fit.ellipse.y_px_q16 / 65536.0);
        check_shape(2 * off * s.major + 1.0 / 4096, &s, &fit.ellipse);
        TEST_ASSERT_EQUAL_INT(clockwise, fit.clockwise);
    }
}

/* With points at uneven angles a step of the angle h errs: the trapezoidal rule by h^3 / 12 times the second
 * derivative, the chord that stands for the arc by -h^3 / 6. For the centre, 2/3 of the mean of the unit vectors, both
 * make sum h^3 / (12 pi) of the size at most; for the shape, the mean of cosines of twice the angle, sum h^3 / (4 pi).
 * Of the area 3 h^5 / 40 a step are left out. Signs differ around the ellipse, which leaves room for higher orders. */
static void crossings_of_the_grid_are_right_to_second_order(void)
{
    uint64_t seed = 32;
    for (unsigned i = 0; i < 2000; i++) {
        const struct shape s = draw_shape(&seed, 500);
        struct areafit fit;
        double third = 0;
        double fifth = 0;
        push_crossings(&s, &third, &fifth);
        if (count < 12) {
            continue;
        }
        TEST_ASSERT_TRUE(areafit_ellipse(xs, ys, count, &fit));
        const double off = third / (12 * SYNTH_PI) * s.major + 2e-5 * s.major + 1.0 / 65536;
        SYNTH_NEAR(off, s.x, fit.ellipse.x_px_q16 / 65536.0);
        SYNTH_NEAR(off, s.y, fit.ellipse.y_px_q16 / 65536.0);
        check_shape((third / (4 * SYNTH_PI) + 4e-5) * s.major * s.major + 1.0 / 4096, &s, &fit.ellipse);
        const double lack = fifth * 3 / 40 / (2 * SYNTH_PI);
        const double square = 2 / (pow(s.major, -2) + pow(s.minor, -2));
        SYNTH_NEAR(lack / 4 * square + 1.0 / 1024, 0, fit.residual_px2_q12 / 4096.0);
    }
}

/* Noise of an edge is shared by neighbours: a mean over five points, 1/5 of the variance in each. A centre's variance
 * is then 2 s^2 / n an axis for single points' s. Fits: 500, so the spread of the spread is 1 / sqrt(2 x 1000) = 2.2 %:
 * 10 % is more than four of those. The residual lacks five degrees of freedom of some n / 5. */
static void noisy_circle_is_centred_as_by_least_squares(void)
{
    enum { POINTS = 96, SHARED = 5 };
    uint64_t seed = 33;
    const struct shape s = {100, 80, 12, 12, 0};
    const double noise = 0.15;
    const unsigned fits = 500;
    double squares = 0;
    double residual = 0;
    for (unsigned i = 0; i < fits; i++) {
        double own[POINTS];
        struct areafit fit;
        for (unsigned k = 0; k < POINTS; k++) {
            own[k] = synth_normal(&seed, noise);
        }
        count = 0;
        for (unsigned k = 0; k < POINTS; k++) {
            double off = 0;
            for (unsigned j = 0; j < SHARED; j++) {
                off += own[(k + j) % POINTS] / SHARED;
            }
            push_at(&s, 2 * SYNTH_PI * k / POINTS, off);
        }
        TEST_ASSERT_TRUE(areafit_ellipse(xs, ys, count, &fit));
        squares += pow(fit.ellipse.x_px_q16 / 65536.0 - s.x, 2) + pow(fit.ellipse.y_px_q16 / 65536.0 - s.y, 2);
        residual += fit.residual_px2_q12 / 4096.0 / fits;
    }
    const double theory = noise * sqrt(2.0 / POINTS);
    SYNTH_NEAR(0.10 * theory, theory, sqrt(squares / (2 * fits)));
    const double free = (noise * noise / SHARED) * (1 - 5.0 * SHARED / POINTS);
    SYNTH_NEAR(0.15 * free, free, residual);
}

/* Waves along the normal, of too short a length for an ellipse to follow: amplitude^2 / 2. To second order in the
 * wave's share of the radius, and as far as the waves do not meet the ellipse's own. */
static void residual_is_the_mean_square_distance(void)
{
    static const double cases[][3] = {{6, 6, 0.1}, {12, 12, 0.3}, {12, 7, 0.2}, {40, 25, 0.3}, {300, 300, 0.4}};
    for (unsigned k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        const struct shape s = {200.3, 100.8, cases[k][0], cases[k][1], 0.4};
        struct areafit fit;
        const uint32_t points = (uint32_t)(8 * s.major);
        count = 0;
        for (uint32_t i = 0; i < points; i++) {
            const double a = 2 * SYNTH_PI * i / points;
            push_at(&s, a, cases[k][2] * cos(5 * a));
        }
        TEST_ASSERT_TRUE(areafit_ellipse(xs, ys, count, &fit));
        const double square = cases[k][2] * cases[k][2] / 2;
        SYNTH_NEAR(0.12 * square + 1.0 / 2048, square, fit.residual_px2_q12 / 4096.0);
    }
}

static void push_line(double x0, double y0, double x1, double y1)
{
    const int n = (int)(hypot(x1 - x0, y1 - y0) / 0.785);
    for (int i = 0; i < n; i++) {
        push(x0 + (x1 - x0) * i / n, y0 + (y1 - y0) * i / n);
    }
}

/* Of an equilateral triangle of side 1: area sqrt(3) / 4, second moments 1 / 24 of it an axis; so S = 1 / 6,
 * (A / pi)^2 = 3 / (16 pi^2), and the mean square (det - that) / (4 trace) = 0.0066 of the side squared: 0.28 of the
 * inradius. The lines' joints and the polygon's share in the area cost some percent. */
static void triangle_lies_far_from_its_ellipse(void)
{
    for (double side = 20; side < 500; side *= 2) {
        struct areafit fit;
        count = 0;
        push_line(30, 30, 30 + side, 30);
        push_line(30 + side, 30, 30 + side / 2, 30 + side * sqrt(0.75));
        push_line(30 + side / 2, 30 + side * sqrt(0.75), 30, 30);
        TEST_ASSERT_TRUE(areafit_ellipse(xs, ys, count, &fit));
        const double square = (1.0 / 36 - 3 / (16 * SYNTH_PI * SYNTH_PI)) / (4.0 / 3) * side * side;
        SYNTH_NEAR(0.1 * square, square, fit.residual_px2_q12 / 4096.0);
    }
}

/* The longest needles and squares, and paths at random that end where they began. */
static void nothing_leaves_the_range(void)
{
    uint64_t seed = 34;
    struct areafit fit;
    for (unsigned turn = 0; turn < 8; turn++) { /* out and back again */
        static const int8_t ways[8][2] = {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}};
        count = 0;
        for (int i = 0; i < (int)AREAFIT_POINTS_MAX; i++) {
            const int far = i < (int)AREAFIT_POINTS_MAX / 2 ? i : (int)AREAFIT_POINTS_MAX - i;
            push(4000 + far * ways[turn][0], 4000 + far * ways[turn][1]);
        }
        TEST_ASSERT_FALSE(areafit_ellipse(xs, ys, count, &fit));
    }
    for (int sense = -1; sense <= 1; sense += 2) {
        count = 0;
        for (int i = 0; i < (int)AREAFIT_POINTS_MAX; i++) {
            const int side = (int)AREAFIT_POINTS_MAX / 4;
            const int on = i % side;
            const int at[4][2] = {{on, 0}, {side, on}, {side - on, side}, {0, side - on}};
            push(at[i / side][0], sense * at[i / side][1]);
        }
        TEST_ASSERT_FALSE(areafit_ellipse(xs, ys, count, &fit)); /* an axis above 512 px */
    }
    for (unsigned round = 0; round < 3000; round++) {
        double x[AREAFIT_POINTS_MAX + 1] = {0};
        double y[AREAFIT_POINTS_MAX + 1] = {0};
        const uint32_t n = (uint32_t)(8 * exp(synth_uniform(&seed) * log(AREAFIT_POINTS_MAX / 8.0)));
        const double keep = synth_uniform(&seed);
        double step_x = 0;
        double step_y = 0;
        for (uint32_t i = 0; i < n; i++) {
            step_x = keep * step_x + (1 - keep) * (synth_uniform(&seed) - 0.5);
            step_y = keep * step_y + (1 - keep) * (synth_uniform(&seed) - 0.5);
            x[i + 1] = x[i] + step_x;
            y[i + 1] = y[i] + step_y;
        }
        count = 0;
        for (uint32_t i = 0; i < n; i++) {
            push(4096 + x[i] - x[n] * i / n, 4096 + y[i] - y[n] * i / n);
        }
        if (areafit_ellipse(xs, ys, count, &fit)) {
            const struct ellipse *e = &fit.ellipse;
            TEST_ASSERT_TRUE(e->shape_xx_px2_q12 >= ELLIPSE_SHAPE_MIN_PX2_Q12);
            TEST_ASSERT_TRUE(e->shape_yy_px2_q12 <= ELLIPSE_SHAPE_MAX_PX2_Q12);
            TEST_ASSERT_TRUE(fit.residual_px2_q12 >= 0);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(evenly_spaced_points_come_back_exactly);
    RUN_TEST(crossings_of_the_grid_are_right_to_second_order);
    RUN_TEST(noisy_circle_is_centred_as_by_least_squares);
    RUN_TEST(residual_is_the_mean_square_distance);
    RUN_TEST(triangle_lies_far_from_its_ellipse);
    RUN_TEST(nothing_leaves_the_range);
    return UNITY_END();
}
