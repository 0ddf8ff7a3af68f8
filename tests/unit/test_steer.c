/* Rows of derivatives against plain two-dimensional convolution in double, borders included. */
#include "firmware/detect/steer.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "tests/unit/synth.h"

static struct steer steer;
static void *memory;

void setUp(void) {}
void tearDown(void)
{
    free(memory);
    memory = NULL;
}

static void start(unsigned radius, uint32_t gradient_min_q3, unsigned width, unsigned height)
{
    struct arena arena = {0};
    steer_init(&steer, &arena, &dsp_scalar, radius, gradient_min_q3, width, height);
    const size_t bytes = arena.used;
    free(memory);
    memory = malloc(bytes);
    TEST_ASSERT_NOT_NULL(memory);
    memset(memory, 0x5a, bytes);
    arena = (struct arena){.base = memory, .size = bytes};
    steer_init(&steer, &arena, &dsp_scalar, radius, gradient_min_q3, width, height);
    TEST_ASSERT_EQUAL_UINT64(bytes, arena.used);
    steer_begin(&steer);
}

static double tap(unsigned radius, int derivative, int k)
{
    const struct taps *taps = &taps_table[radius - 2];
    const int at = abs(k);
    return derivative == 0   ? taps->smooth_q15[at] / 32768.0
           : derivative == 1 ? (k < 0 ? -1 : 1) * taps->first_q15[at] / 32768.0
                             : taps->second_q14[at] / 16384.0;
}

static int clamp(int value, int count)
{
    return value < 0 ? 0 : value >= count ? count - 1 : value;
}

/* The derivative (dx, dy) at (x, y), the outermost pixels repeated; grey_q4. */
static double exact(const struct frame_view *frame, unsigned radius, int dx, int dy, int x, int y)
{
    double sum = 0;
    for (int j = -(int)radius; j <= (int)radius; j++) {
        for (int i = -(int)radius; i <= (int)radius; i++) {
            const int column = clamp(x + i, frame->width_px);
            const int row = clamp(y + j, frame->height_px);
            sum += tap(radius, dy, j) * tap(radius, dx, i) * 16 *
                   frame->pixels[(size_t)row * frame->stride_bytes + (size_t)column];
        }
    }
    return sum;
}

static void check_frame(const struct frame_view *frame, unsigned radius, unsigned step)
{
    for (unsigned y = 0; y < frame->height_px; y++) {
        const struct dsp_gradient *g = steer_row(&steer, frame, (uint16_t)y);
        for (unsigned x = 0; x < frame->width_px; x += step) {
            /* Tolerances: see test_dsp_scalar.c. */
            SYNTH_NEAR(2.0, 8 * exact(frame, radius, 1, 0, (int)x, (int)y), g->x_q3[x]);
            SYNTH_NEAR(2.1, 8 * exact(frame, radius, 0, 1, (int)x, (int)y), g->y_q3[x]);
            SYNTH_NEAR(2.0, 4 * exact(frame, radius, 2, 0, (int)x, (int)y), g->xx_q2[x]);
            SYNTH_NEAR(1.6, 4 * exact(frame, radius, 1, 1, (int)x, (int)y), g->xy_q2[x]);
            SYNTH_NEAR(2.5, 4 * exact(frame, radius, 0, 2, (int)x, (int)y), g->yy_q2[x]);
        }
    }
}

static void junk(uint8_t *bytes, size_t count, uint64_t seed)
{
    for (size_t i = 0; i < count; i++) {
        bytes[i] = (uint8_t)synth_u64(&seed);
    }
}

static void every_shape_of_frame_agrees_with_double_up_to_its_border(void)
{
    static const uint16_t shapes[][2] = {{1, 1}, {1, 40}, {40, 1}, {2, 2}, {3, 7}, {29, 5}, {33, 31}};
    static uint8_t bytes[40 * 40];
    for (unsigned radius = 2; radius <= 5; radius++) {
        for (unsigned i = 0; i < sizeof shapes / sizeof shapes[0]; i++) {
            junk(bytes, sizeof bytes, i + 7);
            const struct frame_view frame = {.pixels = bytes, .stride_bytes = shapes[i][0],
                                             .width_px = shapes[i][0], .height_px = shapes[i][1],
                                             .format = FRAME_GREY8};
            start(radius, 20, frame.width_px, frame.height_px);
            check_frame(&frame, radius, 1);
        }
    }
}

static void widest_frame_agrees_with_double_at_both_ends(void)
{
    static uint8_t bytes[8192 * 3];
    junk(bytes, sizeof bytes, 8);
    const struct frame_view frame = {.pixels = bytes, .stride_bytes = 8192, .width_px = 8192,
                                     .height_px = 3, .format = FRAME_GREY8};
    start(5, 20, 8192, 3);
    check_frame(&frame, 5, 8191); /* the first column and the last */
}

static void second_frame_owes_nothing_to_the_first(void)
{
    static uint8_t first[24 * 20];
    static uint8_t second[24 * 20];
    junk(first, sizeof first, 9);
    junk(second, sizeof second, 10);
    struct frame_view frame = {.pixels = first, .stride_bytes = 24, .width_px = 24,
                               .height_px = 20, .format = FRAME_GREY8};
    start(3, 20, 24, 20);
    check_frame(&frame, 3, 1);
    frame.pixels = second;
    steer_begin(&steer);
    check_frame(&frame, 3, 1);
}

static void row_holds_until_the_row_after_the_next_is_asked_for(void)
{
    static uint8_t bytes[16 * 16];
    int16_t copy[16];
    junk(bytes, sizeof bytes, 11);
    const struct frame_view frame = {.pixels = bytes, .stride_bytes = 16, .width_px = 16,
                                     .height_px = 16, .format = FRAME_GREY8};
    start(4, 20, 16, 16);
    for (uint16_t y = 0; y + 1 < 16; y++) {
        const struct dsp_gradient *row = y == 0 ? steer_row(&steer, &frame, 0) : &steer.rows[y & 1];
        memcpy(copy, row->xx_q2, sizeof copy);
        const struct dsp_gradient *next = steer_row(&steer, &frame, (uint16_t)(y + 1));
        TEST_ASSERT_TRUE(next != row);
        TEST_ASSERT_EQUAL_INT16_ARRAY(copy, row->xx_q2, 16);
    }
}

/* Where |gradient| is below the threshold by more than its error of 2 x sqrt 2 there is no side, where it
 * is above by more there is one, and it is positive on the dark side of a step. */
static void sides_follow_the_threshold_and_tell_dark_from_bright(void)
{
    struct synth_image image = synth_image_new(40, 9, 0);
    synth_edge(&image, 1, 0, 19.3, 40, 200, 1.0);
    uint8_t bytes[40 * 9];
    const struct frame_view frame = synth_frame(&image, FRAME_GREY8, bytes);
    const uint32_t threshold_q3 = 400;
    start(3, threshold_q3, 40, 9);
    unsigned dark = 0;
    unsigned bright = 0;
    for (uint16_t y = 0; y < 9; y++) {
        const struct dsp_gradient *g = steer_row(&steer, &frame, y);
        for (int x = 0; x < 40; x++) {
            const double strength = 8 * hypot(exact(&frame, 3, 1, 0, x, y), exact(&frame, 3, 0, 1, x, y));
            if (strength < threshold_q3 - 3) {
                TEST_ASSERT_EQUAL_INT(0, dsp_side(g, (unsigned)x));
            } else if (strength > threshold_q3 + 3) {
                TEST_ASSERT_EQUAL_INT(x < 19.3 ? 1 : -1, dsp_side(g, (unsigned)x));
                dark += x < 19.3;
                bright += x > 19.3;
            }
        }
    }
    TEST_ASSERT_TRUE(dark >= 9 && bright >= 9);
    synth_image_free(&image);
}

static void check_same_rows(const struct frame_view *frame, struct steer *half,
                            const struct frame_view *small, struct steer *alone)
{
    steer_begin(half);
    steer_begin(alone);
    for (uint16_t y = 0; y < small->height_px; y++) {
        const struct dsp_gradient *found = steer_row(half, frame, y);
        const struct dsp_gradient *expected = steer_row(alone, small, y);
        TEST_ASSERT_EQUAL_INT16_ARRAY(expected->x_q3, found->x_q3, small->width_px);
        TEST_ASSERT_EQUAL_INT16_ARRAY(expected->y_q3, found->y_q3, small->width_px);
        TEST_ASSERT_EQUAL_INT16_ARRAY(expected->xx_q2, found->xx_q2, small->width_px);
        TEST_ASSERT_EQUAL_INT16_ARRAY(expected->xy_q2, found->xy_q2, small->width_px);
        TEST_ASSERT_EQUAL_INT16_ARRAY(expected->yy_q2, found->yy_q2, small->width_px);
        TEST_ASSERT_EQUAL_HEX8_ARRAY(expected->strong, found->strong, DSP_BITS_BYTES(small->width_px));
        TEST_ASSERT_EQUAL_HEX8_ARRAY(expected->bright, found->bright, DSP_BITS_BYTES(small->width_px));
    }
}

/* The halved picture as a frame of 12 bits, which hold it exactly. The frame's odd last column and row are left
 * out. */
static void halved_frame_is_steered_like_its_halved_picture(void)
{
    static const enum frame_format formats[] = {FRAME_GREY8, FRAME_GREY12};
    static uint8_t bytes[2 * 41 * 35];
    static uint16_t picture[20 * 17];
    for (unsigned i = 0; i < 2; i++) {
        junk(bytes, sizeof bytes, 12 + i);
        const struct frame_view frame = {.pixels = bytes, .stride_bytes = 41 * (i + 1),
                                         .width_px = 41, .height_px = 35, .format = formats[i]};
        for (uint16_t y = 0; y < 17; y++) {
            luma_halved_row(&frame, y, picture + 20 * y);
        }
        const struct frame_view small = {.pixels = (const uint8_t *)picture, .stride_bytes = 40,
                                         .width_px = 20, .height_px = 17, .format = FRAME_GREY12};
        start(3, 20, 20, 17);
        struct steer alone = steer;
        void *own = memory;
        memory = NULL;
        start(3, 20, 41, 35);
        struct steer half;
        steer_halve(&steer, &half);
        check_same_rows(&frame, &half, &small, &alone);
        free(own);
    }
}

/* sigma r / 3 px of the picture it sees; a pixel of the halved frame is a box of 2 px, of 4 / 12 px^2, where
 * one of the frame has 1 / 12: sqrt(4 sigma^2 + 1/4). Both roots are cut to Q16, the filter's own sigma counting
 * twice. */
static void width_of_the_filters_is_told_in_pixels_of_the_frame(void)
{
    for (unsigned radius = 2; radius <= 5; radius++) {
        start(radius, 20, 40, 30);
        struct steer half;
        steer_halve(&steer, &half);
        const double sigma = radius / 3.0;
        SYNTH_NEAR(1.0 / 65536, sigma, steer_sigma_px_q16(&steer) / 65536.0);
        SYNTH_NEAR(3.0 / 65536, sqrt(4 * sigma * sigma + 0.25), steer_sigma_px_q16(&half) / 65536.0);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(every_shape_of_frame_agrees_with_double_up_to_its_border);
    RUN_TEST(widest_frame_agrees_with_double_at_both_ends);
    RUN_TEST(second_frame_owes_nothing_to_the_first);
    RUN_TEST(row_holds_until_the_row_after_the_next_is_asked_for);
    RUN_TEST(sides_follow_the_threshold_and_tell_dark_from_bright);
    RUN_TEST(halved_frame_is_steered_like_its_halved_picture);
    RUN_TEST(width_of_the_filters_is_told_in_pixels_of_the_frame);
    return UNITY_END();
}
