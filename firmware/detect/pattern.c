/* The colour behind an edge is that of the triangle that holds a point a little beyond the edge's middle.
 * The anchor's edges each border on two triangles; they are far enough from its circle not to matter. */
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

/* Twice the signed area of (a, b, p); corners in eighths, p in Q24. */
static int64_t side_of(const struct layout_feature *f, unsigned a, unsigned b, int64_t u_q24,
                       int64_t v_q24)
{
    const int64_t du = (int64_t)f->corner_u_8th[b] - f->corner_u_8th[a];
    const int64_t dv = (int64_t)f->corner_v_8th[b] - f->corner_v_8th[a];
    return du * (v_q24 - ((int64_t)f->corner_v_8th[a] << 21)) -
           dv * (u_q24 - ((int64_t)f->corner_u_8th[a] << 21));
}

/* The colour of the triangle of patch `id` that holds (u, v). */
static enum colour colour_in_patch(unsigned levels, uint16_t id, int64_t u_q24, int64_t v_q24)
{
    const unsigned features = layout_feature_count(levels);
    for (unsigned i = 0; i < features; i++) {
        const struct layout_feature *f = layout_feature(levels, i);
        /* Corners run clockwise as seen, y down: inside is on the right, positive. */
        if (side_of(f, 0, 1, u_q24, v_q24) >= 0 && side_of(f, 1, 2, u_q24, v_q24) >= 0 &&
            side_of(f, 2, 0, u_q24, v_q24) >= 0) {
            return layout_circle_is_white(levels, id, i) ? COLOUR_BLACK : COLOUR_WHITE;
        }
    }
    return COLOUR_UNKNOWN;
}

static enum colour colour_at(const struct pattern_patch *patch, int64_t u_q24, int64_t v_q24)
{
    if (u_q24 >= 0 && v_q24 >= 0 && u_q24 <= ONE_Q24 && v_q24 <= ONE_Q24) {
        return colour_in_patch(patch->levels, patch->id, u_q24, v_q24);
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
    int64_t u = board_u & (ONE_Q24 - 1);
    int64_t v = board_v & (ONE_Q24 - 1);
    if (target->turns[place] != 0) {
        u = ONE_Q24 - u;
        v = ONE_Q24 - v;
    }
    return colour_in_patch(target->levels, target->ids[place], u, v);
}

/* The line through two image points, its normal turned towards the third. False when they are one. */
static bool make_edge(const struct boardmap_place *a, const struct boardmap_place *b,
                      const struct boardmap_place *inside, struct pattern_edge *out)
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
    nx = towards < 0 ? -nx : nx;
    ny = towards < 0 ? -ny : ny;
    *out = (struct pattern_edge){
        .x_px_q16 = fx_saturate_i32((a->x_q16 + b->x_q16) / 2),
        .y_px_q16 = fx_saturate_i32((a->y_q16 + b->y_q16) / 2),
        .nx_q15 = (int32_t)(nx * 32768 / length),
        .ny_q15 = (int32_t)(ny * 32768 / length),
    };
    return true;
}

void pattern_edges_of(const struct pattern_patch *patch, unsigned feature,
                      const struct boardmap *map, struct pattern_edges *out)
{
    out->count = 0;
    out->known = false;
    if (feature == LAYOUT_ANCHOR) {
        return;
    }
    const struct layout_feature *f = layout_feature(patch->levels, feature);
    const enum colour own =
        layout_circle_is_white(patch->levels, patch->id, feature) ? COLOUR_BLACK : COLOUR_WHITE;
    struct boardmap_place corners[3];
    struct boardmap_place centre;
    int64_t board_u;
    int64_t board_v;
    pattern_to_board(patch, f->u_q30 >> 6, f->v_q30 >> 6, &board_u, &board_v);
    boardmap_apply(map, board_u, board_v, &centre);
    for (unsigned i = 0; i < 3; i++) {
        pattern_to_board(patch, (int64_t)f->corner_u_8th[i] << 21,
                         (int64_t)f->corner_v_8th[i] << 21, &board_u, &board_v);
        boardmap_apply(map, board_u, board_v, &corners[i]);
    }
    out->known = true;
    for (unsigned i = 0; i < 3; i++) {
        const unsigned next = (i + 1) % 3;
        /* The edge's middle, and an eighth of the way from the centre to it beyond. */
        const int64_t middle_u =
            ((int64_t)f->corner_u_8th[i] + f->corner_u_8th[next]) << 20;
        const int64_t middle_v =
            ((int64_t)f->corner_v_8th[i] + f->corner_v_8th[next]) << 20;
        const enum colour beyond =
            colour_at(patch, middle_u + (middle_u - (f->u_q30 >> 6)) / 8,
                      middle_v + (middle_v - (f->v_q30 >> 6)) / 8);
        if (beyond == COLOUR_UNKNOWN) {
            out->known = false;
        } else if (beyond != own &&
                   make_edge(&corners[i], &corners[next], &centre, &out->at[out->count])) {
            out->count++;
        }
    }
}
