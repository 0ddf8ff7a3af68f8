/* The one reader of target files (JSON, described in common/target/TARGET.md), for both halves.
 * Uses the heap while it reads and keeps nothing there. */
#ifndef COMMON_TARGETFILE_TARGETFILE_H
#define COMMON_TARGETFILE_TARGETFILE_H

#include <stdbool.h>
#include <stddef.h>

#include "common/target/target.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    TARGETFILE_ERROR_BYTES = 512,
    TARGETFILE_BYTES_MAX = 1 << 20, /* the largest target needs some 40 KiB, indented 200 */
    TARGETFILE_KEYS_MAX = 256       /* top-level keys, x_ ones included */
};

struct targetfile {
    struct target target;     /* prepared: target_find works */
    double patch_mm;          /* nominal side of a patch, [0.01, 100000]             */
    double circle_ratio;      /* [0.05, 1]                                           */
    double edge_level;        /* [0.05, 1]                                           */
    double gauss_sigma;       /* [0.01, 100]                                         */
    double margin;            /* white border round the grid, patch sides, [0, 10]   */
    double measured_scale[2]; /* print's measured size over nominal, x, y, [0.5, 2]  */
};

/* Reads a target file. On failure returns false with one sentence in `error` that names the file
 * and the key at fault; *out is then not to be used. */
bool targetfile_read(const char *path, struct targetfile *out,
                     char error[TARGETFILE_ERROR_BYTES]);

/* The same from text in memory; `source` is what the sentence calls it. */
bool targetfile_parse(const char *text, size_t bytes, const char *source, struct targetfile *out,
                      char error[TARGETFILE_ERROR_BYTES]);

/* Centre of a feature in the board frame, millimetres: X right, Y down, origin at the outer corner
 * of patch (0, 0), Z always 0; the patch's turn and measured_scale applied. *radius_mm is the
 * circle's radius. (Where the two scales differ the print's circle is an ellipse by their ratio;
 * the radius is then that of the circle of equal area.) False, and nothing written, when the patch
 * is not on the target or has no such feature. radius_mm may be NULL. */
bool targetfile_point_mm(const struct targetfile *file, unsigned patch_id, unsigned feature,
                         double xyz_mm[3], double *radius_mm);

#ifdef __cplusplus
}
#endif

#endif
