// See rig.h.
#include "host/solve/rig.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "host/base/parallel.h"
#include "host/solve/baseline_check.h"
#include "host/solve/enrich.h"
#include "host/solve/facing.h"
#include "host/solve/intrinsics.h"
#include "host/solve/moved.h"
#include "host/solve/pose_graph.h"
#include "host/solve/prior.h"
#include "host/solve/prior_poses.h"
#include "host/solve/row_times.h"
#include "host/solve/scale.h"
#include "host/solve/swapped.h"
#include "host/solve/uncertainty.h"
#include "host/solve/velocity_prior.h"
#include "host/solve/view_kernel.h"

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

// The frames in which a camera has views.
std::set<std::int64_t> frames_seen(const ViewSet& set, int camera)
{
    std::set<std::int64_t> frames;
    for (const View& view : set.views) {
        if (view.camera == camera) {
            frames.insert(view.frame);
        }
    }
    return frames;
}

// The same in words: the first few and how many there are.
std::string frames_of(const ViewSet& set, int camera)
{
    constexpr std::size_t kNamed = 5;
    const std::set<std::int64_t> frames = frames_seen(set, camera);
    if (frames.empty()) {
        return "no frame";
    }
    std::vector<std::int64_t> named(frames.begin(), std::next(frames.begin(),
                                    static_cast<std::ptrdiff_t>(std::min(kNamed, frames.size()))));
    return frames.size() <= kNamed
               ? fmt::format("frame{} {}", frames.size() == 1 ? "" : "s", fmt::join(named, ", "))
               : fmt::format("frames {} ... {}; {} in all", fmt::join(named, ", "), *frames.rbegin(),
                             frames.size());
}

// "camera 'a' (frames 1, 2), cameras ..." of one part.
std::string seen_by(const Scene& scene, const ViewSet& set, const std::vector<int>& cameras)
{
    std::vector<std::string> each;
    for (const int camera : cameras) {
        each.push_back(names_of(scene, {camera}) + " (" + frames_of(set, camera) + ")");
    }
    return fmt::format("{} {}", cameras.size() == 1 ? "camera" : "cameras", fmt::join(each, ", "));
}

// What joins two parts: frames seen together, or, where the boards that each sees are fixed to each
// other and were seen together but do not turn enough to tell how (`by_motion`), more turning.
Status not_connected(const Scene& scene, const ViewSet& set, const std::vector<int>& lost,
                     const std::vector<int>& main, bool by_motion)
{
    return Status::failure(fmt::format(
        "nothing connects {} with {}: {}, or use --partial", seen_by(scene, set, lost),
        seen_by(scene, set, main),
        by_motion ? "the boards that 'rigid' fixes to each other turn too little; record frames in which "
                    "they turn by 20 degrees and more about two axes, or in which one camera sees both"
                  : "record frames in which a camera of each group sees the same board at the same time, "
                    "or boards that 'rigid' fixes to each other"));
}

// The cameras to solve: all that hang together, or with `partial` all parts, each by itself.
Status choose_cameras(const Scene& scene, const Connection& connection, bool partial, Solution* solution)
{
    solution->cameras.clear();
    solution->gauge_cameras.clear();
    solution->part_of_camera = connection.part_of_camera;
    const auto& parts = connection.parts;
    for (std::size_t i = 0; i < parts.size(); ++i) {
        if (partial && frames_seen(solution->set, parts[i].front()).empty()) {
            continue;  // left out already, with a sentence of its own
        }
        if (i > 0 && !partial) {
            return not_connected(scene, solution->set, parts[i], parts.front(),
                                 connect(scene, solution->set).parts.size() < parts.size());
        }
        if (i > 0) {
            solution->left_out.push_back(
                fmt::format("nothing connects {} {} with {}: part {} has a rig frame of its own",
                            parts[i].size() == 1 ? "camera" : "cameras", names_of(scene, parts[i]),
                            names_of(scene, parts.front()), i));
        }
        solution->gauge_cameras.push_back(parts[i].front());
        solution->cameras.insert(solution->cameras.end(), parts[i].begin(), parts[i].end());
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

// A camera that cannot be solved alone: the end, or with `partial` left out.
Status leave_out(const Status& failure, bool partial, std::size_t camera, Solution* solution)
{
    if (!partial) {
        return failure;
    }
    solution->left_out.push_back(failure.sentence());
    for (const View& view : solution->set.views) {
        if (static_cast<std::size_t>(view.camera) == camera) {
            solution->set.rejected["camera left out"] += view.points.size();
        }
    }
    return Status();
}

// Stage one for each camera; views without a pose leave the set. noise_px, by camera, is of each
// alone.
Status calibrate_each(const Scene& scene, const SolveOptions& options, const Progress& progress,
                      Solution* solution, std::vector<Pose>* by_view, std::vector<double>* noise_px)
{
    ViewSet& set = solution->set;
    std::vector<bool> keep(set.views.size(), false);
    by_view->assign(set.views.size(), Pose());
    std::vector<std::optional<Result<CameraAlone>>> alone(scene.cameras.size());
    parallel_for(alone.size(), options.threads, 1, [&](std::size_t camera) {
        alone[camera] = calibrate_alone(scene, set, static_cast<int>(camera),
                                        options.lenses[camera].model);
        if (!alone[camera]->ok() && in_prior(options.prior, camera)) {
            alone[camera] = poses_through_prior(scene, *options.prior, set, camera);
        }
    });
    std::vector<std::optional<Change>> change;
    for (const auto& each : alone) {
        change.push_back(each->ok() ? each->value().change : std::nullopt);
    }
    const Status lenses = check_lenses(scene, set, options.lenses, change);
    if (!lenses.ok()) {
        return lenses;
    }
    for (std::size_t camera = 0; camera < alone.size(); ++camera) {
        if (!alone[camera]->ok()) {
            const Status left = leave_out(alone[camera]->status(), options.partial, camera, solution);
            if (!left.ok()) {
                return left;
            }
            continue;
        }
        const CameraAlone& found = alone[camera]->value();
        for (std::size_t i = 0; i < found.views.size(); ++i) {
            keep[found.views[i]] = true;
            (*by_view)[found.views[i]] = found.cam_from_board[i];
        }
        if (found.points_without_pose > 0) {
            set.rejected["view without a pose"] += found.points_without_pose;
        }
        solution->state.lenses[camera] = found.lens;
        (*noise_px)[camera] = found.noise_px;
        progress(fmt::format("lens of {}: fx {:.1f}, {} views, noise {:.4f} px", scene.cameras[camera].name,
                             found.lens.intrinsics[0], found.views.size(), found.noise_px));
    }
    keep_views(keep, &set, by_view);
    return set.views.empty() ? alone.front()->status() : Status();
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
            solution->state.rig_from_body[count] = solution->state.rig_from_body[i];
            if (!solution->state.shutter.empty()) {
                solution->state.shutter.velocity[count] = solution->state.shutter.velocity[i];
            }
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
    solution->state.rig_from_body.resize(count);
    if (!solution->state.shutter.empty()) {
        solution->state.shutter.velocity.resize(count);
    }
}

// Of a camera's views those that are still in use, without their points.
ViewSet used_views(const ViewSet& set)
{
    ViewSet out;
    for (const View& view : set.views) {
        if (std::any_of(view.points.begin(), view.points.end(),
                        [](const ViewPoint& point) { return point.used; })) {
            View used;
            used.camera = view.camera;
            used.board = view.board;
            used.frame = view.frame;
            out.views.push_back(used);
        }
    }
    return out;
}

// A camera that fits the rig worse than its own views by this factor, and than this many pixels, is
// not at one place in it. Boards and lenses that are not as modelled are so alone, too.
constexpr double kTogetherWorst = 5.0;
constexpr double kTogetherWorstPx = 1.0;

// After outliers went: most of every camera's views must agree, and all must still hang together.
Status check_support(const Scene& scene, const Prior* prior, const Connection& connection,
                     const std::vector<double>& alone_px, const Solution& solution)
{
    const std::string check = std::string("check that it did not move and that its frame numbers or clock agree "
                                          "with those of the other cameras")
                              + (solution.state.shutter.empty()
                                     ? ", and give the 'row_time_ns' of rolling shutters where boards moved"
                                     : "");
    const ViewSet used = used_views(solution.set);
    const auto count = [](const ViewSet& set, int camera) {
        return static_cast<int>(std::count_if(
            set.views.begin(), set.views.end(),
            [&](const View& view) { return view.camera == camera; }));
    };
    for (const int camera : solution.cameras) {
        const int good = count(used, camera);
        const int all = count(solution.set, camera);
        const int wanted = in_prior(prior, static_cast<std::size_t>(camera)) ? 1 : kCameraViewsMin;
        if (good < wanted || 2 * good < all) {
            return Status::failure(
                fmt::format("camera '{}': only {} of its {} views agree with one rig; {}",
                            scene.cameras[static_cast<std::size_t>(camera)].name, good, all, check));
        }
    }
    const std::vector<double> together = noise_px(solution.state, solution.set.views);
    for (const int camera : solution.cameras) {
        const auto c = static_cast<std::size_t>(camera);
        if (together[c] > std::max(kTogetherWorstPx, kTogetherWorst * alone_px[c])) {
            return Status::failure(fmt::format(
                "camera '{}' fits its boards to {:.2f} px alone, but with the others only to {:.1f} px; {}",
                scene.cameras[c].name, alone_px[c], together[c], check));
        }
    }
    const Connection now = connect(scene, used);
    for (const std::vector<int>& part : now.parts) {
        const auto before = static_cast<std::size_t>(
            connection.part_of_camera[static_cast<std::size_t>(part.front())]);
        if (part.size() < connection.parts[before].size()
            && part.front() != connection.parts[before].front()) {
            return Status::failure(fmt::format(
                "the views that connect camera {} with the others contradict each other; {}",
                names_of(scene, {part.front()}), check));
        }
    }
    return Status();
}

}  // namespace

bool is_gauge(const Solution& solution, int camera)
{
    return std::count(solution.gauge_cameras.begin(), solution.gauge_cameras.end(), camera) != 0;
}

Result<Solution> solve_rig(const Scene& scene, const SolveOptions& options, const Progress& progress)
{
    Solution solution;
    solution.set = make_views(scene);
    solution.state.lenses.resize(scene.cameras.size());
    Connection connection = connect(scene, solution.set);
    Status status = options.partial ? Status()
                                    : choose_cameras(scene, connection, false, &solution);
    if (!status.ok()) {
        return status;
    }
    std::vector<Pose> by_view;
    std::vector<double> alone_px(scene.cameras.size(), 0.0);
    status = calibrate_each(scene, options, progress, &solution, &by_view, &alone_px);
    if (!status.ok()) {
        return status;
    }
    if (options.prior != nullptr) {
        status = check_prior(scene, *options.prior, solution.set, solution.state.lenses, by_view,
                             options.flat);
        if (status.ok() && options.prior->poses) {
            status = check_prior_poses(scene, *options.prior, solution.set);
        }
        if (!status.ok()) {
            return status;
        }
    }
    status = check_facing(scene, solution.set, by_view);
    if (!status.ok()) {
        return status;
    }
    status = check_scale(scene, solution.set, by_view);
    if (!status.ok()) {
        return status;
    }
    solution.state =
        join_cameras(scene, solution.state.lenses, by_view, &solution.set, &connection);
    status = choose_cameras(scene, connection, options.partial, &solution);
    if (!status.ok()) {
        return status;
    }
    status = check_row_time_reference(scene, solution.part_of_camera);
    if (!status.ok()) {
        return status;
    }
    start_shutter(scene, &solution.set, &solution.state);
    BundleOptions bundle_options;
    bundle_options.gauge_cameras = solution.gauge_cameras;
    bundle_options.threads = options.threads;
    bundle_options.progress = progress;
    bundle_options.prior = options.prior;
    bundle_options.lens = LensFreedom::kNone;
    if (!approach(bundle_options, solution.set.views, &solution.state)) {
        return Status::failure("the cameras' poses cannot be joined into one rig; check that frame "
                               "numbers or clocks agree between cameras");
    }
    progress(fmt::format("relative poses of {} cameras over {} board poses", solution.cameras.size(),
                         solution.set.poses.size()));
    bundle_options.lens = LensFreedom::kAll;
    const RefineResult refined =
        refine_rolling(bundle_options, &solution.set.views, &solution.state);
    // Boards that are not flat contradict a prior, too, until they may bend.
    const Status met = options.prior != nullptr
                           ? check_prior_met(scene, bundle_options, alone_px, solution)
                           : Status();
    const bool bends = !met.ok() && !options.flat;
    status = met.ok() ? check_moved(scene, solution) : bends ? Status() : met;
    if (!status.ok()) {
        return status;
    }
    if (!refined.converged) {
        return Status::failure("the joint solution does not settle; record more views");
    }
    solution.noise_factor = refined.noise_factor;
    status = enrich(scene, options, progress, &solution);
    if (status.ok() && bends) {
        status = check_prior_met(scene, bundle_options, alone_px, solution);
    }
    if (!status.ok()) {
        return status;
    }
    status = check_support(scene, options.prior, connection, alone_px, solution);
    if (!status.ok()) {
        return status;
    }
    drop_unused_poses(&solution);
    status = estimate_uncertainty(scene, options.prior, &solution);
    if (status.ok()) {
        status = check_baselines(scene, solution);
    }
    if (!status.ok()) {
        return status;
    }
    status = check_row_times(scene, solution);
    if (!status.ok()) {
        return status;
    }
    progress("joint solution of lenses, cameras and boards");
    return solution;
}

std::vector<Eigen::Vector2d> residuals_px(const Solution& solution, const View& view)
{
    Eigen::Matrix2Xd whitened;
    view_residuals(view, solution.state, &whitened);
    std::vector<Eigen::Vector2d> residuals(view.points.size());
    for (std::size_t i = 0; i < view.points.size(); ++i) {
        residuals[i] = static_cast<double>(view.points[i].sigma_px)
                       * whitened.col(static_cast<Eigen::Index>(i));
    }
    return residuals;
}

}  // namespace rig
