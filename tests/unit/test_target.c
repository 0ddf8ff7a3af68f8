/* Checking a target, finding patches by id, and the digest. */
#include "common/target/target.h"

#include <string.h>
#include <unity.h>

static struct target target;
static unsigned bad_place;

void setUp(void)
{
    memset(&target, 0, sizeof target);
    target.rows = 2;
    target.cols = 3;
    target.levels = 2;
    target.circle_ratio_q16 = 32768;
    target.edge_level_q16 = 52429;
    target.gauss_sigma_q16 = 26214;
    target.patch_nm = 100000000;
    const uint16_t ids[6] = {7, 4095, 0, 20, 21, 22};
    memcpy(target.ids, ids, sizeof ids);
    target.turns[1] = 1;
}

void tearDown(void) {}

static void patches_are_found_by_id_with_row_column_and_turn(void)
{
    TEST_ASSERT_EQUAL_INT(TARGET_OK, target_prepare(&target, &bad_place));
    for (unsigned place = 0; place < 6; place++) {
        uint16_t row = 99;
        uint16_t col = 99;
        uint8_t turn = 99;
        TEST_ASSERT_TRUE(target_find(&target, target.ids[place], &row, &col, &turn));
        TEST_ASSERT_EQUAL_UINT(place / 3, row);
        TEST_ASSERT_EQUAL_UINT(place % 3, col);
        TEST_ASSERT_EQUAL_UINT(place == 1 ? 1 : 0, turn);
    }
}

static void ids_that_are_not_on_the_target_are_not_found(void)
{
    TEST_ASSERT_EQUAL_INT(TARGET_OK, target_prepare(&target, &bad_place));
    uint16_t row = 99;
    uint16_t col = 99;
    uint8_t turn = 99;
    TEST_ASSERT_FALSE(target_find(&target, 1, &row, &col, &turn));
    TEST_ASSERT_FALSE(target_find(&target, 4096, &row, &col, &turn));
    TEST_ASSERT_FALSE(target_find(&target, 65535, &row, &col, &turn));
    TEST_ASSERT_EQUAL_UINT(99, row);
}

static void a_target_of_all_4096_patches_is_prepared_and_found(void)
{
    target.rows = 64;
    target.cols = 64;
    for (unsigned place = 0; place < 4096; place++) {
        target.ids[place] = (uint16_t)(4095 - place);
    }
    TEST_ASSERT_EQUAL_INT(TARGET_OK, target_prepare(&target, &bad_place));
    uint16_t row = 0;
    uint16_t col = 0;
    uint8_t turn = 0;
    TEST_ASSERT_TRUE(target_find(&target, 0, &row, &col, &turn));
    TEST_ASSERT_EQUAL_UINT(63, row);
    TEST_ASSERT_EQUAL_UINT(63, col);
}

static void preparing_again_forgets_the_old_ids(void)
{
    TEST_ASSERT_EQUAL_INT(TARGET_OK, target_prepare(&target, &bad_place));
    target.ids[0] = 8;
    TEST_ASSERT_EQUAL_INT(TARGET_OK, target_prepare(&target, &bad_place));
    uint16_t row = 0;
    uint16_t col = 0;
    uint8_t turn = 0;
    TEST_ASSERT_FALSE(target_find(&target, 7, &row, &col, &turn));
    TEST_ASSERT_TRUE(target_find(&target, 8, &row, &col, &turn));
}

static void an_id_that_stands_twice_is_refused_with_its_second_place(void)
{
    target.ids[4] = 4095;
    TEST_ASSERT_EQUAL_INT(TARGET_SAME_ID, target_prepare(&target, &bad_place));
    TEST_ASSERT_EQUAL_UINT(4, bad_place);
}

static void an_id_above_4095_is_refused(void)
{
    target.ids[5] = 4096;
    TEST_ASSERT_EQUAL_INT(TARGET_BAD_ID, target_prepare(&target, &bad_place));
    TEST_ASSERT_EQUAL_UINT(5, bad_place);
}

static void a_turn_other_than_0_and_1_is_refused(void)
{
    target.turns[2] = 2;
    TEST_ASSERT_EQUAL_INT(TARGET_BAD_TURN, target_prepare(&target, &bad_place));
    TEST_ASSERT_EQUAL_UINT(2, bad_place);
}

static void sizes_out_of_range_are_refused(void)
{
    const uint16_t sizes[][2] = {{0, 3}, {2, 0}, {65, 64}, {4096, 4096}, {1, 4097}};
    for (unsigned i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        target.rows = sizes[i][0];
        target.cols = sizes[i][1];
        TEST_ASSERT_EQUAL_INT(TARGET_BAD_SIZE, target_prepare(&target, &bad_place));
    }
    setUp();
    target.patch_nm = 0;
    TEST_ASSERT_EQUAL_INT(TARGET_BAD_SIZE, target_prepare(&target, &bad_place));
}

static void levels_other_than_2_and_3_are_refused(void)
{
    target.levels = 1;
    TEST_ASSERT_EQUAL_INT(TARGET_BAD_LEVELS, target_prepare(&target, &bad_place));
    target.levels = 4;
    TEST_ASSERT_EQUAL_INT(TARGET_BAD_LEVELS, target_prepare(&target, &bad_place));
    target.levels = 3;
    TEST_ASSERT_EQUAL_INT(TARGET_OK, target_prepare(&target, &bad_place));
}

static void circles_out_of_range_are_refused(void)
{
    target.circle_ratio_q16 = 65537;
    TEST_ASSERT_EQUAL_INT(TARGET_BAD_CIRCLE, target_prepare(&target, &bad_place));
    setUp();
    target.edge_level_q16 = 0;
    TEST_ASSERT_EQUAL_INT(TARGET_BAD_CIRCLE, target_prepare(&target, &bad_place));
    setUp();
    target.gauss_sigma_q16 = 0;
    TEST_ASSERT_EQUAL_INT(TARGET_BAD_CIRCLE, target_prepare(&target, &bad_place));
}

static void the_digest_is_the_documented_one(void)
{
    /* FNV-1a of the bytes that target.h lists, worked out by hand:
     * python3 -c "
     * import struct
     * b = struct.pack('<HHBIIIQ', 2, 3, 2, 32768, 52429, 26214, 100000000)
     * for i, t in zip((7, 4095, 0, 20, 21, 22), (0, 1, 0, 0, 0, 0)): b += struct.pack('<HB', i, t)
     * h = 0xcbf29ce484222325
     * for x in b: h = (h ^ x) * 0x100000001b3 % 2**64
     * print(hex(h))" */
    TEST_ASSERT_TRUE(target_digest(&target) == UINT64_C(0x47bb0718d7bf783f));
}

static void the_digest_changes_with_everything_that_shapes_the_pattern(void)
{
    uint64_t digests[10];
    const unsigned count = sizeof digests / sizeof digests[0];
    for (unsigned i = 0; i < count; i++) {
        setUp();
        switch (i) {
        case 1:
            target.rows = 3;
            target.cols = 2;
            break;
        case 2:
            target.levels = 3;
            break;
        case 3:
            target.circle_ratio_q16++;
            break;
        case 4:
            target.edge_level_q16++;
            break;
        case 5:
            target.gauss_sigma_q16++;
            break;
        case 6:
            target.patch_nm++;
            break;
        case 7:
            target.ids[5] = 23;
            break;
        case 8:
            target.turns[5] = 1;
            break;
        case 9:
            target.ids[0] = 4095;
            target.ids[1] = 7;
            break;
        default:
            break;
        }
        digests[i] = target_digest(&target);
        for (unsigned other = 0; other < i; other++) {
            TEST_ASSERT_TRUE(digests[other] != digests[i]);
        }
    }
}

static void the_digest_ignores_the_name_and_what_lies_beyond_the_grid(void)
{
    const uint64_t before = target_digest(&target);
    strcpy(target.name, "another");
    target.ids[6] = 99;
    target.turns[6] = 1;
    TEST_ASSERT_TRUE(target_digest(&target) == before);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(patches_are_found_by_id_with_row_column_and_turn);
    RUN_TEST(ids_that_are_not_on_the_target_are_not_found);
    RUN_TEST(a_target_of_all_4096_patches_is_prepared_and_found);
    RUN_TEST(preparing_again_forgets_the_old_ids);
    RUN_TEST(an_id_that_stands_twice_is_refused_with_its_second_place);
    RUN_TEST(an_id_above_4095_is_refused);
    RUN_TEST(a_turn_other_than_0_and_1_is_refused);
    RUN_TEST(sizes_out_of_range_are_refused);
    RUN_TEST(levels_other_than_2_and_3_are_refused);
    RUN_TEST(circles_out_of_range_are_refused);
    RUN_TEST(the_digest_is_the_documented_one);
    RUN_TEST(the_digest_changes_with_everything_that_shapes_the_pattern);
    RUN_TEST(the_digest_ignores_the_name_and_what_lies_beyond_the_grid);
    return UNITY_END();
}
