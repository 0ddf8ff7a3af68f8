/* tessera-cam's command line: each option's meaning, and each refusal. */
#include <getopt.h>
#include <string.h>
#include <unity.h>

#include "firmware/app/camera_options.h"

#define WORDS_MAX 16

static struct camera_options options;

void setUp(void) {}
void tearDown(void) {}

static enum camera_options_result take(int count, const char *const words[])
{
    static char text[WORDS_MAX][64];
    static char *line[WORDS_MAX + 2];
    line[0] = strcpy(text[0], "tessera-cam");
    for (int i = 0; i < count; i++) {
        line[i + 1] = strcpy(text[i + 1], words[i]);
    }
    line[count + 1] = NULL;
    optind = 0; /* start getopt anew */
    return camera_options_read(count + 1, line, &options);
}

#define TAKE(...)                                                                                  \
    take((int)(sizeof((const char *[]){__VA_ARGS__}) / sizeof(const char *)),                      \
         (const char *[]){__VA_ARGS__})

static void receiver_alone_is_enough(void)
{
    TEST_ASSERT_EQUAL_INT(CAMERA_OPTIONS_RUN, TAKE("--to", "host:7400"));
    TEST_ASSERT_EQUAL_STRING("host:7400", options.to);
    TEST_ASSERT_EQUAL_STRING("/dev/video0", options.capture.device);
    TEST_ASSERT_EQUAL_UINT32(10000, options.give_up_ms);
    TEST_ASSERT_EQUAL_UINT32(WIRE_CLOCK_UNCERTAINTY_UNKNOWN, options.about.clock_uncertainty_ns);
    TEST_ASSERT_FALSE(options.clock_given);
    TEST_ASSERT_FALSE(options.wait);
}

static void what_the_driver_cannot_say_reaches_packet_and_capture(void)
{
    TEST_ASSERT_EQUAL_INT(CAMERA_OPTIONS_RUN,
                          TAKE("--to", "h:1", "--exposure-us", "2500", "--row-time-ns", "14000",
                               "--region", "8,16,1920,1080", "--binning", "2x1", "--flip", "xy"));
    TEST_ASSERT_EQUAL_UINT32(2500000, options.about.exposure_ns);
    TEST_ASSERT_EQUAL_UINT32(2500000, options.capture.exposure_ns);
    TEST_ASSERT_EQUAL_UINT32(14000, options.about.row_time_ns);
    TEST_ASSERT_EQUAL_UINT(8, options.about.region_x);
    TEST_ASSERT_EQUAL_UINT(1080, options.about.region_height);
    TEST_ASSERT_EQUAL_UINT(2, options.about.binning_x);
    TEST_ASSERT_EQUAL_UINT(1, options.about.binning_y);
    TEST_ASSERT_EQUAL_UINT(WIRE_FLIP_COLUMNS | WIRE_FLIP_ROWS, options.about.flips);
}

static void clocks_are_known_by_name(void)
{
    TEST_ASSERT_EQUAL_INT(CAMERA_OPTIONS_RUN, TAKE("--to", "h:1", "--clock", "tai"));
    TEST_ASSERT_EQUAL_UINT(WIRE_CLOCK_TAI, options.about.clock_kind);
    TEST_ASSERT_TRUE(options.clock_given);
    TEST_ASSERT_EQUAL_INT(CAMERA_OPTIONS_USAGE, TAKE("--to", "h:1", "--clock", "sundial"));
}

static void bad_values_are_wrong_use(void)
{
    static const char *const bad[][2] = {
        {"--size", "1920"},       {"--size", "0x1080"},      {"--size", "9000x100"},
        {"--buffers", "1"},       {"--buffers", "33"},       {"--frames", "0"},
        {"--frames", "-1"},       {"--region", "1,2,3"},     {"--region", "1,2,0,4"},
        {"--binning", "17x1"},    {"--flip", "z"},           {"--exposure-us", "1e3"},
        {"--give-up", ""},        {"--serial", ""},          {"--kernel", "6"},
        {"--serial", "a name of more than thirty-two bytes"},
    };
    for (unsigned i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        TEST_ASSERT_EQUAL_INT(CAMERA_OPTIONS_USAGE, TAKE("--to", "h:1", bad[i][0], bad[i][1]));
    }
}

static void no_receiver_stray_words_and_unknown_options_are_wrong_use(void)
{
    TEST_ASSERT_EQUAL_INT(CAMERA_OPTIONS_USAGE, TAKE("--wait"));
    TEST_ASSERT_EQUAL_INT(CAMERA_OPTIONS_USAGE, TAKE("--to", "h:1", "frames"));
    TEST_ASSERT_EQUAL_INT(CAMERA_OPTIONS_USAGE, TAKE("--to", "h:1", "--turbo"));
}

static void missing_target_file_is_a_failure_not_wrong_use(void)
{
    TEST_ASSERT_EQUAL_INT(CAMERA_OPTIONS_FAILED,
                          TAKE("--to", "h:1", "--target", "/nonexistent/target.json"));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(receiver_alone_is_enough);
    RUN_TEST(what_the_driver_cannot_say_reaches_packet_and_capture);
    RUN_TEST(clocks_are_known_by_name);
    RUN_TEST(bad_values_are_wrong_use);
    RUN_TEST(no_receiver_stray_words_and_unknown_options_are_wrong_use);
    RUN_TEST(missing_target_file_is_a_failure_not_wrong_use);
    return UNITY_END();
}
