// See lens_change.h.
#include "host/solve/lens_change.h"

#include <Eigen/Cholesky>

#include "host/solve/frame_quadratic.h"

namespace rig {

std::optional<Change> find_lens_change(const RigState& state, const std::vector<View>& views)
{
    FrameQuadratics frames;
    const Camera& lens = state.lenses[0];
    const auto count = static_cast<Eigen::Index>(lens.intrinsics.size());
    for (const View& view : views) {
        FrameQuadratic frame;
        LocalQuadratic local;
        if (!own_quadratic(view, lens, cam_from_board(state, view), &frame, &local)) {
            continue;
        }
        // The view's own pose is free: what remains of the lens is the Schur complement.
        const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> own(local.normal.bottomRightCorner<6, 6>());
        const Eigen::MatrixXd across = local.normal.topRightCorner(count, kMotionCount);
        const Vector6 pose_gradient = local.gradient.tail<6>();
        frame.normal =
            local.normal.topLeftCorner(count, count) - across * own.solve(across.transpose());
        frame.gradient = local.gradient.head(count) - across * own.solve(pose_gradient);
        frame.squares -= pose_gradient.dot(own.solve(pose_gradient));
        frames.add(frame);
    }
    return find_change(frames.list());
}

}  // namespace rig
