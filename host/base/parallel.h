// Loops whose turns are independent, on several threads. A turn writes only what belongs to its own
// index, so that the result does not depend on how many threads there are; sums over turns are made
// afterwards, in order.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

namespace rig {

// Calls body(i) for each i below count, on at most `threads` threads; 0 and 1: on the caller's
// alone. body must not throw. Turns are handed out in runs of `run`: more where one turn takes
// little time.
template <typename Body>
void parallel_for(std::size_t count, int threads, std::size_t run, const Body& body)
{
    const std::size_t runs = (count + run - 1) / run;
    const std::size_t helpers = std::min(static_cast<std::size_t>(std::max(1, threads)), runs);
    std::atomic<std::size_t> next{0};
    const auto work = [&] {
        for (std::size_t taken = next++; taken < runs; taken = next++) {
            const std::size_t end = std::min(count, (taken + 1) * run);
            for (std::size_t i = taken * run; i < end; ++i) {
                body(i);
            }
        }
    };
    std::vector<std::thread> others;
    for (std::size_t i = 1; i < helpers; ++i) {
        others.emplace_back(work);
    }
    work();
    for (std::thread& other : others) {
        other.join();
    }
}

}  // namespace rig
