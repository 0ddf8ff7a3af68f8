// Camera models: from a point in the camera frame (x right, y down, z forward, mm) to pixels, where
// (0, 0) is the centre of the top-left pixel, and back to a ray. Coefficients are in OpenCV's order.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "host/model/spline_field.h"

namespace rig {

// Value of each is fixed only in this program; files carry the names.
enum class CameraModel {
    kBrown,      // k1 k2 p1 p2 k3
    kRational,   // k1 k2 p1 p2 k3 k4 k5 k6
    kThinPrism,  // k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4
    kFisheye     // k1 k2 k3 k4 of theta (Kannala-Brandt)
};

enum { kPinholeCount = 4, kDistortionMax = 12, kIntrinsicsMax = kPinholeCount + kDistortionMax };

// Distortion coefficients of a model: 5, 8, 12 or 4.
int distortion_count(CameraModel model);
std::string_view camera_model_name(CameraModel model);
std::optional<CameraModel> camera_model_from_name(std::string_view name);
// Names of the coefficients as people write them: fx fy cx cy k1 ...
std::vector<std::string> intrinsics_names(CameraModel model);

// Derivatives of a projection. Columns of by_intrinsics beyond the model's count are not written.
struct ProjectionJacobian {
    Eigen::Matrix<double, 2, 3> by_point;                // px / mm
    Eigen::Matrix<double, 2, kIntrinsicsMax> by_intrinsics;  // px / unit of each
};

// The formula alone, wherever it has a value: intrinsics are fx fy cx cy, then the distortion. False,
// and nothing written, for points that no lens of the model can see: z <= 0 (fisheye: the point lies
// on the optical axis behind the camera). Does not ask whether distortion folds there.
bool project_formula(CameraModel model, const double* intrinsics, const Eigen::Vector3d& point_mm,
                     Eigen::Vector2d* pixel, ProjectionJacobian* jacobian);

// A calibrated lens as a value. With a field it is a `spline` lens: model and intrinsics are its
// parametric part.
struct Camera {
    CameraModel model = CameraModel::kBrown;
    std::vector<double> intrinsics;  // fx fy cx cy, then distortion_count(model) coefficients
    SplineField field = {};

    // What files call the lens: the model's name, or spline.
    std::string_view name() const { return field.empty() ? camera_model_name(model) : "spline"; }

    // Radius at which the distortion first folds back (r/z; fisheye: angle from the axis, rad):
    // beyond it one pixel would have two rays. At most 100 (fisheye: pi).
    double fold_radius() const;

    // Pixel of a point in the camera frame; both coordinates nan when it has no image (behind the
    // camera, or beyond the fold).
    // The second form spares finding the fold again for each of many points.
    Eigen::Vector2d project(const Eigen::Vector3d& point_mm) const;
    Eigen::Vector2d project(const Eigen::Vector3d& point_mm, double fold) const;

    // Unit ray of a pixel; all three nan when no ray inside the fold lands there.
    Eigen::Vector3d unproject(const Eigen::Vector2d& pixel) const;
    Eigen::Vector3d unproject(const Eigen::Vector2d& pixel, double fold) const;
};

// The formula of a whole lens, field included, for other intrinsics than its own: project_formula for
// a lens without a field. Derivatives are for a field that is held.
bool project_lens(const Camera& lens, const double* intrinsics, const Eigen::Vector3d& point_mm,
                  Eigen::Vector2d* pixel, ProjectionJacobian* jacobian);

}  // namespace rig
