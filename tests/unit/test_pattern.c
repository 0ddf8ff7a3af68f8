/* What is printed around a circle, by patches whose colours can be told without the code. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "firmware/detect/pattern.h"

#define SIDE_PX 100.0

static struct target target;
static struct boardmap map;

/* The board at 100 px a side, unturned, its origin at (200, 150). */
void setUp(void)
{
    static struct boardmap_pair pairs[25];
    for (int i = 0; i < 25; i++) {
        const int u = i % 5;
        const int v = i / 5;
        pairs[i] = (struct boardmap_pair){
            .u_q24 = (int64_t)u << 23,
            .v_q24 = (int64_t)v << 23,
            .x_px_q16 = (200 + 50 * u) * 65536,
            .y_px_q16 = (150 + 50 * v) * 65536,
        };
    }
    TEST_ASSERT_TRUE(boardmap_fit(pairs, 25, &map));
}
void tearDown(void) {}

static void make_target(uint16_t left, uint16_t right, uint8_t right_turn)
{
    unsigned bad;
    memset(&target, 0, sizeof target);
    target.rows = 1;
    target.cols = 2;
    target.levels = 2;
    target.circle_ratio_q16 = 32768;
    target.edge_level_q16 = 52429;
    target.gauss_sigma_q16 = 26214;
    target.patch_nm = 100000000;
    target.ids[0] = left;
    target.ids[1] = right;
    target.turns[1] = right_turn;
    TEST_ASSERT_EQUAL_INT(TARGET_OK, target_prepare(&target, &bad));
}

static struct pattern_patch left_patch(bool with_target, uint16_t id)
{
    return (struct pattern_patch){
        .target = with_target ? &target : NULL, .levels = 2, .id = id, .row = 0, .col = 0,
    };
}

static void patch_of_one_colour_has_no_edges_inside(void)
{
    /* All twelve bits set: all small triangles black, and the parity is even, so the anchor is black too. */
    struct pattern_patch patch = left_patch(false, 0xfff);
    for (unsigned i = 0; i < LAYOUT_FEATURES_LEVEL2; i++) {
        struct pattern_edges edges;
        pattern_edges_of(&patch, i, &map, &edges);
        TEST_ASSERT_EQUAL_UINT(0, edges.count);
    }
}

static void white_triangles_meet_the_black_anchor_in_one_edge_each(void)
{
    /* No bit set: small triangles white, the anchor black. Its legs each border on two small triangles,
     * those whose circles lie nearest to it. */
    struct pattern_patch patch = left_patch(false, 0);
    unsigned edges_in_all = 0;
    for (unsigned i = 1; i < LAYOUT_FEATURES_LEVEL2; i++) {
        struct pattern_edges edges;
        pattern_edges_of(&patch, i, &map, &edges);
        TEST_ASSERT_TRUE(edges.count <= 1);
        edges_in_all += edges.count;
    }
    TEST_ASSERT_EQUAL_UINT(4, edges_in_all);
}

static void edge_lies_an_inradius_from_the_circle(void)
{
    struct pattern_patch patch = left_patch(false, 0);
    for (unsigned i = 1; i < LAYOUT_FEATURES_LEVEL2; i++) {
        struct pattern_edges edges;
        pattern_edges_of(&patch, i, &map, &edges);
        for (unsigned k = 0; k < edges.count; k++) {
            const struct layout_feature *f = layout_feature(2, i);
            const double x = 200 + SIDE_PX * f->u_q30 / 1073741824.0;
            const double y = 150 + SIDE_PX * f->v_q30 / 1073741824.0;
            const struct pattern_edge *e = &edges.at[k];
            const double inside = e->nx_q15 / 32768.0 * (x - e->x_px_q16 / 65536.0) +
                                  e->ny_q15 / 32768.0 * (y - e->y_px_q16 / 65536.0);
            /* The normal is held in 15 bits, the offsets are below 50 px: 50 / 2^15. */
            TEST_ASSERT_TRUE(fabs(inside - SIDE_PX * f->inradius_q30 / 1073741824.0) < 0.002);
        }
    }
}

static void beyond_the_patch_nothing_is_known_without_a_target(void)
{
    struct pattern_patch patch = left_patch(false, 0);
    unsigned unknown = 0;
    for (unsigned i = 1; i < LAYOUT_FEATURES_LEVEL2; i++) {
        struct pattern_edges edges;
        pattern_edges_of(&patch, i, &map, &edges);
        unknown += edges.known ? 0 : 1;
    }
    /* Two of each quarter's four small triangles lie on the patch's side. */
    TEST_ASSERT_EQUAL_UINT(6, unknown);
}

static void margin_and_neighbour_are_known_with_a_target(void)
{
    /* Black throughout on the left; white on the right, its black anchor at the top or, turned, at the
     * bottom. The board's own border is white margin: every border edge of the left patch is an edge. */
    for (uint8_t turn = 0; turn < 2; turn++) {
        make_target(0xfff, 0, turn);
        struct pattern_patch patch = left_patch(true, 0xfff);
        unsigned edges_in_all = 0;
        for (unsigned i = 1; i < LAYOUT_FEATURES_LEVEL2; i++) {
            struct pattern_edges edges;
            pattern_edges_of(&patch, i, &map, &edges);
            TEST_ASSERT_TRUE(edges.known);
            edges_in_all += edges.count;
        }
        TEST_ASSERT_EQUAL_UINT(6, edges_in_all);
    }
    /* Black on the right as well, but for one bit (the ids must differ): where that bit's triangle is the
     * innermost of its quarter (bit 11), the shared side is no edge; where it shares a half of the side (bit 10),
     * that half is. */
    static const struct {
        uint16_t right;
        unsigned edges;
    } cases[] = {{0x7ff, 4}, {0xbff, 5}};
    for (unsigned c = 0; c < 2; c++) {
        make_target(0xfff, cases[c].right, 0);
        struct pattern_patch patch = left_patch(true, 0xfff);
        unsigned edges_in_all = 0;
        for (unsigned i = 1; i < LAYOUT_FEATURES_LEVEL2; i++) {
            struct pattern_edges edges;
            pattern_edges_of(&patch, i, &map, &edges);
            edges_in_all += edges.count;
        }
        TEST_ASSERT_EQUAL_UINT(cases[c].edges, edges_in_all);
    }
}

/* Whether the triangle that holds (u, v) is of another colour than feature 0's. */
static bool is_other(uint16_t id, double u, double v)
{
    for (unsigned i = 0; i < LAYOUT_FEATURES_LEVEL2; i++) {
        const struct layout_feature *f = layout_feature(2, i);
        bool inside = true;
        for (unsigned k = 0; k < 3; k++) {
            const unsigned next = (k + 1) % 3;
            const double du = f->corner_u_8th[next] - f->corner_u_8th[k];
            const double dv = f->corner_v_8th[next] - f->corner_v_8th[k];
            inside = inside && du * (8 * v - f->corner_v_8th[k]) - dv * (8 * u - f->corner_u_8th[k]) > 0;
        }
        if (inside) {
            return layout_circle_is_white(2, id, i) != layout_circle_is_white(2, id, 0);
        }
    }
    TEST_FAIL_MESSAGE("a place outside of the patch");
    return false;
}

/* By the edge and its rays: the share of the other colour there. */
static int other_by(const struct pattern_edge *edge, double x, double y)
{
    int other = edge->other ? 1 : 0;
    for (unsigned i = 0; i < edge->ray_count; i++) {
        const struct pattern_ray *ray = &edge->rays[i];
        other += ray->nx_q15 * (x - edge->x_px_q16 / 65536.0) +
                         ray->ny_q15 * (y - edge->y_px_q16 / 65536.0) > 0
                     ? ray->step
                     : 0;
    }
    return other;
}

static void rays_part_the_colours_behind_an_anchor_s_legs(void)
{
    unsigned rays = 0;
    for (unsigned id = 0; id < LAYOUT_IDS; id += 37) {
        struct pattern_patch patch = left_patch(false, (uint16_t)id);
        struct pattern_edges edges;
        pattern_edges_of(&patch, LAYOUT_ANCHOR, &map, &edges);
        TEST_ASSERT_FALSE(edges.known); /* the third side is the patch's */
        for (unsigned k = 0; k < edges.count; k++) {
            const struct pattern_edge *edge = &edges.at[k];
            rays += edge->ray_count;
            /* Half a leg is 35 px long; all around behind it, beside the multiples of 45 degrees. */
            for (int degrees = 4; degrees < 180; degrees += 11) {
                const double turn = degrees * 3.14159265358979 / 180 + atan2(-edge->ny_q15, -edge->nx_q15) -
                                    3.14159265358979 / 2;
                const double x = edge->x_px_q16 / 65536.0 + 10 * cos(turn);
                const double y = edge->y_px_q16 / 65536.0 + 10 * sin(turn);
                TEST_ASSERT_EQUAL_INT(is_other((uint16_t)id, (x - 200) / SIDE_PX, (y - 150) / SIDE_PX),
                                      other_by(edge, x, y));
            }
        }
    }
    TEST_ASSERT_TRUE(rays > 100);
}

static void edges_move_with_their_circle(void)
{
    struct pattern_patch patch = left_patch(false, 1); /* an odd parity: a white anchor with two legs */
    struct pattern_edges edges;
    pattern_edges_of(&patch, 1, &map, &edges);
    const struct pattern_edges before = edges;
    pattern_edges_move(&edges, before.x_px_q16 + 1000, before.y_px_q16 - 500);
    TEST_ASSERT_TRUE(edges.count > 0);
    for (unsigned k = 0; k < edges.count; k++) {
        TEST_ASSERT_EQUAL_INT32(before.at[k].x_px_q16 + 1000, edges.at[k].x_px_q16);
        TEST_ASSERT_EQUAL_INT32(before.at[k].y_px_q16 - 500, edges.at[k].y_px_q16);
        TEST_ASSERT_EQUAL_INT32(before.at[k].nx_q15, edges.at[k].nx_q15);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(patch_of_one_colour_has_no_edges_inside);
    RUN_TEST(white_triangles_meet_the_black_anchor_in_one_edge_each);
    RUN_TEST(edge_lies_an_inradius_from_the_circle);
    RUN_TEST(beyond_the_patch_nothing_is_known_without_a_target);
    RUN_TEST(margin_and_neighbour_are_known_with_a_target);
    RUN_TEST(rays_part_the_colours_behind_an_anchor_s_legs);
    RUN_TEST(edges_move_with_their_circle);
    return UNITY_END();
}
