/* Five-bit codes, three to an octave, for a feature's sigma and size. */
#ifndef TESSERA_COMMON_WIRE_CODES_H
#define TESSERA_COMMON_WIRE_CODES_H

#include <stdint.h>

#define CODES_COUNT 32u

/* The nearest code in the logarithm, saturating. */
uint32_t codes_of_sigma(uint32_t sigma_px_q24);
uint32_t codes_of_size(uint32_t size_px_q16);

/* What a code (below CODES_COUNT) stands for: sigma 2^(-11 + code/3) px, size 2^(code/3) px,
 * rounded. */
uint32_t codes_sigma_px_q24(uint32_t code);
uint32_t codes_size_px_q16(uint32_t code);

#endif
