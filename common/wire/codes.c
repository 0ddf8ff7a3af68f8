/* value = base * 2^(code / 3). The nearest code in the logarithm changes where the value passes
 * base * 2^((code + 1/2) / 3); the three boundaries of one octave are constants, the octave is a
 * shift, so no logarithm is taken. */
#include "common/wire/codes.h"

#include <assert.h>

/* 2^(k/3) and 2^((k + 1/2)/3), k = 0, 1, 2. */
static const uint32_t third_q30[3] = { 1073741824, 1352829926, 1704458901 };
static const uint32_t boundary_q30[3] = { 1205234447, 1518500250, 1913190429 };
/* Left shifts that turn a quantity into units of its code 0: sigma from 2^-24 px to 2^-11 px,
 * size from 2^-16 px to 1 px, both then in 30 fraction bits. */
enum { SIGMA_SHIFT = 30 - (24 - 11), SIZE_SHIFT = 30 - 16 };

static uint32_t code_of(uint64_t units_q30)
{
    uint32_t code = 0;
    while (code < CODES_COUNT - 1 && units_q30 >= (uint64_t)boundary_q30[code % 3] << (code / 3)) {
        code++;
    }
    return code;
}

static uint32_t value_of(uint32_t code, uint32_t shift)
{
    assert(code < CODES_COUNT);
    const uint64_t units_q30 = (uint64_t)third_q30[code % 3] << (code / 3);
    return (uint32_t)((units_q30 + ((uint64_t)1 << (shift - 1))) >> shift);
}

uint32_t codes_of_sigma(uint32_t sigma_px_q24)
{
    return code_of((uint64_t)sigma_px_q24 << SIGMA_SHIFT);
}

uint32_t codes_of_size(uint32_t size_px_q16)
{
    return code_of((uint64_t)size_px_q16 << SIZE_SHIFT);
}

uint32_t codes_sigma_px_q24(uint32_t code)
{
    return value_of(code, SIGMA_SHIFT);
}

uint32_t codes_size_px_q16(uint32_t code)
{
    return value_of(code, SIZE_SHIFT);
}
