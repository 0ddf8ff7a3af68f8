// From a view's own six numbers of motion (view_kernel.h) to those of the poses between camera and
// board.
#pragma once

#include <vector>

#include "host/solve/view_kernel.h"

namespace rig {

// The poses of a view's chain, from the camera outwards: cam_from_rig, rig_from_body and, for a
// board that is a member of its body, body_from_board.
struct PoseChain {
    enum { kLinksMax = 3 };
    int count = 0;
    Vector6 link[kLinksMax];
};

PoseChain chain_of(const RigState& state, const View& view);

// motion = map[i] * (change of link i), to first order. For link i with all before it rotating by
// P, its own rotation vector v with right Jacobian J, and everything behind it translating by s:
//     w = P R(v) J dv,   t_motion = P dt - [P R(v) s]x P R(v) J dv
void motion_maps(const PoseChain& chain, Eigen::Matrix<double, 6, 6> maps[PoseChain::kLinksMax]);

// The normal matrix of a view by the lens's parameters and then six of each link.
Eigen::MatrixXd chain_normal(const LocalQuadratic& quadratic, const PoseChain& chain);

}  // namespace rig
