/* The filters along both axes from their blocks, which the including file defines for its vectors:
 *
 *   along_x_block(taps, radius, luma_grey_q4, out, x)  LANES pixels from x on of a row
 *   along_y_block(taps, radius, rows, places, out, x)  the same of the row between rows
 *
 * With the radius known the compiler unrolls them; the frequent ones are. */
#ifndef TESSERA_FIRMWARE_DETECT_DSP_ALONG_H
#define TESSERA_FIRMWARE_DETECT_DSP_ALONG_H

#include "firmware/detect/dsp_blocks.h"

/* Whole blocks, and one that ends with the row. */
static inline __attribute__((always_inline)) void along_x_row(const struct taps *taps,
                                                              unsigned radius,
                                                              const uint16_t *luma_grey_q4,
                                                              unsigned width,
                                                              const struct dsp_row *out)
{
    /* Nothing that is written can be a part of these: they stay in registers. */
    const struct taps own = *taps;
    const struct dsp_row to = *out;
    for (unsigned x = 0; x < width - LANES; x += LANES) {
        along_x_block(&own, radius, luma_grey_q4, &to, x);
    }
    along_x_block(&own, radius, luma_grey_q4, &to, width - LANES);
}

static void along_x(const struct taps *taps, const uint16_t *luma_grey_q4, unsigned width,
                    const struct dsp_row *out)
{
    if (width < LANES) {
        dsp_scalar.along_x(taps, luma_grey_q4, width, out);
    } else if (taps->radius == 2) {
        along_x_row(taps, 2, luma_grey_q4, width, out);
    } else if (taps->radius == 3) {
        along_x_row(taps, 3, luma_grey_q4, width, out);
    } else {
        along_x_row(taps, taps->radius, luma_grey_q4, width, out);
    }
}

static inline __attribute__((always_inline)) void along_y_row(const struct taps *taps,
                                                              unsigned radius,
                                                              const struct dsp_row rows[],
                                                              unsigned width,
                                                              const struct dsp_gradient *out)
{
    const struct taps own = *taps;
    const struct dsp_gradient to = *out;
    const struct dsp_row any = rows[0];
    const int16_t *from[2 * TAPS_RADIUS_MAX + 1];
    for (unsigned i = 0; i <= 2 * radius; i++) {
        from[i] = rows[i].smooth_q3;
    }
    for (unsigned x = 0; x < width - LANES; x += LANES) {
        along_y_block(&own, radius, from, places_at(x, &any), &to, x);
    }
    along_y_block(&own, radius, from, places_at(width - LANES, &any), &to, width - LANES);
}

static void along_y(const struct taps *taps, const struct dsp_row rows[], unsigned width,
                    const struct dsp_gradient *out)
{
    if (width < LANES) {
        dsp_scalar.along_y(taps, rows, width, out);
    } else if (taps->radius == 2) {
        along_y_row(taps, 2, rows, width, out);
    } else if (taps->radius == 3) {
        along_y_row(taps, 3, rows, width, out);
    } else {
        along_y_row(taps, taps->radius, rows, width, out);
    }
}

#endif
