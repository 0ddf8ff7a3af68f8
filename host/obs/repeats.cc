// See repeats.h.
#include "host/obs/repeats.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <vector>

namespace rig {
namespace {

// A run of observations of one camera, frame and board.
struct Run {
    std::size_t first = 0;
    std::size_t count = 0;
};

bool one_view(const Observation& a, const Observation& b)
{
    return a.camera == b.camera && a.frame == b.frame && a.board == b.board;
}

std::uint64_t bits(double value)
{
    std::uint64_t out = 0;
    std::memcpy(&out, &value, sizeof out);
    return out;
}

// FNV-1a over points and pixels, by 64-bit words.
std::uint64_t digest(const std::vector<Observation>& all, const Run& run)
{
    std::uint64_t sum = 0xCBF29CE484222325u;
    for (std::size_t i = run.first; i < run.first + run.count; ++i) {
        for (const std::uint64_t word : {std::uint64_t{all[i].point}, bits(all[i].pixel.x()),
                                         bits(all[i].pixel.y())}) {
            sum = (sum ^ word) * 0x100000001B3u;
        }
    }
    return sum;
}

bool same(const std::vector<Observation>& all, const Run& a, const Run& b)
{
    return all[a.first].camera == all[b.first].camera && all[a.first].board == all[b.first].board
           && a.count == b.count
           && std::equal(all.begin() + static_cast<std::ptrdiff_t>(a.first),
                         all.begin() + static_cast<std::ptrdiff_t>(a.first + a.count),
                         all.begin() + static_cast<std::ptrdiff_t>(b.first),
                         [](const Observation& x, const Observation& y) {
                             return x.point == y.point && x.pixel == y.pixel;
                         });
}

}  // namespace

void drop_repeats(Scene* scene)
{
    std::vector<Observation>& all = scene->observations;
    std::multimap<std::uint64_t, Run> seen;
    std::size_t kept = 0;
    for (std::size_t first = 0; first < all.size();) {
        Run run{first, 0};
        while (first < all.size() && one_view(all[run.first], all[first])) {
            ++first;
        }
        run.count = first - run.first;
        const std::uint64_t key = digest(all, run);
        const auto [begin, end] = seen.equal_range(key);
        const auto is_it = [&](const auto& item) { return same(all, item.second, run); };
        if (std::any_of(begin, end, is_it)) {
            scene->rejected["view that repeats an earlier frame bit for bit"] += run.count;
            continue;
        }
        std::copy(all.begin() + static_cast<std::ptrdiff_t>(run.first),
                  all.begin() + static_cast<std::ptrdiff_t>(run.first + run.count),
                  all.begin() + static_cast<std::ptrdiff_t>(kept));
        seen.emplace(key, Run{kept, run.count});
        kept += run.count;
    }
    all.resize(kept);
}

}  // namespace rig
