/* The rim's row kernels (rimrow.h) of a variant against the plain ones, bit for bit. */
#ifndef TESSERA_TESTS_SIMD_SIMD_RIM_H
#define TESSERA_TESTS_SIMD_SIMD_RIM_H

#include <stdbool.h>

#include "firmware/detect/dsp.h"

/* False, and says which kernel, where the variant differs. random: 64 bits each call. */
bool simd_rim_same(const struct dsp_kernels *variant, uint64_t (*random)(void));

#endif
