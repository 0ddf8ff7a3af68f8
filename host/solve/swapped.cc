// See swapped.h.
#include "host/solve/swapped.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace rig {
namespace {

// Lenses of two halves of a recording differ by what their views leave open; two cameras of one
// make differ by pixels. One that is this much nearer to the other's than to its own former is the
// other's.
constexpr double kNearerPart = 0.3;

// Views of one camera before or from a frame on.
std::optional<Camera> lens_of_half(const Scene& scene, const ViewSet& set, int camera, CameraModel model,
                                   const Change& change, bool after)
{
    ViewSet half;
    for (const View& view : set.views) {
        if (view.camera == camera && (view.frame >= change.first_after) == after) {
            half.views.push_back(view);
        }
    }
    const Result<CameraAlone> alone = calibrate_alone(scene, half, camera, model);
    return alone.ok() ? std::optional<Camera>(alone.value().lens) : std::nullopt;
}

// Root mean square distance of the same ray's pixels over the image, px.
double distance_px(const Camera& a, const Camera& b, const SceneCamera& camera)
{
    constexpr int kSteps = 8;
    double squares = 0.0;
    int count = 0;
    for (int i = 1; i < kSteps; ++i) {
        for (int j = 1; j < kSteps; ++j) {
            const Eigen::Vector2d pixel(camera.width_px * i / kSteps, camera.height_px * j / kSteps);
            const Eigen::Vector2d other = b.project(a.unproject(pixel));
            if (other.allFinite()) {
                squares += (other - pixel).squaredNorm();
                ++count;
            }
        }
    }
    return count > 0 ? std::sqrt(squares / count) : HUGE_VAL;
}

bool are_swapped(const Scene& scene, const ViewSet& set, const std::vector<LensChoice>& lenses, int a,
                 int b, const Change& change_a, const Change& change_b)
{
    const CameraModel model_a = lenses[static_cast<std::size_t>(a)].model;
    const CameraModel model_b = lenses[static_cast<std::size_t>(b)].model;
    const bool together =
        change_a.last_before <= change_b.first_after && change_b.last_before <= change_a.first_after;
    const SceneCamera& known_a = scene.cameras[static_cast<std::size_t>(a)];
    const SceneCamera& known_b = scene.cameras[static_cast<std::size_t>(b)];
    if (!together || known_a.width_px != known_b.width_px || known_a.height_px != known_b.height_px) {
        return false;
    }
    const auto a_before = lens_of_half(scene, set, a, model_a, change_a, false);
    const auto a_after = lens_of_half(scene, set, a, model_a, change_a, true);
    const auto b_before = lens_of_half(scene, set, b, model_b, change_b, false);
    const auto b_after = lens_of_half(scene, set, b, model_b, change_b, true);
    if (!a_before || !a_after || !b_before || !b_after) {
        return false;
    }
    const double own = std::min(distance_px(*a_before, *a_after, known_a),
                                distance_px(*b_before, *b_after, known_b));
    const double other = std::max(distance_px(*a_before, *b_after, known_a),
                                  distance_px(*b_before, *a_after, known_b));
    return other < kNearerPart * own;
}

}  // namespace

Status check_lenses(const Scene& scene, const ViewSet& set, const std::vector<LensChoice>& lenses,
                    const std::vector<std::optional<Change>>& change)
{
    for (std::size_t a = 0; a < change.size(); ++a) {
        if (!change[a]) {
            continue;
        }
        for (std::size_t b = a + 1; b < change.size(); ++b) {
            if (change[b]
                && are_swapped(scene, set, lenses, static_cast<int>(a), static_cast<int>(b), *change[a],
                               *change[b])) {
                return Status::failure(fmt::format(
                    "cameras '{}' and '{}' have each other's lens from frame {} on: their names were "
                    "swapped between recordings; swap them back in one of these and solve again",
                    scene.cameras[a].name, scene.cameras[b].name,
                    std::min(change[a]->first_after, change[b]->first_after)));
            }
        }
        return Status::failure(fmt::format(
            "the lens of camera '{}' changed between frames {} and {}: its focus, zoom or mount was "
            "touched, or another camera got its name; solve what was recorded before and after apart",
            scene.cameras[a].name, change[a]->last_before, change[a]->first_after));
    }
    return Status();
}

}  // namespace rig
