/* Looked-up functions of the photometric fit, by linear interpolation in tables
 * (tools/gen/profile_table.py states the interpolation's errors; entries and results are rounded besides, to
 * 1.5e-5 in Q15 and 3e-5 in Q14). */
#ifndef TESSERA_FIRMWARE_DETECT_PROFILE_H
#define TESSERA_FIRMWARE_DETECT_PROFILE_H

#include <assert.h>
#include <stdint.h>

#include "common/fx/fx.h"

extern const uint16_t profile_edge_q15[257];
extern const uint16_t profile_bell_q15[257];
extern const uint16_t profile_root_q14[193];
extern const uint16_t profile_inverse_q15[193];
extern const uint16_t profile_cube_share_q15[258];

/* Between table entries; at_q16 counts entries. */
static inline int32_t profile_between(const uint16_t *table, uint32_t at_q16)
{
    const uint32_t i = at_q16 >> 16;
    const int32_t rest_q16 = (int32_t)(at_q16 & 0xffffu);
    const int32_t step = (int32_t)table[i + 1] - table[i];
    return table[i] + (int32_t)(((int64_t)step * rest_q16 + 32768) >> 16);
}

/* A straight step edge under Gaussian blur, t standard deviations on its bright side: 0..1, Q15; also
 * its slope, the normal density. |t| is cut at 4, where the edge is over but for 3e-5. */
static inline int32_t profile_edge(int32_t t_q16, int32_t *bell_q15)
{
    uint32_t size = t_q16 < 0 ? (uint32_t)-(int64_t)t_q16 : (uint32_t)t_q16;
    const uint32_t last = (4u << 16) - 1;
    size = size > last ? last : size;
    *bell_q15 = profile_between(profile_bell_q15, size << 6);
    const int32_t edge_q15 = profile_between(profile_edge_q15, size << 6);
    return t_q16 < 0 ? 32768 - edge_q15 : edge_q15;
}

/* The even shift that brings x into [2^30, 2^32). x > 0. */
static inline unsigned profile_even_shift(uint32_t x)
{
    return (unsigned)__builtin_clz(x) & ~1u;
}

/* sqrt of x_q24, Q24; relative error 7e-5. */
static inline uint32_t profile_root_q24(uint32_t x_q24)
{
    if (x_q24 == 0) {
        return 0;
    }
    const unsigned shift = profile_even_shift(x_q24);
    const uint32_t m_q30 = x_q24 << shift; /* [1, 4) */
    /* (m - 1) * 64 entries, Q16. */
    const uint32_t root_q14 = (uint32_t)profile_between(profile_root_q14, (m_q30 - (1u << 30)) >> 8);
    /* sqrt(m 2^30 2^-shift 2^-24) = sqrt(m) 2^(3 - shift/2); from Q14 to Q24 that is 13 more. */
    return (uint32_t)(((uint64_t)root_q14 << 13) >> (shift / 2));
}

/* 1 / sqrt of x_q24, Q16, for x at least 2^-12; relative error 7e-5. */
static inline uint32_t profile_inverse_q16(uint32_t x_q24)
{
    assert(x_q24 >= 1u << 12);
    const unsigned shift = profile_even_shift(x_q24);
    const uint32_t m_q30 = x_q24 << shift;
    const uint32_t inverse_q15 =
        (uint32_t)profile_between(profile_inverse_q15, (m_q30 - (1u << 30)) >> 8);
    /* 1 / sqrt(m 2^(6 - shift)) = inverse(m) 2^(shift/2 - 3); from Q15 to Q16 one more. */
    return (uint32_t)(((uint64_t)inverse_q15 << (shift / 2)) >> 2);
}

/* a^3 / (a^3 + b^3) by a^2 / (a^2 + b^2). share_q16 is in 0..65537. */
static inline uint32_t profile_cube_share_q16(uint32_t share_q16)
{
    const uint16_t *table = profile_cube_share_q15 + (share_q16 >> 8);
    const int32_t step = (int32_t)table[1] - table[0];
    return (uint32_t)(table[0] * 256 + step * (int32_t)(share_q16 & 0xffu)) >> 7;
}

#endif
