/* Decoded patches and the target -> every other circle of the target that can be seen.
 *
 * Where the target is known, a decoded patch says what lies beside it. For each patch of the target that is
 * not whole yet, the features found around it are fitted by a map of second order from the board to the
 * image; it predicts where the patch's missing circles must be and what they look like, and the profile fit
 * (refine.h) decides on the pixels whether they are there: right colour, right size, right place, nothing
 * in front. What was found so takes part in the next round, until a round finds nothing. */
#ifndef TESSERA_FIRMWARE_DETECT_LATTICE_H
#define TESSERA_FIRMWARE_DETECT_LATTICE_H

#include "firmware/detect/refine.h"

/* How far a circle may lie from where its neighbours predict it: half a pixel, or a sixth of its radius for
 * large ones, whose surroundings bend more. */
#define LATTICE_OFF_MAX_PX_Q16 32768
#define LATTICE_OFF_SHARE      6

struct lattice {
    struct boardmap_pair *pairs; /* of the fit at hand */
    uint32_t *patch_of;  /* by row * cols + col of the target: index in the list, or MARKS_NONE */
    uint8_t  *wanted;    /* likewise: the last round in which another look may find more */
    uint32_t  added;     /* features found here, of the frame */
    bool      truncated; /* a patch or mark had no room       */
};

void lattice_init(struct lattice *lattice, struct arena *arena);

/* Completes the patches; does nothing where no target is known. The list is sorted by id again. */
void lattice_extend(struct lattice *lattice, struct refine *refine,
                    const struct frame_view *frame, struct patches *patches, struct marks *marks);

#endif
