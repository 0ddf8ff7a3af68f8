/* Half the frame's size: each pixel is the mean of four. Included by the dsp_*.c that have no better
 * way, like rimrow_loops.h. */
#ifndef TESSERA_FIRMWARE_DETECT_HALVE_LOOPS_H
#define TESSERA_FIRMWARE_DETECT_HALVE_LOOPS_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Two rows of 2 * width bytes, grey levels of 256, into one of luma. */
static void halve_bytes(const uint8_t *restrict above, const uint8_t *restrict below, unsigned width,
                        uint16_t *restrict out_grey_q4)
{
    for (size_t x = 0; x < width; x++) {
        uint16_t upper; /* two bytes at once, whichever is which */
        uint16_t lower;
        memcpy(&upper, above + 2 * x, sizeof upper);
        memcpy(&lower, below + 2 * x, sizeof lower);
        const int sum = (upper & 255) + (upper >> 8) + (lower & 255) + (lower >> 8);
        out_grey_q4[x] = (uint16_t)(sum * 4);
    }
}

#endif
