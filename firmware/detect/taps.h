/* The Gaussian derivative filters, as integers (tools/gen/taps_table.py says how they are made). */
#ifndef TESSERA_FIRMWARE_DETECT_TAPS_H
#define TESSERA_FIRMWARE_DETECT_TAPS_H

#include <stdint.h>

#define TAPS_RADIUS_MAX 5
#define TAPS_KERNELS    4 /* radius 2, 3, 4, 5: kernel sizes 5, 7, 9, 11 */

/* One half of each kernel; index is the distance from the centre. `smooth` and `second` are
 * symmetric. `first` is applied as a correlation, positive on the side of larger coordinates, so
 * that a ramp of slope 1 gives +1. Sums are exact: 2^15, 0, 0. */
struct taps {
    unsigned radius;
    uint32_t sigma_px_q16;
    int16_t  smooth_q15[TAPS_RADIUS_MAX + 1];
    int16_t  first_q15[TAPS_RADIUS_MAX + 1];
    int16_t  second_q14[TAPS_RADIUS_MAX + 1];
};

extern const struct taps taps_table[TAPS_KERNELS];

#endif
