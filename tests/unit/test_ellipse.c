/* Shapes, roots, axes and steps of ellipses against double. */
#include "firmware/detect/ellipse.h"

#include <math.h>
#include <unity.h>

#include "tests/unit/synth.h"

void setUp(void) {}
void tearDown(void) {}

static struct ellipse make(double x, double y, double major, double minor, double angle)
{
    const double c = cos(angle);
    const double s = sin(angle);
    const double a = major * major;
    const double b = minor * minor;
    return (struct ellipse){(int32_t)lrint(x * 65536), (int32_t)lrint(y * 65536),
                            (int32_t)lrint((c * c * a + s * s * b) * 4096),
                            (int32_t)lrint(c * s * (a - b) * 4096),
                            (int32_t)lrint((s * s * a + c * c * b) * 4096)};
}

/* The shape's step of 2^-12 px^2 moves a semi-axis r by half of that over 2 r; at elongation e the smaller
 * one feels the errors of all three entries. 3 half steps over 2 r, and the rounding to 2^-16 twice. */
static double axis_tolerance(double r)
{
    return 3 * 0.5 / 4096 / (2 * r) + 2.0 / 65536;
}

static void axes_and_angle_come_back_from_the_shape(void)
{
    uint64_t seed = 31;
    for (unsigned i = 0; i < 3000; i++) {
        const double major = exp(synth_uniform(&seed) * log(500));
        const double minor = fmax(0.6, major * (0.15 + 0.84 * synth_uniform(&seed)));
        if (minor > major) {
            continue;
        }
        const double angle = SYNTH_PI * synth_uniform(&seed);
        const struct ellipse e = make(10, 20, major, minor, angle);
        uint32_t got_major;
        uint32_t got_minor;
        uint16_t turn;
        ellipse_axes(&e, &got_major, &got_minor, &turn);
        SYNTH_NEAR(axis_tolerance(major), major, got_major / 65536.0);
        /* The smaller one may come as a difference of Q12 numbers of the larger's size: relative 2^-24
         * steps of a root there add. */
        SYNTH_NEAR(axis_tolerance(minor) + major * major / minor * 2e-7, minor, got_minor / 65536.0);
        TEST_ASSERT_TRUE(turn < 32768);
        /* The angle of a shape entry's error against a^2 - b^2, and turn.h's 3 / 65536 of 2 x angle. */
        const double slack = 2 / 65536.0 * 2 * SYNTH_PI + 2.0 / 4096 / (major * major - minor * minor);
        SYNTH_NEAR(slack, 0, remainder(turn * 2 * SYNTH_PI / 65536 - angle, SYNTH_PI));
        SYNTH_NEAR(axis_tolerance(minor) * sqrt(major / minor) + 1e-6 * major, sqrt(major * minor),
                   ellipse_size_px_q16(&e) / 65536.0);
    }
}

static void root_maps_the_unit_circle_to_the_ellipse(void)
{
    uint64_t seed = 32;
    for (unsigned i = 0; i < 3000; i++) {
        const double major = exp(synth_uniform(&seed) * log(500));
        const double minor = fmax(0.6, major * (0.15 + 0.85 * synth_uniform(&seed)));
        const struct ellipse e = make(0, 0, fmax(major, minor), minor, SYNTH_PI * synth_uniform(&seed));
        struct ellipse_root root;
        TEST_ASSERT_TRUE(ellipse_take_root(&e, &root));
        TEST_ASSERT_TRUE(root.xx_px_q16 > 0 && root.yy_px_q16 > 0);
        const double xx = root.xx_px_q16 / 65536.0;
        const double yx = root.yx_px_q16 / 65536.0;
        const double yy = root.yy_px_q16 / 65536.0;
        /* Entries of the root are rounded to 2^-16; products with entries up to `major` twice over. */
        const double tolerance = 4 * major / 65536 + 1.0 / 4096;
        SYNTH_NEAR(tolerance, e.shape_xx_px2_q12 / 4096.0, xx * xx);
        SYNTH_NEAR(tolerance, e.shape_xy_px2_q12 / 4096.0, xx * yx);
        SYNTH_NEAR(tolerance, e.shape_yy_px2_q12 / 4096.0, yx * yx + yy * yy);
    }
}

static void shapes_that_are_no_ellipse_have_no_root(void)
{
    struct ellipse_root root;
    struct ellipse e = {0, 0, 4096, 4096, 4096}; /* a line */
    TEST_ASSERT_FALSE(ellipse_take_root(&e, &root));
    e = (struct ellipse){0, 0, 4096, 8192, 4096}; /* a hyperbola */
    TEST_ASSERT_FALSE(ellipse_take_root(&e, &root));
    e = (struct ellipse){0, 0, -4096, 0, 4096};
    TEST_ASSERT_FALSE(ellipse_take_root(&e, &root));
    e = (struct ellipse){0, 0, 4096, 0, -4096};
    TEST_ASSERT_FALSE(ellipse_take_root(&e, &root));
    e = (struct ellipse){0, 0, 0, 0, 0};
    TEST_ASSERT_FALSE(ellipse_take_root(&e, &root));
    e = make(0, 0, 10, 0.24, 0); /* below a quarter pixel */
    TEST_ASSERT_FALSE(ellipse_take_root(&e, &root));
    e = make(0, 0, 10, 0.24, SYNTH_PI / 2);
    TEST_ASSERT_FALSE(ellipse_take_root(&e, &root));
    e = make(0, 0, 512, 400, 0.7);
    TEST_ASSERT_TRUE(ellipse_take_root(&e, &root));
}

/* The change that the header names, in double. */
static void step_moves_centre_and_shape_as_promised(void)
{
    uint64_t seed = 33;
    for (unsigned i = 0; i < 1000; i++) {
        const double major = 1.5 + 60 * synth_uniform(&seed);
        const double minor = major * (0.4 + 0.6 * synth_uniform(&seed));
        struct ellipse e = make(300, 200, major, minor, SYNTH_PI * synth_uniform(&seed));
        struct ellipse_root root;
        TEST_ASSERT_TRUE(ellipse_take_root(&e, &root));
        int64_t step_q36[ELLIPSE_UNKNOWNS];
        double t[ELLIPSE_UNKNOWNS];
        for (unsigned k = 0; k < ELLIPSE_UNKNOWNS; k++) {
            t[k] = 0.15 * (2 * synth_uniform(&seed) - 1);
            step_q36[k] = llrint(t[k] * 68719476736.0);
        }
        const double b[2][2] = {{root.xx_px_q16 / 65536.0, 0},
                                {root.yx_px_q16 / 65536.0, root.yy_px_q16 / 65536.0}};
        const double m[2][2] = {{1 + 2 * (t[2] + t[3]), 2 * t[4]}, {2 * t[4], 1 + 2 * (t[2] - t[3])}};
        double s[2][2] = {{0}};
        for (int r = 0; r < 2; r++) {
            for (int c = 0; c < 2; c++) {
                for (int k = 0; k < 2; k++) {
                    for (int l = 0; l < 2; l++) {
                        s[r][c] += b[r][k] * m[k][l] * b[c][l];
                    }
                }
            }
        }
        const double x = e.x_px_q16 / 65536.0 + b[0][0] * t[0];
        const double y = e.y_px_q16 / 65536.0 + b[1][0] * t[0] + b[1][1] * t[1];
        TEST_ASSERT_TRUE(ellipse_step(&e, &root, step_q36));
        /* One rounding to 2^-16 for a product each; of the shape to 2^-12, with intermediate ones at most
         * as coarse as 2^-16 times the axis. */
        SYNTH_NEAR(2.0 / 65536, x, e.x_px_q16 / 65536.0);
        SYNTH_NEAR(3.0 / 65536, y, e.y_px_q16 / 65536.0);
        SYNTH_NEAR(1.0 / 4096 + 4 * major / 65536, s[0][0], e.shape_xx_px2_q12 / 4096.0);
        SYNTH_NEAR(1.0 / 4096 + 4 * major / 65536, s[0][1], e.shape_xy_px2_q12 / 4096.0);
        SYNTH_NEAR(1.0 / 4096 + 4 * major / 65536, s[1][1], e.shape_yy_px2_q12 / 4096.0);
    }
}

static void step_above_a_quarter_or_out_of_range_changes_nothing(void)
{
    for (unsigned k = 0; k < ELLIPSE_UNKNOWNS; k++) {
        struct ellipse e = make(30, 20, 10, 8, 0.5);
        const struct ellipse before = e;
        struct ellipse_root root;
        TEST_ASSERT_TRUE(ellipse_take_root(&e, &root));
        int64_t step_q36[ELLIPSE_UNKNOWNS] = {0};
        step_q36[k] = ((int64_t)1 << 34) + 1000;
        TEST_ASSERT_FALSE(ellipse_step(&e, &root, step_q36));
        TEST_ASSERT_EQUAL_MEMORY(&before, &e, sizeof e);
        step_q36[k] = -step_q36[k];
        TEST_ASSERT_FALSE(ellipse_step(&e, &root, step_q36));
        TEST_ASSERT_EQUAL_MEMORY(&before, &e, sizeof e);
    }
    struct ellipse largest = make(600, 600, 510, 510, 0);
    const struct ellipse before = largest;
    struct ellipse_root root;
    TEST_ASSERT_TRUE(ellipse_take_root(&largest, &root));
    const int64_t grow_q36[ELLIPSE_UNKNOWNS] = {0, 0, (int64_t)1 << 32, 0, 0}; /* by a sixteenth */
    TEST_ASSERT_FALSE(ellipse_step(&largest, &root, grow_q36));
    TEST_ASSERT_EQUAL_MEMORY(&before, &largest, sizeof largest);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(axes_and_angle_come_back_from_the_shape);
    RUN_TEST(root_maps_the_unit_circle_to_the_ellipse);
    RUN_TEST(shapes_that_are_no_ellipse_have_no_root);
    RUN_TEST(step_moves_centre_and_shape_as_promised);
    RUN_TEST(step_above_a_quarter_or_out_of_range_changes_nothing);
    return UNITY_END();
}
