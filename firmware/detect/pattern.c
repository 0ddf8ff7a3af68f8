/* Colours behind an edge are those of the triangles that hold points a little beyond the edge's middle. Behind a
 * small circle's edge there is one; behind each of the anchor's, three meet. */
#include "firmware/detect/pattern.h"

#include <stddef.h>

#include "common/fx/fx.h"
#include "common/fx/root.h"

#define ONE_Q24 ((int64_t)1 << 24)

enum colour { COLOUR_BLACK, COLOUR_WHITE, COLOUR_UNKNOWN };

void pattern_to_board(const struct pattern_patch *patch, int64_t u_q24, int64_t v_q24,
                      int64_t *board_u_q24, int64_t *board_v_q24)
{
    *board_u_q24 = ((int64_t)patch->col << 24) + (patch->turned ? ONE_Q24 - u_q24 : u_q24);
    *board_v_q24 = ((int64_t)patch->row << 24) + (patch->turned ? ONE_Q24 - v_q24 : v_q24);
}

/* The colour of the triangle of patch `id` that holds (u, v). */
static enum colour colour_in_patch(unsigned levels, uint16_t id, int32_t u_q24, int32_t v_q24)
{
    const unsigned feature = layout_feature_at(levels, u_q24, v_q24);
    return layout_circle_is_white(levels, id, feature) ? COLOUR_BLACK : COLOUR_WHITE;
}

static enum colour colour_at(const struct pattern_patch *patch, int64_t u_q24, int64_t v_q24)
{
    if (u_q24 >= 0 && v_q24 >= 0 && u_q24 <= ONE_Q24 && v_q24 <= ONE_Q24) {
        return colour_in_patch(patch->levels, patch->id, (int32_t)u_q24, (int32_t)v_q24);
    }
    const struct target *target = patch->target;
    if (target == NULL) {
        return COLOUR_UNKNOWN;
    }
    int64_t board_u;
    int64_t board_v;
    pattern_to_board(patch, u_q24, v_q24, &board_u, &board_v);
    if (board_u < 0 || board_v < 0 || board_u >= (int64_t)target->cols << 24 ||
        board_v >= (int64_t)target->rows << 24) {
        return COLOUR_WHITE; /* the margin */
    }
    const unsigned place = (unsigned)(board_v >> 24) * target->cols + (unsigned)(board_u >> 24);
    int32_t u = (int32_t)(board_u & (ONE_Q24 - 1));
    int32_t v = (int32_t)(board_v & (ONE_Q24 - 1));
    if (target->turns[place] != 0) {
        u = (int32_t)ONE_Q24 - u;
        v = (int32_t)ONE_Q24 - v;
    }
    return colour_in_patch(target->levels, target->ids[place], u, v);
}

/* The normal of the line through two image points, turned towards the third. False when they are one. */
static bool find_normal(const struct boardmap_point *a, const struct boardmap_point *b,
                        const struct boardmap_point *inside, int32_t *nx_q15, int32_t *ny_q15)
{
    int64_t nx = a->y_q16 - b->y_q16;
    int64_t ny = b->x_q16 - a->x_q16;
    if (fx_abs_i64(nx) > INT32_MAX / 2 || fx_abs_i64(ny) > INT32_MAX / 2) {
        return false;
    }
    const int64_t length = root_u64((uint64_t)(nx * nx) + (uint64_t)(ny * ny));
    if (length < 65536) {
        return false;
    }
    const int64_t towards = nx * ((inside->x_q16 - a->x_q16) >> 8) +
                            ny * ((inside->y_q16 - a->y_q16) >> 8);
    const int64_t sign = towards < 0 ? -32768 : 32768;
    *nx_q15 = (int32_t)(nx * sign / length);
    *ny_q15 = (int32_t)(ny * sign / length);
    return true;
}

/* One side of a triangle in the patch's frame: its middle, half of it from there to the second corner, and as
 * much outwards. Sides run along multiples of 45 degrees, and so do those of the triangles behind. */
struct side {
    int64_t u_q24;
    int64_t v_q24;
    int64_t along_u_q24;
    int64_t along_v_q24;
};

static struct side make_side(const struct layout_feature *f, unsigned first, unsigned second)
{
    return (struct side){
        .u_q24 = ((int64_t)f->corner_u_8th[first] + f->corner_u_8th[second]) << 20,
        .v_q24 = ((int64_t)f->corner_v_8th[first] + f->corner_v_8th[second]) << 20,
        .along_u_q24 = ((int64_t)f->corner_u_8th[second] - f->corner_u_8th[first]) * (1 << 20),
        .along_v_q24 = ((int64_t)f->corner_v_8th[second] - f->corner_v_8th[first]) * (1 << 20),
    };
}

/* The place `along` and `out` sixteenths from a side's middle; corners run clockwise, so that outside is on the
 * left. */
static void beside(const struct side *side, int64_t along, int64_t out, int64_t *u_q24, int64_t *v_q24)
{
    *u_q24 = side->u_q24 + (along * side->along_u_q24 + out * side->along_v_q24) / 16;
    *v_q24 = side->v_q24 + (along * side->along_v_q24 - out * side->along_u_q24) / 16;
}

static struct boardmap_point point_at(const struct pattern_patch *patch, const struct boardmap *map,
                                      int64_t u_q24, int64_t v_q24)
{
    int64_t board_u;
    int64_t board_v;
    pattern_to_board(patch, u_q24, v_q24, &board_u, &board_v);
    return boardmap_point_at(map, board_u, board_v);
}

/* Whether no triangles are smaller than the feature's: then there is one behind each side. */
static bool is_smallest(unsigned levels, unsigned feature)
{
    return feature != LAYOUT_ANCHOR && (levels == 2 || feature >= LAYOUT_FEATURES_LEVEL2);
}

/* Looks behind a side: into the four sectors of 45 degrees around its middle, from the second corner's end on; into
 * one of them where all are the same. False where a colour there is not known. */
static bool look_behind(const struct pattern_patch *patch, const struct boardmap *map,
                        const struct side *side, bool same, enum colour own,
                        const struct boardmap_point *first_corner, struct pattern_edge *edge)
{
    static const int8_t sectors[PATTERN_RAYS + 1][2] = {{2, 1}, {1, 2}, {-1, 2}, {-2, 1}};
    static const int8_t rays[PATTERN_RAYS][2] = {{16, 16}, {0, 16}, {-16, 16}};
    const unsigned last = same ? 0 : PATTERN_RAYS;
    bool other[PATTERN_RAYS + 1];
    int64_t u_q24;
    int64_t v_q24;
    for (unsigned i = 0; i <= last; i++) {
        beside(side, sectors[i][0], sectors[i][1], &u_q24, &v_q24);
        const enum colour colour = colour_at(patch, u_q24, v_q24);
        if (colour == COLOUR_UNKNOWN) {
            return false;
        }
        other[i] = colour != own;
    }
    edge->other = other[0];
    edge->ray_count = 0;
    for (unsigned i = 0; i < last; i++) {
        struct pattern_ray *ray = &edge->rays[edge->ray_count];
        if (other[i] == other[i + 1]) {
            continue;
        }
        const struct boardmap_point middle = point_at(patch, map, side->u_q24, side->v_q24);
        beside(side, rays[i][0], rays[i][1], &u_q24, &v_q24);
        const struct boardmap_point end = point_at(patch, map, u_q24, v_q24);
        if (find_normal(&middle, &end, first_corner, &ray->nx_q15, &ray->ny_q15)) {
            ray->step = other[i + 1] ? 1 : -1;
            edge->ray_count++;
        }
    }
    return true;
}

void pattern_edges_of(const struct pattern_patch *patch, unsigned feature,
                      const struct boardmap *map, struct pattern_edges *out)
{
    const struct layout_feature *f = layout_feature(patch->levels, feature);
    const enum colour own =
        layout_circle_is_white(patch->levels, patch->id, feature) ? COLOUR_BLACK : COLOUR_WHITE;
    const bool same = is_smallest(patch->levels, feature);
    struct boardmap_point corners[3];
    const struct boardmap_point centre = point_at(patch, map, f->u_q30 >> 6, f->v_q30 >> 6);
    for (unsigned i = 0; i < 3; i++) {
        corners[i] = point_at(patch, map, (int64_t)f->corner_u_8th[i] << 21,
                              (int64_t)f->corner_v_8th[i] << 21);
    }
    out->count = 0;
    out->known = true;
    out->x_px_q16 = fx_saturate_i32(centre.x_q16);
    out->y_px_q16 = fx_saturate_i32(centre.y_q16);
    for (unsigned i = 0; i < 3; i++) {
        const unsigned next = (i + 1) % 3;
        const struct side side = make_side(f, i, next);
        struct pattern_edge *edge = &out->at[out->count];
        if (!look_behind(patch, map, &side, same, own, &corners[i], edge)) {
            out->known = false;
        } else if ((edge->other || edge->ray_count > 0) &&
                   find_normal(&corners[i], &corners[next], &centre, &edge->nx_q15, &edge->ny_q15)) {
            edge->x_px_q16 = fx_saturate_i32((corners[i].x_q16 + corners[next].x_q16) / 2);
            edge->y_px_q16 = fx_saturate_i32((corners[i].y_q16 + corners[next].y_q16) / 2);
            out->count++;
        }
    }
}

void pattern_edges_move(struct pattern_edges *edges, int32_t x_px_q16, int32_t y_px_q16)
{
    for (unsigned i = 0; i < edges->count; i++) {
        struct pattern_edge *edge = &edges->at[i];
        edge->x_px_q16 = fx_saturate_i32((int64_t)edge->x_px_q16 + x_px_q16 - edges->x_px_q16);
        edge->y_px_q16 = fx_saturate_i32((int64_t)edge->y_px_q16 + y_px_q16 - edges->y_px_q16);
    }
}
