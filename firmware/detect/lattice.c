/* Board places are in patch sides, Q24; a fit's own coordinates are taken from the middle of its points
 * and divided by 4, so that they stay within one. */
#include "firmware/detect/lattice.h"

#include "common/fx/fx.h"
#include "common/fx/root.h"
#include "common/fx/smallsolve.h"

#define TERMS          6u
#define PAIRS_MIN      9u
#define PAIRS_MAX      256u
#define ROUNDS_MAX     8u
#define REACH_CELLS    2
#define ROOT_LIMIT_Q16 ((int64_t)600 << 16)

/* From the board to the image: x = sum_k coefficient_k term_k, in pixels relative to the middle. */
struct board_map {
    int64_t middle_u_q24;
    int64_t middle_v_q24;
    int64_t middle_x_q16;
    int64_t middle_y_q16;
    int64_t x_q30[TERMS]; /* in units of 2^12 px */
    int64_t y_q30[TERMS];
};

void lattice_init(struct lattice *lattice, struct arena *arena)
{
    lattice->patch_of = arena_take(arena, TARGET_PATCHES_MAX, sizeof(uint32_t));
    lattice->pairs = arena_take(arena, PAIRS_MAX, sizeof(struct lattice_pair));
    lattice->added = 0;
    lattice->truncated = false;
}

/* Where a feature of the patch at (row, col) lies on the board. */
static void board_place(const struct target *target, unsigned row, unsigned col, unsigned feature,
                        int64_t *u_q24, int64_t *v_q24)
{
    const struct layout_feature *at = layout_feature(target->levels, feature);
    const bool turned = target->turns[row * target->cols + col] != 0;
    const int64_t one = (int64_t)1 << 30;
    *u_q24 = ((int64_t)col << 24) + ((turned ? one - at->u_q30 : at->u_q30) >> 6);
    *v_q24 = ((int64_t)row << 24) + ((turned ? one - at->v_q30 : at->v_q30) >> 6);
}

/* The features found in the patch itself and around it, near ones first. */
static uint32_t gather_pairs(const struct lattice *lattice, const struct patches *patches,
                             const struct marks *marks, unsigned row, unsigned col,
                             struct lattice_pair pairs[PAIRS_MAX])
{
    const struct target *target = patches->settings.target;
    uint32_t count = 0;
    for (int ring = 0; ring <= REACH_CELLS; ring++) {
        /* The outer ring only where the inner ones say too little. */
        if (ring == REACH_CELLS && count >= 3 * LAYOUT_FEATURES_LEVEL2) {
            break;
        }
        for (int dr = -ring; dr <= ring; dr++) {
            for (int dc = -ring; dc <= ring; dc++) {
                const int r = (int)row + dr;
                const int c = (int)col + dc;
                const int far = (dr < 0 ? -dr : dr) > (dc < 0 ? -dc : dc) ? (dr < 0 ? -dr : dr)
                                                                          : (dc < 0 ? -dc : dc);
                if (far != ring || r < 0 || c < 0 || r >= target->rows || c >= target->cols) {
                    continue;
                }
                const uint32_t index = lattice->patch_of[(unsigned)r * target->cols + (unsigned)c];
                if (index == MARKS_NONE) {
                    continue;
                }
                /* At three levels the thirteen of every level are plenty. */
                for (unsigned i = 0; i < LAYOUT_FEATURES_LEVEL2 && count < PAIRS_MAX; i++) {
                    const uint32_t mark = patches->at[index].marks[i];
                    if (mark != MARKS_NONE) {
                        struct lattice_pair *pair = &pairs[count++];
                        board_place(target, (unsigned)r, (unsigned)c, i, &pair->u_q24,
                                    &pair->v_q24);
                        pair->x_px_q16 = marks->at[mark].ellipse.x_px_q16;
                        pair->y_px_q16 = marks->at[mark].ellipse.y_px_q16;
                    }
                }
            }
        }
    }
    return count;
}

static void fill_terms(int64_t u_q30, int64_t v_q30, int64_t terms_q30[TERMS])
{
    terms_q30[0] = (int64_t)1 << 30;
    terms_q30[1] = u_q30;
    terms_q30[2] = v_q30;
    terms_q30[3] = fx_mul_q30(u_q30, u_q30);
    terms_q30[4] = fx_mul_q30(u_q30, v_q30);
    terms_q30[5] = fx_mul_q30(v_q30, v_q30);
}

static bool fit_board_map(const struct lattice_pair pairs[], uint32_t count, struct board_map *map)
{
    *map = (struct board_map){0};
    if (count < PAIRS_MIN) {
        return false;
    }
    for (uint32_t i = 0; i < count; i++) {
        map->middle_u_q24 += pairs[i].u_q24;
        map->middle_v_q24 += pairs[i].v_q24;
        map->middle_x_q16 += pairs[i].x_px_q16;
        map->middle_y_q16 += pairs[i].y_px_q16;
    }
    map->middle_u_q24 /= count;
    map->middle_v_q24 /= count;
    map->middle_x_q16 /= count;
    map->middle_y_q16 /= count;

    struct smallsolve normal = {.size = TERMS};
    for (uint32_t i = 0; i < count; i++) {
        int64_t terms_q30[TERMS];
        fill_terms((pairs[i].u_q24 - map->middle_u_q24) * 16,
                   (pairs[i].v_q24 - map->middle_v_q24) * 16, terms_q30);
        const int64_t x_q30 = (pairs[i].x_px_q16 - map->middle_x_q16) * 4;
        const int64_t y_q30 = (pairs[i].y_px_q16 - map->middle_y_q16) * 4;
        for (unsigned row = 0; row < TERMS; row++) {
            for (unsigned col = 0; col <= row; col++) {
                normal.at_q30[row][col] += fx_mul_q30(terms_q30[row], terms_q30[col]);
            }
            map->x_q30[row] += fx_mul_q30(terms_q30[row], x_q30);
            map->y_q30[row] += fx_mul_q30(terms_q30[row], y_q30);
        }
    }
    for (unsigned row = 0; row < TERMS; row++) {
        for (unsigned col = 0; col <= row; col++) {
            normal.at_q30[row][col] /= count;
        }
        map->x_q30[row] /= count;
        map->y_q30[row] /= count;
    }
    /* Features of one patch alone reach pivots of 1e-5 in the second-order terms. */
    return smallsolve_factor(&normal, 256) && smallsolve_solve(&normal, map->x_q30) &&
           smallsolve_solve(&normal, map->y_q30);
}

static int64_t dot_terms(const int64_t a_q30[TERMS], const int64_t b_q30[TERMS])
{
    int64_t sum_q30 = 0;
    for (unsigned k = 0; k < TERMS; k++) {
        sum_q30 += fx_round_shift_i64((a_q30[k] >> 6) * b_q30[k], 24);
    }
    return sum_q30;
}

/* The ellipse of a circle of radius_q24 sides at (u, v): centre by the map, shape by its derivatives,
 * S = r^2 J J'. False when it leaves the frame or the ranges. */
static bool predict(const struct board_map *map, const struct frame_view *frame, int64_t u_q24,
                    int64_t v_q24, int64_t radius_q24, struct ellipse *out)
{
    const int64_t u = (u_q24 - map->middle_u_q24) * 16;
    const int64_t v = (v_q24 - map->middle_v_q24) * 16;
    int64_t place[TERMS];
    fill_terms(u, v, place);
    const int64_t by_u[TERMS] = {0, (int64_t)1 << 30, 0, 2 * u, v, 0};
    const int64_t by_v[TERMS] = {0, 0, (int64_t)1 << 30, 0, u, 2 * v};
    const int64_t x_q16 = map->middle_x_q16 + dot_terms(map->x_q30, place) / 4;
    const int64_t y_q16 = map->middle_y_q16 + dot_terms(map->y_q30, place) / 4;
    /* Derivatives are per four sides, in 2^12 px: times the radius in sides, in px Q16. */
    const int64_t jxu = fx_round_shift_i64((dot_terms(map->x_q30, by_u) >> 4) * radius_q24, 24);
    const int64_t jxv = fx_round_shift_i64((dot_terms(map->x_q30, by_v) >> 4) * radius_q24, 24);
    const int64_t jyu = fx_round_shift_i64((dot_terms(map->y_q30, by_u) >> 4) * radius_q24, 24);
    const int64_t jyv = fx_round_shift_i64((dot_terms(map->y_q30, by_v) >> 4) * radius_q24, 24);
    const int64_t largest = ROOT_LIMIT_Q16;
    if (fx_abs_i64(jxu) > largest || fx_abs_i64(jxv) > largest || fx_abs_i64(jyu) > largest ||
        fx_abs_i64(jyv) > largest) {
        return false;
    }
    const int64_t sxx = fx_round_shift_i64(jxu * jxu + jxv * jxv, 20);
    const int64_t sxy = fx_round_shift_i64(jxu * jyu + jxv * jyv, 20);
    const int64_t syy = fx_round_shift_i64(jyu * jyu + jyv * jyv, 20);
    if (sxx < ELLIPSE_SHAPE_MIN_PX2_Q12 || syy < ELLIPSE_SHAPE_MIN_PX2_Q12 ||
        sxx > ELLIPSE_SHAPE_MAX_PX2_Q12 || syy > ELLIPSE_SHAPE_MAX_PX2_Q12) {
        return false;
    }
    const int64_t half_x = root_u64((uint64_t)sxx << 20);
    const int64_t half_y = root_u64((uint64_t)syy << 20);
    if (x_q16 - half_x < 0 || y_q16 - half_y < 0 ||
        x_q16 + half_x > (int64_t)(frame->width_px - 1) << 16 ||
        y_q16 + half_y > (int64_t)(frame->height_px - 1) << 16) {
        return false;
    }
    *out = (struct ellipse){
        .x_px_q16 = (int32_t)x_q16,
        .y_px_q16 = (int32_t)y_q16,
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

/* Looks for one feature where the map says; adds a mark for it. */
static uint32_t look_for(struct lattice *lattice, const struct refine *refine,
                         const struct frame_view *frame, const struct board_map *map,
                         const struct patches *patches, unsigned row, unsigned col,
                         unsigned feature, struct marks *marks)
{
    const struct target *target = patches->settings.target;
    const uint16_t id = target->ids[row * target->cols + col];
    int64_t u_q24;
    int64_t v_q24;
    board_place(target, row, col, feature, &u_q24, &v_q24);
    struct mark predicted = {
        .next = MARKS_NONE,
        .white = layout_circle_is_white(target->levels, id, feature),
    };
    if (!predict(map, frame, u_q24, v_q24, (int64_t)patches->slots[feature].radius_q20 << 4,
                 &predicted.ellipse)) {
        return MARKS_NONE;
    }
    predicted.size_px_q16 = ellipse_size_px_q16(&predicted.ellipse);
    struct mark found = predicted;
    if (!refine_predicted(refine, frame, &found) || !agrees(&found, &predicted)) {
        return MARKS_NONE;
    }
    if (marks->count == marks->size) {
        lattice->truncated = true;
        return MARKS_NONE;
    }
    marks->at[marks->count] = found;
    return marks->count++;
}

/* One patch of the target: looks for what it lacks. Returns how many features were found. */
static unsigned extend_patch(struct lattice *lattice, const struct refine *refine,
                             const struct frame_view *frame, struct patches *patches,
                             struct marks *marks, unsigned row, unsigned col)
{
    const struct target *target = patches->settings.target;
    const unsigned features = layout_feature_count(target->levels);
    uint32_t *index = &lattice->patch_of[row * target->cols + col];
    if (*index != MARKS_NONE && patches->at[*index].feature_count == features) {
        return 0;
    }
    struct board_map map;
    const uint32_t pairs = gather_pairs(lattice, patches, marks, row, col, lattice->pairs);
    if (!fit_board_map(lattice->pairs, pairs, &map)) {
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
        added++;
    }
    return added;
}

void lattice_extend(struct lattice *lattice, const struct refine *refine,
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
    }
    for (uint32_t i = 0; i < patches->count; i++) {
        uint16_t row;
        uint16_t col;
        uint8_t turn;
        if (target_find(target, patches->at[i].id, &row, &col, &turn)) {
            lattice->patch_of[row * target->cols + col] = i;
        }
    }
    for (unsigned round = 0; round < ROUNDS_MAX; round++) {
        uint32_t added = 0;
        for (unsigned place = 0; place < places; place++) {
            added += extend_patch(lattice, refine, frame, patches, marks, place / target->cols,
                                  place % target->cols);
        }
        lattice->added += added;
        if (added == 0) {
            break;
        }
    }
    patches_sort(patches);
}
