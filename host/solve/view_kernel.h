// Residuals of one view's points, and their quadratic model in the view's own parameters: the lens,
// and a small motion of the board in the camera's frame,
//     p_cam = q + w x q + t_motion + translation,   q = R p_board,   motion = (w, t_motion)
// However many poses lie between camera and board, a point's residual depends on them through these
// six numbers only: what sums over points stays small, and is led on to the poses once a view
// (pose_chain.h). A point's residual is
//     (projection + centre_offset_px - observed) / sigma_px
// without unit, so that J'J is the information matrix.
#pragma once

#include "host/solve/views.h"

namespace rig {

enum { kMotionCount = 6 };

// Sum of a view's squared residuals with robust weights, and the quadratic model of it: with w the
// loss's derivative, normal = sum w J'J and gradient = sum w J'r over the points in use. Columns:
// the lens's intrinsics, then the motion.
struct LocalQuadratic {
    double squares = 0.0;  // sum of loss(|r|^2)
    Eigen::MatrixXd normal;
    Eigen::VectorXd gradient;
};

// cauchy: scale of the Cauchy loss in units of sigma; 0: plain squares. With derive false only
// `squares` is written. False when a point in use has no image: the step that led here is
// impossible.
bool local_quadratic(const View& view, const Camera& lens, const Pose& cam_from_board, double cauchy,
                     bool derive, LocalQuadratic* out);

// Whitened residuals of all points, used or not, one column each; infinite for a point without
// image.
void view_residuals(const View& view, const Camera& lens, const Pose& cam_from_board,
                    Eigen::Matrix2Xd* residuals);
void view_residuals(const View& view, const RigState& state, Eigen::Matrix2Xd* residuals);

}  // namespace rig
