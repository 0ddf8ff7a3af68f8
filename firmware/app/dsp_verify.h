/* Every result of a vector variant held against plain C while the program runs, on whatever frames come: the last
 * line behind `make simd` and `make golden`. Programs built with DSP_VERIFY=1 run all variants so. */
#ifndef TESSERA_FIRMWARE_APP_DSP_VERIFY_H
#define TESSERA_FIRMWARE_APP_DSP_VERIFY_H

#include "firmware/detect/dsp.h"

/* Who hears of a difference: the kernel's name, the variant's, and how many values the call was for. */
typedef void dsp_verify_listener(const char *kernel, const char *variant, unsigned count);

/* Kernels that run `variant`, whose results they hand on, and plain C beside it. One variant at a time: what an
 * earlier call returned runs the later one's. Rows are at most LIMIT_SIDE_PX wide. */
const struct dsp_kernels *dsp_verify(const struct dsp_kernels *variant);

/* NULL: a difference is one sentence on standard error and ends the program (abort). */
void dsp_verify_tell(dsp_verify_listener *listener);

#endif
