// See scale.h. A board that is larger by a factor than its file says makes every distance smaller
// by that factor, whatever the lens. The distance of two cameras is taken as the median over the
// places at which both see the board, its deviation from the median deviation.
#include "host/solve/scale.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "host/base/median.h"

namespace rig {
namespace {

constexpr std::size_t kPlacesMin = 5;
constexpr double kSigmas = 6.0;

struct Distance {
    std::vector<double> all_mm;
    double median_mm = 0.0;
    double sigma_part = 0.0;  // of the median, relative
};

// Of a Gaussian sample the median deviates by 1.2533 / sqrt(n) sigmas, and sigma is 1.4826 median
// deviations.
void settle(Distance* distance)
{
    distance->median_mm = median_of(&distance->all_mm);
    std::vector<double> off;
    for (const double each : distance->all_mm) {
        off.push_back(std::abs(each - distance->median_mm));
    }
    distance->sigma_part = 1.2533 * 1.4826 * median_of(&off)
                           / std::sqrt(static_cast<double>(off.size())) / distance->median_mm;
}

using Pair = std::pair<int, int>;  // cameras

std::map<Pair, std::map<int, Distance>> distances(const Scene& scene, const ViewSet& set,
                                                  const std::vector<Pose>& by_view)
{
    std::map<std::pair<int, std::int64_t>, std::vector<std::size_t>> places;
    for (std::size_t i = 0; i < set.views.size(); ++i) {
        const View& view = set.views[i];
        const bool is_static = scene.boards[static_cast<std::size_t>(view.board)].is_static;
        if (!is_static) {
            places[{view.board, view.frame}].push_back(i);
        }
    }
    std::map<Pair, std::map<int, Distance>> out;
    for (const auto& [key, views] : places) {
        for (std::size_t i = 0; i < views.size(); ++i) {
            for (std::size_t j = i + 1; j < views.size(); ++j) {
                const Pose b_from_a = by_view[views[j]] * inverse(by_view[views[i]]);
                out[{set.views[views[i]].camera, set.views[views[j]].camera}][key.first].all_mm.push_back(
                    b_from_a.translation_mm.norm());
            }
        }
    }
    for (auto& [pair, boards] : out) {
        for (auto& [board, distance] : boards) {
            settle(&distance);
        }
    }
    return out;
}

}  // namespace

Status check_scale(const Scene& scene, const ViewSet& set, const std::vector<Pose>& by_view)
{
    for (const auto& [pair, boards] : distances(scene, set, by_view)) {
        for (auto a = boards.begin(); a != boards.end(); ++a) {
            for (auto b = std::next(a); b != boards.end(); ++b) {
                const Distance& one = a->second;
                const Distance& other = b->second;
                const double part = one.median_mm / other.median_mm - 1.0;
                const double sigma = std::hypot(one.sigma_part, other.sigma_part);
                if (std::min(one.all_mm.size(), other.all_mm.size()) < kPlacesMin
                    || !(std::abs(part) > std::max(kScaleWorstPart, kSigmas * sigma))) {
                    continue;
                }
                const auto board = [&](int i) { return scene.boards[static_cast<std::size_t>(i)].name; };
                const auto camera = [&](int i) { return scene.cameras[static_cast<std::size_t>(i)].name; };
                return Status::failure(fmt::format(
                    "boards '{}' and '{}' contradict each other in size: cameras '{}' and '{}' are {:.1f} mm "
                    "apart by the first and {:.1f} mm by the second, {:.1f} % less; measure both prints and "
                    "correct their files",
                    board(part > 0.0 ? a->first : b->first), board(part > 0.0 ? b->first : a->first),
                    camera(pair.first), camera(pair.second), std::max(one.median_mm, other.median_mm),
                    std::min(one.median_mm, other.median_mm),
                    100.0 * (1.0 - std::min(one.median_mm, other.median_mm)
                                       / std::max(one.median_mm, other.median_mm))));
            }
        }
    }
    return Status();
}

}  // namespace rig
