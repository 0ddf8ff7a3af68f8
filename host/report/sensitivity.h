// One camera's image of a point of the rig frame, and how it changes with everything.
#pragma once

#include "host/report/rig_file.h"

namespace rig {

struct Sensitivity {
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> by_point;  // px / mm in the rig frame
    Eigen::MatrixXd by_lens;               // 2 rows; px / unit of each intrinsic
    Eigen::Matrix<double, 2, 6> by_pose;   // px / small motion on the left of cam_from_rig
};

// `fold` is camera.lens.fold_radius(). False when the point has no image.
bool sense(const RigCamera& camera, double fold, const Eigen::Vector3d& point_mm, Sensitivity* out);

// Change of a point in the rig frame by a small motion (w, d): w x p + d.
Eigen::Matrix<double, 3, 6> point_by_motion(const Eigen::Vector3d& point_mm);

// Adds block times the derivatives to the camera's columns of `rows`, which has as many columns as the
// covariance has rows.
void add_camera_columns(const Eigen::MatrixXd& block, const Sensitivity& sensitivity,
                        const RigCovariance& places, std::size_t camera, Eigen::MatrixXd* rows);

// Whether a pixel lies inside of the camera's image.
bool inside(const RigCamera& camera, const Eigen::Vector2d& pixel);

// Pixels of a grid over the whole image, row by row, corner to corner.
std::vector<Eigen::Vector2d> image_grid(const RigCamera& camera, int columns, int rows);

}  // namespace rig
