// See instants.h.
#include "host/assoc/instants.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <set>

namespace rig {

std::vector<std::int64_t> find_instants(const std::vector<Capture>& captures, std::int64_t tolerance_ns)
{
    std::vector<std::size_t> order(captures.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return captures[a].t_ns != captures[b].t_ns ? captures[a].t_ns < captures[b].t_ns
                                                    : captures[a].camera < captures[b].camera;
    });
    std::vector<std::int64_t> instants(captures.size(), 0);
    std::int64_t instant = -1;
    std::int64_t begin_ns = 0;
    std::set<int> present;
    for (const std::size_t i : order) {
        const Capture& capture = captures[i];
        if (instant < 0 || capture.t_ns - begin_ns > tolerance_ns || present.count(capture.camera) != 0) {
            ++instant;
            begin_ns = capture.t_ns;
            present.clear();
        }
        present.insert(capture.camera);
        instants[i] = instant;
    }
    return instants;
}

std::int64_t default_tolerance_ns(const std::vector<Capture>& captures)
{
    std::map<int, std::vector<std::int64_t>> times;
    for (const Capture& capture : captures) {
        times[capture.camera].push_back(capture.t_ns);
    }
    std::int64_t shortest_ns = std::numeric_limits<std::int64_t>::max();
    for (auto& [camera, list] : times) {
        std::sort(list.begin(), list.end());
        std::vector<std::int64_t> gaps;
        for (std::size_t i = 1; i < list.size(); ++i) {
            gaps.push_back(list[i] - list[i - 1]);
        }
        if (!gaps.empty()) {
            std::sort(gaps.begin(), gaps.end());
            shortest_ns = std::min(shortest_ns, gaps[gaps.size() / 2]);
        }
    }
    return shortest_ns == std::numeric_limits<std::int64_t>::max() ? 1000000 : shortest_ns / 10;
}

}  // namespace rig
