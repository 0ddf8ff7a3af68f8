/* Marks from ideal ellipses laid out by the target's geometry: doubles, large and small, sigma, search. */
#include "firmware/detect/marks.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "tests/unit/synth.h"

#define WIDTH  1200u
#define HEIGHT 900u
#define RATIO_Q8 512u /* two levels: large over small is 2 */

static struct ellipses ellipses;
static struct marks marks;
static void *memory;

static void take_all(struct arena *arena, unsigned width, unsigned height)
{
    ellipses_init(&ellipses, arena, width, height);
    marks_init(&marks, arena, width, height);
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
    ellipses_begin(&ellipses);
}

void setUp(void)
{
    start(WIDTH, HEIGHT);
}
void tearDown(void)
{
    free(memory);
    memory = NULL;
}

static struct ellipses_item *add(double x, double y, double xx, double xy, double yy, bool white)
{
    struct ellipses_item *item = &ellipses.at[ellipses.count++];
    TEST_ASSERT_TRUE(ellipses.count <= ellipses.size);
    *item = (struct ellipses_item){
        .ellipse = {(int32_t)lrint(x * 65536), (int32_t)lrint(y * 65536), (int32_t)lrint(xx * 4096),
                    (int32_t)lrint(xy * 4096), (int32_t)lrint(yy * 4096)},
        .gradient_mean_q3 = 4000,
        .white = white};
    return item;
}

static bool inside(const struct synth_circle *c)
{
    return c->x > 2 * c->size && c->y > 2 * c->size && c->x < WIDTH - 2 * c->size &&
           c->y < HEIGHT - 2 * c->size;
}

/* All features of a board of 8 x 6 patches; anchors first in `large`. Returns how many are anchors. */
static unsigned add_board(const struct synth_map *map)
{
    unsigned anchors = 0;
    for (unsigned place = 0; place < 48; place++) {
        const struct synth_patch patch = {.id = (uint16_t)(place * 83), .col = (int)(place % 8),
                                          .row = (int)(place / 8), .turned = place % 3 == 0};
        for (unsigned i = 0; i < 13; i++) {
            const struct synth_circle c = synth_feature(map, 2, &patch, i);
            if (inside(&c)) {
                add(c.x, c.y, c.shape_xx, c.shape_xy, c.shape_yy,
                    layout_circle_is_white(2, patch.id, i));
                anchors += i == 0;
            }
        }
    }
    return anchors;
}

static void classify(void)
{
    marks_classify(&ellipses, RATIO_Q8, &marks);
    TEST_ASSERT_TRUE(marks.count <= marks.size);
}

/* The mark at a place, or NULL. */
static const struct mark *mark_at(double x, double y)
{
    for (uint32_t i = 0; i < marks.count; i++) {
        const struct mark *m = &marks.at[i];
        if (hypot(m->ellipse.x_px_q16 / 65536.0 - x, m->ellipse.y_px_q16 / 65536.0 - y) < 0.01) {
            return m;
        }
    }
    return NULL;
}

static void large_and_small_are_told_apart_under_strong_perspective(void)
{
    static const double tilts[] = {0, 0.5, 0.9, 1.1};
    for (unsigned k = 0; k < 4; k++) {
        ellipses_begin(&ellipses);
        /* At 1.1 rad the nearest patches are imaged three times as large as the farthest, so that far
         * anchors are smaller than near bits. */
        const struct synth_map map = synth_view(1100, 10, 0.3, tilts[k], 4, 3, WIDTH / 2, HEIGHT / 2);
        const unsigned anchors = add_board(&map);
        TEST_ASSERT_TRUE(anchors > 20);
        classify();
        TEST_ASSERT_EQUAL_UINT32(ellipses.count, marks.count);
        unsigned large = 0;
        for (unsigned place = 0; place < 48; place++) {
            const struct synth_patch patch = {.id = (uint16_t)(place * 83), .col = (int)(place % 8),
                                              .row = (int)(place / 8), .turned = place % 3 == 0};
            for (unsigned i = 0; i < 13; i++) {
                const struct synth_circle c = synth_feature(&map, 2, &patch, i);
                if (inside(&c)) {
                    const struct mark *m = mark_at(c.x, c.y);
                    TEST_ASSERT_NOT_NULL(m);
                    TEST_ASSERT_EQUAL_INT(i == 0, m->large);
                    TEST_ASSERT_EQUAL_INT(layout_circle_is_white(2, patch.id, i), m->white);
                    /* ellipse.h's error of a size, and the shape's rounding (test_ellipse.c). */
                    SYNTH_NEAR(0.001, c.size, m->size_px_q16 / 65536.0);
                    large++;
                }
            }
        }
        TEST_ASSERT_EQUAL_UINT(ellipses.count, large);
    }
}

static void inner_ring_of_the_same_colour_is_dropped(void)
{
    const struct synth_map map = synth_view(1100, 10, 0.3, 0.4, 4, 3, WIDTH / 2, HEIGHT / 2);
    add_board(&map);
    const uint32_t count = ellipses.count;
    for (uint32_t i = 0; i < count; i += 3) {
        const struct ellipses_item *o = &ellipses.at[i];
        struct ellipses_item *ring = &ellipses.at[ellipses.count++];
        *ring = *o; /* the Gaussian peak's: 0.6 of the size, a little off */
        ring->ellipse.x_px_q16 += 9000;
        ring->ellipse.shape_xx_px2_q12 = (int32_t)(o->ellipse.shape_xx_px2_q12 * 0.36);
        ring->ellipse.shape_xy_px2_q12 = (int32_t)(o->ellipse.shape_xy_px2_q12 * 0.36);
        ring->ellipse.shape_yy_px2_q12 = (int32_t)(o->ellipse.shape_yy_px2_q12 * 0.36);
    }
    classify();
    TEST_ASSERT_EQUAL_UINT32(count, marks.count);
    for (uint32_t i = 0; i < count; i++) {
        const struct mark *m = mark_at(ellipses.at[i].ellipse.x_px_q16 / 65536.0,
                                       ellipses.at[i].ellipse.y_px_q16 / 65536.0);
        TEST_ASSERT_NOT_NULL(m);
        TEST_ASSERT_EQUAL_INT32(ellipses.at[i].ellipse.shape_xx_px2_q12, m->ellipse.shape_xx_px2_q12);
    }
}

static void outer_ring_of_the_other_colour_is_dropped(void)
{
    const struct synth_map map = synth_view(1100, 10, 0.3, 0.4, 4, 3, WIDTH / 2, HEIGHT / 2);
    add_board(&map);
    const uint32_t count = ellipses.count;
    for (uint32_t i = 0; i < count; i += 3) {
        const struct ellipses_item *o = &ellipses.at[i];
        struct ellipses_item *ring = &ellipses.at[ellipses.count++];
        *ring = *o; /* the triangle taken for an ellipse: 1.7 of the size, rounded by blur */
        ring->white = !o->white;
        ring->ellipse.y_px_q16 -= 20000;
        ring->ellipse.shape_xx_px2_q12 = (int32_t)(o->ellipse.shape_xx_px2_q12 * 2.9);
        ring->ellipse.shape_xy_px2_q12 = (int32_t)(o->ellipse.shape_xy_px2_q12 * 2.9);
        ring->ellipse.shape_yy_px2_q12 = (int32_t)(o->ellipse.shape_yy_px2_q12 * 2.9);
    }
    classify();
    TEST_ASSERT_EQUAL_UINT32(count, marks.count);
    for (uint32_t i = 0; i < count; i++) {
        TEST_ASSERT_NOT_NULL(mark_at(ellipses.at[i].ellipse.x_px_q16 / 65536.0,
                                     ellipses.at[i].ellipse.y_px_q16 / 65536.0));
    }
}

static void search_finds_exactly_what_lies_in_the_square(void)
{
    const struct synth_map map = synth_view(1100, 10, 0.3, 0.4, 4, 3, WIDTH / 2, HEIGHT / 2);
    add_board(&map);
    classify();
    uint64_t seed = 71;
    uint32_t out[700];
    for (unsigned round = 0; round < 400; round++) {
        const int32_t x = (int32_t)(65536 * ((WIDTH + 200) * synth_uniform(&seed) - 100));
        const int32_t y = (int32_t)(65536 * ((HEIGHT + 200) * synth_uniform(&seed) - 100));
        const uint32_t reach = (uint32_t)(65536 * 300 * synth_uniform(&seed) * synth_uniform(&seed));
        uint32_t expected = 0;
        for (uint32_t i = 0; i < marks.count; i++) {
            expected += (uint32_t)labs((long)marks.at[i].ellipse.x_px_q16 - x) <= reach &&
                        (uint32_t)labs((long)marks.at[i].ellipse.y_px_q16 - y) <= reach;
        }
        TEST_ASSERT_EQUAL_UINT32(expected, marks_near(&marks, x, y, reach, out, 700));
        for (uint32_t i = 0; i < expected; i++) {
            TEST_ASSERT_TRUE(out[i] < marks.count);
            TEST_ASSERT_TRUE((uint32_t)labs((long)marks.at[out[i]].ellipse.x_px_q16 - x) <= reach);
            for (uint32_t j = 0; j < i; j++) {
                TEST_ASSERT_TRUE(out[j] != out[i]);
            }
        }
        uint32_t few[3];
        TEST_ASSERT_EQUAL_UINT32(expected < 3 ? expected : 3, marks_near(&marks, x, y, reach, few, 3));
    }
}

static void no_ellipses_or_one_make_no_trouble(void)
{
    classify();
    TEST_ASSERT_EQUAL_UINT32(0, marks.count);
    uint32_t out[2];
    TEST_ASSERT_EQUAL_UINT32(0, marks_near(&marks, 0, 0, UINT32_MAX, out, 2));
    add(100, 100, 25, 0, 25, true);
    classify();
    TEST_ASSERT_EQUAL_UINT32(1, marks.count);
    start(1, 1);
    add(0, 0, 25, 0, 25, true);
    classify();
    TEST_ASSERT_EQUAL_UINT32(1, marks.count);
}

static void full_list_of_ellipses_all_become_marks(void)
{
    start(400, 400);
    uint64_t seed = 72;
    while (ellipses.count < ellipses.size) { /* any centre, inside the image or a little beside it */
        add(420 * synth_uniform(&seed) - 10, 420 * synth_uniform(&seed) - 10, 2, 0, 2, true);
    }
    classify();
    TEST_ASSERT_TRUE(marks.count <= ellipses.size);
    TEST_ASSERT_TRUE(marks.count > ellipses.size / 4); /* those that lie inside others are doubles */
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(large_and_small_are_told_apart_under_strong_perspective);
    RUN_TEST(inner_ring_of_the_same_colour_is_dropped);
    RUN_TEST(outer_ring_of_the_other_colour_is_dropped);
    RUN_TEST(search_finds_exactly_what_lies_in_the_square);
    RUN_TEST(no_ellipses_or_one_make_no_trouble);
    RUN_TEST(full_list_of_ellipses_all_become_marks);
    return UNITY_END();
}
