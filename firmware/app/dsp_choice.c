/* The processor is asked here, outside of the core. */
#include "firmware/app/dsp_choice.h"

#include <stdio.h>
#include <string.h>
#if defined(DSP_HAS_NEON) && !defined(__aarch64__)
#include <asm/hwcap.h>
#include <sys/auxv.h>
#endif

#ifdef DSP_VERIFY
#include "firmware/app/dsp_verify.h"
#endif

#define CHOICES_MAX 4u

/* Fills `out`, best first; their number. */
static unsigned list_choices(const struct dsp_kernels *out[CHOICES_MAX])
{
    unsigned count = 0;
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) {
        out[count++] = &dsp_avx2;
    }
    out[count++] = &dsp_sse2; /* part of the architecture */
#endif
#if defined(__aarch64__)
    out[count++] = &dsp_neon; /* part of the architecture */
#elif defined(DSP_HAS_NEON)
    if ((getauxval(AT_HWCAP) & HWCAP_NEON) != 0) {
        out[count++] = &dsp_neon;
    }
#endif
    out[count++] = &dsp_scalar;
    return count;
}

const struct dsp_kernels *dsp_choice_at(unsigned index)
{
    const struct dsp_kernels *choices[CHOICES_MAX];
    return index < list_choices(choices) ? choices[index] : NULL;
}

static const struct dsp_kernels *for_programs(const struct dsp_kernels *kernels)
{
#ifdef DSP_VERIFY
    return dsp_verify(kernels);
#else
    return kernels;
#endif
}

const struct dsp_kernels *dsp_choice_find(const char *name)
{
    const struct dsp_kernels *choices[CHOICES_MAX];
    const unsigned count = list_choices(choices);
    for (unsigned i = 0; i < count; i++) {
        if (strcmp(name, "best") == 0 || strcmp(name, choices[i]->name) == 0) {
            return for_programs(choices[i]);
        }
    }
    return NULL;
}

const char *dsp_choice_names(void)
{
    static char names[64];
    const struct dsp_kernels *choices[CHOICES_MAX];
    const unsigned count = list_choices(choices);
    names[0] = '\0';
    for (unsigned i = 0; i < count; i++) {
        const size_t used = strlen(names);
        (void)snprintf(names + used, sizeof names - used, "%s%s", i > 0 ? ", " : "",
                       choices[i]->name);
    }
    return names;
}
