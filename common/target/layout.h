/* Where the features of one patch lie and which bit colours them. TARGET.md tells it in words.
 *
 * Patch frame: (u, v) in [0, 1]^2, u to the right, v down, before the patch's turn. Lengths are Q30
 * fractions of the patch side. Each feature is a circle concentric with the incircle of its own
 * triangle; the triangles of all features of a level together tile the patch. */
#ifndef COMMON_TARGET_LAYOUT_H
#define COMMON_TARGET_LAYOUT_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    LAYOUT_LEVELS_MIN = 2,
    LAYOUT_LEVELS_MAX = 3,
    LAYOUT_FEATURES_LEVEL2 = 13,
    LAYOUT_FEATURES_LEVEL3 = 85,
    LAYOUT_FEATURES_MAX = LAYOUT_FEATURES_LEVEL3,
    LAYOUT_BITS = 12,
    LAYOUT_IDS = 4096,      /* patch ids are 0..4095 */
    LAYOUT_ANCHOR = 0,      /* feature index of the large circle */
    LAYOUT_ANCHOR_BIT = 12, /* `bit` of the anchor: coloured by parity, by no bit */
    LAYOUT_POINT_STRIDE = 128 /* point id = patch id * 128 + feature index */
};

struct layout_feature {
    int32_t u_q30;           /* centre, (0, 2^30)                                              */
    int32_t v_q30;
    int32_t inradius_q30;    /* of the feature's triangle; circle radius = circle_ratio x this  */
    uint8_t bit;             /* 0..11, the bit of the id that colours it; 12 for the anchor     */
    bool inverted;           /* true: white circle where the bit is 0 (half of level 3)         */
    uint8_t corner_u_8th[3]; /* the triangle's corners, exact, in eighths of the side, 0..8,    */
    uint8_t corner_v_8th[3]; /* clockwise as a viewer sees them                                 */
};

/* Features in a patch: 13 at levels 2, 85 at levels 3, 0 for any other number. */
unsigned layout_feature_count(unsigned levels);

/* Feature `index` of a patch; NULL when levels is not 2 or 3 or there is no such index. The index
 * is 0 for the anchor, 1 + bit for a bit's circle, 13 + 6 * bit + j for a level-3 circle. A bit's
 * circle lies elsewhere, and is half the size, at levels 3. */
#ifdef __cplusplus
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow" /* C++ sees a constructor hidden; C has none */
#endif
const struct layout_feature *layout_feature(unsigned levels, unsigned index);
#ifdef __cplusplus
#pragma GCC diagnostic pop
#endif

/* True when the circle of this feature is white (and its triangle black) in the patch `patch_id`;
 * false for black circles. The feature must exist and patch_id be below 4096. */
bool layout_circle_is_white(unsigned levels, uint16_t patch_id, unsigned index);

/* The feature whose triangle holds a place of the patch, 0..1 in Q24; on a border one of those beside it. Levels are
 * 2 or 3. */
unsigned layout_feature_at(unsigned levels, int32_t u_q24, int32_t v_q24);

extern const struct layout_feature layout_table_level2[LAYOUT_FEATURES_LEVEL2];
extern const struct layout_feature layout_table_level3[LAYOUT_FEATURES_LEVEL3];
/* [row][column] of squares of 1/8, then their left, top, bottom and right quarters. */
extern const uint8_t layout_table_map2[8][8][4];
extern const uint8_t layout_table_map3[8][8][4];

#ifdef __cplusplus
}
#endif

#endif
