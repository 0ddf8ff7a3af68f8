/* Sums of products beyond 64 bits, with the same results on processors that have no such type. */
#ifndef TESSERA_COMMON_FX_WIDE_H
#define TESSERA_COMMON_FX_WIDE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__SIZEOF_INT128__)

__extension__ typedef __int128 fx_wide;

static inline fx_wide fx_wide_product(int64_t a, int64_t b)
{
    return (fx_wide)a * b;
}

static inline fx_wide fx_wide_difference(fx_wide a, fx_wide b)
{
    return a - b;
}

/* value / 2^30, rounded to nearest; |value| below 2^92. */
static inline int64_t fx_wide_shift_30(fx_wide value)
{
    return (int64_t)((value + (1 << 29)) >> 30);
}

#else

/* high 2^64 + low. */
typedef struct {
    int64_t  high;
    uint64_t low;
} fx_wide;

static inline fx_wide fx_wide_difference(fx_wide a, fx_wide b)
{
    const fx_wide difference = {a.high - b.high - (a.low < b.low ? 1 : 0), a.low - b.low};
    return difference;
}

/* |a| and |b| below 2^63; four products of 32-bit halves. */
static inline fx_wide fx_wide_product(int64_t a, int64_t b)
{
    const uint64_t a_size = a < 0 ? 0 - (uint64_t)a : (uint64_t)a;
    const uint64_t b_size = b < 0 ? 0 - (uint64_t)b : (uint64_t)b;
    const uint64_t low = (a_size & UINT32_MAX) * (b_size & UINT32_MAX);
    const uint64_t cross = (a_size >> 32) * (b_size & UINT32_MAX);
    const uint64_t middle = (a_size & UINT32_MAX) * (b_size >> 32) + (low >> 32) + (cross & UINT32_MAX);
    const fx_wide size = {(int64_t)((a_size >> 32) * (b_size >> 32) + (cross >> 32) + (middle >> 32)),
                          (middle << 32) | (low & UINT32_MAX)};
    const fx_wide zero = {0, 0};
    return (a < 0) != (b < 0) ? fx_wide_difference(zero, size) : size;
}

/* value / 2^30, rounded to nearest; |value| below 2^92. */
static inline int64_t fx_wide_shift_30(fx_wide value)
{
    const uint64_t low = value.low + (1u << 29);
    const uint64_t high = (uint64_t)value.high + (low < value.low ? 1 : 0);
    return (int64_t)(high << 34 | low >> 30);
}

#endif

#ifdef __cplusplus
}
#endif

#endif
