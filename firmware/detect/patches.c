/* See patches.h. Image offsets from the anchor are held in its unit frame, p = B^-1 (x - c), Q20, but with
 * half its triangle's inradius as the unit, which does not depend on the circle's ratio; patch coordinates
 * relative to the anchor, w = (u, v) - (u, v)_anchor, Q20. */
#include "firmware/detect/patches.h"

#include <string.h>

#include "common/fx/fx.h"
#include "common/fx/root.h"
#include "common/fx/turn.h"
#include "firmware/detect/keysort.h"
#include "firmware/limits.h"

/* Marks looked at around an anchor: a square of 2.3 sides holds 5.5 patches, and five times as many
 * where the anchor's ellipse is as long as it may be; cut off where it holds more than four times. */
#define NEIGHBOURS_MAX 2048u
#define TURN_BINS      64u
#define TURNS_TRIED    3u
/* Features are at least 0.2 sides apart at two levels, 0.073 at three. */
#define NEAR_FIRST_Q20  FX_Q(0.085, 20)
#define NEAR_THEN_Q20   FX_Q(0.05, 20)
#define NEAR_LEVEL3_Q20 FX_Q(0.025, 20)
#define SQUARE_Q20       (1 << 17)
#define SQUARES_FROM_Q20 (1 << 20)

/* One anchor under trial. */
struct trial {
    const struct marks *marks;
    uint32_t            anchor;
    uint32_t            anchor_radius_q20; /* in sides */
    uint32_t            unit_q20;          /* of p and q, in sides */
    uint32_t            count;
    uint32_t            looks;             /* of all anchors so far */
    struct patches_neighbour *neighbours;
    uint32_t            found[LAYOUT_FEATURES_MAX]; /* neighbour by feature, or MARKS_NONE */
};

uint32_t patches_size_ratio_q8(unsigned levels)
{
    const struct layout_feature *anchor = layout_feature(levels, LAYOUT_ANCHOR);
    const struct layout_feature *common = layout_feature(levels, layout_feature_count(levels) - 1);
    return (uint32_t)(((uint64_t)anchor->inradius_q30 << 8) / (uint64_t)common->inradius_q30);
}

/* A size nearer to the expected one than to the next that may be near: large and small differ by two at
 * two levels; a bit's circle and those beside it by 1.4 at three. Within less than half their distance of each other,
 * as the features of the third level are looked for, the place alone tells features apart. */
static void bound_radius(struct patches_slot *slot, unsigned levels)
{
    const uint64_t more = levels == LAYOUT_LEVELS_MAX ? 6 : 3;
    const uint64_t less = levels == LAYOUT_LEVELS_MAX ? 5 : 2;
    slot->radius_least_q20 = (uint32_t)((less * slot->radius_q20 + more - 1) / more);
    slot->radius_most_q20 = (uint32_t)(more * slot->radius_q20 / less);
}

static bool size_fits(const struct patches_slot *slot, uint32_t radius_q20)
{
    return radius_q20 >= slot->radius_least_q20 && radius_q20 <= slot->radius_most_q20;
}

static void fill_squares(struct patches *patches)
{
    const int32_t reach_q20 = SQUARE_Q20 / 2 + (int32_t)NEAR_FIRST_Q20;
    for (int32_t row = 0; row < (int32_t)PATCHES_SQUARES; row++) {
        for (int32_t col = 0; col < (int32_t)PATCHES_SQUARES; col++) {
            const int32_t u_q20 = col * SQUARE_Q20 + SQUARE_Q20 / 2 - SQUARES_FROM_Q20;
            const int32_t v_q20 = row * SQUARE_Q20 + SQUARE_Q20 / 2 - SQUARES_FROM_Q20;
            unsigned near = 0;
            for (unsigned i = 1; i < LAYOUT_FEATURES_LEVEL2; i++) {
                const struct patches_slot *slot = &patches->slots[i];
                if (fx_abs_i64((int64_t)slot->u_q20 - u_q20) <= reach_q20 &&
                    fx_abs_i64((int64_t)slot->v_q20 - v_q20) <= reach_q20) {
                    near |= 1u << i;
                }
            }
            patches->near_square[row][col] = (uint16_t)near;
        }
    }
}

void patches_init(struct patches *patches, struct arena *arena,
                  const struct patches_settings *settings, unsigned width, unsigned height)
{
    patches->settings = *settings;
    const uint32_t marks = limit_ellipses(width, height);
    /* Whole patches, and as many again and some that are seen in part. */
    patches->size = 2 * (marks / LAYOUT_FEATURES_LEVEL2) + 64;
    patches->size = patches->size > LIMIT_PATCHES ? LIMIT_PATCHES : patches->size;
    patches->at = arena_take(arena, patches->size, sizeof(struct patch));
    patches->looks_max = limit_looks(width, height);
    patches->keys = arena_take(arena, patches->size, sizeof(uint32_t));
    patches->near = arena_take(arena, NEIGHBOURS_MAX, sizeof(uint32_t));
    patches->neighbours = arena_take(arena, NEIGHBOURS_MAX, sizeof(struct patches_neighbour));

    patches->reach_q20 = 0;
    patches->farthest_q20 = 0;
    const unsigned features = layout_feature_count(settings->levels);
    const struct layout_feature *anchor = layout_feature(settings->levels, LAYOUT_ANCHOR);
    for (unsigned i = 0; i < features; i++) {
        const struct layout_feature *feature = layout_feature(settings->levels, i);
        struct patches_slot *slot = &patches->slots[i];
        const int64_t u_q30 = (int64_t)feature->u_q30 - anchor->u_q30;
        const int64_t v_q30 = (int64_t)feature->v_q30 - anchor->v_q30;
        slot->u_q20 = (int32_t)fx_round_shift_i64(u_q30, 10);
        slot->v_q20 = (int32_t)fx_round_shift_i64(v_q30, 10);
        slot->distance_q20 = root_u64((uint64_t)(u_q30 * u_q30 + v_q30 * v_q30)) >> 10;
        slot->direction_turn_q16 = turn_atan2_q16(v_q30, u_q30);
        slot->radius_q20 =
            (uint32_t)(((uint64_t)feature->inradius_q30 * settings->circle_ratio_q16) >> 26);
        bound_radius(slot, i < LAYOUT_FEATURES_LEVEL2 ? settings->levels : LAYOUT_LEVELS_MIN);
        /* Less than a fifth of it away: perspective, seen from the anchor. */
        slot->distance_least_q20 = slot->distance_q20 * 4 / 5 + 1;
        slot->distance_most_q20 = i == LAYOUT_ANCHOR ? 0 : (slot->distance_q20 * 6 + 4) / 5 - 1;
        if (i < LAYOUT_FEATURES_LEVEL2 && slot->distance_most_q20 > patches->farthest_q20) {
            patches->farthest_q20 = slot->distance_most_q20;
        }
        /* A little farther than the farthest feature, for perspective stretches. */
        const uint32_t reach_q20 = slot->distance_q20 + slot->distance_q20 / 16;
        patches->reach_q20 = reach_q20 > patches->reach_q20 ? reach_q20 : patches->reach_q20;
    }
    fill_squares(patches);
}

/* Collects the marks around the anchor that can belong to its patch. */
static bool gather_neighbours(struct trial *trial, const struct patches *patches)
{
    const struct marks *marks = trial->marks;
    const struct mark *anchor = &marks->at[trial->anchor];
    trial->anchor_radius_q20 = patches->slots[LAYOUT_ANCHOR].radius_q20;
    trial->unit_q20 = (uint32_t)layout_feature(patches->settings.levels, LAYOUT_ANCHOR)->inradius_q30 >> 11;
    /* Reach in anchor radii, and in pixels along the ellipse's larger axis. */
    const int64_t reach_radii_q8 = ((int64_t)patches->reach_q20 << 8) / trial->anchor_radius_q20;
    uint32_t major_px_q16;
    uint32_t minor_px_q16;
    uint16_t angle;
    struct ellipse_root root;
    ellipse_axes(&anchor->ellipse, &major_px_q16, &minor_px_q16, &angle);
    if (!ellipse_take_root(&anchor->ellipse, &root)) {
        return false;
    }
    int64_t reach_px_q16 = ((int64_t)major_px_q16 * reach_radii_q8) >> 8;
    reach_px_q16 += reach_px_q16 / 4;
    uint32_t *near = patches->near;
    const uint32_t near_count =
        marks_near(marks, anchor->ellipse.x_px_q16, anchor->ellipse.y_px_q16,
                   (uint32_t)(reach_px_q16 > INT32_MAX ? INT32_MAX : reach_px_q16), near,
                   NEIGHBOURS_MAX);
    trial->count = 0;
    for (uint32_t i = 0; i < near_count; i++) {
        const struct mark *mark = &marks->at[near[i]];
        if (near[i] == trial->anchor) {
            continue;
        }
        /* Forward substitution with B; offsets below 2^30. */
        const int64_t dx = (int64_t)mark->ellipse.x_px_q16 - anchor->ellipse.x_px_q16;
        const int64_t dy = (int64_t)mark->ellipse.y_px_q16 - anchor->ellipse.y_px_q16;
        const int64_t p_q20 = dx * ((int64_t)1 << 20) / root.xx_px_q16;
        const int64_t rest = dy - fx_round_shift_i64(p_q20 * root.yx_px_q16, 20);
        const int64_t q_q20 = rest * ((int64_t)1 << 20) / root.yy_px_q16;
        const int64_t limit_q20 = reach_radii_q8 * ((int64_t)1 << 12) * 5 / 4;
        if (fx_abs_i64(p_q20) > limit_q20 || fx_abs_i64(q_q20) > limit_q20) {
            continue;
        }
        trial->neighbours[trial->count++] = (struct patches_neighbour){
            .mark = near[i],
            .p_q20 = (int32_t)(p_q20 * trial->anchor_radius_q20 / trial->unit_q20),
            .q_q20 = (int32_t)(q_q20 * trial->anchor_radius_q20 / trial->unit_q20),
            .radius_q20 = (uint32_t)(((uint64_t)mark->size_px_q16 * trial->anchor_radius_q20) /
                                     anchor->size_px_q16),
        };
    }
    return trial->count + 1 >= LAYOUT_FEATURES_LEVEL2;
}

/* Fills turns[] with the most voted directions of the patch's u axis, best first. Two thirds of the
 * votes for the true turn survive the strongest perspective. */
static unsigned vote_turns(const struct trial *trial, const struct patches *patches,
                           uint16_t turns[TURNS_TRIED])
{
    uint16_t cast[TURN_BINS] = {0};
    for (uint32_t j = 0; j < trial->count; j++) {
        const struct patches_neighbour *n = &trial->neighbours[j];
        const uint64_t units_q20 =
            root_u64((uint64_t)((int64_t)n->p_q20 * n->p_q20 + (int64_t)n->q_q20 * n->q_q20));
        const uint32_t distance_q20 = (uint32_t)((units_q20 * trial->unit_q20) >> 20);
        if (distance_q20 > patches->farthest_q20) {
            continue;
        }
        const uint16_t direction = turn_atan2_q16(n->q_q20, n->p_q20);
        for (unsigned i = 1; i < LAYOUT_FEATURES_LEVEL2; i++) {
            const struct patches_slot *slot = &patches->slots[i];
            if (distance_q20 >= slot->distance_least_q20 && distance_q20 <= slot->distance_most_q20 &&
                size_fits(slot, n->radius_q20)) {
                const uint16_t turn = (uint16_t)(direction - slot->direction_turn_q16);
                cast[turn / (65536u / TURN_BINS)]++;
            }
        }
    }
    /* A vote reaches the two neighbours, for the turn need not be a bin's centre. */
    uint16_t votes[TURN_BINS];
    for (unsigned bin = 0; bin < TURN_BINS; bin++) {
        votes[bin] = (uint16_t)(2 * cast[bin] + cast[(bin + 1) % TURN_BINS] +
                                cast[(bin + TURN_BINS - 1) % TURN_BINS]);
    }
    unsigned count = 0;
    while (count < TURNS_TRIED) {
        unsigned best = 0;
        for (unsigned bin = 1; bin < TURN_BINS; bin++) {
            best = votes[bin] > votes[best] ? bin : best;
        }
        if (votes[best] < 8) {
            break;
        }
        turns[count++] = (uint16_t)(best * (65536u / TURN_BINS) + 32768u / TURN_BINS);
        for (unsigned k = 0; k < 5; k++) {
            votes[(best + k + TURN_BINS - 2) % TURN_BINS] = 0;
        }
    }
    return count;
}

/* Whether the neighbour may be the feature and is nearer to it than what was there. */
static bool is_nearer(const struct patches_slot *slot, const struct patches_neighbour *n,
                      struct patchmap_place at, int64_t *nearest_q40)
{
    const int64_t du = (int64_t)at.u_q20 - slot->u_q20;
    const int64_t dv = (int64_t)at.v_q20 - slot->v_q20;
    const int64_t distance_q40 = du * du + dv * dv;
    if (distance_q40 >= *nearest_q40 || !size_fits(slot, n->radius_q20)) {
        return false;
    }
    *nearest_q40 = distance_q40;
    return true;
}

/* For each of the thirteen features but the anchor the nearest neighbour within `near`, of the right size, by the
 * map. Returns how many of them were found. */
static unsigned match_features(struct trial *trial, const struct patches *patches,
                               const struct patchmap *map, int64_t near_q20)
{
    int64_t nearest_q40[LAYOUT_FEATURES_LEVEL2];
    for (unsigned i = 0; i < LAYOUT_FEATURES_LEVEL2; i++) {
        nearest_q40[i] = near_q20 * near_q20;
        trial->found[i] = MARKS_NONE;
    }
    trial->looks += trial->count;
    const struct patchmap own = *map; /* what is written is no part of it */
    unsigned count = 0;
    for (uint32_t j = 0; j < trial->count; j++) {
        const struct patches_neighbour *n = &trial->neighbours[j];
        const struct patchmap_place at = patchmap_place_of(&own, n->p_q20, n->q_q20);
        /* Wraps before the first square: too large then. */
        const uint32_t col = ((uint32_t)at.u_q20 + SQUARES_FROM_Q20) / SQUARE_Q20;
        const uint32_t row = ((uint32_t)at.v_q20 + SQUARES_FROM_Q20) / SQUARE_Q20;
        if (col >= PATCHES_SQUARES || row >= PATCHES_SQUARES) {
            continue;
        }
        for (unsigned near = patches->near_square[row][col]; near != 0; near &= near - 1) {
            const unsigned i = (unsigned)__builtin_ctz(near);
            if (is_nearer(&patches->slots[i], n, at, &nearest_q40[i])) {
                count += trial->found[i] == MARKS_NONE ? 1 : 0;
                trial->found[i] = j;
            }
        }
    }
    return count;
}

/* Likewise for the features of the third level. */
static void match_level3(struct trial *trial, const struct patches *patches, const struct patchmap *map)
{
    for (uint32_t j = 0; j < trial->count; j++) {
        struct patches_neighbour *n = &trial->neighbours[j];
        n->place = patchmap_place_of(map, n->p_q20, n->q_q20);
    }
    for (unsigned i = LAYOUT_FEATURES_LEVEL2; i < LAYOUT_FEATURES_LEVEL3; i++) {
        int64_t nearest_q40 = NEAR_LEVEL3_Q20 * NEAR_LEVEL3_Q20;
        trial->found[i] = MARKS_NONE;
        for (uint32_t j = 0; j < trial->count; j++) {
            const struct patches_neighbour *n = &trial->neighbours[j];
            if (is_nearer(&patches->slots[i], n, n->place, &nearest_q40)) {
                trial->found[i] = j;
            }
        }
    }
}

/* The map through the features found of the thirteen, the anchor among them. */
static bool fit_map(const struct trial *trial, const struct patches *patches, unsigned terms,
                    struct patchmap *map)
{
    struct patchmap_pair pairs[LAYOUT_FEATURES_LEVEL2] = {{0}}; /* the first is the anchor's */
    unsigned count = 1;
    for (unsigned i = 1; i < LAYOUT_FEATURES_LEVEL2; i++) {
        if (trial->found[i] != MARKS_NONE) {
            const struct patches_neighbour *n = &trial->neighbours[trial->found[i]];
            const struct patches_slot *slot = &patches->slots[i];
            pairs[count++] =
                (struct patchmap_pair){n->p_q20, n->q_q20, {slot->u_q20, slot->v_q20}};
        }
    }
    return patchmap_fit(pairs, count, terms, map);
}

/* Whether the neighbours are the patch that lies along `turn`; then trial->found holds its features. */
static bool try_turn(struct trial *trial, const struct patches *patches, uint16_t turn)
{
    struct patchmap map = patchmap_turned(turn, trial->unit_q20);
    unsigned found = match_features(trial, patches, &map, NEAR_FIRST_Q20);
    bool settled = false; /* the same features would give the same map again */
    for (unsigned round = 0; round < 2 && !settled; round++) {
        uint32_t before[LAYOUT_FEATURES_LEVEL2];
        memcpy(before, trial->found, sizeof before);
        if (found < 5 || !fit_map(trial, patches, PATCHMAP_LINEAR, &map)) {
            return false;
        }
        found = match_features(trial, patches, &map, NEAR_FIRST_Q20);
        settled = memcmp(before, trial->found, sizeof before) == 0;
    }
    if (found < 9 || !fit_map(trial, patches, PATCHMAP_TERMS_MAX, &map)) {
        return false;
    }
    found = match_features(trial, patches, &map, NEAR_THEN_Q20);
    if (found + 1 != LAYOUT_FEATURES_LEVEL2) {
        return false;
    }
    if (patches->settings.levels == LAYOUT_LEVELS_MAX) {
        (void)fit_map(trial, patches, PATCHMAP_TERMS_MAX, &map);
        match_level3(trial, patches, &map);
    }
    return true;
}

static bool is_white(const struct trial *trial, unsigned feature)
{
    return trial->marks->at[trial->neighbours[trial->found[feature]].mark].white;
}

/* Reads the id; checks it. Level-3 circles of the wrong colour are dropped. */
static bool read_patch(struct trial *trial, struct patches *patches, struct patch *out)
{
    const unsigned levels = patches->settings.levels;
    uint16_t id = 0;
    for (unsigned bit = 0; bit < LAYOUT_BITS; bit++) {
        id |= (uint16_t)(is_white(trial, 1 + bit) ? 1u << bit : 0u);
    }
    if (layout_circle_is_white(levels, id, LAYOUT_ANCHOR) !=
        trial->marks->at[trial->anchor].white) {
        patches->bad_parity++;
        return false;
    }
    const struct target *target = patches->settings.target;
    uint16_t row;
    uint16_t col;
    uint8_t turn;
    if (target != NULL && !target_find(target, id, &row, &col, &turn)) {
        patches->not_on_target++;
        return false;
    }
    out->id = id;
    out->feature_count = 0;
    out->light = (struct patch_light){0};
    out->extended = false;
    const unsigned features = layout_feature_count(levels);
    for (unsigned i = 0; i < LAYOUT_FEATURES_MAX; i++) {
        uint32_t mark = MARKS_NONE;
        if (i == LAYOUT_ANCHOR) {
            mark = trial->anchor;
        } else if (i < features && trial->found[i] != MARKS_NONE &&
                   is_white(trial, i) == layout_circle_is_white(levels, id, i)) {
            mark = trial->neighbours[trial->found[i]].mark;
        }
        out->marks[i] = mark;
        out->feature_count = (uint16_t)(out->feature_count + (mark != MARKS_NONE ? 1 : 0));
    }
    return true;
}

/* Patches are large: their ids are sorted, with the places where they stand, and each patch then moves once. */
static void sort_by_id(struct patches *patches)
{
    uint32_t *keys = patches->keys;
    for (uint32_t i = 0; i < patches->count; i++) {
        keys[i] = (uint32_t)patches->at[i].id << 16 | i;
    }
    keysort(keys, patches->count);
    for (uint32_t i = 0; i < patches->count; i++) {
        uint32_t to = i;
        uint32_t from = keys[i] & 0xffff;
        if (from != i) { /* around the ring of those that take each other's places */
            const struct patch first = patches->at[i];
            for (; from != i; from = keys[to] & 0xffff) {
                patches->at[to] = patches->at[from];
                keys[to] = to;
                to = from;
            }
            patches->at[to] = first;
            keys[to] = to;
        }
    }
}

/* An id that stands twice in the frame is wrong at least once, and nobody knows where. */
static void drop_claimed_twice(struct patches *patches)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < patches->count;) {
        uint32_t end = i + 1;
        while (end < patches->count && patches->at[end].id == patches->at[i].id) {
            end++;
        }
        if (end == i + 1) {
            if (kept != i) {
                patches->at[kept] = patches->at[i];
            }
            kept++;
        } else {
            patches->twice++;
        }
        i = end;
    }
    patches->count = kept;
}

uint32_t patches_add_empty(struct patches *patches, uint16_t id)
{
    if (patches->count == patches->size) {
        patches->truncated = true;
        return MARKS_NONE;
    }
    struct patch *patch = &patches->at[patches->count];
    patch->id = id;
    patch->feature_count = 0;
    patch->light = (struct patch_light){0};
    patch->extended = false;
    for (unsigned i = 0; i < LAYOUT_FEATURES_MAX; i++) {
        patch->marks[i] = MARKS_NONE;
    }
    return patches->count++;
}

void patches_sort(struct patches *patches)
{
    sort_by_id(patches);
}

void patches_decode(const struct marks *marks, struct patches *patches)
{
    struct trial trial = {.marks = marks, .neighbours = patches->neighbours};
    patches->count = 0;
    patches->anchors = 0;
    patches->bad_parity = 0;
    patches->not_on_target = 0;
    patches->twice = 0;
    patches->truncated = false;
    for (uint32_t i = 0; i < marks->count; i++) {
        if (!marks->at[i].large) {
            continue;
        }
        if (trial.looks > patches->looks_max) {
            patches->truncated = true;
            break;
        }
        patches->anchors++;
        trial.anchor = i;
        uint16_t turns[TURNS_TRIED];
        unsigned turn_count = 0;
        if (gather_neighbours(&trial, patches)) {
            turn_count = vote_turns(&trial, patches, turns);
        }
        for (unsigned t = 0; t < turn_count; t++) {
            if (!try_turn(&trial, patches, turns[t])) {
                continue;
            }
            if (patches->count == patches->size) {
                patches->truncated = true;
            } else if (read_patch(&trial, patches, &patches->at[patches->count])) {
                patches->count++;
            }
            break;
        }
    }
    patches_sort(patches);
    drop_claimed_twice(patches);
}
