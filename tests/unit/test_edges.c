/* Sub-pixel edge points against analytic steps: a step blurred by a Gaussian and integrated over pixels,
 * at every direction and sub-pixel position. */
#include "firmware/detect/edges.h"

#include <math.h>
#include <stdlib.h>
#include <unity.h>

#include "tests/unit/synth.h"

static struct steer steer;
static struct edge_row edges;
static void *memory;

void setUp(void) {}
void tearDown(void)
{
    free(memory);
    memory = NULL;
}

static void take_all(struct arena *arena, unsigned radius, uint32_t gradient_min_q3, unsigned width,
                     unsigned height)
{
    steer_init(&steer, arena, &dsp_scalar, radius, gradient_min_q3, width, height);
    edges_init(&edges, arena, width);
}

static void start(unsigned radius, uint32_t gradient_min_q3, unsigned width, unsigned height)
{
    struct arena arena = {0};
    take_all(&arena, radius, gradient_min_q3, width, height);
    free(memory);
    memory = malloc(arena.used);
    TEST_ASSERT_NOT_NULL(memory);
    arena = (struct arena){.base = memory, .size = arena.used};
    take_all(&arena, radius, gradient_min_q3, width, height);
    steer_begin(&steer);
}

typedef void point_check(const struct edge *edge, bool across, unsigned y);

/* Scans a frame, checks what the header says of every point and calls `check` for each. */
static unsigned scan(const struct frame_view *frame, point_check *check)
{
    const struct dsp_gradient *above = NULL;
    unsigned total = 0;
    for (unsigned y = 0; y < frame->height_px; y++) {
        const struct dsp_gradient *row = steer_row(&steer, frame, (uint16_t)y);
        edges_scan_row(above, row, (uint16_t)y, frame->width_px, &edges);
        above = row;
        TEST_ASSERT_TRUE(edges.across_count < frame->width_px);
        TEST_ASSERT_TRUE(edges.down_count <= frame->width_px);
        TEST_ASSERT_TRUE(y > 0 || edges.down_count == 0);
        for (unsigned i = 0; i < edges.across_count; i++) {
            const struct edge *e = &edges.across[i];
            TEST_ASSERT_EQUAL_INT32(y * 65536, e->y_px_q16);
            TEST_ASSERT_TRUE(i == 0 || edges.across[i - 1].column < e->column);
            TEST_ASSERT_TRUE(e->x_px_q16 >= e->column * 65536);
            TEST_ASSERT_TRUE(e->x_px_q16 <= (e->column + 1) * 65536);
            check(e, true, y);
        }
        for (unsigned i = 0; i < edges.down_count; i++) {
            const struct edge *e = &edges.down[i];
            TEST_ASSERT_EQUAL_INT32(e->column * 65536, e->x_px_q16);
            TEST_ASSERT_TRUE(i == 0 || edges.down[i - 1].column < e->column);
            TEST_ASSERT_TRUE(e->y_px_q16 >= ((int32_t)y - 1) * 65536);
            TEST_ASSERT_TRUE(e->y_px_q16 <= (int32_t)y * 65536);
            check(e, false, y);
        }
        total += edges.across_count + edges.down_count;
    }
    return total;
}

static struct {
    double nx, ny, offset;
    double tolerance;
    double gradient_q3;
    double variance;
    double worst;
    unsigned inner;
} step;

#define SIDE 48u

static void on_the_step(const struct edge *e, bool across, unsigned y)
{
    const double x = e->x_px_q16 / 65536.0;
    const double at_y = e->y_px_q16 / 65536.0;
    /* The repeated border bends the edge there: five taps in, all is well. */
    if (x < 6 || x > SIDE - 7 || at_y < 6 || at_y > SIDE - 7) {
        return;
    }
    const double distance = step.nx * x + step.ny * at_y - step.offset;
    step.worst = fmax(step.worst, fabs(distance));
    SYNTH_NEAR(step.tolerance, 0, distance);
    /* Dark on the left when walking along t: the normal to the bright side is t turned clockwise as seen, (t)
     * -> (-ty, tx); so t = (ny, -nx). Across points are passed downwards when t_y > 0. */
    TEST_ASSERT_EQUAL_INT(across ? -step.nx > 0 : step.ny > 0, e->forward);
    /* The slope at distance n from the edge falls off as exp(-n^2 / 2 v). 3 %: the pixel's box, taken
     * for a Gaussian of variance 1/12, and the filter's cut at three sigma. */
    const double first = step.nx * e->column + step.ny * (across ? y : y - 1.0) - step.offset;
    const double second = first + (across ? step.nx : step.ny);
    const double expected = step.gradient_q3 / 2 *
        (exp(-first * first / 2 / step.variance) + exp(-second * second / 2 / step.variance));
    SYNTH_NEAR(0.03 * expected, expected, sqrt(e->squares_q6 / 2.0));
    step.inner++;
}

/* Analytic: gradient of the step smoothed by all three blurs. */
static double slope_q3(double contrast, double blur, double sigma)
{
    return 8 * 16 * contrast / sqrt(2 * SYNTH_PI * (blur * blur + sigma * sigma + 1.0 / 12));
}

static void steps_of_every_direction_and_position_are_found_without_bias(void)
{
    static uint8_t bytes[SIDE * SIDE * 2];
    uint64_t seed = 12;
    for (unsigned i = 0; i < 96; i++) {
        const double a = 2 * SYNTH_PI * (i + 0.3) / 96;
        const double blur = 0.7 + 0.8 * synth_uniform(&seed);
        step.nx = cos(a);
        step.ny = sin(a);
        step.offset = (step.nx + step.ny) * SIDE / 2 + synth_uniform(&seed) - 0.5;
        step.variance = 1.0 + blur * blur + 1.0 / 12;
        step.gradient_q3 = slope_q3(160, blur, 1.0);
        /* 12-bit samples. The steps' derivatives are rounded to 2.5 units of Q2 (test_dsp_scalar.c) against
         * a slope of the second derivative of gradient / (sigma^2 + blur^2): under 0.5 / 64 px... in all,
         * 0.005 px with the sampling of the narrow filters. */
        step.tolerance = 0.005;
        struct synth_image image = synth_image_new(SIDE, SIDE, 0);
        synth_edge(&image, step.nx, step.ny, step.offset, 45, 205, blur);
        const struct frame_view frame = synth_frame(&image, FRAME_GREY12, bytes);
        start(3, 320, SIDE, SIDE);
        step.inner = 0;
        scan(&frame, on_the_step);
        /* A line of length 34 crosses |cos| + |sin| grid lines a pixel. */
        TEST_ASSERT_TRUE(step.inner >= 34);
        synth_image_free(&image);
    }
}

static void no_points(const struct edge *e, bool across, unsigned y)
{
    (void)e;
    (void)across;
    (void)y;
    TEST_FAIL_MESSAGE("a point where there is no edge");
}

static void flat_frames_of_all_shapes_have_no_edges(void)
{
    static uint8_t bytes[8192 * 2];
    static const uint16_t shapes[][2] = {{1, 1}, {1, 9}, {9, 1}, {2, 2}, {8192, 2}, {2, 8192}};
    for (unsigned i = 0; i < sizeof bytes; i++) {
        bytes[i] = 137;
    }
    for (unsigned i = 0; i < sizeof shapes / sizeof shapes[0]; i++) {
        const struct frame_view frame = {.pixels = bytes, .stride_bytes = shapes[i][0],
                                         .width_px = shapes[i][0], .height_px = shapes[i][1],
                                         .format = FRAME_GREY8};
        start(3, 1, shapes[i][0], shapes[i][1]);
        TEST_ASSERT_EQUAL_UINT(0, scan(&frame, no_points));
    }
}

static void anything(const struct edge *e, bool across, unsigned y)
{
    (void)across;
    (void)y;
    TEST_ASSERT_TRUE(e->squares_q6 > 0);
}

/* Junk of full contrast has a crossing at every other grid line: the counts' bounds and the order are
 * checked by `scan`. */
static void noise_of_full_contrast_stays_within_the_bounds(void)
{
    static uint8_t bytes[8192 * 8];
    uint64_t seed = 13;
    for (unsigned i = 0; i < sizeof bytes; i++) {
        bytes[i] = synth_u64(&seed) & 1 ? 255 : 0;
    }
    static const uint16_t shapes[][2] = {{8192, 8}, {8, 1024}, {1, 100}, {100, 1}, {256, 256}};
    for (unsigned i = 0; i < 5; i++) {
        for (unsigned radius = 2; radius <= 5; radius++) {
            const struct frame_view frame = {.pixels = bytes, .stride_bytes = shapes[i][0],
                                             .width_px = shapes[i][0], .height_px = shapes[i][1],
                                             .format = FRAME_GREY8};
            start(radius, 1, shapes[i][0], shapes[i][1]);
            TEST_ASSERT_TRUE(scan(&frame, anything) > 0);
        }
    }
}

static void weak_edges_are_left_out_and_strong_ones_kept(void)
{
    static uint8_t bytes[SIDE * SIDE * 2];
    struct synth_image image = synth_image_new(SIDE, SIDE, 0);
    synth_edge(&image, 1, 0, SIDE / 2 + 0.2, 100, 110, 1.0);
    const struct frame_view frame = synth_frame(&image, FRAME_GREY12, bytes);
    const double peak_q3 = slope_q3(10, 1.0, 1.0);
    start(3, (uint32_t)(1.1 * peak_q3), SIDE, SIDE);
    TEST_ASSERT_EQUAL_UINT(0, scan(&frame, no_points));
    /* The pixels at both sides are up to one pixel off the peak: exp(-1 / (2 2.08)) = 0.79 of it. */
    start(3, (uint32_t)(0.7 * peak_q3), SIDE, SIDE);
    TEST_ASSERT_EQUAL_UINT(SIDE, scan(&frame, anything));
    synth_image_free(&image);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(steps_of_every_direction_and_position_are_found_without_bias);
    RUN_TEST(flat_frames_of_all_shapes_have_no_edges);
    RUN_TEST(noise_of_full_contrast_stays_within_the_bounds);
    RUN_TEST(weak_edges_are_left_out_and_strong_ones_kept);
    return UNITY_END();
}
