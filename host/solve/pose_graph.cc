// See pose_graph.h.
#include "host/solve/pose_graph.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

#include "host/solve/residuals.h"

namespace rig {
namespace {

constexpr std::size_t kPairPosesMax = 64;  // relative poses of a pair that are compared
constexpr std::size_t kTryPoints = 40;     // points of a view that a board pose is tried on
constexpr double kTryErrorMaxPx = 100.0;

// A pair of cameras: views of both with the same pose.
struct Pair {
    int a = 0;
    int b = 0;
    std::size_t weight = 0;
    std::vector<std::pair<std::size_t, std::size_t>> views;
};

int root_of(std::vector<int>* parent, int node)
{
    while ((*parent)[static_cast<std::size_t>(node)] != node) {
        node = (*parent)[static_cast<std::size_t>(node)];
    }
    return node;
}

std::vector<std::vector<std::size_t>> views_by_pose(const ViewSet& set)
{
    std::vector<std::vector<std::size_t>> by_pose(set.poses.size());
    for (std::size_t i = 0; i < set.views.size(); ++i) {
        by_pose[set.views[i].pose].push_back(i);
    }
    return by_pose;
}

std::vector<Pair> make_pairs(const ViewSet& set)
{
    std::map<std::pair<int, int>, Pair> pairs;
    for (const auto& views : views_by_pose(set)) {
        for (std::size_t i = 0; i < views.size(); ++i) {
            for (std::size_t j = i + 1; j < views.size(); ++j) {
                const View& a = set.views[views[i]];
                const View& b = set.views[views[j]];
                if (a.camera == b.camera) {
                    continue;
                }
                Pair& pair = pairs[{a.camera, b.camera}];
                pair.a = a.camera;
                pair.b = b.camera;
                pair.weight += std::min(a.points.size(), b.points.size());
                pair.views.emplace_back(views[i], views[j]);
            }
        }
    }
    std::vector<Pair> list;
    for (auto& [key, pair] : pairs) {
        list.push_back(std::move(pair));
    }
    std::stable_sort(list.begin(), list.end(),
                     [](const Pair& x, const Pair& y) { return x.weight > y.weight; });
    return list;
}

// The relative pose b_from_a that most of the pair's shared boards agree with. Ten milliradians or a
// hundredth of the distance count alike; a disagreement counts at most ten of these.
Pose relative_pose(const Pair& pair, const std::vector<Pose>& by_view)
{
    std::vector<Pose> candidates;
    std::vector<double> distances_mm;
    const std::size_t step = std::max<std::size_t>(1, pair.views.size() / kPairPosesMax);
    for (std::size_t i = 0; i < pair.views.size(); i += step) {
        const auto [a, b] = pair.views[i];
        candidates.push_back(by_view[b] * inverse(by_view[a]));
        distances_mm.push_back(by_view[b].translation_mm.norm());
    }
    std::size_t best = 0;
    double best_sum = HUGE_VAL;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
        double sum = 0.0;
        for (std::size_t j = 0; j < candidates.size(); ++j) {
            const double turn = rotation_distance(candidates[i].rotation, candidates[j].rotation);
            const double shift =
                (candidates[i].translation_mm - candidates[j].translation_mm).norm() / distances_mm[j];
            sum += std::min(10.0, turn / 0.01 + shift / 0.01);
        }
        if (sum < best_sum) {
            best_sum = sum;
            best = i;
        }
    }
    return candidates[best];
}

// Median distance of a view's points from where this board pose puts them, px, bounded.
double misfit_px(const View& view, const RigState& state, const Vector6& rig_from_board)
{
    const auto camera = static_cast<std::size_t>(view.camera);
    const Camera& lens = state.lenses[camera];
    Eigen::VectorXd residuals;
    if (!view_residuals(view, lens.model, lens.intrinsics.data(), state.cam_from_rig[camera].data(),
                        rig_from_board.data(), &residuals, nullptr)) {
        return kTryErrorMaxPx;
    }
    std::vector<double> sizes;
    for (std::size_t i = 0; i < view.points.size(); ++i) {
        sizes.push_back(view.points[i].sigma_px
                        * residuals.segment<2>(static_cast<Eigen::Index>(2 * i)).norm());
    }
    const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
    std::nth_element(sizes.begin(), middle, sizes.end());
    return std::min(kTryErrorMaxPx, *middle);
}

View thinned(const View& view)
{
    View thin{view.camera, view.board, view.frame, view.pose, {}};
    const std::size_t step = std::max<std::size_t>(1, view.points.size() / kTryPoints);
    for (std::size_t i = 0; i < view.points.size(); i += step) {
        thin.points.push_back(view.points[i]);
    }
    return thin;
}

// Of the poses that each camera says this board has, the one that suits all its views best.
Vector6 best_board_pose(const ViewSet& set, const std::vector<std::size_t>& views,
                        const RigState& state, const std::vector<Pose>& by_view)
{
    std::vector<View> thin;
    for (const std::size_t view : views) {
        thin.push_back(thinned(set.views[view]));
    }
    Vector6 best = Vector6::Zero();
    double best_sum = HUGE_VAL;
    for (const std::size_t view : views) {
        const auto camera = static_cast<std::size_t>(set.views[view].camera);
        const Vector6 candidate =
            pose_log(inverse(pose_exp(state.cam_from_rig[camera])) * by_view[view]);
        double sum = 0.0;
        for (const View& other : thin) {
            sum += misfit_px(other, state, candidate);
        }
        if (sum < best_sum) {
            best_sum = sum;
            best = candidate;
        }
    }
    return best;
}

}  // namespace

std::vector<std::vector<int>> connected_parts(const ViewSet& set, std::size_t camera_count)
{
    std::vector<int> parent(camera_count);
    std::iota(parent.begin(), parent.end(), 0);
    for (const auto& views : views_by_pose(set)) {
        for (const std::size_t view : views) {
            const int a = root_of(&parent, set.views[views.front()].camera);
            const int b = root_of(&parent, set.views[view].camera);
            parent[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
        }
    }
    std::map<int, std::vector<int>> by_root;
    for (std::size_t camera = 0; camera < camera_count; ++camera) {
        by_root[root_of(&parent, static_cast<int>(camera))].push_back(static_cast<int>(camera));
    }
    std::vector<std::vector<int>> parts;
    for (auto& [root, cameras] : by_root) {
        parts.push_back(std::move(cameras));
    }
    std::stable_sort(parts.begin(), parts.end(),
                     [](const auto& x, const auto& y) { return x.size() > y.size(); });
    return parts;
}

RigState join_cameras(const ViewSet& set, const std::vector<int>& cameras,
                      const std::vector<Camera>& lenses, const std::vector<Pose>& by_view)
{
    RigState state{lenses, std::vector<Vector6>(lenses.size(), Vector6::Zero()),
                   std::vector<Vector6>(set.poses.size(), Vector6::Zero())};
    // Prim's tree from the first camera: pairs are sorted, so the first that leads out is the heaviest.
    const std::vector<Pair> pairs = make_pairs(set);
    std::vector<bool> joined(lenses.size(), false);
    joined[static_cast<std::size_t>(cameras.front())] = true;
    for (std::size_t count = 1; count < cameras.size(); ++count) {
        for (const Pair& pair : pairs) {
            const auto a = static_cast<std::size_t>(pair.a);
            const auto b = static_cast<std::size_t>(pair.b);
            if (joined[a] == joined[b]) {
                continue;
            }
            const Pose b_from_a = relative_pose(pair, by_view);
            if (joined[a]) {
                state.cam_from_rig[b] = pose_log(b_from_a * pose_exp(state.cam_from_rig[a]));
            } else {
                state.cam_from_rig[a] = pose_log(inverse(b_from_a) * pose_exp(state.cam_from_rig[b]));
            }
            joined[a] = joined[b] = true;
            break;
        }
    }
    const auto by_pose = views_by_pose(set);
    for (std::size_t pose = 0; pose < by_pose.size(); ++pose) {
        if (!by_pose[pose].empty()) {
            state.rig_from_board[pose] = best_board_pose(set, by_pose[pose], state, by_view);
        }
    }
    return state;
}

}  // namespace rig
