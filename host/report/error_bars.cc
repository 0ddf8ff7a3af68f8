// See error_bars.h. A point x is found by least squares over the pixels of the cameras that see it; with
// P_c the derivative of camera c's pixel by the point and G = (sum P_c' P_c)^-1, a change of parameters
// moves what is found by -G sum P_c' (dq_c / dparameters), and pixel noise by G sum P_c' noise.
#include "host/report/error_bars.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cassert>
#include <cmath>
#include <limits>

#include "host/report/sensitivity.h"

namespace rig {
namespace {

// A covariance in px^2 with what the lens's field adds there. At distances other than the map's both are
// approximate; a sum that is none is left out.
Eigen::Matrix2d with_field(const RigCamera& camera, const Eigen::Vector2d& pixel, const Eigen::Matrix2d& told)
{
    const Eigen::Matrix2d sum =
        told + camera.field_errors.at(pixel, camera.width_px, camera.height_px);
    return sum(0, 0) > 0.0 && sum.determinant() > 0.0 ? sum : told;
}

}  // namespace

Eigen::Matrix2d field_covariance(const RigCamera& camera, const Eigen::Vector2d& pixel)
{
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(
        camera.field_errors.at(pixel, camera.width_px, camera.height_px));
    return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal()
           * eigen.eigenvectors().transpose();
}

double worst_px(const PixelError& error)
{
    const Eigen::Matrix2d& c = error.covariance_px2;
    const double half = 0.5 * (c(0, 0) - c(1, 1));
    return std::sqrt(0.5 * (c(0, 0) + c(1, 1)) + std::hypot(half, c(0, 1)));
}

std::vector<PixelError> projection_errors(const RigFile& rig, std::size_t camera, double distance_mm,
                                          int columns, int rows)
{
    assert(rig.covariance.has_value());
    const RigCovariance& covariance = *rig.covariance;
    const RigCamera& own = rig.cameras[camera];
    const double fold = own.lens.fold_radius();
    const Pose rig_from_cam = inverse(own.cam_from_rig);
    std::vector<PixelError> out;
    for (const Eigen::Vector2d& pixel : image_grid(own, columns, rows)) {
        PixelError error;
        error.pixel = pixel;
        const Eigen::Vector3d at_mm = rig_from_cam * (distance_mm * own.lens.unproject(pixel, fold));
        Sensitivity sensitivity;
        if (at_mm.allFinite() && sense(own, fold, at_mm, &sensitivity)) {
            Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(2, covariance.matrix.cols());
            add_camera_columns(Eigen::Matrix2d::Identity(), sensitivity, covariance, camera, &slope);
            slope.middleCols<6>(covariance.motion[camera]) = sensitivity.by_point * point_by_motion(at_mm);
            error.covariance_px2 =
                with_field(own, pixel, slope * covariance.matrix * slope.transpose());
        } else {
            error.covariance_px2.setConstant(std::numeric_limits<double>::quiet_NaN());
        }
        out.push_back(error);
    }
    return out;
}

PointError triangulation_error(const RigFile& rig, const Eigen::Vector3d& at_mm, double noise_px)
{
    assert(rig.covariance.has_value());
    const RigCovariance& covariance = *rig.covariance;
    PointError out;
    out.at_mm = at_mm;
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d fields = Eigen::Matrix3d::Zero();
    Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(3, covariance.matrix.cols());
    for (std::size_t camera = 0; camera < rig.cameras.size(); ++camera) {
        const RigCamera& own = rig.cameras[camera];
        Sensitivity sensitivity;
        if (own.part == 0 && sense(own, own.lens.fold_radius(), at_mm, &sensitivity)
            && inside(own, sensitivity.pixel)) {
            ++out.cameras;
            normal += sensitivity.by_point.transpose() * sensitivity.by_point;
            add_camera_columns(-sensitivity.by_point.transpose(), sensitivity, covariance, camera, &slope);
            // What only their fields can do is as good as independent between cameras.
            fields += sensitivity.by_point.transpose() * field_covariance(own, sensitivity.pixel)
                      * sensitivity.by_point;
        }
    }
    if (out.cameras >= 2) {
        const Eigen::Matrix3d inverse_normal = normal.inverse();
        slope = (inverse_normal * slope).eval();
        slope.middleCols<6>(covariance.motion.front()) -= point_by_motion(at_mm);
        out.covariance_mm2 = slope * covariance.matrix * slope.transpose()
                             + inverse_normal * fields * inverse_normal
                             + noise_px * noise_px * inverse_normal;
    }
    return out;
}

std::vector<PointError> volume_errors(const RigFile& rig, int per_axis, double noise_px)
{
    std::vector<PointError> out;
    for (const Eigen::Vector3d& at_mm : volume_grid(rig, per_axis)) {
        const PointError error = triangulation_error(rig, at_mm, noise_px);
        if (error.cameras >= 2) {
            out.push_back(error);
        }
    }
    return out;
}

}  // namespace rig
