/* Cutting contours where they stop bending one way, and the store of arcs. */
#include "firmware/detect/arcs.h"

#include <math.h>
#include <stdlib.h>
#include <unity.h>

#include "firmware/limits.h"
#include "tests/unit/synth.h"

static int32_t xs[LIMIT_CONTOUR_POINTS];
static int32_t ys[LIMIT_CONTOUR_POINTS];
static struct contour contour = {.x_px_q16 = xs, .y_px_q16 = ys};
static struct arcs_run runs[ARCS_RUNS_MAX];
static struct arcs arcs;
static void *memory;

void setUp(void)
{
    contour.count = 0;
    contour.closed = false;
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

/* Points 0.785 px apart, as edge points are on average (4 / pi a pixel). */
static void push_arc(double cx, double cy, double r, double from, double to)
{
    const int n = (int)(fabs(to - from) * r / 0.785);
    for (int i = 0; i < n; i++) {
        const double a = from + (to - from) * i / n;
        push(cx + r * cos(a), cy + r * sin(a));
    }
}

static void push_line(double x0, double y0, double x1, double y1)
{
    const int n = (int)(hypot(x1 - x0, y1 - y0) / 0.785);
    for (int i = 0; i < n; i++) {
        push(x0 + (x1 - x0) * i / n, y0 + (y1 - y0) * i / n);
    }
}

static void whole_circle_is_one_run(void)
{
    push_arc(50, 50, 20, 0, 2 * SYNTH_PI);
    contour.closed = true;
    const uint32_t count = arcs_split(&contour, 6, 12, runs);
    TEST_ASSERT_EQUAL_UINT32(1, count);
    /* All but what a chord on each side cannot see. */
    TEST_ASSERT_TRUE(runs[0].count + 12 >= contour.count && runs[0].count <= contour.count);
    TEST_ASSERT_TRUE(runs[0].first < contour.count);
}

static void straight_line_has_no_run(void)
{
    push_line(10, 10, 110, 47);
    TEST_ASSERT_EQUAL_UINT32(0, arcs_split(&contour, 6, 12, runs));
}

static void triangle_has_no_run(void)
{
    push_line(10, 10, 90, 10);
    push_line(90, 10, 50, 50);
    push_line(50, 50, 10, 10);
    contour.closed = true;
    TEST_ASSERT_EQUAL_UINT32(0, arcs_split(&contour, 6, 12, runs));
}

/* A line that runs into three quarters of a circle of radius 15 and away again. */
static void arc_between_lines_is_cut_out(void)
{
    push_line(0, 35, 50, 35);
    const uint32_t first = contour.count;
    push_arc(50, 50, 15, -SYNTH_PI / 2, SYNTH_PI);
    const uint32_t last = contour.count;
    push_line(35, 50, 35, 0);
    const uint32_t count = arcs_split(&contour, 6, 12, runs);
    TEST_ASSERT_EQUAL_UINT32(1, count);
    /* Within two chords of the joints: a chord that straddles one still bends. */
    TEST_ASSERT_INT_WITHIN(12, (int)first, (int)runs[0].first);
    TEST_ASSERT_INT_WITHIN(12, (int)last, (int)(runs[0].first + runs[0].count));
}

static void s_shape_is_cut_where_its_bend_turns(void)
{
    push_arc(30, 30, 15, SYNTH_PI, 2 * SYNTH_PI);
    const uint32_t middle = contour.count;
    push_arc(60, 30, 15, SYNTH_PI, 0);
    const uint32_t count = arcs_split(&contour, 6, 12, runs);
    TEST_ASSERT_EQUAL_UINT32(2, count);
    TEST_ASSERT_TRUE(runs[0].first + runs[0].count <= middle + 12);
    TEST_ASSERT_TRUE(runs[1].first + 12 >= middle);
    TEST_ASSERT_TRUE(runs[1].first + runs[1].count <= contour.count);
}

/* Where the contour's first point lies must not matter. */
static void run_may_pass_over_the_start_of_a_closed_contour(void)
{
    push_arc(50, 50, 20, 0.4 * SYNTH_PI, 0.5 * SYNTH_PI + SYNTH_PI); /* the left half */
    push_line(50, 30, 110, 50);
    push_line(110, 50, 50, 70);
    contour.closed = true;
    const uint32_t n = contour.count;
    for (uint32_t shift = 0; shift < n; shift += 7) {
        int32_t x[400];
        int32_t y[400];
        for (uint32_t i = 0; i < n; i++) {
            x[i] = xs[(i + shift) % n];
            y[i] = ys[(i + shift) % n];
        }
        const struct contour turned = {.x_px_q16 = x, .y_px_q16 = y, .count = n, .closed = true};
        TEST_ASSERT_EQUAL_UINT32(1, arcs_split(&turned, 6, 12, runs));
        TEST_ASSERT_TRUE(runs[0].first < n);
        const uint32_t begin = (runs[0].first + shift) % n;
        /* It starts within two chords of the joint, which is the shape's point 0 (or just before). */
        TEST_ASSERT_TRUE(begin <= 12 || begin + 12 >= n);
    }
}

static void short_runs_are_left_out_and_the_list_has_an_end(void)
{
    push_arc(50, 50, 20, 0, 2 * SYNTH_PI);
    contour.closed = true;
    TEST_ASSERT_EQUAL_UINT32(0, arcs_split(&contour, 6, contour.count + 1, runs));
    /* A wave of more bends than the list has room for. */
    setUp();
    for (int i = 0; i < 80; i++) {
        push_arc(20 + 16 * i, 50, 8, SYNTH_PI, i % 2 ? 0 : 2 * SYNTH_PI);
    }
    const uint32_t count = arcs_split(&contour, 3, 12, runs);
    TEST_ASSERT_EQUAL_UINT32(ARCS_RUNS_MAX, count);
    for (uint32_t i = 0; i < count; i++) {
        TEST_ASSERT_TRUE(runs[i].count >= 12);
        TEST_ASSERT_TRUE(runs[i].first + runs[i].count <= contour.count);
    }
}

static void contours_shorter_than_the_step_are_no_arcs(void)
{
    for (uint32_t n = 0; n < 14; n++) {
        for (unsigned closed = 0; closed < 2; closed++) {
            setUp();
            for (uint32_t i = 0; i < n; i++) {
                push(10 + 3 * cos(i * 0.5), 10 + 3 * sin(i * 0.5));
            }
            contour.closed = closed;
            TEST_ASSERT_EQUAL_UINT32(0, arcs_split(&contour, 6, 14, runs));
        }
    }
}

static void start_store(void)
{
    struct arena arena = {0};
    arcs_init(&arcs, &arena, 64, 64);
    memory = malloc(arena.used);
    TEST_ASSERT_NOT_NULL(memory);
    arena = (struct arena){.base = memory, .size = arena.used};
    arcs_init(&arcs, &arena, 64, 64);
    arcs_begin(&arcs);
}

static void keep(double cx, double cy, double r, double from, double to)
{
    setUp();
    push_arc(cx, cy, r, from, to);
    arcs_keep(&arcs, xs, ys, contour.count, 1000);
}

static void stored_arc_knows_its_circle_and_colour(void)
{
    start_store();
    keep(50.25, 40.5, 12, 0, SYNTH_PI);  /* clockwise as seen: bright on the right, inside */
    keep(50.25, 40.5, 12, SYNTH_PI, 0);
    TEST_ASSERT_EQUAL_UINT32(2, arcs.count);
    for (unsigned i = 0; i < 2; i++) {
        /* Generous comparisons need no more than the 1/64 px to which the three points are cut; the centre's
         * error is at most twice that for half a circle. */
        SYNTH_NEAR(2.0 / 64, 50.25, arcs.at[i].x_px_q16 / 65536.0);
        SYNTH_NEAR(2.0 / 64, 40.5, arcs.at[i].y_px_q16 / 65536.0);
        SYNTH_NEAR(2.0 / 64, 12, arcs.at[i].radius_px_q16 / 65536.0);
        TEST_ASSERT_EQUAL_UINT16(1000, arcs.at[i].gradient_mean_q3);
        TEST_ASSERT_FALSE(arcs.at[i].used);
    }
    TEST_ASSERT_TRUE(arcs.at[0].white);
    TEST_ASSERT_FALSE(arcs.at[1].white);
}

static void only_arcs_of_one_circle_and_colour_may_join(void)
{
    start_store();
    keep(50, 40, 12, 0, SYNTH_PI);
    keep(50, 40, 12, SYNTH_PI, 2 * SYNTH_PI);
    keep(50, 40, 12, 2 * SYNTH_PI, SYNTH_PI);  /* other colour */
    keep(150, 40, 12, SYNTH_PI, 2 * SYNTH_PI); /* elsewhere */
    keep(50, 40, 100, 0, SYNTH_PI);            /* far larger */
    TEST_ASSERT_EQUAL_UINT32(5, arcs.count);
    TEST_ASSERT_TRUE(arcs_may_join(&arcs.at[0], &arcs.at[1]));
    TEST_ASSERT_TRUE(arcs_may_join(&arcs.at[1], &arcs.at[0]));
    for (unsigned i = 2; i < 5; i++) {
        TEST_ASSERT_FALSE(arcs_may_join(&arcs.at[0], &arcs.at[i]));
        TEST_ASSERT_FALSE(arcs_may_join(&arcs.at[i], &arcs.at[0]));
    }
}

static void straight_points_are_not_kept_and_that_is_no_truncation(void)
{
    start_store();
    push_line(10, 10, 60, 35);
    arcs_keep(&arcs, xs, ys, contour.count, 1000);
    TEST_ASSERT_EQUAL_UINT32(0, arcs.count);
    TEST_ASSERT_FALSE(arcs.truncated);
}

static void full_store_says_so_and_keeps_what_it_had(void)
{
    start_store();
    for (unsigned i = 0; i < arcs.size; i++) {
        keep(50 + i, 40, 12, 0, SYNTH_PI / 2);
    }
    TEST_ASSERT_EQUAL_UINT32(arcs.size, arcs.count);
    TEST_ASSERT_FALSE(arcs.truncated);
    keep(5, 5, 12, 0, SYNTH_PI);
    TEST_ASSERT_EQUAL_UINT32(arcs.size, arcs.count);
    TEST_ASSERT_TRUE(arcs.truncated);
    SYNTH_NEAR(0.1, 50 + arcs.size - 1, arcs.at[arcs.size - 1].x_px_q16 / 65536.0);
    arcs_begin(&arcs);
    TEST_ASSERT_EQUAL_UINT32(0, arcs.count);
    TEST_ASSERT_FALSE(arcs.truncated);
}

static void store_full_of_points_says_so(void)
{
    start_store();
    while (!arcs.truncated) {
        keep(600, 600, 500, 0, SYNTH_PI); /* 2001 points each */
        TEST_ASSERT_TRUE(arcs.points <= arcs.points_size);
        TEST_ASSERT_TRUE(arcs.count < 20);
    }
    TEST_ASSERT_EQUAL_UINT32(arcs.points_size / 2001, arcs.count);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(whole_circle_is_one_run);
    RUN_TEST(straight_line_has_no_run);
    RUN_TEST(triangle_has_no_run);
    RUN_TEST(arc_between_lines_is_cut_out);
    RUN_TEST(s_shape_is_cut_where_its_bend_turns);
    RUN_TEST(run_may_pass_over_the_start_of_a_closed_contour);
    RUN_TEST(short_runs_are_left_out_and_the_list_has_an_end);
    RUN_TEST(contours_shorter_than_the_step_are_no_arcs);
    RUN_TEST(stored_arc_knows_its_circle_and_colour);
    RUN_TEST(only_arcs_of_one_circle_and_colour_may_join);
    RUN_TEST(straight_points_are_not_kept_and_that_is_no_truncation);
    RUN_TEST(full_store_says_so_and_keeps_what_it_had);
    RUN_TEST(store_full_of_points_says_so);
    return UNITY_END();
}
