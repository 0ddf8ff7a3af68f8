/* One printed target as the detector needs it: integers only, no heap. Read from its file by
 * common/targetfile; the geometry inside a patch is in layout.h. */
#ifndef COMMON_TARGET_TARGET_H
#define COMMON_TARGET_TARGET_H

#include <stdbool.h>
#include <stdint.h>

#include "common/target/layout.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    TARGET_PATCHES_MAX = LAYOUT_IDS, /* ids are unique, so there cannot be more; 20 KiB in all */
    TARGET_NAME_BYTES = 64           /* UTF-8 with its final zero */
};

struct target {
    char name[TARGET_NAME_BYTES];     /* for people; empty when the file has none       */
    uint16_t rows;                    /* 1..4096                                        */
    uint16_t cols;                    /* 1..4096, rows x cols <= TARGET_PATCHES_MAX     */
    uint8_t levels;                   /* 2 or 3                                         */
    uint32_t circle_ratio_q16;        /* circle radius / inradius, (0, 65536]           */
    uint32_t edge_level_q16;          /* a white circle's reflectance where its Gaussian peak has
                                         died away, (0, 65536]; 65536: a flat disc     */
    uint32_t gauss_sigma_q16;         /* of the peak, in circle radii; above 0          */
    int64_t patch_nm;                 /* nominal side of a patch, nanometres, above 0   */
    uint16_t ids[TARGET_PATCHES_MAX]; /* at row * cols + col; below 4096, none twice    */
    uint8_t turns[TARGET_PATCHES_MAX]; /* 1: the patch stands rotated by half a turn     */
    uint16_t place_plus_1[LAYOUT_IDS]; /* by id: row * cols + col + 1, or 0 when not on the target;
                                          written by target_prepare                       */
};

enum target_status {
    TARGET_OK = 0,
    TARGET_BAD_SIZE,   /* rows, cols or patch_nm */
    TARGET_BAD_LEVELS,
    TARGET_BAD_CIRCLE, /* circle_ratio, edge_level or gauss_sigma */
    TARGET_BAD_ID,     /* above 4095 */
    TARGET_SAME_ID,    /* an id stands twice */
    TARGET_BAD_TURN    /* neither 0 nor 1 */
};

/* Checks every field and writes the map that target_find looks in. For the three statuses about a
 * patch, *bad_place is row * cols + col of the first one at fault. The map is of use only after
 * TARGET_OK. */
enum target_status target_prepare(struct target *target, unsigned *bad_place);

/* Where patch `id` stands, in constant time; false, and nothing written, when it is not on the
 * target. Any 16-bit id may be asked for. */
bool target_find(const struct target *target, uint16_t id, uint16_t *row, uint16_t *col,
                 uint8_t *turn);

/* 64 bits that name the pattern: equal for targets that a detector and a solver would treat the
 * same. FNV-1a (64 bits) over these bytes, integers little-endian: rows (2), cols (2), levels (1),
 * circle_ratio_q16 (4), edge_level_q16 (4), gauss_sigma_q16 (4), patch_nm (8), then row by row for
 * each patch id (2) and turn (1). Left out: the name, the margin, x_ keys, and measured_scale,
 * which is found by measuring a print that already carries this digest in its caption. Never 0, so
 * that 0 can say "no target". */
uint64_t target_digest(const struct target *target);

#ifdef __cplusplus
}
#endif

#endif
