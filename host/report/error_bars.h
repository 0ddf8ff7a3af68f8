// What the covariance of a rig means where a user looks: pixels and millimetres. First-order
// propagation: a row of derivatives on either side of the covariance.
//
// Both are of a point fixed to the world that the calibration's boards stand for: when the parameters
// change, the point moves in the rig frame by the implied motion (solve/covariance.h). So a turn of a
// camera's frame that its principal point makes up for does not count, as it would not be noticed.
// Included: the noise of the calibration's observations (scaled by the noise factor), by way of lenses,
// camera poses and the boards. Not included: a lens model or board that does not fit, a rig that has
// moved since, the noise of later observations (but see triangulation_errors). It is what mrcal calls
// projection uncertainty, with its mean over the frames replaced by the mean weighted by information.
#pragma once

#include "host/report/rig_file.h"

namespace rig {

struct PixelError {
    Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
    Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();  // nan where the pixel has no ray
};

// What a field adds beyond the covariance at a pixel (solve/field_errors.h), where it adds; px^2.
Eigen::Matrix2d field_covariance(const RigCamera& camera, const Eigen::Vector2d& pixel);

// Standard deviation in the direction in which it is largest, px.
double worst_px(const PixelError& error);

// Of points at `distance_mm` from the camera whose images lie on a grid over its image, row by row; the
// corner pixels' centres are on it. Needs rig.covariance.
std::vector<PixelError> projection_errors(const RigFile& rig, std::size_t camera, double distance_mm,
                                          int columns, int rows);

struct PointError {
    Eigen::Vector3d at_mm = Eigen::Vector3d::Zero();  // rig frame
    int cameras = 0;                                  // that see it; with fewer than two nothing follows
    Eigen::Matrix3d covariance_mm2 = Eigen::Matrix3d::Zero();
};

// Of the point that the cameras which see `at_mm` (of part 0, in front, inside of their images) find
// by least squares over pixels. noise_px: of each later observation, per axis; 0 leaves the calibration's part.
PointError triangulation_error(const RigFile& rig, const Eigen::Vector3d& at_mm, double noise_px);

// Grid of per_axis^3 points over the box of the rig's volume that at least two cameras see.
std::vector<PointError> volume_errors(const RigFile& rig, int per_axis, double noise_px);

}  // namespace rig
