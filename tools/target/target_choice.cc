#include "tools/target/target_choice.h"

#include <random>
#include <utility>

#include <fmt/format.h>

#include "common/target/layout.h"

namespace target_maker {

namespace {

// Uniform in 0..n-1: outputs below 2^64 mod n are passed over, so that n divides what remains.
std::uint64_t draw(std::mt19937_64& generator, std::uint64_t n)
{
    const std::uint64_t passed_over = (0 - n) % n;
    std::uint64_t output = generator();
    while (output < passed_over) {
        output = generator();
    }
    return output % n;
}

}  // namespace

rig::Result<Choice> choose_patches(std::size_t count, std::uint64_t seed,
                                   const std::set<unsigned>& taken)
{
    std::vector<unsigned> free;
    for (unsigned id = 0; id < LAYOUT_IDS; id++) {
        if (taken.count(id) == 0) {
            free.push_back(id);
        }
    }
    if (count > free.size()) {
        return rig::Status::failure(
            fmt::format("--rows and --cols ask for {} patches, but only {} ids are free; make the "
                        "target smaller{}",
                        count, free.size(), taken.empty() ? "" : " or exclude fewer"));
    }
    std::mt19937_64 generator(seed);
    for (std::size_t i = 0; i < count; i++) {
        std::swap(free[i], free[i + static_cast<std::size_t>(draw(generator, free.size() - i))]);
    }
    Choice choice;
    choice.ids.assign(free.begin(), free.begin() + static_cast<std::ptrdiff_t>(count));
    for (std::size_t i = 0; i < count; i++) {
        choice.turns.push_back(static_cast<unsigned>(generator() >> 63));
    }
    return choice;
}

}  // namespace target_maker
