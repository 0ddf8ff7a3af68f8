/* The row kernels with 256-bit vectors; compiled with -mavx2, so nobody calls them before asking the
 * processor (app/dsp_choice.h). */
#include "firmware/detect/dsp.h"

#if defined(__x86_64__)
#include <immintrin.h>

/* Unpacking has left the quarters of a row as first, third and second, fourth. */
static inline void store_wide(void *out, __m256i low, __m256i high)
{
    __m256i *at = (__m256i *)out;
    _mm256_storeu_si256(at, _mm256_permute2x128_si256(low, high, 0x20));
    _mm256_storeu_si256(at + 1, _mm256_permute2x128_si256(low, high, 0x31));
}

#define VEC              __m256i
#define LANES            16u
#define V(op)            _mm256_##op
#define LOAD(p)          _mm256_loadu_si256((const __m256i *)(const void *)(p))
#define STORE(p, v)      _mm256_storeu_si256((__m256i *)(void *)(p), v)
#define LOAD_BYTES(p)    _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)(const void *)(p)))
#define SIGNS(v)         ((unsigned)_mm_movemask_epi8(_mm_packs_epi16( \
                             _mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1))))
#define STORE_WIDE(p, s) store_wide(p, (s).low, (s).high)
#define QUARTERS(v)      _mm_add_epi32(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1))
#define AND(a, b)        _mm256_and_si256(a, b)
#define ANDNOT(a, b)     _mm256_andnot_si256(a, b)
#define OR(a, b)         _mm256_or_si256(a, b)
#define ZERO             _mm256_setzero_si256()
#define ROUNDED(a, b)    _mm256_mulhrs_epi16(a, b)
#define KERNELS          dsp_avx2
#define NAME             "avx2"
#include "firmware/detect/dsp_x86_rows.h"
#endif
