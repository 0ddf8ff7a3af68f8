/* The reader of target files: what it takes, what it works out, and each refusal by itself. */
#include "common/targetfile/targetfile.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <unity.h>

static struct targetfile file;
static char error[TARGETFILE_ERROR_BYTES];

void setUp(void) {}
void tearDown(void) {}

/* The body between the head and the grids is the test's; rows 1, cols 2. */
#define HEAD "{\"format\": \"tessera-target\", \"version\": 1, "
#define SIZE "\"rows\": 1, \"cols\": 2, \"patch_mm\": 50, "
#define GRIDS "\"ids\": [[5, 6]], \"turns\": [[0, 1]]}"

static bool parse(const char *text)
{
    return targetfile_parse(text, strlen(text), "some.json", &file, error);
}

/* Refused, with a sentence that names the file and holds `words`. */
static void assert_refused(const char *text, const char *words)
{
    TEST_ASSERT_FALSE(parse(text));
    TEST_ASSERT_TRUE_MESSAGE(strncmp(error, "some.json: ", 11) == 0, error);
    TEST_ASSERT_TRUE_MESSAGE(strstr(error, words) != NULL, error);
    TEST_ASSERT_NULL(strchr(error, '\n'));
}

static void a_file_of_required_keys_gets_the_defaults(void)
{
    TEST_ASSERT_TRUE_MESSAGE(parse(HEAD SIZE GRIDS), error);
    TEST_ASSERT_EQUAL_UINT(1, file.target.rows);
    TEST_ASSERT_EQUAL_UINT(2, file.target.cols);
    TEST_ASSERT_EQUAL_UINT(2, file.target.levels);
    TEST_ASSERT_TRUE(file.target.patch_nm == 50000000);
    TEST_ASSERT_EQUAL_UINT(32768, file.target.circle_ratio_q16);
    TEST_ASSERT_EQUAL_UINT(52429, file.target.edge_level_q16);
    TEST_ASSERT_EQUAL_UINT(26214, file.target.gauss_sigma_q16);
    TEST_ASSERT_EQUAL_STRING("", file.target.name);
    TEST_ASSERT_TRUE(file.circle_ratio == 0.5 && file.edge_level == 0.8);
    TEST_ASSERT_TRUE(file.gauss_sigma == 0.4 && file.margin == 0.5);
    TEST_ASSERT_TRUE(file.measured_scale[0] == 1 && file.measured_scale[1] == 1);
}

static void every_key_is_read(void)
{
    TEST_ASSERT_TRUE_MESSAGE(
        parse(HEAD SIZE "\"name\": \"w\xc3\xa4nd \\\"a\\\"\", \"levels\": 3, "
                        "\"circle_ratio\": 0.6, \"edge_level\": 1, \"gauss_sigma\": 0.3, "
                        "\"margin\": 0, \"measured_scale\": [1.001, 0.999], "
                        "\"x_note\": {\"by\": [1, {}]}, " GRIDS),
        error);
    TEST_ASSERT_EQUAL_STRING("w\xc3\xa4nd \"a\"", file.target.name);
    TEST_ASSERT_EQUAL_UINT(3, file.target.levels);
    TEST_ASSERT_TRUE(file.circle_ratio == 0.6 && file.edge_level == 1 && file.gauss_sigma == 0.3);
    TEST_ASSERT_TRUE(file.margin == 0);
    TEST_ASSERT_TRUE(file.measured_scale[0] == 1.001 && file.measured_scale[1] == 0.999);
    TEST_ASSERT_EQUAL_UINT(6, file.target.ids[1]);
    TEST_ASSERT_EQUAL_UINT(1, file.target.turns[1]);
}

static void each_required_key_is_missed_by_name(void)
{
    assert_refused("{\"version\": 1, " SIZE GRIDS, "\"format\"");
    assert_refused("{\"format\": \"tessera-target\", " SIZE GRIDS, "\"version\" is missing");
    assert_refused(HEAD "\"cols\": 2, \"patch_mm\": 50, " GRIDS, "\"rows\" is missing");
    assert_refused(HEAD "\"rows\": 1, \"patch_mm\": 50, " GRIDS, "\"cols\" is missing");
    assert_refused(HEAD "\"rows\": 1, \"cols\": 2, " GRIDS, "\"patch_mm\" is missing");
    assert_refused(HEAD SIZE "\"turns\": [[0, 1]]}", "\"ids\" is missing");
    assert_refused(HEAD SIZE "\"ids\": [[5, 6]]}", "\"turns\" is missing");
}

static void another_format_or_version_is_refused(void)
{
    assert_refused("{\"format\": \"other\", \"version\": 1, " SIZE GRIDS, "\"format\"");
    assert_refused("{\"format\": 3, \"version\": 1, " SIZE GRIDS, "\"format\"");
    const char *format = "{\"format\": \"tessera-target\", \"version\": %s, " SIZE GRIDS;
    const char *versions[] = {"2", "0", "-1", "1.5", "\"1\"", "null", "1e300"};
    for (unsigned i = 0; i < sizeof versions / sizeof versions[0]; i++) {
        char text[512];
        (void)snprintf(text, sizeof text, format, versions[i]);
        assert_refused(text, "\"version\"");
    }
}

static void unknown_and_repeated_keys_are_refused(void)
{
    assert_refused(HEAD SIZE "\"ratio\": 1, " GRIDS, "\"ratio\" is not known");
    assert_refused(HEAD SIZE "\"Rows\": 1, " GRIDS, "\"Rows\" is not known");
    assert_refused(HEAD SIZE "\"\": 1, " GRIDS, "\"\" is not known");
    assert_refused(HEAD SIZE "\"rows\": 1, " GRIDS, "\"rows\" stands twice");
    assert_refused(HEAD SIZE "\"x_a\": 1, \"x_a\": 1, " GRIDS, "\"x_a\" stands twice");
    TEST_ASSERT_TRUE(parse(HEAD SIZE "\"x_a\": 1, \"x_A\": 1, " GRIDS));
}

/* `key` with each of these values is refused by name. */
static void assert_values_refused(const char *key, const char *const values[], unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        const bool rows = strcmp(key, "rows") == 0;
        const bool cols = strcmp(key, "cols") == 0;
        const bool patch_mm = strcmp(key, "patch_mm") == 0;
        const bool other = !rows && !cols && !patch_mm;
        char text[512];
        (void)snprintf(text, sizeof text,
                       HEAD "\"rows\": %s, \"cols\": %s, \"patch_mm\": %s, \"%s\": %s, " GRIDS,
                       rows ? values[i] : "1", cols ? values[i] : "2", patch_mm ? values[i] : "50",
                       other ? key : "x_other", other ? values[i] : "0");
        assert_refused(text, key);
    }
}

static void numbers_out_of_range_and_things_that_are_no_numbers_are_refused(void)
{
    static const char *const counts[] = {"0", "-1", "4097", "1.5", "\"1\"", "null", "true", "[1]"};
    static const char *const lengths[] = {"0", "-1", "100001", "1e999", "\"50\"", "null", "{}"};
    static const char *const ratios[] = {"0", "-0.5", "1.01", "-1e999", "\"0.5\"", "false", "[]"};
    static const char *const levels[] = {"0", "1", "4", "2.5", "\"2\"", "null"};
    static const char *const sigmas[] = {"0", "-1", "101", "1e999", "\"1\""};
    static const char *const margins[] = {"-0.1", "11", "\"0\""};
    assert_values_refused("rows", counts, 8);
    assert_values_refused("cols", counts, 8);
    assert_values_refused("patch_mm", lengths, 7);
    assert_values_refused("circle_ratio", ratios, 7);
    assert_values_refused("edge_level", ratios, 7);
    assert_values_refused("levels", levels, 6);
    assert_values_refused("gauss_sigma", sigmas, 5);
    assert_values_refused("margin", margins, 3);
}

static void names_that_are_no_short_plain_text_are_refused(void)
{
    static const char *const names[] = {
        "3", "null", "\"two\\nlines\"", "\"\\u007f\"",
        "\"0123456789012345678901234567890123456789012345678901234567890123\""};
    assert_values_refused("name", names, 5);
    TEST_ASSERT_TRUE(parse(
        HEAD SIZE
        "\"name\": \"012345678901234567890123456789012345678901234567890123456789012\", " GRIDS));
}

static void a_measured_scale_of_another_shape_is_refused(void)
{
    static const char *const scales[] = {"1",         "[1]",    "[1, 1, 1]", "[1, \"1\"]",
                                         "[0.4, 1]",  "[1, 3]", "[]",        "[null, 1]",
                                         "[1e999, 1]", "{}"};
    assert_values_refused("measured_scale", scales, 10);
}

static void more_patches_than_ids_are_refused(void)
{
    assert_refused(HEAD "\"rows\": 65, \"cols\": 64, \"patch_mm\": 50, " GRIDS, "4160 patches");
    assert_refused(HEAD "\"rows\": 4096, \"cols\": 4096, \"patch_mm\": 50, " GRIDS, "patches");
}

static void grids_of_another_size_are_refused(void)
{
    assert_refused(HEAD SIZE "\"ids\": [[5, 6], [7, 8]], \"turns\": [[0, 1]]}", "\"ids\"");
    assert_refused(HEAD SIZE "\"ids\": [], \"turns\": [[0, 1]]}", "\"ids\"");
    assert_refused(HEAD SIZE "\"ids\": [5], \"turns\": [[0, 1]]}", "\"ids\", row 0");
    assert_refused(HEAD SIZE "\"ids\": [[5]], \"turns\": [[0, 1]]}", "\"ids\", row 0");
    assert_refused(HEAD SIZE "\"ids\": [[5, 6, 7]], \"turns\": [[0, 1]]}", "\"ids\", row 0");
    assert_refused(HEAD SIZE "\"ids\": {\"a\": [5, 6]}, \"turns\": [[0, 1]]}", "\"ids\"");
    assert_refused(HEAD SIZE "\"ids\": [[5, 6]], \"turns\": [[0]]}", "\"turns\", row 0");
    assert_refused(HEAD SIZE "\"ids\": [[5, 6]], \"turns\": 0}", "\"turns\"");
}

static void ids_and_turns_out_of_range_are_refused_with_their_place(void)
{
    assert_refused(HEAD SIZE "\"ids\": [[5, 4096]], \"turns\": [[0, 1]]}",
                   "\"ids\", row 0, column 1");
    assert_refused(HEAD SIZE "\"ids\": [[-1, 6]], \"turns\": [[0, 1]]}",
                   "\"ids\", row 0, column 0");
    assert_refused(HEAD SIZE "\"ids\": [[5.5, 6]], \"turns\": [[0, 1]]}",
                   "\"ids\", row 0, column 0");
    assert_refused(HEAD SIZE "\"ids\": [[\"5\", 6]], \"turns\": [[0, 1]]}", "\"ids\", row 0");
    assert_refused(HEAD SIZE "\"ids\": [[null, 6]], \"turns\": [[0, 1]]}", "\"ids\", row 0");
    assert_refused(HEAD SIZE "\"ids\": [[6, 6]], \"turns\": [[0, 1]]}", "id 6 stands twice");
    assert_refused(HEAD SIZE "\"ids\": [[5, 6]], \"turns\": [[0, 2]]}",
                   "\"turns\", row 0, column 1");
    assert_refused(HEAD SIZE "\"ids\": [[5, 6]], \"turns\": [[true, 0]]}", "\"turns\", row 0");
}

static void text_that_is_not_json_is_refused_with_its_line(void)
{
    assert_refused("", "not valid JSON");
    assert_refused("P5 640 480 255", "line 1 is not valid JSON");
    assert_refused("{\n\"rows\": 1,\n\"cols\": }\n", "line 3 is not valid JSON");
    assert_refused(HEAD SIZE "\"margin\": NaN, " GRIDS, "not valid JSON");
    assert_refused(HEAD SIZE "\"margin\": Infinity, " GRIDS, "not valid JSON");
    assert_refused(HEAD SIZE GRIDS "\n{}", "line 2 goes on after the end");
    assert_refused("[1, 2]", "one JSON object");
    assert_refused("3", "one JSON object");
    TEST_ASSERT_TRUE(parse(" \r\n\t" HEAD SIZE GRIDS " \r\n\t"));
}

static void bytes_that_are_not_utf8_are_refused(void)
{
    static const char *const bad[] = {
        "\xff",             /* no such byte                 */
        "\x80",             /* continuation without a start */
        "\xc3",             /* start without continuation   */
        "\xc0\xaf",         /* overlong                     */
        "\xe0\x80\xaf",     /* overlong                     */
        "\xed\xa0\x80",     /* surrogate                    */
        "\xf4\x90\x80\x80", /* above U+10FFFF               */
    };
    for (unsigned i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        char text[512];
        (void)snprintf(text, sizeof text, HEAD SIZE "\n\"x_a\": \"%s\", " GRIDS, bad[i]);
        assert_refused(text, "line 2 is not UTF-8");
    }
    static const char with_zero[] = HEAD SIZE "\"x_a\": \"\0\", " GRIDS;
    TEST_ASSERT_FALSE(
        targetfile_parse(with_zero, sizeof with_zero - 1, "some.json", &file, error));
    TEST_ASSERT_TRUE_MESSAGE(strstr(error, "UTF-8") != NULL, error);
    TEST_ASSERT_TRUE(parse(HEAD SIZE "\"x_a\": \"\xe2\x82\xac \xf0\x9f\x93\xb7\", " GRIDS));
}

static void deep_nesting_and_floods_of_keys_are_refused_at_once(void)
{
    char *text = malloc(TARGETFILE_BYTES_MAX + 2);
    TEST_ASSERT_NOT_NULL(text);
    const size_t deep = 500000;
    memset(text, '[', deep);
    TEST_ASSERT_FALSE(targetfile_parse(text, deep, "some.json", &file, error));
    int used = sprintf(text, "{\"x_a\": ");
    memset(text + used, '[', deep);
    TEST_ASSERT_FALSE(targetfile_parse(text, deep, "some.json", &file, error));

    used = sprintf(text, HEAD);
    for (unsigned i = 0; i < 60000; i++) {
        used += sprintf(text + used, "\"x_%u\": 0, ", i);
    }
    (void)sprintf(text + used, SIZE GRIDS);
    assert_refused(text, "keys");

    memset(text, ' ', TARGETFILE_BYTES_MAX + 1);
    TEST_ASSERT_FALSE(
        targetfile_parse(text, TARGETFILE_BYTES_MAX + 1, "some.json", &file, error));
    TEST_ASSERT_TRUE_MESSAGE(strstr(error, "larger") != NULL, error);
    free(text);
}

static void a_file_cut_anywhere_is_refused(void)
{
    static const char whole[] = HEAD SIZE "\"measured_scale\": [1, 1], " GRIDS;
    for (size_t bytes = 0; bytes < sizeof whole - 1; bytes++) {
        char *text = malloc(bytes + 1); /* exact size, so that the sanitizers see each overrun */
        TEST_ASSERT_NOT_NULL(text);
        memcpy(text, whole, bytes);
        TEST_ASSERT_FALSE(targetfile_parse(text, bytes, "some.json", &file, error));
        free(text);
    }
}

static void paths_that_cannot_be_read_get_a_sentence(void)
{
    TEST_ASSERT_FALSE(targetfile_read("/no/such/target.json", &file, error));
    TEST_ASSERT_EQUAL_STRING("/no/such/target.json: cannot be opened: No such file or directory",
                             error);
    TEST_ASSERT_FALSE(targetfile_read("/tmp", &file, error));
    TEST_ASSERT_EQUAL_STRING("/tmp: cannot be read: Is a directory", error);
    TEST_ASSERT_FALSE(targetfile_read("/dev/zero", &file, error));
    TEST_ASSERT_TRUE_MESSAGE(strstr(error, "/dev/zero: is larger") == error, error);
}

static void a_file_is_read_from_its_path(void)
{
    char path[] = "/tmp/test_targetfile_XXXXXX";
    const int handle = mkstemp(path);
    TEST_ASSERT_TRUE(handle >= 0);
    static const char text[] = HEAD SIZE GRIDS;
    TEST_ASSERT_TRUE(write(handle, text, sizeof text - 1) == (ssize_t)(sizeof text - 1));
    TEST_ASSERT_EQUAL_INT(0, close(handle));
    const bool right = targetfile_read(path, &file, error);
    TEST_ASSERT_EQUAL_INT(0, unlink(path));
    TEST_ASSERT_TRUE_MESSAGE(right, error);
    TEST_ASSERT_EQUAL_UINT(2, file.target.cols);
}

/* Q30 holds a position to 2^-31 of the patch side (50 mm): 2.4e-8 mm. */
static const double mm_tolerance = 3e-8;

static void points_stand_in_the_board_frame_with_turn_and_scale(void)
{
    const double h = (1.41421356237309504880 - 1) / 4;
    double xyz[3];
    double radius = 0;
    TEST_ASSERT_TRUE(parse(HEAD SIZE GRIDS));
    /* Patch 5, not turned, at (0, 0): bit 0's circle lies at (1 - h, 1/4). */
    TEST_ASSERT_TRUE(targetfile_point_mm(&file, 5, 1, xyz, &radius));
    TEST_ASSERT_TRUE(fabs(xyz[0] - 50 * (1 - h)) < mm_tolerance);
    TEST_ASSERT_TRUE(fabs(xyz[1] - 50 * 0.25) < mm_tolerance);
    TEST_ASSERT_TRUE(xyz[2] == 0);
    TEST_ASSERT_TRUE(fabs(radius - 0.5 * h * 50) < mm_tolerance);
    /* Patch 6, turned, in the second column: the same circle at (h, 3/4) of its cell. */
    TEST_ASSERT_TRUE(targetfile_point_mm(&file, 6, 1, xyz, &radius));
    TEST_ASSERT_TRUE(fabs(xyz[0] - 50 * (1 + h)) < mm_tolerance);
    TEST_ASSERT_TRUE(fabs(xyz[1] - 50 * 0.75) < mm_tolerance);

    TEST_ASSERT_TRUE(
        parse(HEAD SIZE "\"measured_scale\": [1.21, 1], \"circle_ratio\": 0.6, " GRIDS));
    TEST_ASSERT_TRUE(targetfile_point_mm(&file, 6, 0, xyz, &radius));
    TEST_ASSERT_TRUE(fabs(xyz[0] - 1.21 * 50 * 1.5) < mm_tolerance);
    TEST_ASSERT_TRUE(fabs(xyz[1] - 50 * (1 - 2 * h)) < mm_tolerance);
    TEST_ASSERT_TRUE(fabs(radius - 1.1 * 0.6 * 2 * h * 50) < mm_tolerance);
    TEST_ASSERT_TRUE(targetfile_point_mm(&file, 6, 0, xyz, NULL));
}

static void points_that_the_target_does_not_have_are_refused(void)
{
    double xyz[3] = {-1, -1, -1};
    TEST_ASSERT_TRUE(parse(HEAD SIZE GRIDS));
    TEST_ASSERT_FALSE(targetfile_point_mm(&file, 7, 0, xyz, NULL));
    TEST_ASSERT_FALSE(targetfile_point_mm(&file, 5, 13, xyz, NULL));
    TEST_ASSERT_FALSE(targetfile_point_mm(&file, 5 + 65536, 0, xyz, NULL));
    TEST_ASSERT_TRUE(xyz[0] == -1);
    TEST_ASSERT_TRUE(parse(HEAD SIZE "\"levels\": 3, " GRIDS));
    TEST_ASSERT_TRUE(targetfile_point_mm(&file, 5, 84, xyz, NULL));
    TEST_ASSERT_FALSE(targetfile_point_mm(&file, 5, 85, xyz, NULL));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(a_file_of_required_keys_gets_the_defaults);
    RUN_TEST(every_key_is_read);
    RUN_TEST(each_required_key_is_missed_by_name);
    RUN_TEST(another_format_or_version_is_refused);
    RUN_TEST(unknown_and_repeated_keys_are_refused);
    RUN_TEST(numbers_out_of_range_and_things_that_are_no_numbers_are_refused);
    RUN_TEST(names_that_are_no_short_plain_text_are_refused);
    RUN_TEST(a_measured_scale_of_another_shape_is_refused);
    RUN_TEST(more_patches_than_ids_are_refused);
    RUN_TEST(grids_of_another_size_are_refused);
    RUN_TEST(ids_and_turns_out_of_range_are_refused_with_their_place);
    RUN_TEST(text_that_is_not_json_is_refused_with_its_line);
    RUN_TEST(bytes_that_are_not_utf8_are_refused);
    RUN_TEST(deep_nesting_and_floods_of_keys_are_refused_at_once);
    RUN_TEST(a_file_cut_anywhere_is_refused);
    RUN_TEST(paths_that_cannot_be_read_get_a_sentence);
    RUN_TEST(a_file_is_read_from_its_path);
    RUN_TEST(points_stand_in_the_board_frame_with_turn_and_scale);
    RUN_TEST(points_that_the_target_does_not_have_are_refused);
    return UNITY_END();
}
