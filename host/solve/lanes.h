// Four points at a time: arithmetic on Lanes is that of each of its four numbers alone, in the
// order written, so that results do not depend on how wide the processor's registers are.
#pragma once

#include <cstring>

namespace rig {

enum { kLanes = 4 };
typedef double Lanes __attribute__((vector_size(kLanes * sizeof(double))));

// Compiled twice: for any x86-64, and for those with AVX2, chosen when the program starts.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__SANITIZE_ADDRESS__)
#define RIG_WIDE __attribute__((target_clones("arch=haswell", "default")))
#else
#define RIG_WIDE
#endif
#define RIG_INLINE inline __attribute__((always_inline))

RIG_INLINE void load(const double* from, Lanes& to)
{
    std::memcpy(&to, from, sizeof to);
}

// The sum, always in the same order.
RIG_INLINE double sum(const Lanes& lanes)
{
    return (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
}

}  // namespace rig
