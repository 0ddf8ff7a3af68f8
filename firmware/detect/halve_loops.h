/* Half the frame's size: each pixel is the mean of four. Included by every dsp_*.c, like rimrow_loops.h. */
#ifndef TESSERA_FIRMWARE_DETECT_HALVE_LOOPS_H
#define TESSERA_FIRMWARE_DETECT_HALVE_LOOPS_H

#include <stdint.h>

/* Two rows of 2 * width bytes, grey levels of 256, into one of luma. */
static void halve_bytes(const uint8_t *restrict above, const uint8_t *restrict below, unsigned width,
                        uint16_t *restrict out_grey_q4)
{
    for (unsigned x = 0; x < width; x++) {
        const int sum = above[2 * x] + above[2 * x + 1] + below[2 * x] + below[2 * x + 1];
        out_grey_q4[x] = (uint16_t)(sum * 4);
    }
}

#endif
