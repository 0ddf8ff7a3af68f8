// See frame_quadratic.h.
#include "host/solve/frame_quadratic.h"

#include <algorithm>

#include "host/base/median.h"

namespace rig {
namespace {

// Points further than this many of their view's own typical residuals are wrong ones.
constexpr double kOwnSigmas = 6.0;

// Some of the view's points, those in use that agree with most of them.
View with_own_points(const View& view, const Camera& lens, const Pose& cam_from_board)
{
    constexpr std::size_t kPoints = 64;
    View all = view;
    for (ViewPoint& point : all.points) {
        point.used = true;
    }
    View out = thinned(all, kPoints);
    Eigen::Matrix2Xd residuals;
    view_residuals(out, lens, cam_from_board, &residuals);
    std::vector<double> sizes;
    for (Eigen::Index i = 0; i < residuals.cols(); ++i) {
        sizes.push_back(residuals.col(i).norm());
    }
    const double median = median_of(&sizes);
    for (std::size_t i = 0; i < out.points.size(); ++i) {
        out.points[i].used = residuals.col(static_cast<Eigen::Index>(i)).norm() <= kOwnSigmas * median;
    }
    return out;
}

}  // namespace

bool own_quadratic(const View& view, const Camera& lens, const Pose& cam_from_board,
                   FrameQuadratic* frame, LocalQuadratic* out)
{
    const View own = with_own_points(view, lens, cam_from_board);
    frame->frame = view.frame;
    frame->points = static_cast<std::size_t>(std::count_if(
        own.points.begin(), own.points.end(), [](const ViewPoint& point) { return point.used; }));
    const bool usable = frame->points >= kViewPointsMin
                        && local_quadratic(own, lens, cam_from_board, 0.0, true, out);
    frame->squares = out->squares;
    return usable;
}

void FrameQuadratics::add(const FrameQuadratic& view)
{
    const auto [found, is_new] = by_frame_.emplace(view.frame, view);
    if (!is_new) {
        found->second.points += view.points;
        found->second.squares += view.squares;
        found->second.normal += view.normal;
        found->second.gradient += view.gradient;
    }
}

std::vector<FrameQuadratic> FrameQuadratics::list() const
{
    std::vector<FrameQuadratic> list;
    for (const auto& [frame, quadratic] : by_frame_) {
        list.push_back(quadratic);
    }
    return list;
}

}  // namespace rig
