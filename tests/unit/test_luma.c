/* Every pixel format comes out in one scale, whatever lies around its luma. */
#include "firmware/detect/luma.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "tests/unit/synth.h"

#define WIDTH 7u
#define PAD   5u
#define JUNK  0x5a5au

static uint16_t row[WIDTH + 2 * PAD + 2];

void setUp(void)
{
    for (unsigned i = 0; i < sizeof row / sizeof row[0]; i++) {
        row[i] = JUNK;
    }
}
void tearDown(void) {}

/* Runs luma_row on `bytes` as row 1 of 2; the row before is junk, and so is what surrounds the output. */
static void run(enum frame_format format, uint16_t width, const uint8_t *bytes)
{
    const uint32_t used = frame_row_bytes(format, width);
    const uint32_t stride = used + 3; /* odd: nothing is aligned */
    uint8_t *pixels = malloc(stride + used); /* exactly: a sanitizer sees a read behind it */
    TEST_ASSERT_NOT_NULL(pixels);
    memset(pixels, 0xa5, stride + used);
    memcpy(pixels + stride, bytes, used);
    const struct frame_view frame = {.pixels = pixels, .stride_bytes = stride, .width_px = width,
                                     .height_px = 2, .format = format};
    luma_row(&frame, 1, PAD, row + 1 + PAD);
    free(pixels);
}

static void check(const uint16_t *expected, unsigned width)
{
    TEST_ASSERT_EQUAL_HEX16(JUNK, row[0]);
    for (unsigned i = 0; i < PAD; i++) {
        TEST_ASSERT_EQUAL_UINT16(expected[0], row[1 + i]);
        TEST_ASSERT_EQUAL_UINT16(expected[width - 1], row[1 + PAD + width + i]);
    }
    TEST_ASSERT_EQUAL_UINT16_ARRAY(expected, row + 1 + PAD, width);
    TEST_ASSERT_EQUAL_HEX16(JUNK, row[1 + PAD + width + PAD]);
}

static void eight_bits_are_multiplied_by_sixteen(void)
{
    const uint8_t bytes[WIDTH] = {0, 1, 127, 128, 254, 255, 16};
    const uint16_t expected[WIDTH] = {0, 16, 2032, 2048, 4064, 4080, 256};
    run(FRAME_GREY8, WIDTH, bytes);
    check(expected, WIDTH);
    setUp();
    run(FRAME_NV12, WIDTH, bytes);
    check(expected, WIDTH);
}

static void ten_bits_are_multiplied_by_four_and_stop_at_their_maximum(void)
{
    const uint8_t bytes[2 * WIDTH] = {0, 0, 1, 0, 255, 3, 0, 4, 255, 255, 0, 2, 44, 1};
    const uint16_t expected[WIDTH] = {0, 4, 4092, 4092, 4092, 2048, 1200};
    run(FRAME_GREY10, WIDTH, bytes);
    check(expected, WIDTH);
}

static void twelve_bits_stay_and_stop_at_their_maximum(void)
{
    const uint8_t bytes[2 * WIDTH] = {0, 0, 1, 0, 255, 15, 0, 16, 255, 255, 0, 8, 44, 1};
    const uint16_t expected[WIDTH] = {0, 1, 4095, 4095, 4095, 2048, 300};
    run(FRAME_GREY12, WIDTH, bytes);
    check(expected, WIDTH);
}

static void sixteen_bits_are_divided_by_sixteen_and_truncated(void)
{
    const uint8_t bytes[2 * WIDTH] = {0, 0, 15, 0, 16, 0, 31, 0, 255, 255, 0, 128, 239, 255};
    const uint16_t expected[WIDTH] = {0, 0, 1, 1, 4095, 2048, 4094};
    run(FRAME_GREY16, WIDTH, bytes);
    check(expected, WIDTH);
}

static void chroma_is_never_looked_at(void)
{
    const uint8_t yuyv[12] = {10, 99, 20, 98, 30, 97, 40, 96, 50, 95, 255, 94};
    const uint8_t uyvy[12] = {99, 10, 98, 20, 97, 30, 96, 40, 95, 50, 94, 255};
    const uint16_t expected[6] = {160, 320, 480, 640, 800, 4080};
    run(FRAME_YUYV, 6, yuyv);
    check(expected, 6);
    setUp();
    run(FRAME_UYVY, 6, uyvy);
    check(expected, 6);
}

static void single_pixel_fills_its_padding_too(void)
{
    const uint8_t bytes[1] = {200};
    const uint16_t expected[1] = {3200};
    run(FRAME_GREY8, 1, bytes);
    check(expected, 1);
}

static void no_padding_writes_the_pixels_alone(void)
{
    const uint8_t bytes[3] = {1, 2, 3};
    const struct frame_view frame = {.pixels = bytes, .stride_bytes = 3, .width_px = 3,
                                     .height_px = 1, .format = FRAME_GREY8};
    luma_row(&frame, 0, 0, row + 1);
    const uint16_t expected[5] = {JUNK, 16, 32, 48, JUNK};
    TEST_ASSERT_EQUAL_UINT16_ARRAY(expected, row, 5);
}

/* Halves a frame of five rows and compares with the means of four of luma_row's values: an odd column and an
 * odd row are left over, and a row is longer than one of the function's pieces. */
static void check_halved(enum frame_format format, uint16_t width)
{
    static uint8_t bytes[5 * 200 * 2];
    uint64_t seed = 21 + (uint64_t)format;
    for (unsigned i = 0; i < sizeof bytes; i++) {
        bytes[i] = (uint8_t)synth_u64(&seed);
    }
    const struct frame_view frame = {.pixels = bytes, .stride_bytes = frame_row_bytes(format, width) + 3,
                                     .width_px = width, .height_px = 5, .format = format};
    for (uint16_t y = 0; y < 2; y++) {
        static uint16_t rows[2][200];
        static uint16_t halved[102];
        luma_row(&frame, (uint16_t)(2 * y), 0, rows[0]);
        luma_row(&frame, (uint16_t)(2 * y + 1), 0, rows[1]);
        memset(halved, 0x5a, sizeof halved);
        luma_halved_row(&frame, y, halved + 1);
        for (unsigned x = 0; x < width / 2u; x++) {
            const double mean =
                (rows[0][2 * x] + rows[0][2 * x + 1] + rows[1][2 * x] + rows[1][2 * x + 1]) / 4.0;
            TEST_ASSERT_EQUAL_UINT16((uint16_t)floor(mean + 0.5), halved[1 + x]);
        }
        TEST_ASSERT_EQUAL_HEX16(JUNK, halved[0]);
        TEST_ASSERT_EQUAL_HEX16(JUNK, halved[1 + width / 2u]);
    }
}

static void halved_row_is_the_mean_of_four_in_every_format(void)
{
    static const enum frame_format all[] = {FRAME_GREY8,  FRAME_NV12,   FRAME_YUYV,  FRAME_UYVY,
                                            FRAME_GREY10, FRAME_GREY12, FRAME_GREY16};
    for (unsigned i = 0; i < sizeof all / sizeof all[0]; i++) {
        const bool pairs = all[i] == FRAME_YUYV || all[i] == FRAME_UYVY; /* of even width */
        static const uint16_t widths[] = {2, 64, 66, 130, 200};
        for (unsigned k = 0; k < sizeof widths / sizeof widths[0]; k++) {
            check_halved(all[i], widths[k]);
            if (!pairs) {
                check_halved(all[i], (uint16_t)(widths[k] - (k > 0 ? 1 : 0)));
            }
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(eight_bits_are_multiplied_by_sixteen);
    RUN_TEST(ten_bits_are_multiplied_by_four_and_stop_at_their_maximum);
    RUN_TEST(twelve_bits_stay_and_stop_at_their_maximum);
    RUN_TEST(sixteen_bits_are_divided_by_sixteen_and_truncated);
    RUN_TEST(chroma_is_never_looked_at);
    RUN_TEST(single_pixel_fills_its_padding_too);
    RUN_TEST(no_padding_writes_the_pixels_alone);
    RUN_TEST(halved_row_is_the_mean_of_four_in_every_format);
    return UNITY_END();
}
