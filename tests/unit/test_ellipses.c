/* Contours to ellipses: ideal contours with known truth, and lists at their limits. */
#include "firmware/detect/ellipses.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "firmware/limits.h"
#include "tests/unit/synth.h"

static int32_t xs[LIMIT_CONTOUR_POINTS];
static int32_t ys[LIMIT_CONTOUR_POINTS];
static struct contour contour = {.x_px_q16 = xs, .y_px_q16 = ys, .gradient_mean_q3 = 1000};
static struct ellipses ellipses;
static void *memory;

static void start(unsigned width, unsigned height)
{
    struct arena arena = {0};
    ellipses_init(&ellipses, &arena, width, height);
    free(memory);
    memory = malloc(arena.used);
    TEST_ASSERT_NOT_NULL(memory);
    memset(memory, 0x5a, arena.used);
    arena = (struct arena){.base = memory, .size = arena.used};
    ellipses_init(&ellipses, &arena, width, height);
    ellipses_begin(&ellipses);
}

void setUp(void)
{
    contour.count = 0;
    contour.closed = false;
    start(640, 480);
}
void tearDown(void)
{
    free(memory);
    memory = NULL;
}

static void push(double x, double y)
{
    xs[contour.count] = (int32_t)lrint(x * 65536);
    ys[contour.count++] = (int32_t)lrint(y * 65536);
}

/* An ellipse's arc, noise along its normal. from < to runs clockwise as seen, bright inside. */
static void push_arc(double x, double y, double major, double minor, double angle, double from, double to,
                     double noise, uint64_t *seed)
{
    const int n = (int)(fabs(to - from) * sqrt(major * minor) / 0.785);
    for (int i = 0; i < n; i++) {
        const double a = from + (to - from) * i / n;
        const double off = synth_normal(seed, noise) / hypot(cos(a) / major, sin(a) / minor);
        const double p = major * cos(a) + off * cos(a) / major;
        const double q = minor * sin(a) + off * sin(a) / minor;
        push(x + cos(angle) * p - sin(angle) * q, y + sin(angle) * p + cos(angle) * q);
    }
}

static void push_line(double x0, double y0, double x1, double y1)
{
    const int n = (int)(hypot(x1 - x0, y1 - y0) / 0.785);
    for (int i = 0; i < n; i++) {
        push(x0 + (x1 - x0) * i / n, y0 + (y1 - y0) * i / n);
    }
}

/* Adds what was pushed as one contour. */
static void add(bool closed)
{
    contour.closed = closed;
    ellipses_add(&ellipses, &contour);
    contour.count = 0;
}

static void check_only(double tolerance, double x, double y, bool white)
{
    TEST_ASSERT_EQUAL_UINT32(1, ellipses.count);
    SYNTH_NEAR(tolerance, x, ellipses.at[0].ellipse.x_px_q16 / 65536.0);
    SYNTH_NEAR(tolerance, y, ellipses.at[0].ellipse.y_px_q16 / 65536.0);
    TEST_ASSERT_EQUAL_INT(white, ellipses.at[0].white);
    TEST_ASSERT_EQUAL_UINT16(1000, ellipses.at[0].gradient_mean_q3);
}

static void closed_ellipses_of_both_colours_are_found_whole(void)
{
    uint64_t seed = 61;
    for (unsigned i = 0; i < 400; i++) {
        ellipses_begin(&ellipses);
        const double major = 2 + 60 * synth_uniform(&seed);
        const double minor = fmax(1.5, major * (0.3 + 0.7 * synth_uniform(&seed)));
        const double turns = i % 2 ? 2 * SYNTH_PI : -2 * SYNTH_PI;
        push_arc(300, 200, fmax(major, minor), minor, 2 * synth_uniform(&seed), 0, turns, 0, &seed);
        const uint32_t points = contour.count;
        add(true);
        ellipses_end(&ellipses);
        if (points >= ELLIPSES_POINTS_MIN) {
            /* Exact points: areafit.h's 2e-5 of the size and two roundings. */
            check_only(2e-5 * major + 2.0 / 65536, 300, 200, i % 2);
        } else {
            TEST_ASSERT_EQUAL_UINT32(0, ellipses.count);
        }
    }
}

static void lines_triangles_and_squares_are_no_ellipses(void)
{
    for (double size = 12; size < 200; size *= 1.7) {
        push_line(10, 10, 10 + size, 10 + size / 3);
        add(false);
        push_line(10, 10, 10 + size, 10);
        push_line(10 + size, 10, 10 + size / 2, 10 + size / 2);
        push_line(10 + size / 2, 10 + size / 2, 10, 10);
        add(true);
        push_line(10, 10, 10 + size, 10);
        push_line(10 + size, 10, 10 + size, 10 + size);
        push_line(10 + size, 10 + size, 10, 10 + size);
        push_line(10, 10 + size, 10, 10);
        add(true);
    }
    ellipses_end(&ellipses);
    TEST_ASSERT_EQUAL_UINT32(0, ellipses.count);
}

static void tiny_and_needle_shaped_ellipses_are_left_out(void)
{
    uint64_t seed = 62;
    push_arc(50, 50, 1.1, 1.1, 0, 0, 6 * SYNTH_PI, 0, &seed); /* below 1.2 px, yet of many points */
    add(true);
    push_arc(50, 50, 40, 7.5, 0.3, 0, 2 * SYNTH_PI, 0, &seed); /* thinner than a fifth */
    add(true);
    push_arc(50, 50, 40, 40, 0.3, 0, 0.25, 0, &seed); /* 11 points or so */
    add(false);
    ellipses_end(&ellipses);
    TEST_ASSERT_EQUAL_UINT32(0, ellipses.count);
}

/* A circle whose edge runs into a line at a bridge (a speck of dirt, a near edge): the contour is not closed
 * in itself, but six sevenths of the circle are there. */
static void arc_that_hangs_on_lines_is_found_alone(void)
{
    uint64_t seed = 63;
    push_line(200, 100, 204, 180.4);
    push_arc(200, 200, 20, 20, 0, -SYNTH_PI / 2 + 0.2, 1.3 * SYNTH_PI, 0.02, &seed);
    push_line(188.2, 183.8, 170, 100);
    add(false);
    ellipses_end(&ellipses);
    /* sigma of the centre 0.02 sqrt(2 / 110) = 0.003; points of the lines' ends that the cut leaves to the arc
     * pull more: within a tenth. */
    check_only(0.1, 200, 200, true);
}

static void circle_in_two_halves_is_merged_at_the_end(void)
{
    uint64_t seed = 64;
    for (unsigned white = 0; white < 2; white++) {
        ellipses_begin(&ellipses);
        const double s = white ? 1 : -1;
        push_arc(200, 150, 16, 11, 0.5, s * 0.1, s * (SYNTH_PI - 0.1), 0.03, &seed);
        add(false);
        push_arc(200, 150, 16, 11, 0.5, s * (SYNTH_PI + 0.1), s * (2 * SYNTH_PI - 0.1), 0.03, &seed);
        add(false);
        TEST_ASSERT_EQUAL_UINT32(0, ellipses.count);
        ellipses_end(&ellipses);
        /* sigma 0.03 sqrt(2 / 100) = 0.004, doubled for the ellipse's and the gaps' sake: five of those. */
        check_only(0.04, 200, 150, white != 0);
    }
}

static void halves_of_different_circles_are_not_merged(void)
{
    uint64_t seed = 65;
    push_arc(200, 150, 16, 16, 0, 0.1, SYNTH_PI - 0.1, 0.02, &seed); /* lower half, bright inside */
    add(false);
    push_arc(200, 150, 16, 16, 0, 2 * SYNTH_PI - 0.1, SYNTH_PI + 0.1, 0.02, &seed); /* dark inside */
    add(false);
    push_arc(209, 158, 22, 22, 0, SYNTH_PI + 0.1, 2 * SYNTH_PI - 0.1, 0.02, &seed); /* elsewhere */
    add(false);
    ellipses_end(&ellipses);
    TEST_ASSERT_EQUAL_UINT32(0, ellipses.count);
}

static void half_a_circle_alone_is_not_enough(void)
{
    uint64_t seed = 66;
    push_arc(200, 150, 16, 16, 0, 0.1, SYNTH_PI + 0.1, 0, &seed);
    add(false);
    ellipses_end(&ellipses);
    TEST_ASSERT_EQUAL_UINT32(0, ellipses.count);
}

/* A corner's 135 degrees are not fitted; 250 degrees of a tilted circle are, wherever they begin. */
static void only_arcs_that_turn_far_enough_are_fitted(void)
{
    uint64_t seed = 70;
    push_arc(200, 150, 16, 16, 0, 0.1, 0.75 * SYNTH_PI, 0.02, &seed);
    add(false);
    TEST_ASSERT_EQUAL_UINT32(0, ellipses.fits);
    for (unsigned i = 0; i < 60; i++) {
        ellipses_begin(&ellipses);
        const double size = 14 + i;
        const double from = 0.7 * i;
        const double turn = (i % 2 ? 250 : -250) * SYNTH_PI / 180;
        push_arc(300, 200, size, 0.6 * size, 0.3 * i, from, from + turn, 0.02, &seed);
        add(false);
        ellipses_end(&ellipses);
        TEST_ASSERT_EQUAL_UINT32(1, ellipses.count);
    }
}

static void full_list_says_so_and_keeps_what_it_had(void)
{
    uint64_t seed = 67;
    start(1, 1);
    const uint32_t size = limit_ellipses(1, 1);
    for (uint32_t i = 0; i < size; i++) {
        push_arc(100 + i, 150, 8, 8, 0, 0, 2 * SYNTH_PI, 0, &seed);
        add(true);
    }
    TEST_ASSERT_EQUAL_UINT32(size, ellipses.count);
    TEST_ASSERT_FALSE(ellipses.truncated);
    push_arc(5, 5, 8, 8, 0, 0, 2 * SYNTH_PI, 0, &seed);
    add(true);
    TEST_ASSERT_EQUAL_UINT32(size, ellipses.count);
    TEST_ASSERT_TRUE(ellipses.truncated);
    TEST_ASSERT_EQUAL_UINT32(size, ellipses.fits); /* and spares fitting what has no room */
    SYNTH_NEAR(0.001, 100 + size - 1, ellipses.at[size - 1].ellipse.x_px_q16 / 65536.0);
    ellipses_begin(&ellipses);
    TEST_ASSERT_EQUAL_UINT32(0, ellipses.count);
    TEST_ASSERT_FALSE(ellipses.truncated);
}

static void fits_beyond_the_limit_are_not_made_and_reported(void)
{
    uint64_t seed = 69;
    push_arc(100, 150, 8, 8, 0, 0, 2 * SYNTH_PI, 0, &seed);
    add(true);
    const uint32_t fits = ellipses.fits;
    TEST_ASSERT_TRUE(fits >= 1);
    ellipses.fits = ellipses.fits_max;
    push_arc(130, 150, 8, 8, 0, 0, 2 * SYNTH_PI, 0, &seed);
    add(true);
    TEST_ASSERT_EQUAL_UINT32(1, ellipses.count);
    TEST_ASSERT_EQUAL_UINT32(ellipses.fits_max, ellipses.fits);
    TEST_ASSERT_TRUE(ellipses.truncated);
    ellipses_begin(&ellipses);
    push_arc(130, 150, 8, 8, 0, 0, 2 * SYNTH_PI, 0, &seed);
    add(true);
    TEST_ASSERT_EQUAL_UINT32(1, ellipses.count);
    TEST_ASSERT_EQUAL_UINT32(fits, ellipses.fits);
}

static void too_many_waiting_arcs_are_reported(void)
{
    uint64_t seed = 68;
    for (unsigned i = 0; i <= ellipses.arcs.size; i++) {
        push_arc(100 + i % 400, 150, 12, 12, 0, 0, 0.6 * SYNTH_PI, 0, &seed);
        add(false);
    }
    TEST_ASSERT_TRUE(ellipses.arcs.truncated);
    ellipses_end(&ellipses);
}

/* Pixel k of the small frame covers 2 k and 2 k + 1 of the large one: its centre is at 2 k + 1/2. */
static void doubled_list_is_in_pixels_of_the_frame(void)
{
    uint64_t seed = 69;
    push_arc(100, 60, 20, 12, 0.4, 0, 2 * SYNTH_PI, 0, &seed);
    add(true);
    push_arc(300, 200, 5, 5, 0, 2 * SYNTH_PI, 0, 0, &seed);
    add(true);
    ellipses_end(&ellipses);
    TEST_ASSERT_EQUAL_UINT32(2, ellipses.count);
    struct ellipses_item before[2];
    memcpy(before, ellipses.at, sizeof before);
    ellipses_double(&ellipses);
    TEST_ASSERT_EQUAL_UINT32(2, ellipses.count);
    for (unsigned i = 0; i < 2; i++) {
        const struct ellipses_item *item = &ellipses.at[i];
        TEST_ASSERT_EQUAL_INT32(2 * before[i].ellipse.x_px_q16 + 32768, item->ellipse.x_px_q16);
        TEST_ASSERT_EQUAL_INT32(2 * before[i].ellipse.y_px_q16 + 32768, item->ellipse.y_px_q16);
        TEST_ASSERT_EQUAL_INT32(4 * before[i].ellipse.shape_xx_px2_q12, item->ellipse.shape_xx_px2_q12);
        TEST_ASSERT_EQUAL_INT32(4 * before[i].ellipse.shape_xy_px2_q12, item->ellipse.shape_xy_px2_q12);
        TEST_ASSERT_EQUAL_INT32(4 * before[i].ellipse.shape_yy_px2_q12, item->ellipse.shape_yy_px2_q12);
        TEST_ASSERT_EQUAL_UINT16(500, item->gradient_mean_q3); /* the same swing over twice the pixels */
        TEST_ASSERT_EQUAL_INT(before[i].white, item->white);
    }
}

static void what_becomes_too_large_is_dropped_and_the_rest_closes_up(void)
{
    const int32_t most = ELLIPSE_SHAPE_MAX_PX2_Q12 / 4;
    static const int32_t over[4][2] = {{0, 0}, {1, 0}, {0, 1}, {0, 0}};
    for (unsigned i = 0; i < 4; i++) {
        ellipses.at[i] = (struct ellipses_item){
            .ellipse = {.x_px_q16 = (int32_t)i << 16, .shape_xx_px2_q12 = most + over[i][0],
                        .shape_yy_px2_q12 = most + over[i][1]}};
    }
    ellipses.count = 4;
    ellipses_double(&ellipses);
    TEST_ASSERT_EQUAL_UINT32(2, ellipses.count);
    TEST_ASSERT_EQUAL_INT32(32768, ellipses.at[0].ellipse.x_px_q16);
    TEST_ASSERT_EQUAL_INT32((6 << 16) + 32768, ellipses.at[1].ellipse.x_px_q16);
    TEST_ASSERT_TRUE(ellipses.at[1].ellipse.shape_xx_px2_q12 <= ELLIPSE_SHAPE_MAX_PX2_Q12);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(closed_ellipses_of_both_colours_are_found_whole);
    RUN_TEST(lines_triangles_and_squares_are_no_ellipses);
    RUN_TEST(tiny_and_needle_shaped_ellipses_are_left_out);
    RUN_TEST(arc_that_hangs_on_lines_is_found_alone);
    RUN_TEST(circle_in_two_halves_is_merged_at_the_end);
    RUN_TEST(halves_of_different_circles_are_not_merged);
    RUN_TEST(half_a_circle_alone_is_not_enough);
    RUN_TEST(only_arcs_that_turn_far_enough_are_fitted);
    RUN_TEST(full_list_says_so_and_keeps_what_it_had);
    RUN_TEST(fits_beyond_the_limit_are_not_made_and_reported);
    RUN_TEST(too_many_waiting_arcs_are_reported);
    RUN_TEST(doubled_list_is_in_pixels_of_the_frame);
    RUN_TEST(what_becomes_too_large_is_dropped_and_the_rest_closes_up);
    return UNITY_END();
}
