/* Marks -> patches: which circle is which.
 *
 * Each large mark is taken for an anchor. Its ellipse says how the patch is stretched (it is a circle on the
 * target), all but the turn: in the frame where the anchor is the unit circle every neighbour that stands as
 * far off as some feature does votes for a turn. For the best turns the features' places are
 * predicted, the marks nearest to them taken, and a smooth map from image to patch fitted to the pairs, which
 * draws the prediction closer: first affine, then of second order, for perspective and distortion bend it.
 *
 * A patch counts when all its circles are found where they must be, in the right size; then the colours of the
 * twelve bits are its id, and the anchor's colour must be the id's parity. An id that is not on the
 * target (where one is given), or that two places claim, is refused. */
#ifndef TESSERA_FIRMWARE_DETECT_PATCHES_H
#define TESSERA_FIRMWARE_DETECT_PATCHES_H

#include "common/target/target.h"
#include "firmware/detect/marks.h"
#include "firmware/detect/patchmap.h"

/* What is known of the targets in view. */
struct patches_settings {
    uint8_t              levels;           /* 2 or 3                                   */
    uint32_t             circle_ratio_q16; /* circle radius over inradius              */
    uint32_t             edge_level_q16;   /* of the circles' Gaussian peaks: TARGET.md */
    uint32_t             gauss_sigma_q16;
    const struct target *target;           /* NULL: any id may be seen                 */
};

/* How the brightness of black, or of white, changes about a place; Q30 of 4096 grey_q4. */
struct patch_shade {
    int32_t slope_q30[2]; /* per pixel along x and y                                                       */
    int32_t bend_q40[3];  /* and how these change per pixel: x along x, either along the other, y along y */
};

/* The light on a patch. */
struct patch_light {
    int32_t x_px_q16; /* the place that slopes are of */
    int32_t y_px_q16;
    struct patch_shade black;
    struct patch_shade white;
    int32_t swing_q30; /* from black to white there; 0: not known */
};

struct patch {
    uint16_t id;
    uint16_t feature_count;
    bool     extended;        /* has features that its neighbours told: lattice.h */
    struct patch_light light; /* once refined */
    uint32_t marks[LAYOUT_FEATURES_MAX]; /* by feature index; MARKS_NONE where not found */
};

/* One neighbour of the anchor at hand, relative to it. */
struct patches_neighbour {
    uint32_t mark;
    int32_t  p_q20;      /* from the anchor: see patches.c */
    int32_t  q_q20;
    struct patchmap_place place; /* by the map to the third level's features */
    uint32_t radius_q20; /* in patch sides                */
};

#define PATCHES_SQUARES 16u

struct patches {
    struct patches_settings settings;
    struct patch           *at;          /* by rising id */
    uint32_t            *keys;           /* for sorting */
    uint32_t            *near;           /* marks around the anchor at hand */
    struct patches_neighbour *neighbours;
    uint32_t                count;
    uint32_t                size;
    uint32_t                looks_max;   /* neighbours whose place may be computed */
    /* Counters of the frame. */
    uint32_t anchors;        /* large marks tried                                 */
    uint32_t bad_parity;     /* complete patches whose anchor contradicts the id  */
    uint32_t not_on_target;
    uint32_t twice;          /* ids claimed by two places                         */
    bool     truncated;
    /* Per feature: place relative to the anchor in patch units, Q20, and its direction. */
    struct patches_slot {
        int32_t  u_q20;
        int32_t  v_q20;
        uint32_t distance_q20;
        uint32_t radius_q20;
        uint32_t distance_least_q20; /* of a mark that may be the feature */
        uint32_t distance_most_q20;
        uint32_t radius_least_q20;
        uint32_t radius_most_q20;
        uint16_t direction_turn_q16;
    } slots[LAYOUT_FEATURES_MAX];
    /* Which of the thirteen features may be near: by squares of 1/8 side, from 1 before the anchor on. */
    uint16_t near_square[PATCHES_SQUARES][PATCHES_SQUARES];
    uint32_t farthest_q20; /* of a mark that may be one of the thirteen */
    uint32_t reach_q20; /* how far from an anchor its features are looked for, in patch sides */
};

/* The large circle's radius over that of the bits' circles (the common features at three levels). */
uint32_t patches_size_ratio_q8(unsigned levels);

void patches_init(struct patches *patches, struct arena *arena,
                  const struct patches_settings *settings, unsigned width, unsigned height);

void patches_decode(const struct marks *marks, struct patches *patches);

/* Adds a patch without features at the end of the list; its index, or MARKS_NONE when there is no room. */
uint32_t patches_add_empty(struct patches *patches, uint16_t id);

/* Brings the list back to the order of ids. */
void patches_sort(struct patches *patches);

#endif
