/* Image files, good and broken: what comes out, and what the sentence says. */
#include "firmware/app/image_file.h"

#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <unity.h>

static char path[64];
static char error[IMAGE_FILE_ERROR_BYTES];
static struct image_file image;

void setUp(void)
{
    snprintf(path, sizeof path, "/tmp/tessera-image-XXXXXX");
    const int fd = mkstemp(path);
    TEST_ASSERT_TRUE(fd >= 0);
    close(fd);
    memset(error, 0, sizeof error);
}
void tearDown(void)
{
    unlink(path);
}

static void put(const void *bytes, size_t count)
{
    FILE *file = fopen(path, "wb");
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_EQUAL_UINT(count, fwrite(bytes, 1, count, file));
    TEST_ASSERT_EQUAL_INT(0, fclose(file));
}

static void expect_frame(unsigned width, unsigned height, enum frame_format format,
                         const uint8_t *samples)
{
    if (!image_file_read(path, &image, error)) {
        TEST_FAIL_MESSAGE(error);
    }
    TEST_ASSERT_EQUAL_UINT(width, image.frame.width_px);
    TEST_ASSERT_EQUAL_UINT(height, image.frame.height_px);
    TEST_ASSERT_EQUAL_INT(format, image.frame.format);
    const uint32_t used = frame_row_bytes(format, (uint16_t)width);
    for (unsigned y = 0; y < height; y++) {
        TEST_ASSERT_EQUAL_MEMORY(samples + y * used,
                                 image.frame.pixels + y * image.frame.stride_bytes, used);
    }
    image_file_free(&image);
}

static void expect_refusal(const char *word)
{
    TEST_ASSERT_FALSE(image_file_read(path, &image, error));
    TEST_ASSERT_NOT_NULL(strstr(error, path)); /* names the file */
    if (strstr(error, word) == NULL) {
        TEST_FAIL_MESSAGE(error);
    }
    TEST_ASSERT_NULL(strchr(error, '\n'));
}

static void eight_bit_pgm_is_grey8(void)
{
    put("P5\n3 2\n255\n\x00\x01\x7f\x80\xfe\xff", 11 + 6);
    expect_frame(3, 2, FRAME_GREY8, (const uint8_t *)"\x00\x01\x7f\x80\xfe\xff");
}

static void comments_and_any_white_space_are_allowed_in_a_pgm_header(void)
{
    static const char text[] = "P5 # made by hand\n# second\n 2\t1\r\n255\nAB";
    put(text, sizeof text - 1);
    expect_frame(2, 1, FRAME_GREY8, (const uint8_t *)"AB");
}

/* PGM is big-endian, frames are little-endian. */
static void sixteen_bit_pgm_is_swapped_and_told_by_its_maxval(void)
{
    static const struct {
        const char *maxval;
        enum frame_format format;
    } kinds[] = {{"1023", FRAME_GREY10}, {"4095", FRAME_GREY12}, {"65535", FRAME_GREY16}};
    for (unsigned i = 0; i < 3; i++) {
        char bytes[64];
        const int head = snprintf(bytes, sizeof bytes, "P5\n2 1\n%s\n", kinds[i].maxval);
        memcpy(bytes + head, "\x03\xff\x00\x01", 4);
        put(bytes, (size_t)head + 4);
        expect_frame(2, 1, kinds[i].format, (const uint8_t *)"\xff\x03\x01\x00");
    }
}

static void smallest_image_is_one_pixel(void)
{
    put("P5\n1 1\n255\nx", 12);
    expect_frame(1, 1, FRAME_GREY8, (const uint8_t *)"x");
}

static void write_png(unsigned width, unsigned height, int depth, int colour, const uint8_t *rows)
{
    FILE *file = fopen(path, "wb");
    TEST_ASSERT_NOT_NULL(file);
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png_create_info_struct(png);
    png_init_io(png, file);
    png_set_IHDR(png, info, width, height, depth, colour, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    const size_t row = png_get_rowbytes(png, info);
    for (unsigned y = 0; y < height; y++) {
        png_write_row(png, rows + y * row);
    }
    png_write_end(png, NULL);
    png_destroy_write_struct(&png, &info);
    TEST_ASSERT_EQUAL_INT(0, fclose(file));
}

static void grey_png_of_eight_and_sixteen_bits_keeps_its_samples(void)
{
    const uint8_t eight[6] = {0, 1, 127, 128, 254, 255};
    write_png(3, 2, 8, PNG_COLOR_TYPE_GRAY, eight);
    expect_frame(3, 2, FRAME_GREY8, eight);
    const uint8_t big[4] = {0x12, 0x34, 0xff, 0x01};
    write_png(2, 1, 16, PNG_COLOR_TYPE_GRAY, big);
    expect_frame(2, 1, FRAME_GREY16, (const uint8_t *)"\x34\x12\x01\xff");
}

static void colour_png_is_turned_grey_and_transparency_ignored(void)
{
    const uint8_t rgb[9] = {90, 90, 90, 0, 0, 0, 255, 255, 255};
    write_png(3, 1, 8, PNG_COLOR_TYPE_RGB, rgb);
    expect_frame(3, 1, FRAME_GREY8, (const uint8_t *)"\x5a\x00\xff");
    const uint8_t rgba[8] = {90, 90, 90, 0, 200, 200, 200, 255};
    write_png(2, 1, 8, PNG_COLOR_TYPE_RGBA, rgba);
    expect_frame(2, 1, FRAME_GREY8, (const uint8_t *)"\x5a\xc8");
    const uint8_t grey_alpha[4] = {7, 0, 250, 255};
    write_png(2, 1, 8, PNG_COLOR_TYPE_GRAY_ALPHA, grey_alpha);
    expect_frame(2, 1, FRAME_GREY8, (const uint8_t *)"\x07\xfa");
}

static void broken_files_are_refused_with_a_sentence(void)
{
    put("", 0);
    expect_refusal(" ");
    put("P6\n1 1\n255\nxyz", 14);
    expect_refusal("P");
    put("P5\n3 2\n255\nabcde", 16); /* one byte short */
    expect_refusal(" ");
    put("P5\n0 2\n255\n", 11);
    expect_refusal(" ");
    put("P5\n2 0\n255\n", 11);
    expect_refusal(" ");
    put("P5\n8193 1\n255\n", 14);
    expect_refusal("8192");
    put("P5\n1 99999999999999999999\n255\n", 30);
    expect_refusal(" ");
    put("P5\n-1 1\n255\nx", 13);
    expect_refusal(" ");
    put("P5\n1 1\n0\nx", 10);
    expect_refusal(" ");
    put("P5\n1 1\n77\nx", 11);
    expect_refusal("maximum");
    put("P5\n1 1\n65536\nxx", 15);
    expect_refusal(" ");
    put("P5\n1", 4);
    expect_refusal(" ");
    put("\x89PNG\r\n\x1a\nnonsense", 16);
    expect_refusal(" ");
}

static void png_cut_short_is_refused(void)
{
    static const uint8_t rows[64 * 64] = {1, 2, 3};
    write_png(64, 64, 8, PNG_COLOR_TYPE_GRAY, rows);
    for (long size = 60; size > 8; size -= 9) {
        TEST_ASSERT_EQUAL_INT(0, truncate(path, size));
        expect_refusal(" ");
    }
}

static void missing_file_and_folder_are_refused_by_name(void)
{
    unlink(path);
    expect_refusal("No such file");
    snprintf(path, sizeof path, "/tmp");
    expect_refusal(" ");
    snprintf(path, sizeof path, "/tmp/tessera-image-none");
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(eight_bit_pgm_is_grey8);
    RUN_TEST(comments_and_any_white_space_are_allowed_in_a_pgm_header);
    RUN_TEST(sixteen_bit_pgm_is_swapped_and_told_by_its_maxval);
    RUN_TEST(smallest_image_is_one_pixel);
    RUN_TEST(grey_png_of_eight_and_sixteen_bits_keeps_its_samples);
    RUN_TEST(colour_png_is_turned_grey_and_transparency_ignored);
    RUN_TEST(broken_files_are_refused_with_a_sentence);
    RUN_TEST(png_cut_short_is_refused);
    RUN_TEST(missing_file_and_folder_are_refused_by_name);
    return UNITY_END();
}
