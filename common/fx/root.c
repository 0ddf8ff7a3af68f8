/* The value is shifted by an even number of bits into [1, 4), a parabola gives its root to half a percent, and each of
 * Newton's steps, r <- (r + v / r) / 2, squares the error: to 1.3e-5, then to 8e-11. A step never ends below the root
 * but for what is cut off, so that what it gives is the root, rounded down, or little more. */
#include "common/fx/root.h"

/* The root of m in [1, 4), within 0.51 %. */
static uint32_t rough_root_q15(uint32_t m_q14)
{
    static const uint32_t at_0_q15 = 16992;   /* 0.51855 */
    static const uint32_t slope_q15 = 17236;  /* 0.52601 */
    static const uint32_t bend_q15 = 1296;    /* 0.03954 */
    return at_0_q15 + (((slope_q15 - ((bend_q15 * m_q14) >> 14)) * m_q14) >> 14);
}

uint32_t root_u64(uint64_t value)
{
    if (value <= UINT32_MAX) {
        return root_u32((uint32_t)value);
    }
    const unsigned shift = (unsigned)__builtin_clzll(value) & ~1u;
    const uint64_t m_q62 = value << shift;
    uint64_t root_q31 = (uint64_t)rough_root_q15((uint32_t)(m_q62 >> 48)) << 16;
    root_q31 = (root_q31 + m_q62 / root_q31) / 2;
    root_q31 = (root_q31 + m_q62 / root_q31) / 2;
    root_q31 = root_q31 > UINT32_MAX ? UINT32_MAX : root_q31;
    while (root_q31 * root_q31 > m_q62) {
        root_q31--;
    }
    return (uint32_t)(root_q31 >> (shift / 2));
}

uint32_t root_u32(uint32_t value)
{
    if (value == 0) {
        return 0;
    }
    const unsigned shift = (unsigned)__builtin_clz(value) & ~1u;
    const uint32_t m_q30 = value << shift;
    uint32_t root_q15 = rough_root_q15(m_q30 >> 16);
    root_q15 = (root_q15 + m_q30 / root_q15) / 2;
    root_q15 = root_q15 > UINT16_MAX ? UINT16_MAX : root_q15;
    while (root_q15 * root_q15 > m_q30) {
        root_q15--;
    }
    return root_q15 >> (shift / 2);
}
