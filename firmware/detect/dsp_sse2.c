/* The row kernels with 128-bit vectors: every x86-64 processor has them. */
#include "firmware/detect/dsp.h"

#if defined(__x86_64__)
#include <emmintrin.h>

/* (a b + 2^14) >> 15: twice the upper half, and what the lower half's highest bits bring. */
static inline __m128i rounded_product(__m128i a, __m128i b)
{
    const __m128i low = _mm_mullo_epi16(a, b);
    const __m128i one = _mm_and_si128(_mm_srli_epi16(low, 14), _mm_set1_epi16(1));
    const __m128i high = _mm_mulhi_epi16(a, b);
    return _mm_add_epi16(_mm_add_epi16(high, high),
                         _mm_add_epi16(_mm_srli_epi16(low, 15), one));
}

static inline void store_wide(void *out, __m128i low, __m128i high)
{
    __m128i *at = (__m128i *)out;
    _mm_storeu_si128(at, low);
    _mm_storeu_si128(at + 1, high);
}

#define VEC              __m128i
#define LANES            8u
#define V(op)            _mm_##op
#define LOAD(p)          _mm_loadu_si128((const __m128i *)(const void *)(p))
#define STORE(p, v)      _mm_storeu_si128((__m128i *)(void *)(p), v)
#define LOAD_BYTES(p)    _mm_unpacklo_epi8(_mm_loadl_epi64((const __m128i *)(const void *)(p)), \
                                           _mm_setzero_si128())
#define SIGNS(v)         ((unsigned)_mm_movemask_epi8(_mm_packs_epi16(v, _mm_setzero_si128())))
#define STORE_WIDE(p, s) store_wide(p, (s).low, (s).high)
#define QUARTERS(v)      (v)
#define AND(a, b)        _mm_and_si128(a, b)
#define ANDNOT(a, b)     _mm_andnot_si128(a, b)
#define OR(a, b)         _mm_or_si128(a, b)
#define ZERO             _mm_setzero_si128()
#define ROUNDED(a, b)    rounded_product(a, b)
#define KERNELS          dsp_sse2
#define NAME             "sse2"
#include "firmware/detect/dsp_x86_rows.h"
#endif
