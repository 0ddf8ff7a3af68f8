/* Linking, on edge points laid by hand and on pictures whose contours are known. */
#include "firmware/detect/chains.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "firmware/limits.h"
#include "tests/unit/synth.h"

static struct steer steer;
static struct edge_row edges;
static struct chains chains;
static int32_t contour_x[LIMIT_CONTOUR_POINTS];
static int32_t contour_y[LIMIT_CONTOUR_POINTS];
static struct contour contour = {.x_px_q16 = contour_x, .y_px_q16 = contour_y};
static void *memory;

void setUp(void) {}
void tearDown(void)
{
    free(memory);
    memory = NULL;
}

static void take_all(struct arena *arena, unsigned width, unsigned height)
{
    steer_init(&steer, arena, &dsp_scalar, 3, 320, width, height);
    edges_init(&edges, arena, width);
    chains_init(&chains, arena, width, height);
}

static void start(unsigned width, unsigned height)
{
    struct arena arena = {0};
    take_all(&arena, width, height);
    free(memory);
    memory = malloc(arena.used);
    TEST_ASSERT_NOT_NULL(memory);
    memset(memory, 0x5a, arena.used);
    arena = (struct arena){.base = memory, .size = arena.used};
    take_all(&arena, width, height);
    chains_begin(&chains);
}

/* Dark on the left when walking: the signed area of a closed contour is positive (clockwise as seen, y
 * down) when its inside lies on the right, and so is bright. */
static double area(const struct contour *c)
{
    double sum = 0;
    for (uint32_t i = 0; i < c->count; i++) {
        const uint32_t j = (i + 1) % c->count;
        sum += (double)c->x_px_q16[i] * c->y_px_q16[j] - (double)c->x_px_q16[j] * c->y_px_q16[i];
    }
    return sum / 2 / 65536 / 65536;
}

/* Neighbours of a contour lie in one grid cell: at most its diagonal apart. */
static void check_steps(const struct contour *c)
{
    for (uint32_t i = 0; i + 1 < c->count + (c->closed ? 1 : 0); i++) {
        const uint32_t j = (i + 1) % c->count;
        const double step = hypot(c->x_px_q16[i] - c->x_px_q16[j], c->y_px_q16[i] - c->y_px_q16[j]);
        TEST_ASSERT_TRUE(step <= 65536 * 1.41422);
    }
}

struct found {
    unsigned closed, open, points;
    double area[64];
};

static struct found link_frame(const struct frame_view *frame, uint32_t shortest)
{
    struct found found = {0};
    const struct dsp_gradient *above = NULL;
    steer_begin(&steer);
    chains_begin(&chains);
    for (unsigned y = 0; y <= frame->height_px; y++) {
        if (y < frame->height_px) {
            const struct dsp_gradient *row = steer_row(&steer, frame, (uint16_t)y);
            edges_scan_row(above, row, (uint16_t)y, frame->width_px, &edges);
            chains_link_row(&chains, &edges, y == 0);
            above = row;
        } else {
            chains_end(&chains);
        }
        while (chains_take(&chains, shortest, &contour)) {
            TEST_ASSERT_TRUE(contour.count >= shortest);
            check_steps(&contour);
            if (contour.closed && found.closed < 64) {
                found.area[found.closed] = area(&contour);
            }
            found.closed += contour.closed;
            found.open += !contour.closed;
            found.points += contour.count;
        }
    }
    TEST_ASSERT_EQUAL_UINT32(0, chains.points_used); /* every point came back */
    return found;
}

static struct found link_image(struct synth_image *image, uint32_t shortest)
{
    uint8_t *bytes = malloc((size_t)image->width * image->height * 2);
    TEST_ASSERT_NOT_NULL(bytes);
    const struct frame_view frame = synth_frame(image, FRAME_GREY12, bytes);
    start(image->width, image->height);
    const struct found found = link_frame(&frame, shortest);
    free(bytes);
    return found;
}

static void white_and_black_circles_are_closed_and_turn_opposite_ways(void)
{
    struct synth_image image = synth_image_new(60, 40, 128);
    synth_ellipse(&image, 19.3, 20.4, 9, 9, 0, 220);
    synth_ellipse(&image, 43.1, 18.8, 9, 9, 0, 30);
    synth_blur(&image, 0.8);
    const struct found found = link_image(&image, 12);
    TEST_ASSERT_EQUAL_UINT(2, found.closed);
    TEST_ASSERT_EQUAL_UINT(0, found.open);
    const double white = fmax(found.area[0], found.area[1]);
    const double black = fmin(found.area[0], found.area[1]);
    /* pi r^2; blur of variance v = 1 + 0.64 + 1/12 moves a circle's zero crossing inwards by v / 2r = 0.1 px
     * or so, 6 px^2 round the circle; the polygon lies inside by much less. */
    SYNTH_NEAR(7, SYNTH_PI * 81, white);
    SYNTH_NEAR(7, -SYNTH_PI * 81, black);
    synth_image_free(&image);
}

static void edge_from_border_to_border_is_one_open_contour(void)
{
    struct synth_image image = synth_image_new(50, 40, 0);
    synth_edge(&image, 0.8, 0.6, 32.1, 40, 200, 0.9);
    const struct found found = link_image(&image, 4);
    TEST_ASSERT_EQUAL_UINT(0, found.closed);
    TEST_ASSERT_EQUAL_UINT(1, found.open);
    synth_image_free(&image);
}

/* Chequers: at each inner corner four edges meet, and the bilinear surface has a saddle there. However it is
 * cut, contours may not cross, every point must be in exactly one and nothing is left over. */
static void saddles_lose_no_points(void)
{
    struct synth_image image = synth_image_new(64, 64, 0);
    for (unsigned i = 0; i < 64 * 64; i++) {
        const double x = i % 64 + 0.3;
        const double y = (double)(i / 64) + 0.3;
        image.pixels[i] = 128 + 110 * sin(x * SYNTH_PI / 8) * sin(y * SYNTH_PI / 8);
    }
    uint8_t bytes[64 * 64 * 2];
    const struct frame_view frame = synth_frame(&image, FRAME_GREY12, bytes);
    start(64, 64);
    steer_begin(&steer);
    unsigned points = 0;
    const struct dsp_gradient *above = NULL;
    for (uint16_t y = 0; y < 64; y++) {
        const struct dsp_gradient *row = steer_row(&steer, &frame, y);
        edges_scan_row(above, row, y, 64, &edges);
        points += edges.across_count + edges.down_count;
        above = row;
    }
    const struct found found = link_frame(&frame, 1);
    TEST_ASSERT_TRUE(points > 200);
    TEST_ASSERT_EQUAL_UINT(points, found.points);
    synth_image_free(&image);
}

/* Noise of full contrast: every kind of cell comes up. */
static void every_point_of_pure_noise_is_in_exactly_one_contour(void)
{
    static uint8_t bytes[128 * 128];
    uint64_t seed = 21;
    for (unsigned i = 0; i < sizeof bytes; i++) {
        bytes[i] = synth_u64(&seed) & 1 ? 255 : 0;
    }
    const struct frame_view frame = {.pixels = bytes, .stride_bytes = 128, .width_px = 128,
                                     .height_px = 128, .format = FRAME_GREY8};
    start(128, 128);
    steer_begin(&steer);
    unsigned points = 0;
    const struct dsp_gradient *above = NULL;
    for (uint16_t y = 0; y < 128; y++) {
        const struct dsp_gradient *row = steer_row(&steer, &frame, y);
        edges_scan_row(above, row, y, 128, &edges);
        points += edges.across_count + edges.down_count;
        above = row;
    }
    const struct found found = link_frame(&frame, 1);
    TEST_ASSERT_FALSE(chains.truncated);
    TEST_ASSERT_EQUAL_UINT(points, found.points);
}

static void short_contours_are_dropped_on_the_way(void)
{
    struct synth_image image = synth_image_new(60, 40, 128);
    synth_ellipse(&image, 15, 20, 3, 3, 0, 230);
    synth_ellipse(&image, 42, 20, 12, 12, 0, 230);
    synth_blur(&image, 0.8);
    const struct found found = link_image(&image, 60); /* 8 points a pixel of radius: 24 and 96 */
    TEST_ASSERT_EQUAL_UINT(1, found.closed);
    TEST_ASSERT_EQUAL_UINT(0, found.open);
    synth_image_free(&image);
}

/* By hand: `width` columns, an edge across every row at column c (dark on the left when going down). */
static void link_line_down(uint32_t rows, uint16_t column)
{
    for (uint32_t y = 0; y < rows; y++) {
        edges.across[0] = (struct edge){.x_px_q16 = column * 65536 + 32768, .y_px_q16 = (int32_t)y * 65536,
                                        .squares_q6 = y % 2 ? 2 * 1000 * 1000 : 2 * 3000 * 3000,
                                        .column = column, .forward = true};
        edges.across_count = 1;
        edges.down_count = 0;
        edges_end_lists(&edges);
        chains_link_row(&chains, &edges, y == 0);
    }
}

static void longest_contour_is_kept_whole_and_a_longer_one_is_dropped(void)
{
    start(16, 8192);
    link_line_down(LIMIT_CONTOUR_POINTS, 3);
    chains_end(&chains);
    TEST_ASSERT_TRUE(chains_take(&chains, 2, &contour));
    TEST_ASSERT_EQUAL_UINT32(LIMIT_CONTOUR_POINTS, contour.count);
    TEST_ASSERT_FALSE(contour.closed);
    for (uint32_t i = 0; i < contour.count; i++) { /* forward: downwards */
        TEST_ASSERT_EQUAL_INT32(i * 65536, contour.y_px_q16[i]);
    }
    TEST_ASSERT_EQUAL_UINT16(2236, contour.gradient_mean_q3); /* root of 5 million */
    TEST_ASSERT_FALSE(chains_take(&chains, 2, &contour));

    chains_begin(&chains);
    link_line_down(LIMIT_CONTOUR_POINTS + 1, 3);
    chains_end(&chains);
    TEST_ASSERT_FALSE(chains_take(&chains, 2, &contour));
    TEST_ASSERT_EQUAL_UINT32(0, chains.points_used);
    TEST_ASSERT_FALSE(chains.truncated);
}

static void overlong_contour_does_not_fill_the_pool(void)
{
    start(2, 8192);
    link_line_down(8192, 0);
    TEST_ASSERT_TRUE(chains.points_used <= LIMIT_CONTOUR_POINTS + 2);
    chains_end(&chains);
    TEST_ASSERT_FALSE(chains.truncated);
}

/* Vertical stripes two pixels wide: contours that stay open over the whole frame, far more points than the
 * pool's share for a frame of that size. */
static void full_pool_says_so_keeps_going_and_recovers(void)
{
    enum { WIDTH = 256, HEIGHT = 1200 };
    start(WIDTH, HEIGHT);
    TEST_ASSERT_TRUE((uint64_t)limit_points(WIDTH, HEIGHT) < (uint64_t)(WIDTH - 2) * HEIGHT);
    for (uint32_t y = 0; y < HEIGHT; y++) {
        for (uint16_t c = 0; c + 1 < WIDTH; c++) {
            edges.across[c] = (struct edge){.x_px_q16 = c * 65536 + 32768,
                                            .y_px_q16 = (int32_t)y * 65536, .squares_q6 = 1,
                                            .column = c, .forward = c % 2 == 0};
        }
        edges.across_count = WIDTH - 1;
        edges.down_count = 0;
        edges_end_lists(&edges);
        chains_link_row(&chains, &edges, y == 0);
    }
    chains_end(&chains);
    TEST_ASSERT_TRUE(chains.truncated);
    unsigned taken = 0;
    while (chains_take(&chains, 2, &contour)) {
        taken++;
        check_steps(&contour);
    }
    TEST_ASSERT_TRUE(taken > 0);
    TEST_ASSERT_EQUAL_UINT32(0, chains.points_used);
    TEST_ASSERT_TRUE(chains.points_used_max <= limit_points(WIDTH, HEIGHT));

    chains_begin(&chains); /* the next frame starts clean */
    TEST_ASSERT_FALSE(chains.truncated);
    link_line_down(100, 3);
    chains_end(&chains);
    TEST_ASSERT_TRUE(chains_take(&chains, 2, &contour));
    TEST_ASSERT_EQUAL_UINT32(100, contour.count);
    TEST_ASSERT_FALSE(chains.truncated);
}

static void smallest_frames_link_nothing(void)
{
    start(1, 1);
    edges.across_count = 0;
    edges.down_count = 0;
    edges_end_lists(&edges);
    chains_link_row(&chains, &edges, true);
    chains_end(&chains);
    TEST_ASSERT_FALSE(chains_take(&chains, 1, &contour));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(white_and_black_circles_are_closed_and_turn_opposite_ways);
    RUN_TEST(edge_from_border_to_border_is_one_open_contour);
    RUN_TEST(saddles_lose_no_points);
    RUN_TEST(every_point_of_pure_noise_is_in_exactly_one_contour);
    RUN_TEST(short_contours_are_dropped_on_the_way);
    RUN_TEST(longest_contour_is_kept_whole_and_a_longer_one_is_dropped);
    RUN_TEST(overlong_contour_does_not_fill_the_pool);
    RUN_TEST(full_pool_says_so_keeps_going_and_recovers);
    RUN_TEST(smallest_frames_link_nothing);
    return UNITY_END();
}
