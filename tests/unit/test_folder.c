/* The order in which a folder's frames are shown. */
#include "tools/v4l2_shim/folder.c"
#include "tools/v4l2_shim/pgm_head.c"
#include "tools/v4l2_shim/times_csv.c"

#include "unity.h"

void setUp(void)
{
}

void tearDown(void)
{
}

static void names_sort_by_their_numbers(void)
{
    static const char *const sorted[] = {
        "",          "0",   "1",    "9",    "10",    "a",     "a01",  "a1",
        "a2",        "a2b", "a10",  "a10b", "a10b2", "a10b9", "a10c", "a99999999999999999999998",
        "a99999999999999999999999", "b",
    };
    /* "a01" and "a1" have one value: then the characters decide. */
    enum { COUNT = sizeof sorted / sizeof sorted[0] };
    for (int i = 0; i < COUNT; i++) {
        for (int j = 0; j < COUNT; j++) {
            const int order = folder_compare_names(sorted[i], sorted[j]);
            const int sign = (order > 0) - (order < 0);
            const int wanted = (i > j) - (i < j);
            TEST_ASSERT_EQUAL_INT(wanted, sign);
        }
    }
}

static void a_format_that_cannot_be_is_refused(void)
{
    char sentence[SENTENCE_BYTES];
    struct folder_format odd = {.fourcc = V4L2_PIX_FMT_UYVY, .width_px = 3, .height_px = 2};
    struct folder_format huge = {.fourcc = V4L2_PIX_FMT_Y16, .width_px = 65535, .height_px = 65535};
    struct folder_format narrow = {
        .fourcc = V4L2_PIX_FMT_Y10, .width_px = 8, .height_px = 2, .stride_bytes = 15};
    TEST_ASSERT_FALSE(folder_complete_format(&odd, sentence));
    TEST_ASSERT_FALSE(folder_complete_format(&huge, sentence));
    TEST_ASSERT_FALSE(folder_complete_format(&narrow, sentence));
}

static void a_planar_frame_has_chroma_after_its_luma(void)
{
    char sentence[SENTENCE_BYTES];
    struct folder_format nv12 = {.fourcc = V4L2_PIX_FMT_NV12, .width_px = 8, .height_px = 6};
    TEST_ASSERT_TRUE(folder_complete_format(&nv12, sentence));
    TEST_ASSERT_EQUAL_UINT32(8, nv12.stride_bytes);
    TEST_ASSERT_EQUAL_UINT32(8 * 6 + 8 * 3, nv12.image_bytes);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(names_sort_by_their_numbers);
    RUN_TEST(a_format_that_cannot_be_is_refused);
    RUN_TEST(a_planar_frame_has_chroma_after_its_luma);
    return UNITY_END();
}
