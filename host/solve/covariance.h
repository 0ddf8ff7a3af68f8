// The joint covariance of everything a calibrated rig consists of, as a value.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace rig {

// Rows, in this order: for each solved camera its intrinsics, in the units of each, and its pose, then
// the implied motion. The pose of the first solved camera, which is the rig frame, has no rows. A rig in
// parts that nothing connects has a rig frame and an implied motion for each part.
//
// A pose's six rows are a small motion w (rad), d (mm) on the left: cam_from_rig becomes
// (exp(w) R, t + d). So w turns about the camera's axes.
//
// The implied motion is that of the boards together: x_rig becomes x + w x x + d. Lenses and poses are
// known only up to how the rig's frame lies in the world (a principal point that is off by a pixel turns
// the first camera, and with it the rig frame). The boards are the world: a point that is fixed to them
// moves by this motion when the parameters change, so what a camera makes of a fixed point has this
// correlated with the rest. It is the mean of the boards' motions, weighted by the information that the
// observations give about each.
struct RigCovariance {
    Eigen::MatrixXd matrix;
    std::vector<Eigen::Index> lens;  // by camera: first row of its intrinsics; -1 where not solved
    std::vector<Eigen::Index> pose;  // by camera: first row of its pose; -1 where it has none
    std::vector<Eigen::Index> motion;  // by camera: first row of its part's implied motion; -1 likewise
    // Standard deviation of each camera's row time where that was solved for, else 0; has no row. s
    std::vector<double> row_time_s = {};
};

}  // namespace rig
