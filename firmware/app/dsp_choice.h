/* Which variant of the row kernels runs: all give the same bits, so it is only a matter of speed. */
#ifndef TESSERA_FIRMWARE_APP_DSP_CHOICE_H
#define TESSERA_FIRMWARE_APP_DSP_CHOICE_H

#include "firmware/detect/dsp.h"

/* The variants that are built in and that this processor can run, best first; `scalar` is the last.
 * NULL from `index` equal to their number on. */
const struct dsp_kernels *dsp_choice_at(unsigned index);

/* The variant of that name, "best" for the first; NULL when there is none here. In a build with DSP_VERIFY=1 its
 * results are held against plain C's (dsp_verify.h). */
const struct dsp_kernels *dsp_choice_find(const char *name);

/* The names that dsp_choice_find knows here besides "best", for a sentence: "avx2, sse2, scalar". */
const char *dsp_choice_names(void);

#endif
