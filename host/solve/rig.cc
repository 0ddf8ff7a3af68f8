// See rig.h.
#include "host/solve/rig.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "host/solve/facing.h"
#include "host/solve/pose_graph.h"
#include "host/solve/residuals.h"
#include "host/solve/uncertainty.h"

namespace rig {
namespace {

std::string names_of(const Scene& scene, const std::vector<int>& cameras)
{
    std::vector<std::string> names;
    for (const int camera : cameras) {
        names.push_back("'" + scene.cameras[static_cast<std::size_t>(camera)].name + "'");
    }
    return fmt::format("{}", fmt::join(names, ", "));
}

// The cameras to solve: all, or with `partial` the largest connected part.
Status choose_cameras(const Scene& scene, const SolveOptions& options, Solution* solution)
{
    const std::vector<std::vector<int>> parts = connected_parts(solution->set, scene.cameras.size());
    solution->cameras = parts.front();
    for (std::size_t i = 1; i < parts.size(); ++i) {
        const std::string lost = fmt::format(
            "nothing connects {} {} with {}", parts[i].size() == 1 ? "camera" : "cameras",
            names_of(scene, parts[i]), names_of(scene, parts.front()));
        if (!options.partial) {
            return Status::failure(lost
                                   + ": record frames in which a camera of each group sees the same "
                                     "board at the same time, or use --partial");
        }
        solution->left_out.push_back(lost);
    }
    return Status();
}

// Keeps the views that are marked, with their poses in by_view.
void keep_views(const std::vector<bool>& keep, ViewSet* set, std::vector<Pose>* by_view)
{
    std::size_t kept = 0;
    for (std::size_t i = 0; i < set->views.size(); ++i) {
        if (keep[i]) {
            if (kept != i) {
                set->views[kept] = std::move(set->views[i]);
                (*by_view)[kept] = (*by_view)[i];
            }
            ++kept;
        }
    }
    set->views.resize(kept);
    by_view->resize(kept);
}

// Stage one for each chosen camera; views without a pose leave the set.
Status calibrate_each(const Scene& scene, const SolveOptions& options, const Progress& progress,
                      Solution* solution, std::vector<Pose>* by_view)
{
    ViewSet& set = solution->set;
    std::vector<bool> keep(set.views.size(), false);
    by_view->assign(set.views.size(), Pose());
    for (const int camera : solution->cameras) {
        Result<CameraAlone> alone = calibrate_alone(scene, set, camera, options.model);
        if (!alone.ok()) {
            return alone.status();
        }
        const CameraAlone& found = alone.value();
        for (std::size_t i = 0; i < found.views.size(); ++i) {
            keep[found.views[i]] = true;
            (*by_view)[found.views[i]] = found.cam_from_board[i];
        }
        if (found.points_without_pose > 0) {
            set.rejected["view without a pose"] += found.points_without_pose;
        }
        solution->state.lenses[static_cast<std::size_t>(camera)] = found.lens;
        progress(fmt::format("lens of {}: fx {:.1f}, {} views, noise {:.4f} px",
                             scene.cameras[static_cast<std::size_t>(camera)].name,
                             found.lens.intrinsics[0], found.views.size(), found.noise_px));
    }
    std::size_t lost = 0;
    for (std::size_t i = 0; i < set.views.size(); ++i) {
        const bool chosen = std::count(solution->cameras.begin(), solution->cameras.end(),
                                       set.views[i].camera) != 0;
        lost += chosen ? 0 : set.views[i].points.size();
    }
    if (lost > 0) {
        set.rejected["camera left out"] += lost;
    }
    keep_views(keep, &set, by_view);
    return Status();
}

// Board poses that no view needs any more (their views were left out) would hang in the air.
void drop_unused_poses(Solution* solution)
{
    std::vector<std::size_t> place(solution->set.poses.size(), 0);
    std::vector<bool> used(place.size(), false);
    for (const View& view : solution->set.views) {
        for (const ViewPoint& point : view.points) {
            used[view.pose] = used[view.pose] || point.used;
        }
    }
    std::size_t count = 0;
    for (std::size_t i = 0; i < used.size(); ++i) {
        if (used[i]) {
            place[i] = count;
            solution->set.poses[count] = solution->set.poses[i];
            solution->state.rig_from_board[count] = solution->state.rig_from_board[i];
            ++count;
        }
    }
    std::vector<View>& views = solution->set.views;
    std::size_t lost = 0;
    for (const View& view : views) {
        lost += used[view.pose] ? 0 : view.points.size();
    }
    if (lost > 0) {
        solution->set.rejected["no view of the board at this instant fits"] += lost;
    }
    views.erase(std::remove_if(views.begin(), views.end(),
                               [&](const View& view) { return !used[view.pose]; }),
                views.end());
    for (View& view : views) {
        view.pose = place[view.pose];
    }
    solution->set.poses.resize(count);
    solution->state.rig_from_board.resize(count);
}

// After outliers went: every camera still needs its views, and all must still hang together.
Status check_support(const Scene& scene, const Solution& solution)
{
    for (const int camera : solution.cameras) {
        int views = 0;
        for (const View& view : solution.set.views) {
            const bool used = std::any_of(view.points.begin(), view.points.end(),
                                          [](const ViewPoint& point) { return point.used; });
            views += view.camera == camera && used ? 1 : 0;
        }
        if (views < kCameraViewsMin) {
            return Status::failure(fmt::format(
                "camera '{}': only {} of its views agree with one rig; check that it did not move and "
                "that its frame numbers or clock agree with those of the other cameras",
                scene.cameras[static_cast<std::size_t>(camera)].name, views));
        }
    }
    return Status();
}

}  // namespace

Result<Solution> solve_rig(const Scene& scene, const SolveOptions& options, const Progress& progress)
{
    Solution solution;
    solution.set = make_views(scene);
    solution.state.lenses.resize(scene.cameras.size());
    Status status = choose_cameras(scene, options, &solution);
    if (!status.ok()) {
        return status;
    }
    std::vector<Pose> by_view;
    status = calibrate_each(scene, options, progress, &solution, &by_view);
    if (!status.ok()) {
        return status;
    }
    status = check_facing(scene, solution.set, by_view);
    if (!status.ok()) {
        return status;
    }
    const auto parts = connected_parts(solution.set, scene.cameras.size());
    if (parts.front().size() != solution.cameras.size()) {
        return Status::failure("the frames that connect camera "
                               + names_of(scene, {parts[1].front()})
                               + " with the others hold too few good points; record more frames in "
                                 "which both see the board at the same time");
    }
    solution.state = join_cameras(solution.set, solution.cameras, solution.state.lenses, by_view);
    BundleOptions bundle_options;
    bundle_options.gauge_camera = solution.cameras.front();
    bundle_options.lens = LensFreedom::kNone;
    if (!approach(bundle_options, &solution.set.views, &solution.state)) {
        return Status::failure("the cameras' poses cannot be joined into one rig; check that frame "
                               "numbers or clocks agree between cameras");
    }
    progress(fmt::format("relative poses of {} cameras over {} board poses", solution.cameras.size(),
                         solution.set.poses.size()));
    bundle_options.lens = LensFreedom::kAll;
    const RefineResult refined = refine(bundle_options, &solution.set.views, &solution.state);
    if (!refined.converged) {
        return Status::failure("the joint solution does not settle; record more views");
    }
    solution.noise_factor = refined.noise_factor;
    status = check_support(scene, solution);
    if (!status.ok()) {
        return status;
    }
    drop_unused_poses(&solution);
    status = estimate_uncertainty(scene, &solution);
    if (!status.ok()) {
        return status;
    }
    progress("joint solution of lenses, cameras and boards");
    return solution;
}

std::vector<Eigen::Vector2d> residuals_px(const Solution& solution, const View& view)
{
    const auto camera = static_cast<std::size_t>(view.camera);
    const Camera& lens = solution.state.lenses[camera];
    Eigen::VectorXd whitened;
    std::vector<Eigen::Vector2d> residuals;
    if (view_residuals(view, lens.model, lens.intrinsics.data(),
                       solution.state.cam_from_rig[camera].data(),
                       solution.state.rig_from_board[view.pose].data(), &whitened, nullptr)) {
        for (std::size_t i = 0; i < view.points.size(); ++i) {
            residuals.push_back(view.points[i].sigma_px
                                * whitened.segment<2>(static_cast<Eigen::Index>(2 * i)));
        }
    } else {
        residuals.assign(view.points.size(), Eigen::Vector2d::Constant(HUGE_VAL));
    }
    return residuals;
}

}  // namespace rig
