// See intrinsics.h. The lens is freed by and by: focal length, radial terms, everything.
#include "host/solve/intrinsics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host/solve/lens_change.h"
#include "host/solve/robust.h"
#include "host/solve/seed.h"
#include "host/solve/velocity_prior.h"

namespace rig {
namespace {

// A typical misfit above this part of the image's width means that what was solved is not what was
// seen: the worst lens left unmodelled by Brown's terms stays well below.
constexpr double kMisfitPart = 0.005;

// A lens is started from this many of a camera's views, spread over its frames; more add nothing to
// a start.
constexpr std::size_t kLensViews = 80;

// Every n-th of `count`, at most kLensViews of them.
std::vector<std::size_t> some_of(std::size_t count)
{
    std::vector<std::size_t> some;
    const std::size_t taken = std::min(count, kLensViews);
    for (std::size_t i = 0; i < taken; ++i) {
        some.push_back(i * count / taken);
    }
    return some;
}

// Poses of views through a lens. Views without one are counted in alone->points_without_pose.
void add_poses(const Camera& lens, const std::vector<const View*>& views,
               const std::vector<std::size_t>& indices, std::vector<View>* own, RigState* state,
               CameraAlone* alone)
{
    const double fold = lens.fold_radius();
    for (std::size_t i = 0; i < views.size(); ++i) {
        View thin = thinned(*views[i], kApproachPoints);
        const std::optional<Pose> pose = seed_pose(lens, fold, thin);
        if (!pose) {
            alone->points_without_pose += views[i]->points.size();
            continue;
        }
        thin.camera = 0;
        thin.pose = state->rig_from_body.size();
        thin.member = kNoMember;
        own->push_back(std::move(thin));
        state->rig_from_body.push_back(pose_log(*pose));
        alone->views.push_back(indices[i]);
    }
}

// A camera's views, apart: those that its lens is started from, and the rest.
struct OwnViews {
    std::vector<const View*> some;
    std::vector<std::size_t> some_indices;
    std::vector<const View*> rest;
    std::vector<std::size_t> rest_indices;
};

OwnViews own_views(const ViewSet& set, int camera)
{
    std::vector<std::size_t> all;
    for (std::size_t i = 0; i < set.views.size(); ++i) {
        if (set.views[i].camera == camera) {
            all.push_back(i);
        }
    }
    OwnViews out;
    const std::vector<std::size_t> some = some_of(all.size());
    for (std::size_t i = 0, next = 0; i < all.size(); ++i) {
        const bool taken = next < some.size() && some[next] == i;
        next += taken ? 1 : 0;
        (taken ? out.some : out.rest).push_back(&set.views[all[i]]);
        (taken ? out.some_indices : out.rest_indices).push_back(all[i]);
    }
    return out;
}

// Views of flat boards that are all tilted alike tell fewer numbers than a lens has; what tells the
// rest is then the shape of its distortion, which is no measurement of it.
bool all_at_one_tilt(const Scene& scene, const std::vector<View>& views, const RigState& state)
{
    constexpr double kSpreadMin = 0.087;  // rad: 5 degrees
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    std::vector<Eigen::Vector3d> normals;
    for (const View& view : views) {
        const Board& board = scene.boards[static_cast<std::size_t>(view.board)];
        const double z = board.points.front().at_mm.z();
        if (std::any_of(board.points.begin(), board.points.end(),
                        [&](const BoardPoint& point) { return point.at_mm.z() != z; })) {
            return false;
        }
        normals.push_back(cam_from_board(state, view).rotation.col(2));
        mean += normals.back();
    }
    mean.normalize();
    return std::all_of(normals.begin(), normals.end(), [&](const Eigen::Vector3d& normal) {
        return normal.dot(mean) > std::cos(kSpreadMin);
    });
}

Status too_few(const SceneCamera& camera, std::size_t count)
{
    return Status::failure(fmt::format(
        "camera '{}' has {} usable view{}, needs at least {}: record more frames in which it sees "
        "the board, tilted differently",
        camera.name, count, count == 1 ? "" : "s", static_cast<int>(kCameraViewsMin)));
}

// Poses of the views that the lens was not started from, with it held.
void settle_rest(const Scene& scene, const SceneCamera& camera, const OwnViews& views, RigState* state,
                 CameraAlone* alone)
{
    RigState rest_state{state->lenses, {Vector6::Zero()}, {}, {}};
    std::vector<View> rest;
    add_poses(state->lenses[0], views.rest, views.rest_indices, &rest, &rest_state, alone);
    start_own_shutter(scene, camera, &rest, &rest_state);
    BundleOptions options;
    options.lens = LensFreedom::kNone;
    if (!rest.empty()) {
        // Where this does not settle, the first poses stand; the joint solution will tell.
        approach(options, rest, &rest_state);
    }
    state->rig_from_body.insert(state->rig_from_body.end(), rest_state.rig_from_body.begin(),
                                rest_state.rig_from_body.end());
}

// Views in the order of the set, whatever order they were solved in.
void sort_views(CameraAlone* alone)
{
    std::vector<std::pair<std::size_t, Pose>> pairs;
    for (std::size_t i = 0; i < alone->views.size(); ++i) {
        pairs.emplace_back(alone->views[i], alone->cam_from_board[i]);
    }
    std::sort(pairs.begin(), pairs.end(),
              [](const auto& a, const auto& b) { return a.first < b.first; });
    for (std::size_t i = 0; i < pairs.size(); ++i) {
        alone->views[i] = pairs[i].first;
        alone->cam_from_board[i] = pairs[i].second;
    }
}

}  // namespace

Result<CameraAlone> calibrate_alone(const Scene& scene, const ViewSet& set, int camera,
                                    CameraModel model)
{
    const SceneCamera& known = scene.cameras[static_cast<std::size_t>(camera)];
    const OwnViews views = own_views(set, camera);
    if (views.some.size() < kCameraViewsMin) {
        return too_few(known, views.some.size());
    }
    CameraAlone alone;
    std::vector<View> own;
    RigState state{{seed_lens(model, known, views.some)}, {Vector6::Zero()}, {}, {}};
    add_poses(state.lenses[0], views.some, views.some_indices, &own, &state, &alone);
    if (own.size() < kCameraViewsMin) {
        return too_few(known, own.size());
    }
    BundleOptions options;
    bool found = true;
    for (const LensFreedom lens : {LensFreedom::kFocal, LensFreedom::kRadial, LensFreedom::kAll}) {
        options.lens = lens;
        if (lens == LensFreedom::kAll) {
            start_own_shutter(scene, known, &own, &state);
        }
        found = found && approach(options, own, &state);
    }
    alone.noise_px = found ? noise_px(state, own)[0] : HUGE_VAL;
    if (!(alone.noise_px <= kMisfitPart * known.width_px)) {
        return Status::failure(fmt::format(
            "camera '{}': no {} lens with rigid boards explains its points (typical misfit {:.1f} px); "
            "check that the board's file is the printed one, that images are not mirrored and that "
            "frame numbers are right",
            known.name, camera_model_name(model), alone.noise_px));
    }
    if (!refine_near(options, &own, &state).converged) {
        return Status::failure(
            fmt::format("camera '{}': its solution does not settle; record more views", known.name));
    }
    if (all_at_one_tilt(scene, own, state)) {
        return Status::failure(fmt::format(
            "camera '{}': its views do not determine its lens (the board is tilted alike in all of them); "
            "record views in which the board is tilted by 20 to 45 degrees, about different axes, at "
            "different distances",
            known.name));
    }
    alone.noise_px = noise_px(state, own)[0];
    alone.change = find_lens_change(state, own);
    settle_rest(scene, known, views, &state, &alone);
    alone.lens = state.lenses[0];
    for (const Vector6& pose : state.rig_from_body) {
        alone.cam_from_board.push_back(pose_exp(pose));
    }
    sort_views(&alone);
    return alone;
}

}  // namespace rig
