/* Edges by cell, what patches explain of them, and anchors that were not named. */
#include "firmware/detect/survey.h"

#include <stdlib.h>
#include <string.h>
#include <unity.h>

#define WIDTH  640u /* of the frame: 10 x 8 cells of 64 px, the last column's and row's cut */
#define HEIGHT 460u
#define COLUMNS 10u
#define ROWS    8u

static struct survey survey;
static void *memory;

void setUp(void)
{
    struct arena arena = {0};
    survey_init(&survey, &arena, WIDTH, HEIGHT);
    memory = malloc(arena.used);
    TEST_ASSERT_NOT_NULL(memory);
    memset(memory, 0x5a, arena.used);
    arena = (struct arena){.base = memory, .size = arena.used};
    survey_init(&survey, &arena, WIDTH, HEIGHT);
    survey_begin(&survey);
}
void tearDown(void)
{
    free(memory);
    memory = NULL;
}

/* Points between columns c and c + 1 of row y of the halved frame, every `step` from the first column to before the
 * last. */
static void count_row(unsigned y, unsigned first, unsigned last, unsigned step)
{
    static struct edge across[WIDTH / 2];
    struct edge_row row = {.across = across};
    for (unsigned column = first; column < last; column += step) {
        across[row.across_count++] = (struct edge){.column = (uint16_t)column};
    }
    survey_count(&survey, &row, y);
}

/* 32 points in every cell. */
static void fill_cells(void)
{
    for (unsigned y = 0; y < HEIGHT / 2; y += SURVEY_CELL_PX) {
        count_row(y, 0, WIDTH / 2, 1);
    }
}

static void points_are_counted_in_the_cell_they_lie_in(void)
{
    TEST_ASSERT_EQUAL_UINT(COLUMNS, survey.columns);
    TEST_ASSERT_EQUAL_UINT(ROWS, survey.rows);
    count_row(0, 31, 33, 1); /* the last column of a cell and the first of the next */
    count_row(31, 31, 32, 1);
    count_row(32, 31, 32, 1);
    count_row(HEIGHT / 2 - 1, WIDTH / 2 - 1, WIDTH / 2, 1);
    uint16_t expected[COLUMNS * ROWS] = {2, 1};
    expected[COLUMNS] = 1;
    expected[COLUMNS * ROWS - 1] = 1;
    TEST_ASSERT_EQUAL_UINT16_ARRAY(expected, survey.edges, COLUMNS * ROWS);
    survey_begin(&survey);
    memset(expected, 0, sizeof expected);
    TEST_ASSERT_EQUAL_UINT16_ARRAY(expected, survey.edges, COLUMNS * ROWS);
}

static void cell_of_a_triangles_edge_is_left_and_one_of_few_points_is_not(void)
{
    count_row(70, 64, 79, 1); /* 15 */
    TEST_ASSERT_EQUAL_UINT32(0, survey_left(&survey));
    count_row(71, 64, 65, 1); /* half of what an edge through a cell gives */
    TEST_ASSERT_EQUAL_UINT32(1, survey_left(&survey));
    for (unsigned y = 96; y < 128; y++) {
        count_row(y, 100, 101, 1);
    }
    TEST_ASSERT_EQUAL_UINT32(2, survey_left(&survey));
}

/* Every pixel of a cell a point, as far as the type goes. */
static void fullest_cell_does_not_overflow(void)
{
    for (unsigned y = 0; y < SURVEY_CELL_PX; y++) {
        count_row(y, 0, SURVEY_CELL_PX, 1);
    }
    TEST_ASSERT_EQUAL_UINT16(1024, survey.edges[0]);
}

/* One feature at (x, y) px of the frame whose patch has a side of `side` px, in a list of one patch or none. */
static void explain(int x, int y, int side, uint32_t count)
{
    static struct mark mark;
    static struct patch patch;
    static struct patches patches;
    const struct marks marks = {.at = &mark, .count = 1, .size = 1};
    const unsigned feature = 5;
    patch.feature_count = 1;
    for (unsigned i = 0; i < LAYOUT_FEATURES_MAX; i++) {
        patch.marks[i] = MARKS_NONE;
        patches.slots[i].radius_q20 = 1; /* would explain everything */
    }
    patch.marks[feature] = 0;
    patches.at = &patch;
    patches.count = count;
    patches.size = 1;
    patches.settings.levels = 2;
    patches.slots[feature].radius_q20 = 1 << 16; /* a sixteenth of the side */
    mark.ellipse.x_px_q16 = x * 65536;
    mark.ellipse.y_px_q16 = y * 65536;
    mark.size_px_q16 = (uint32_t)side * 4096;
    survey_explain(&survey, &patches, &marks);
}

/* Cells of 64 px of the frame, from (left, top) to (right, bottom), are explained and no others. */
static void check_explained(unsigned left, unsigned top, unsigned right, unsigned bottom)
{
    for (unsigned row = 0; row < ROWS; row++) {
        for (unsigned column = 0; column < COLUMNS; column++) {
            const bool inside = column >= left && column <= right && row >= top && row <= bottom;
            TEST_ASSERT_EQUAL_UINT16(inside ? 0 : 32, survey.edges[row * COLUMNS + column]);
        }
    }
    TEST_ASSERT_EQUAL_UINT32(COLUMNS * ROWS - (right - left + 1) * (bottom - top + 1),
                             survey_left(&survey));
}

static void cells_three_quarters_of_a_side_around_features_are_explained(void)
{
    fill_cells();
    explain(320, 200, 80, 0); /* no patch */
    TEST_ASSERT_EQUAL_UINT32(COLUMNS * ROWS, survey_left(&survey));
    explain(320, 200, 80, 1); /* 260..380, 140..260 */
    check_explained(4, 2, 5, 4);
}

static void reach_ends_where_the_cell_does(void)
{
    fill_cells();
    explain(256 + 60, 128 + 60, 80, 1); /* 256..376, 128..248: just in */
    check_explained(4, 2, 5, 3);
    survey_begin(&survey);
    fill_cells();
    explain(256 + 59, 128 + 59, 80, 1); /* 255.., 127..: one cell more */
    check_explained(3, 1, 5, 3);
}

static void features_at_the_frames_border_explain_what_is_there(void)
{
    fill_cells();
    explain(5, 3, 80, 1);
    check_explained(0, 0, 1, 0);
    survey_begin(&survey);
    fill_cells();
    explain(WIDTH - 1, HEIGHT + 30, 160, 1); /* 519..759, 370..610 */
    check_explained(8, 5, 9, 7);
}

/* Anchors 100 px apart, and room behind them for what the lattice adds. */
#define ANCHORS 20u
static struct mark list[ANCHORS + 4];
static const struct marks all = {.at = list, .count = ANCHORS + 4, .size = ANCHORS + 4};

static void make_marks(unsigned named)
{
    memset(list, 0, sizeof list);
    for (unsigned i = 0; i < ANCHORS; i++) {
        list[i].ellipse.x_px_q16 = (int32_t)(100 + 100 * i) << 16;
        list[i].ellipse.y_px_q16 = 100 << 16;
        list[i].size_px_q16 = 20 << 16;
        list[i].large = true;
        list[i].contrast_q30 = i < named ? -5 : 0; /* named and fitted */
    }
}

static void many_anchors_without_a_name_are_missed(void)
{
    make_marks(ANCHORS);
    TEST_ASSERT_FALSE(survey_misses_anchors(&all, ANCHORS));
    make_marks(ANCHORS - 2); /* two are few */
    TEST_ASSERT_FALSE(survey_misses_anchors(&all, ANCHORS));
    make_marks(ANCHORS - 3); /* more than an eighth of the 17 others */
    TEST_ASSERT_TRUE(survey_misses_anchors(&all, ANCHORS));
    TEST_ASSERT_FALSE(survey_misses_anchors(&all, ANCHORS - 3)); /* not among those that were classified */
    list[ANCHORS - 1].large = false; /* small ones are no anchors */
    TEST_ASSERT_FALSE(survey_misses_anchors(&all, ANCHORS));
}

/* The lattice finds circles again that have a mark already: half a radius in x and y is the same place. */
static void anchors_that_the_lattice_named_are_not_missed(void)
{
    make_marks(ANCHORS - 3);
    struct mark *added = &list[ANCHORS];
    added->contrast_q30 = 1;
    added->ellipse.x_px_q16 = list[ANCHORS - 1].ellipse.x_px_q16 + (10 << 16) - 1;
    added->ellipse.y_px_q16 = list[ANCHORS - 1].ellipse.y_px_q16 - (10 << 16) + 1;
    TEST_ASSERT_FALSE(survey_misses_anchors(&all, ANCHORS));
    added->ellipse.x_px_q16++;
    TEST_ASSERT_TRUE(survey_misses_anchors(&all, ANCHORS));
    added->ellipse.x_px_q16--;
    added->ellipse.y_px_q16--;
    TEST_ASSERT_TRUE(survey_misses_anchors(&all, ANCHORS));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(points_are_counted_in_the_cell_they_lie_in);
    RUN_TEST(cell_of_a_triangles_edge_is_left_and_one_of_few_points_is_not);
    RUN_TEST(fullest_cell_does_not_overflow);
    RUN_TEST(cells_three_quarters_of_a_side_around_features_are_explained);
    RUN_TEST(reach_ends_where_the_cell_does);
    RUN_TEST(features_at_the_frames_border_explain_what_is_there);
    RUN_TEST(many_anchors_without_a_name_are_missed);
    RUN_TEST(anchors_that_the_lattice_named_are_not_missed);
    return UNITY_END();
}
