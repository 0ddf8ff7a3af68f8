// See row_times.h.
#include "host/solve/row_times.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace rig {
namespace {

constexpr double kRowTimeWider = 3.0;

}  // namespace

Status check_row_time_reference(const Scene& scene, const std::vector<int>& part_of_camera)
{
    for (std::size_t camera = 0; camera < scene.cameras.size(); ++camera) {
        bool told = !scene.cameras[camera].estimate_row_time;
        for (std::size_t other = 0; other < scene.cameras.size(); ++other) {
            told = told || (part_of_camera[other] == part_of_camera[camera]
                            && scene.cameras[other].row_time_ns != 0.0
                            && !scene.cameras[other].estimate_row_time);
        }
        if (!told) {
            return Status::failure(fmt::format(
                "camera '{}': its row time cannot be estimated, because only a rolling shutter whose "
                "row time is known tells how fast the boards move; give the 'row_time_ns' of a camera "
                "that sees them with it",
                scene.cameras[camera].name));
        }
    }
    return Status();
}

RefineResult refine_rolling(const BundleOptions& options, std::vector<View>* views, RigState* state)
{
    Shutter& shutter = state->shutter;
    const bool estimates = std::count(shutter.estimated.begin(), shutter.estimated.end(), 1) > 0;
    shutter.wider = estimates ? kRowTimeWider : 1.0;
    RefineResult result = refine(options, views, state);
    if (estimates && result.converged) {
        shutter.wider = 1.0;
        shutter.row_times_held = true;
        result = refine(options, views, state);
    }
    return result;
}

Status check_row_times(const Scene& scene, const Solution& solution)
{
    for (const int camera : solution.cameras) {
        const auto c = static_cast<std::size_t>(camera);
        const SceneCamera& known = scene.cameras[c];
        if (!known.estimate_row_time) {
            continue;
        }
        const bool moves = !solution.state.shutter.empty();
        const double deviation_s = moves ? solution.covariance.row_time_s[c] : HUGE_VAL;
        if (!(deviation_s * known.height_px < kImageTimeWorstS)) {
            return Status::failure(fmt::format(
                "camera '{}': its row time cannot be estimated ({}), because the boards hardly move "
                "while rows are read; move them faster, or give its 'row_time_ns'",
                known.name,
                moves && deviation_s < 1e-3 ? fmt::format("known to {:.0f} ns only", 1e9 * deviation_s)
                                            : "nothing tells it"));
        }
    }
    return Status();
}

}  // namespace rig
