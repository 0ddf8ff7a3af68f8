/* How vector kernels walk a row, LANES pixels at a time; the including file defines LANES. */
#ifndef TESSERA_FIRMWARE_DETECT_DSP_BLOCKS_H
#define TESSERA_FIRMWARE_DETECT_DSP_BLOCKS_H

#include <stddef.h>

#include "firmware/detect/dsp.h"

/* The place of the block after x: the last one ends with the row, overlapping the one before. */
static inline unsigned next_block(unsigned x, unsigned width)
{
    return x + LANES < width && x + 2 * LANES > width ? width - LANES : x + LANES;
}

/* The places of a row's values from its first: one register serves all rows. */
struct places {
    ptrdiff_t smooth;
    ptrdiff_t first;
    ptrdiff_t second;
};

static inline struct places places_at(unsigned x, const struct dsp_row *row)
{
    const ptrdiff_t at = (ptrdiff_t)x;
    return (struct places){at, at + (row->first_q3 - row->smooth_q3),
                           at + (row->second_q2 - row->smooth_q3)};
}

#endif
