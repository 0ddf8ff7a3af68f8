/* Random numbers of defined output: a counter is hashed, so that any number of any frame can be had at
 * once, whatever the order or the number of threads. */
#ifndef RENDER_NOISE_H
#define RENDER_NOISE_H

#include <cmath>
#include <cstdint>

namespace render {

// The SplitMix64 finaliser of key + index * golden ratio.
inline std::uint64_t noise_bits(std::uint64_t key, std::uint64_t index)
{
    std::uint64_t z = key + (index + 1) * 0x9e3779b97f4a7c15U;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
    return z ^ (z >> 31);
}

// In (0, 1): odd multiples of 2^-54.
inline double noise_uniform(std::uint64_t key, std::uint64_t index)
{
    return (static_cast<double>(noise_bits(key, index) >> 11) + 0.5) * 0x1p-53;
}

// Two independent normal numbers (Box and Muller).
inline void noise_normal_pair(std::uint64_t key, std::uint64_t index, double out[2])
{
    const double radius = std::sqrt(-2 * std::log(noise_uniform(key, 2 * index)));
    const double angle = 6.28318530717958647692 * noise_uniform(key, 2 * index + 1);
    out[0] = radius * std::cos(angle);
    out[1] = radius * std::sin(angle);
}

} // namespace render

#endif
