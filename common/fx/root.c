/* Newton's iteration from above, r <- (r + v / r) / 2, starting at a power of two that is not below
 * the root: it falls strictly until it reaches floor(sqrt(v)), so the first step that does not fall
 * ends it. Quadratic convergence: five or six steps for 64 bits. */
#include "common/fx/root.h"

#include "common/fx/fx.h"

uint32_t root_u64(uint64_t value)
{
    if (value <= UINT32_MAX) {
        return root_u32((uint32_t)value);
    }
    /* 2^ceil(bits/2) is above the root; for 64 bits it is 2^32, so the first estimate is one less. */
    const unsigned half = (fx_bits_u64(value) + 1) / 2;
    uint64_t root = half == 32 ? UINT32_MAX : (uint64_t)1 << half;
    for (;;) {
        const uint64_t next = (root + value / root) / 2;
        if (next >= root) {
            return (uint32_t)root;
        }
        root = next;
    }
}

uint32_t root_u32(uint32_t value)
{
    if (value == 0) {
        return 0;
    }
    uint32_t root = (uint32_t)1 << ((fx_bits_u64(value) + 1) / 2);
    for (;;) {
        const uint32_t next = (root + value / root) / 2;
        if (next >= root) {
            return root;
        }
        root = next;
    }
}
