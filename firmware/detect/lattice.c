/* See lattice.h. Board places are in patch sides, Q24. */
#include "firmware/detect/lattice.h"

#include "common/fx/fx.h"
#include "firmware/detect/keysort.h"
#include "common/fx/root.h"

#define PAIRS_MAX      256u
#define ROUNDS_MAX     8u
#define REACH_CELLS    2
/* Circles of fewer blurs are held against the map through all around. It errs by some hundredths of a pixel, they by
 * three sigmas of at most 0.06. */
#define STRAYS_SIGMAS_Q8 640   /* 2.5 */
#define STRAYS_PX_Q16    10486 /* 0.16 */
#define STRAYS_SHARE     8u
#define STRAYS_CIRCLES_MIN 4u
#define ROOT_LIMIT_Q16 ((int64_t)600 << 16)
/* Light that changes by the full swing over fewer pixels is uneven: a circle of 6 px under a blur of 1 px is drawn by
 * 11 px times its slope's error, 0.001 px where that is all of it. */
#define UNEVEN_PX      8192

/* A patch and those around it. */
static const int8_t beside[9][2] = {{0, 0},  {-1, 0}, {1, 0},  {0, -1}, {0, 1},
                                    {-1, -1}, {-1, 1}, {1, -1}, {1, 1}};
/* By rings, and each of them by rows. */
#define OUTER_RING 9u
static const int8_t by_rings[25][2] = {
    {0, 0},
    {-1, -1}, {-1, 0}, {-1, 1}, {0, -1}, {0, 1}, {1, -1}, {1, 0}, {1, 1},
    {-2, -2}, {-2, -1}, {-2, 0}, {-2, 1}, {-2, 2}, {-1, -2}, {-1, 2}, {0, -2}, {0, 2},
    {1, -2}, {1, 2}, {2, -2}, {2, -1}, {2, 0}, {2, 1}, {2, 2}};

void lattice_init(struct lattice *lattice, struct arena *arena)
{
    lattice->patch_of = arena_take(arena, TARGET_PATCHES_MAX, sizeof(uint32_t));
    lattice->wanted = arena_take(arena, TARGET_PATCHES_MAX, sizeof(uint8_t));
    lattice->pairs = arena_take(arena, PAIRS_MAX, sizeof(struct boardmap_pair));
    lattice->added = 0;
    lattice->truncated = false;
}

/* Where a feature of the patch at (row, col) lies on the board. */
static void board_place(const struct target *target, unsigned row, unsigned col,
                        const struct layout_feature *at, int64_t *u_q24, int64_t *v_q24)
{
    const bool turned = target->turns[row * target->cols + col] != 0;
    const int64_t one = (int64_t)1 << 30;
    *u_q24 = ((int64_t)col << 24) + ((turned ? one - at->u_q30 : at->u_q30) >> 6);
    *v_q24 = ((int64_t)row << 24) + ((turned ? one - at->v_q30 : at->v_q30) >> 6);
}

/* Adds the features found in one patch. At three levels the thirteen of every level are plenty. */
static uint32_t gather_patch(const struct patch *patch, const struct target *target,
                             const struct marks *marks, unsigned row, unsigned col, uint32_t count,
                             struct boardmap_pair pairs[PAIRS_MAX])
{
    const struct layout_feature *features = layout_feature(target->levels, 0);
    for (unsigned i = 0; i < LAYOUT_FEATURES_LEVEL2 && count < PAIRS_MAX; i++) {
        if (patch->marks[i] != MARKS_NONE) {
            const struct ellipse *found = &marks->at[patch->marks[i]].ellipse;
            struct boardmap_pair *pair = &pairs[count++];
            board_place(target, row, col, &features[i], &pair->u_q24, &pair->v_q24);
            pair->x_px_q16 = found->x_px_q16;
            pair->y_px_q16 = found->y_px_q16;
        }
    }
    return count;
}

/* The features found in the patch itself and around it, near ones first. */
static uint32_t gather_pairs(const struct lattice *lattice, const struct patches *patches,
                             const struct marks *marks, unsigned row, unsigned col,
                             struct boardmap_pair pairs[PAIRS_MAX])
{
    const struct target *target = patches->settings.target;
    uint32_t count = 0;
    for (unsigned i = 0; i < sizeof by_rings / sizeof by_rings[0]; i++) {
        /* The outer ring only where the inner ones say too little. */
        if (i == OUTER_RING && count >= 3 * LAYOUT_FEATURES_LEVEL2) {
            break;
        }
        const unsigned r = row + (unsigned)by_rings[i][0]; /* wraps above 0: too large then */
        const unsigned c = col + (unsigned)by_rings[i][1];
        if (r < target->rows && c < target->cols) {
            const uint32_t index = lattice->patch_of[r * target->cols + c];
            if (index != MARKS_NONE) {
                count = gather_patch(&patches->at[index], target, marks, r, c, count, pairs);
            }
        }
    }
    return count;
}

/* The ellipse of a circle of radius_q24 sides at (u, v): centre by the map, shape by its derivatives,
 * S = r^2 J J'. False when it leaves the frame or the ranges. */
static bool predict(const struct boardmap *map, const struct frame_view *frame, int64_t u_q24,
                    int64_t v_q24, int64_t radius_q24, struct ellipse *out)
{
    const struct boardmap_point place = boardmap_point_at(map, u_q24, v_q24);
    if (place.x_q16 < 0 || place.y_q16 < 0 || place.x_q16 > (int64_t)(frame->width_px - 1) << 16 ||
        place.y_q16 > (int64_t)(frame->height_px - 1) << 16) {
        return false;
    }
    struct boardmap_slopes slopes;
    boardmap_slopes_at(map, u_q24, v_q24, &slopes);
    /* Pixels a side, times the radius in sides. */
    int64_t j[4] = {slopes.x_by_u_q16, slopes.x_by_v_q16, slopes.y_by_u_q16, slopes.y_by_v_q16};
    for (unsigned i = 0; i < 4; i++) {
        j[i] = fx_round_shift_i64(j[i] * radius_q24, 24);
        if (fx_abs_i64(j[i]) > ROOT_LIMIT_Q16) {
            return false;
        }
    }
    const int64_t sxx = fx_round_shift_i64(j[0] * j[0] + j[1] * j[1], 20);
    const int64_t sxy = fx_round_shift_i64(j[0] * j[2] + j[1] * j[3], 20);
    const int64_t syy = fx_round_shift_i64(j[2] * j[2] + j[3] * j[3], 20);
    if (sxx < ELLIPSE_SHAPE_MIN_PX2_Q12 || syy < ELLIPSE_SHAPE_MIN_PX2_Q12 ||
        sxx > ELLIPSE_SHAPE_MAX_PX2_Q12 || syy > ELLIPSE_SHAPE_MAX_PX2_Q12) {
        return false;
    }
    const int64_t half_x = root_u64((uint64_t)sxx << 20);
    const int64_t half_y = root_u64((uint64_t)syy << 20);
    if (place.x_q16 - half_x < 0 || place.y_q16 - half_y < 0 ||
        place.x_q16 + half_x > (int64_t)(frame->width_px - 1) << 16 ||
        place.y_q16 + half_y > (int64_t)(frame->height_px - 1) << 16) {
        return false;
    }
    *out = (struct ellipse){
        .x_px_q16 = (int32_t)place.x_q16,
        .y_px_q16 = (int32_t)place.y_q16,
        .shape_xx_px2_q12 = (int32_t)sxx,
        .shape_xy_px2_q12 = (int32_t)sxy,
        .shape_yy_px2_q12 = (int32_t)syy,
    };
    return true;
}

/* Whether what the pixels say is what the neighbours predicted. */
static bool agrees(const struct mark *found, const struct mark *predicted)
{
    const int64_t size = predicted->size_px_q16;
    const int64_t off = size / LATTICE_OFF_SHARE > LATTICE_OFF_MAX_PX_Q16
                            ? size / LATTICE_OFF_SHARE
                            : LATTICE_OFF_MAX_PX_Q16;
    const int64_t dx = (int64_t)found->ellipse.x_px_q16 - predicted->ellipse.x_px_q16;
    const int64_t dy = (int64_t)found->ellipse.y_px_q16 - predicted->ellipse.y_px_q16;
    const int64_t grown = fx_abs_i64((int64_t)found->size_px_q16 - size);
    return dx * dx + dy * dy <= off * off && grown * 8 <= size + 2 * LATTICE_OFF_MAX_PX_Q16;
}

/* The light of the patch itself, or of the nearest one in which it is known. */
static struct patch_light nearby_light(const struct lattice *lattice, const struct patches *patches,
                                       unsigned row, unsigned col)
{
    const struct target *target = patches->settings.target;
    const struct patch_light dark = {0};
    for (int ring = 0; ring <= REACH_CELLS; ring++) {
        for (int r = (int)row - ring; r <= (int)row + ring; r++) {
            for (int c = (int)col - ring; c <= (int)col + ring; c++) {
                if (r < 0 || c < 0 || r >= target->rows || c >= target->cols) {
                    continue;
                }
                const uint32_t index = lattice->patch_of[(unsigned)r * target->cols + (unsigned)c];
                if (index != MARKS_NONE &&
                    patches->at[index].light.swing_q30 != 0) {
                    return patches->at[index].light;
                }
            }
        }
    }
    return dark;
}

/* An ellipse that was found there, of the right colour and size: where the map has to reach far it may be
 * pixels off, and the fit wants to start within a blur. Circles are four radii apart, so half a radius cannot
 * mean another one. */
static bool start_from_ellipse(const struct marks *marks, const struct mark *predicted,
                               struct mark *start)
{
    uint32_t near[4];
    const uint32_t count =
        marks_near(marks, predicted->ellipse.x_px_q16, predicted->ellipse.y_px_q16,
                   predicted->size_px_q16 / 2, near, sizeof near / sizeof near[0]);
    for (uint32_t i = 0; i < count; i++) {
        const struct mark *mark = &marks->at[near[i]];
        const int64_t grown =
            fx_abs_i64((int64_t)mark->size_px_q16 - (int64_t)predicted->size_px_q16);
        if (mark->white == predicted->white && mark->contrast_q30 == 0 &&
            grown * 5 <= (int64_t)predicted->size_px_q16) {
            start->ellipse = mark->ellipse;
            start->size_px_q16 = mark->size_px_q16;
            return true;
        }
    }
    return false;
}

/* Looks for one feature where the map says; adds a mark for it. */
static uint32_t look_for(struct lattice *lattice, struct refine *refine,
                         const struct frame_view *frame, const struct boardmap *map,
                         const struct patches *patches, unsigned row, unsigned col,
                         unsigned feature, struct marks *marks)
{
    const struct target *target = patches->settings.target;
    const uint16_t id = target->ids[row * target->cols + col];
    int64_t u_q24;
    int64_t v_q24;
    board_place(target, row, col, layout_feature(target->levels, feature), &u_q24, &v_q24);
    struct mark predicted = {
        .white = layout_circle_is_white(target->levels, id, feature),
        .large = feature == LAYOUT_ANCHOR,
    };
    if (!predict(map, frame, u_q24, v_q24, (int64_t)patches->slots[feature].radius_q20 << 4,
                 &predicted.ellipse)) {
        return MARKS_NONE;
    }
    if (marks->count == marks->size) { /* what may be there has no room: spare looking at its pixels */
        lattice->truncated = true;
        return MARKS_NONE;
    }
    predicted.size_px_q16 = ellipse_size_px_q16(&predicted.ellipse);
    const struct pattern_patch pattern = {
        .target = target,
        .levels = target->levels,
        .id = id,
        .row = (int32_t)row,
        .col = (int32_t)col,
        .turned = target->turns[row * target->cols + col] != 0,
    };
    struct pattern_edges edges;
    pattern_edges_of(&pattern, feature, map, &edges);
    const struct patch_light light = nearby_light(lattice, patches, row, col);
    struct mark found = predicted;
    if (!refine_predicted(refine, frame, &edges, &light, &found) || !agrees(&found, &predicted)) {
        found = predicted;
        if (!start_from_ellipse(marks, &predicted, &found) ||
            !refine_predicted(refine, frame, &edges, &light, &found)) {
            return MARKS_NONE;
        }
    }
    marks->at[marks->count] = found;
    return marks->count++;
}

/* One patch of the target: looks for what it lacks. Returns how many features were found. */
static unsigned extend_patch(struct lattice *lattice, struct refine *refine,
                             const struct frame_view *frame, struct patches *patches,
                             struct marks *marks, unsigned row, unsigned col)
{
    const struct target *target = patches->settings.target;
    const unsigned features = layout_feature_count(target->levels);
    uint32_t *index = &lattice->patch_of[row * target->cols + col];
    if (*index != MARKS_NONE && patches->at[*index].feature_count == features) {
        return 0;
    }
    struct boardmap map;
    const uint32_t pairs = gather_pairs(lattice, patches, marks, row, col, lattice->pairs);
    if (!boardmap_fit(lattice->pairs, pairs, &map)) {
        return 0;
    }
    unsigned added = 0;
    for (unsigned i = 0; i < features; i++) {
        if (*index != MARKS_NONE && patches->at[*index].marks[i] != MARKS_NONE) {
            continue;
        }
        const uint32_t mark =
            look_for(lattice, refine, frame, &map, patches, row, col, i, marks);
        if (mark == MARKS_NONE) {
            continue;
        }
        if (*index == MARKS_NONE) {
            *index = patches_add_empty(patches, target->ids[row * target->cols + col]);
            if (*index == MARKS_NONE) {
                lattice->truncated = true;
                return added;
            }
        }
        patches->at[*index].marks[i] = mark;
        patches->at[*index].feature_count++;
        patches->at[*index].extended = true;
        added++;
    }
    return added;
}

/* Finds the light of a patch that had none when its circles were refined, by all that was found in it and beside it. */
static bool find_light(const struct lattice *lattice, struct light *light,
                       struct patches *patches, const struct marks *marks, unsigned row,
                       unsigned col, struct patch *patch)
{
    const struct target *target = patches->settings.target;
    const unsigned features = layout_feature_count(target->levels);
    uint32_t count = 0;
    const struct ellipse *place = NULL;
    for (unsigned cell = 0; cell < 9; cell++) {
        const unsigned r = row + (unsigned)beside[cell][0]; /* wraps above 0: too large then */
        const unsigned c = col + (unsigned)beside[cell][1];
        const uint32_t index =
            r < target->rows && c < target->cols ? lattice->patch_of[r * target->cols + c] : MARKS_NONE;
        for (unsigned i = 0; index != MARKS_NONE && i < features && count < LIGHT_NEAR_MAX; i++) {
            const uint32_t mark = patches->at[index].marks[i];
            if (mark != MARKS_NONE) {
                light->near[count++] = mark;
                place = place == NULL ? &marks->at[mark].ellipse : place;
            }
        }
    }
    return place != NULL && light_fit(light, marks, count, place, &patch->light);
}

/* Whether light is so uneven that a circle lit by a neighbouring patch's would be seen off its place. */
static bool is_uneven(const struct patch_light *light)
{
    int64_t steepest_q30 = 0;
    for (unsigned axis = 0; axis < 2; axis++) {
        const int64_t black_q30 = fx_abs_i64(light->black.slope_q30[axis]);
        const int64_t white_q30 = fx_abs_i64(light->white.slope_q30[axis]);
        steepest_q30 = black_q30 > steepest_q30 ? black_q30 : steepest_q30;
        steepest_q30 = white_q30 > steepest_q30 ? white_q30 : steepest_q30;
    }
    return UNEVEN_PX * steepest_q30 > light->swing_q30;
}

/* Refines a patch again that was cut when it was refined, for its own circles did not tell its edges well; or that had
 * to borrow its light. */
static void refine_cut(struct lattice *lattice, struct refine *refine,
                       const struct frame_view *frame, struct patches *patches, struct marks *marks,
                       unsigned row, unsigned col)
{
    const struct target *target = patches->settings.target;
    struct patch *patch = &patches->at[lattice->patch_of[row * target->cols + col]];
    struct boardmap map;
    const bool lit = patch->light.swing_q30 == 0 &&
                     find_light(lattice, &refine->light, patches, marks, row, col, patch) &&
                     is_uneven(&patch->light);
    if (!lit && !patch->extended && patch->feature_count == layout_feature_count(target->levels)) {
        return;
    }
    const uint32_t pairs = gather_pairs(lattice, patches, marks, row, col, lattice->pairs);
    if (boardmap_fit(lattice->pairs, pairs, &map)) {
        const struct patch_light light = nearby_light(lattice, patches, row, col);
        refine_again(refine, frame, &map, &light, lit, patches, patch, marks);
    }
}

/* How far a patch's circles lie from where the map through all around has them: the larger of x and y, Q16, by feature;
 * 0 where there is none. Returns the median of those that are there, 0 for fewer than STRAYS_CIRCLES_MIN. */
static uint32_t measure_strays(const struct boardmap *map, const struct target *target, unsigned row, unsigned col,
                               const struct patch *patch, const struct marks *marks,
                               uint32_t off_px_q16[LAYOUT_FEATURES_MAX])
{
    uint32_t sorted_px_q16[LAYOUT_FEATURES_MAX];
    uint32_t count = 0;
    for (unsigned i = 0; i < layout_feature_count(target->levels); i++) {
        off_px_q16[i] = 0;
        if (patch->marks[i] == MARKS_NONE) {
            continue;
        }
        const struct ellipse *ellipse = &marks->at[patch->marks[i]].ellipse;
        int64_t u_q24;
        int64_t v_q24;
        board_place(target, row, col, layout_feature(target->levels, i), &u_q24, &v_q24);
        const struct boardmap_point place = boardmap_point_at(map, u_q24, v_q24);
        const int64_t dx_q16 = fx_abs_i64(place.x_q16 - ellipse->x_px_q16);
        const int64_t dy_q16 = fx_abs_i64(place.y_q16 - ellipse->y_px_q16);
        const int64_t off_q16 = dx_q16 > dy_q16 ? dx_q16 : dy_q16;
        off_px_q16[i] = (uint32_t)(off_q16 < UINT32_MAX ? off_q16 : UINT32_MAX);
        sorted_px_q16[count++] = off_px_q16[i];
    }
    keysort(sorted_px_q16, count);
    return count < STRAYS_CIRCLES_MIN ? 0 : sorted_px_q16[count / 2];
}

/* Takes circles out that lie off the map: the smallest, of which a few settle in a wrong place under noise, wherever
 * they do; others that are far off while the rest of their patch is not, and farther than they say: something of the
 * surround's own shade covers their edge. */
static void drop_strays(struct lattice *lattice, const struct refine *refine,
                        struct patches *patches, const struct marks *marks, unsigned row,
                        unsigned col)
{
    const struct target *target = patches->settings.target;
    struct patch *patch = &patches->at[lattice->patch_of[row * target->cols + col]];
    const int64_t small_px_q16 = (STRAYS_SIGMAS_Q8 * (int64_t)refine->edge_blur_px_q16) >> 8;
    struct boardmap map;
    const uint32_t pairs = gather_pairs(lattice, patches, marks, row, col, lattice->pairs);
    if (!boardmap_fit(lattice->pairs, pairs, &map)) {
        return;
    }
    uint32_t off_px_q16[LAYOUT_FEATURES_MAX];
    const uint64_t median_px_q16 = measure_strays(&map, target, row, col, patch, marks, off_px_q16);
    for (unsigned i = 0; i < layout_feature_count(target->levels); i++) {
        if (patch->marks[i] == MARKS_NONE || off_px_q16[i] <= STRAYS_PX_Q16) {
            continue;
        }
        const struct mark *mark = &marks->at[patch->marks[i]];
        const uint64_t sigma_px_q16 = mark->sigma_px_q20 >> 4;
        const bool alone = median_px_q16 > 0 && off_px_q16[i] > STRAYS_SHARE * median_px_q16 &&
                           off_px_q16[i] > STRAYS_SHARE * sigma_px_q16;
        if (mark->size_px_q16 < small_px_q16 || alone) {
            patch->marks[i] = MARKS_NONE;
            patch->feature_count--;
        }
    }
}

/* The part of the target that patches found so far can say something of: ends are one beyond. */
struct reach {
    unsigned top;
    unsigned bottom;
    unsigned left;
    unsigned right;
};

static void widen(struct reach *reach, const struct target *target, unsigned row, unsigned col)
{
    const unsigned top = row < REACH_CELLS ? 0 : row - REACH_CELLS;
    const unsigned left = col < REACH_CELLS ? 0 : col - REACH_CELLS;
    const unsigned bottom = row + REACH_CELLS < target->rows ? row + REACH_CELLS + 1 : target->rows;
    const unsigned right = col + REACH_CELLS < target->cols ? col + REACH_CELLS + 1 : target->cols;
    reach->top = top < reach->top ? top : reach->top;
    reach->left = left < reach->left ? left : reach->left;
    reach->bottom = bottom > reach->bottom ? bottom : reach->bottom;
    reach->right = right > reach->right ? right : reach->right;
}

/* What was found at (row, col) may tell more of the patches around it: until then another look at one would see what
 * the last one saw. */
static void want_around(struct lattice *lattice, const struct target *target, unsigned row, unsigned col,
                        unsigned round)
{
    struct reach around = {target->rows, 0, target->cols, 0};
    widen(&around, target, row, col);
    for (unsigned r = around.top; r < around.bottom; r++) {
        for (unsigned c = around.left; c < around.right; c++) {
            lattice->wanted[r * target->cols + c] = (uint8_t)round;
        }
    }
}

void lattice_extend(struct lattice *lattice, struct refine *refine,
                    const struct frame_view *frame, struct patches *patches, struct marks *marks)
{
    const struct target *target = patches->settings.target;
    lattice->added = 0;
    lattice->truncated = false;
    if (target == NULL) {
        return;
    }
    const unsigned places = (unsigned)target->rows * target->cols;
    for (unsigned i = 0; i < places; i++) {
        lattice->patch_of[i] = MARKS_NONE;
        lattice->wanted[i] = 0;
    }
    struct reach reach = {target->rows, 0, target->cols, 0};
    for (uint32_t i = 0; i < patches->count; i++) {
        uint16_t row;
        uint16_t col;
        uint8_t turn;
        if (target_find(target, patches->at[i].id, &row, &col, &turn)) {
            lattice->patch_of[row * target->cols + col] = i;
            widen(&reach, target, row, col);
        }
    }
    for (unsigned round = 0; round < ROUNDS_MAX; round++) {
        uint32_t added = 0;
        for (unsigned row = reach.top; row < reach.bottom; row++) {
            for (unsigned col = reach.left; col < reach.right; col++) {
                if (lattice->wanted[row * target->cols + col] < round) {
                    continue;
                }
                const unsigned found =
                    extend_patch(lattice, refine, frame, patches, marks, row, col);
                if (found > 0) {
                    widen(&reach, target, row, col);
                    want_around(lattice, target, row, col, round + 1);
                }
                added += found;
            }
        }
        lattice->added += added;
        if (added == 0) {
            break;
        }
    }
    for (unsigned place = 0; place < places; place++) {
        if (lattice->patch_of[place] != MARKS_NONE) {
            refine_cut(lattice, refine, frame, patches, marks, place / target->cols,
                       place % target->cols);
        }
    }
    for (unsigned place = 0; place < places; place++) {
        if (lattice->patch_of[place] != MARKS_NONE) {
            drop_strays(lattice, refine, patches, marks, place / target->cols,
                        place % target->cols);
        }
    }
    patches_sort(patches);
}
