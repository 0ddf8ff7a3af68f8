// The differences of two calibrations as a linear model: what `compare` fits and tests.
#pragma once

#include "host/report/sensitivity.h"

namespace rig {

// A camera that is in both, and where on its image to look.
struct SharedCamera {
    std::size_t in_a = 0;
    std::size_t in_b = 0;
    double fold_a = 0.0;
    double fold_b = 0.0;
    std::vector<Eigen::Vector3d> points_mm;  // in A's rig frame
    std::vector<double> sigma_px;            // of the difference there, per axis
};

// Two rows a point that both see, for a given motion of the rig frames.
struct DifferenceRows {
    Eigen::VectorXd difference;  // B's pixel less A's, px
    Eigen::VectorXd weight;      // 1 / sigma
    Eigen::VectorXd second_order;  // what the slopes' change from A to B makes of the parameters' change, px
    std::vector<Eigen::Vector2d> pixels;  // A's, one a point
    Eigen::MatrixXd by_motion;   // 6 columns: a small motion on the left of b_from_a
    Eigen::MatrixXd by_a;        // by the rows of A's covariance; no columns where there is none
    Eigen::MatrixXd by_b;
};

// by_a and by_b only with `all`.
DifferenceRows difference_rows(const RigFile& a, const RigFile& b, const SharedCamera& camera,
                               const std::vector<Eigen::Vector3d>& points_mm, const Pose& b_from_a,
                               bool all);

// The motion that makes the cameras' weighted differences least in the manner of a median over
// cameras, and how it follows from the parameters: a change of the motion is follow_a da + follow_b db.
struct ImpliedMotion {
    Pose b_from_a;
    Eigen::MatrixXd follow_a;
    Eigen::MatrixXd follow_b;
};
ImpliedMotion fit_motion(const RigFile& a, const RigFile& b, const std::vector<SharedCamera>& cameras,
                         const Pose& start);

}  // namespace rig
