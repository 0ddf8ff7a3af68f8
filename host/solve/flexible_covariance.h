// Covariance of a rig with fields and surfaces, for those who know nothing of either.
#pragma once

#include "host/solve/flexible.h"

namespace rig {

// Rows: for each of `cameras` in turn its intrinsics and, unless it is a gauge camera, cam_from_rig; then
// the boards' places on their bodies. Times `noise` squared, it is that for points of this noise (times
// their sigmas) and what the prior (null: none) says; fields, surfaces and body poses are free, which is
// what they add. The intrinsics of a lens with a field are held and have no variance of their own: their
// rows are those of the intrinsics that come nearest to the field's change, over the places where the
// camera has points. What no intrinsics can follow of that change is not in them. Empty when the
// information is not positive.
Eigen::MatrixXd flexible_covariance(const std::vector<View>& views, const Scene& scene,
                                    const std::vector<int>& cameras,
                                    const std::vector<int>& gauge_cameras, const Prior* prior,
                                    double noise, const RigState& state);

}  // namespace rig
