// Standard deviations of lenses and camera poses, and whether the data determine them at all.
#pragma once

#include "host/solve/rig.h"

namespace rig {

// Fills solution->uncertainty. Fails with a sentence that names the camera when its focal length is
// known to no better than kFocalWorstPart.
Status estimate_uncertainty(const Scene& scene, Solution* solution);

constexpr double kFocalWorstPart = 0.03;

// Covariance of all free lens and camera pose parameters, body poses marginalised, for unit noise.
// `offset` gives each solved camera's first row; rows per camera: intrinsics, then cam_from_rig
// (not for a gauge camera). Behind the cameras six rows for each member's body_from_board.
struct RigCovariance {
    Eigen::MatrixXd matrix;
    std::vector<Eigen::Index> offset;  // by scene camera; -1 where not solved
};
RigCovariance rig_covariance(const Solution& solution);

}  // namespace rig
