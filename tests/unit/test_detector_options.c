/* The detector's words on a command line: values taken, values refused, and whose fault it is. */
#include "firmware/app/detector_options.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <unity.h>

static struct detector_options options;
static char error[TARGETFILE_ERROR_BYTES];
static bool usage;

void setUp(void)
{
    detector_options_init(&options);
    memset(error, 0, sizeof error);
}
void tearDown(void) {}

static void take(int option, const char *value)
{
    if (!detector_options_take(&options, option, value, &usage, error)) {
        TEST_FAIL_MESSAGE(error);
    }
}

static void refuse(int option, const char *value, const char *word)
{
    usage = false;
    error[0] = 0;
    if (detector_options_take(&options, option, value, &usage, error)) {
        TEST_FAIL_MESSAGE(value);
    }
    TEST_ASSERT_TRUE(usage);
    if (strstr(error, word) == NULL) {
        TEST_FAIL_MESSAGE(error);
    }
}

static void no_words_give_the_defaults(void)
{
    const struct pipeline_settings *settings = detector_options_settings(&options);
    const struct pipeline_settings defaults = pipeline_defaults();
    TEST_ASSERT_EQUAL_UINT8(3, settings->kernel_radius_px); /* size 7 */
    TEST_ASSERT_EQUAL_UINT32(320, settings->gradient_min_q3); /* 2.5 x 128 */
    TEST_ASSERT_EQUAL_UINT8(2, settings->patches.levels);
    TEST_ASSERT_EQUAL_UINT32(32768, settings->patches.circle_ratio_q16);
    TEST_ASSERT_NULL(settings->patches.target);
    TEST_ASSERT_EQUAL_HEX64(pipeline_settings_digest(&defaults), pipeline_settings_digest(settings));
}

static void each_value_reaches_its_setting(void)
{
    static const struct {
        const char *size;
        unsigned radius;
    } kernels[] = {{"5", 2}, {"7", 3}, {"9", 4}, {"11", 5}};
    for (unsigned i = 0; i < 4; i++) {
        take(DETECTOR_OPTION_KERNEL, kernels[i].size);
        TEST_ASSERT_EQUAL_UINT(kernels[i].radius, detector_options_settings(&options)->kernel_radius_px);
    }
    take(DETECTOR_OPTION_GRADIENT, "0.5");
    TEST_ASSERT_EQUAL_UINT32(64, detector_options_settings(&options)->gradient_min_q3);
    take(DETECTOR_OPTION_GRADIENT, "100");
    TEST_ASSERT_EQUAL_UINT32(12800, detector_options_settings(&options)->gradient_min_q3);
    take(DETECTOR_OPTION_LEVELS, "3");
    TEST_ASSERT_EQUAL_UINT8(3, detector_options_settings(&options)->patches.levels);
    take(DETECTOR_OPTION_CIRCLE_RATIO, "0.75");
    TEST_ASSERT_EQUAL_UINT32(49152, detector_options_settings(&options)->patches.circle_ratio_q16);
}

static void bad_values_are_wrong_use_and_the_sentence_quotes_them(void)
{
    static const char *const kernels[] = {"6", "3", "13", "0", "-7", "", "7x", "seven", "99999999999999"};
    for (unsigned i = 0; i < sizeof kernels / sizeof kernels[0]; i++) {
        refuse(DETECTOR_OPTION_KERNEL, kernels[i], kernels[i]);
    }
    static const char *const gradients[] = {"0.4", "101", "nan", "inf", "-1", "", "2.5 px"};
    for (unsigned i = 0; i < sizeof gradients / sizeof gradients[0]; i++) {
        refuse(DETECTOR_OPTION_GRADIENT, gradients[i], gradients[i]);
    }
    static const char *const levels[] = {"1", "4", "", "2.5"};
    for (unsigned i = 0; i < sizeof levels / sizeof levels[0]; i++) {
        refuse(DETECTOR_OPTION_LEVELS, levels[i], levels[i]);
    }
    static const char *const ratios[] = {"0.04", "1.01", "nan", "", "half"};
    for (unsigned i = 0; i < sizeof ratios / sizeof ratios[0]; i++) {
        refuse(DETECTOR_OPTION_CIRCLE_RATIO, ratios[i], ratios[i]);
    }
    /* And none of them left a trace. */
    const struct pipeline_settings defaults = pipeline_defaults();
    TEST_ASSERT_EQUAL_HEX64(pipeline_settings_digest(&defaults),
                            pipeline_settings_digest(detector_options_settings(&options)));
}

static void missing_target_file_is_no_wrong_use_and_is_named(void)
{
    usage = true;
    TEST_ASSERT_FALSE(detector_options_take(&options, DETECTOR_OPTION_TARGET, "/nowhere/t.json", &usage,
                                            error));
    TEST_ASSERT_FALSE(usage);
    TEST_ASSERT_NOT_NULL(strstr(error, "/nowhere/t.json"));
}

static void target_file_brings_its_levels_and_ratio_in_any_order(void)
{
    char path[] = "/tmp/tessera-options-XXXXXX";
    const int fd = mkstemp(path);
    TEST_ASSERT_TRUE(fd >= 0);
    static const char text[] =
        "{\"format\":\"tessera-target\",\"version\":1,\"rows\":1,\"cols\":2,\"patch_mm\":50,"
        "\"levels\":3,\"circle_ratio\":0.625,\"ids\":[[7,9]],\"turns\":[[0,1]]}";
    TEST_ASSERT_EQUAL_INT(sizeof text - 1, write(fd, text, sizeof text - 1));
    close(fd);
    for (unsigned first = 0; first < 2; first++) {
        detector_options_init(&options);
        if (first == 0) {
            take(DETECTOR_OPTION_TARGET, path);
        }
        take(DETECTOR_OPTION_LEVELS, "2"); /* counts only "where no file says so" */
        take(DETECTOR_OPTION_CIRCLE_RATIO, "0.5");
        if (first == 1) {
            take(DETECTOR_OPTION_TARGET, path);
        }
        const struct pipeline_settings *settings = detector_options_settings(&options);
        TEST_ASSERT_TRUE(options.has_target);
        TEST_ASSERT_EQUAL_UINT8(3, settings->patches.levels);
        TEST_ASSERT_EQUAL_UINT32(40960, settings->patches.circle_ratio_q16);
        TEST_ASSERT_NOT_NULL(settings->patches.target);
        TEST_ASSERT_EQUAL_UINT16(9, settings->patches.target->ids[1]);
    }
    unlink(path);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(no_words_give_the_defaults);
    RUN_TEST(each_value_reaches_its_setting);
    RUN_TEST(bad_values_are_wrong_use_and_the_sentence_quotes_them);
    RUN_TEST(missing_target_file_is_no_wrong_use_and_is_named);
    RUN_TEST(target_file_brings_its_levels_and_ratio_in_any_order);
    return UNITY_END();
}
