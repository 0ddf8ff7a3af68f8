// See views.h.
#include "host/solve/views.h"

#include <Eigen/Eigenvalues>
#include <tuple>
#include <utility>

namespace rig {
namespace {

// Points lie on a line when their spread across it is below a hundredth of that along it.
bool on_a_line(const std::vector<ViewPoint>& points)
{
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const ViewPoint& point : points) {
        mean += point.at_mm / static_cast<double>(points.size());
    }
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const ViewPoint& point : points) {
        const Eigen::Vector3d d = point.at_mm - mean;
        spread += d * d.transpose();
    }
    const Eigen::Vector3d squares =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread, Eigen::EigenvaluesOnly).eigenvalues();
    return squares[1] < 1e-4 * squares[2];
}

ViewPoint make_point(const Board& board, const Observation& seen)
{
    ViewPoint point;
    point.at_mm = board.points[seen.point].at_mm;
    point.radius_mm = static_cast<float>(board.points[seen.point].radius_mm);
    point.pixel = seen.pixel;
    point.sigma_known = seen.sigma_px > 0.0f;
    point.sigma_px = point.sigma_known ? seen.sigma_px : 1.0f;
    point.point = seen.point;
    return point;
}

// A number in [0, 1) that looks random and is the same for the same k.
double jitter(std::size_t k)
{
    const auto mixed = static_cast<std::uint32_t>(k + 1) * 2654435761u;
    return static_cast<double>(mixed ^ (mixed >> 15)) / 4294967296.0;
}

}  // namespace

const Surface* surface_of(const RigState& state, int board)
{
    const auto at = static_cast<std::size_t>(board);
    return at < state.surfaces.size() && !state.surfaces[at].empty() ? &state.surfaces[at] : nullptr;
}

Pose rig_from_board(const RigState& state, const View& view)
{
    const Pose rig_from_body = pose_exp(state.rig_from_body[view.pose]);
    return view.member == kNoMember
               ? rig_from_body
               : rig_from_body * pose_exp(state.body_from_board[static_cast<std::size_t>(view.member)]);
}

Pose cam_from_board(const RigState& state, const View& view)
{
    return pose_exp(state.cam_from_rig[static_cast<std::size_t>(view.camera)])
           * rig_from_board(state, view);
}

ViewSet make_views(const Scene& scene)
{
    ViewSet set;
    const auto& observations = scene.observations;
    std::size_t begin = 0;
    while (begin < observations.size()) {
        const Observation& first = observations[begin];
        const Board& board = scene.boards[static_cast<std::size_t>(first.board)];
        std::size_t end = begin;
        while (end < observations.size() && observations[end].camera == first.camera
               && observations[end].frame == first.frame && observations[end].board == first.board) {
            ++end;
        }
        View view;
        view.camera = first.camera;
        view.board = first.board;
        view.frame = first.frame;
        view.points.reserve(end - begin);
        for (std::size_t i = begin; i < end; ++i) {
            view.points.push_back(make_point(board, observations[i]));
        }
        if (end - begin < kViewPointsMin) {
            set.rejected["view with fewer than 6 points"] += end - begin;
        } else if (on_a_line(view.points)) {
            set.rejected["view whose points lie on a line"] += end - begin;
        } else {
            set.views.push_back(std::move(view));
        }
        begin = end;
    }
    return set;
}

void assign_poses(const Scene& scene, const std::vector<int>& part_of_camera,
                  const std::vector<int>& body_of_board, ViewSet* set)
{
    std::map<std::tuple<int, int, std::int64_t>, std::size_t> pose_of;
    std::map<int, int> member_of;
    set->poses.clear();
    set->members.clear();
    for (View& view : set->views) {
        const int part = part_of_camera[static_cast<std::size_t>(view.camera)];
        const int body = body_of_board[static_cast<std::size_t>(view.board)];
        const bool is_static = scene.boards[static_cast<std::size_t>(view.board)].is_static;
        const auto [pose, pose_is_new] =
            pose_of.emplace(std::tuple(part, body, is_static ? 0 : view.frame), set->poses.size());
        if (pose_is_new) {
            set->poses.push_back({body, view.frame, part});
        }
        view.pose = pose->second;
        view.member = kNoMember;
        if (view.board != body) {
            const auto [member, is_new] =
                member_of.emplace(view.board, static_cast<int>(set->members.size()));
            if (is_new) {
                set->members.push_back(view.board);
            }
            view.member = member->second;
        }
    }
}

View thinned(const View& view, std::size_t points_max)
{
    View thin{view.camera, view.board, view.frame, view.pose, view.member, {}, view.clock};
    std::vector<std::size_t> used;
    used.reserve(view.points.size());
    for (std::size_t i = 0; i < view.points.size(); ++i) {
        if (view.points[i].used) {
            used.push_back(i);
        }
    }
    // One of each of points_max equal stretches, at no fixed step: a step in tune with the board's
    // rows would take a few of its columns only.
    const std::size_t count = std::min(points_max, used.size());
    thin.points.reserve(count);
    for (std::size_t k = 0; k < count; ++k) {
        const std::size_t begin = k * used.size() / count;
        const std::size_t end = (k + 1) * used.size() / count;
        const auto inside = static_cast<std::size_t>(jitter(k) * static_cast<double>(end - begin));
        thin.points.push_back(view.points[used[begin + inside]]);
    }
    return thin;
}

std::vector<View> thinned(const std::vector<View>& views, std::size_t points_max)
{
    std::vector<View> thin;
    thin.reserve(views.size());
    for (const View& view : views) {
        thin.push_back(thinned(view, points_max));
    }
    return thin;
}

}  // namespace rig
