// See views.h.
#include "host/solve/views.h"

#include <Eigen/Eigenvalues>
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

}  // namespace

ViewSet make_views(const Scene& scene)
{
    ViewSet set;
    std::map<std::pair<int, std::int64_t>, std::size_t> pose_of;
    const auto& observations = scene.observations;
    std::size_t begin = 0;
    while (begin < observations.size()) {
        const Observation& first = observations[begin];
        View view{first.camera, first.board, first.frame, 0, {}};
        const Board& board = scene.boards[static_cast<std::size_t>(first.board)];
        std::size_t end = begin;
        for (; end < observations.size(); ++end) {
            const Observation& o = observations[end];
            if (o.camera != first.camera || o.frame != first.frame || o.board != first.board) {
                break;
            }
            ViewPoint point;
            point.at_mm = board.points[o.point].at_mm;
            point.radius_mm = board.points[o.point].radius_mm;
            point.pixel = o.pixel;
            point.sigma_known = o.sigma_px > 0.0;
            point.sigma_px = point.sigma_known ? o.sigma_px : 1.0;
            point.observation = end;
            view.points.push_back(point);
        }
        if (end - begin < kViewPointsMin) {
            set.rejected["view with fewer than 6 points"] += end - begin;
        } else if (on_a_line(view.points)) {
            set.rejected["view whose points lie on a line"] += end - begin;
        } else {
            const std::int64_t place = board.is_static ? 0 : first.frame;
            const auto [found, is_new] = pose_of.emplace(std::pair(first.board, place), set.poses.size());
            if (is_new) {
                set.poses.push_back({first.board, first.frame});
            }
            view.pose = found->second;
            set.views.push_back(std::move(view));
        }
        begin = end;
    }
    return set;
}

}  // namespace rig
