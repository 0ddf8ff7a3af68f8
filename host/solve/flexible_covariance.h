// Covariance of a rig with fields and surfaces, for those who know nothing of either.
#pragma once

#include "host/solve/rig.h"

namespace rig {

// Rows: for each camera of the solution in turn its intrinsics and, unless it is a gauge camera, cam_from_rig;
// then the boards' places on their bodies; then the implied motion of each part. Fields, surfaces and body
// poses are free, which is what they add. The intrinsics of a lens with a field are held and have no variance
// of their own: their rows are those of the intrinsics that come nearest to the field's change, over the
// places where the camera has points; what no intrinsics can follow of that change is in `fields`.
// Times `noise` squared, it is that for points of this noise (times their sigmas) and what the prior (null:
// none) says. Empty when the information is not positive.
FlexibleCovariance flexible_covariance(const Scene& scene, const Solution& solution, const Prior* prior,
                                       double noise);

}  // namespace rig
