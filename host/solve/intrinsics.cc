// See intrinsics.h. The lens is freed by and by: focal length, radial terms, everything.
#include "host/solve/intrinsics.h"

#include <fmt/format.h>

#include "host/solve/robust.h"
#include "host/solve/seed.h"

namespace rig {
namespace {

// A typical misfit above this part of the image's width means that what was solved is not what was
// seen: the worst lens left unmodelled by Brown's terms stays well below.
constexpr double kMisfitPart = 0.005;

// The robust standard deviation in pixels: the whitened one times the points' typical sigma.
double noise_px(const RigState& state, const std::vector<View>& views)
{
    std::vector<View> in_px = views;
    for (View& view : in_px) {
        for (ViewPoint& point : view.points) {
            point.sigma_px = 1.0;
        }
    }
    return noise_factors(state, in_px)[0];
}

}  // namespace

Result<CameraAlone> calibrate_alone(const Scene& scene, const ViewSet& set, int camera,
                                    CameraModel model)
{
    const SceneCamera& known = scene.cameras[static_cast<std::size_t>(camera)];
    std::vector<const View*> views;
    std::vector<std::size_t> indices;
    for (std::size_t i = 0; i < set.views.size(); ++i) {
        if (set.views[i].camera == camera) {
            views.push_back(&set.views[i]);
            indices.push_back(i);
        }
    }
    const auto too_few = [&](std::size_t count) {
        return Status::failure(fmt::format(
            "camera '{}' has {} usable view{}, needs at least {}: record more frames in which it sees "
            "the board, tilted differently",
            known.name, count, count == 1 ? "" : "s", static_cast<int>(kCameraViewsMin)));
    };
    if (views.size() < kCameraViewsMin) {
        return too_few(views.size());
    }
    const CameraSeed seed = seed_camera(model, known, views);
    CameraAlone alone;
    std::vector<View> own;
    RigState state{{seed.lens}, {Vector6::Zero()}, {}};
    for (std::size_t i = 0; i < views.size(); ++i) {
        if (!seed.cam_from_board[i]) {
            alone.points_without_pose += views[i]->points.size();
            continue;
        }
        own.push_back(*views[i]);
        own.back().camera = 0;
        own.back().pose = state.rig_from_board.size();
        state.rig_from_board.push_back(pose_log(*seed.cam_from_board[i]));
        alone.views.push_back(indices[i]);
    }
    if (own.size() < kCameraViewsMin) {
        return too_few(own.size());
    }
    BundleOptions options;
    bool found = true;
    for (const LensFreedom lens : {LensFreedom::kFocal, LensFreedom::kRadial, LensFreedom::kAll}) {
        options.lens = lens;
        found = found && approach(options, &own, &state);
    }
    alone.noise_px = found ? noise_px(state, own) : HUGE_VAL;
    if (!(alone.noise_px <= kMisfitPart * known.width_px)) {
        return Status::failure(fmt::format(
            "camera '{}': no {} lens with rigid boards explains its points (typical misfit {:.1f} px); "
            "check that the board's file is the printed one, that images are not mirrored and that "
            "frame numbers are right",
            known.name, camera_model_name(model), alone.noise_px));
    }
    if (!refine(options, &own, &state).converged) {
        return Status::failure(
            fmt::format("camera '{}': its solution does not settle; record more views", known.name));
    }
    alone.lens = state.lenses[0];
    for (const Vector6& pose : state.rig_from_board) {
        alone.cam_from_board.push_back(pose_exp(pose));
    }
    alone.noise_px = noise_px(state, own);
    return alone;
}

}  // namespace rig
