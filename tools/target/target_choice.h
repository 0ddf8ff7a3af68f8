// Which id and which turn each patch of a new target gets.
#ifndef TOOLS_TARGET_TARGET_CHOICE_H
#define TOOLS_TARGET_TARGET_CHOICE_H

#include <cstddef>
#include <cstdint>
#include <set>
#include <vector>

#include "host/base/status.h"

namespace target_maker {

struct Choice {
    std::vector<unsigned> ids;    // row by row, none twice
    std::vector<unsigned> turns;  // 0 or 1
};

// Ids and turns for `count` patches, drawn from the ids 0..4095 that are not in `taken`. Fails when
// fewer are left. The same seed gives the same choice everywhere and for good: the generator is
// std::mt19937_64, which the C++ standard pins, and the draws from it are made here, because the
// standard's distributions differ between libraries:
//   free ids in rising order; for i = 0..count-1 swap number i with number i + draw(free - i);
//   draw(n) takes the next output that is at least 2^64 mod n, and returns it mod n;
//   then one more output a patch: its highest bit is the turn.
rig::Result<Choice> choose_patches(std::size_t count, std::uint64_t seed,
                                   const std::set<unsigned>& taken);

}  // namespace target_maker

#endif
