// Projection and its derivatives.
//
// Brown, rational and thin prism share one formula, with x = X/Z, y = Y/Z, q = x^2 + y^2 and the
// coefficients that a model lacks taken as zero:
//     g  = (1 + k1 q + k2 q^2 + k3 q^3) / (1 + k4 q + k5 q^2 + k6 q^3)
//     x' = x g + 2 p1 x y + p2 (q + 2 x^2) + s1 q + s2 q^2
//     y' = y g + p1 (q + 2 y^2) + 2 p2 x y + s3 q + s4 q^2
// Fisheye, with theta the angle from the axis and r = sqrt(X^2 + Y^2):
//     t  = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8),  x' = t X / r,  y' = t Y / r
#include "host/model/camera.h"

#include <array>
#include <cmath>
#include <limits>

namespace rig {
namespace {

struct ModelName {
    CameraModel model;
    std::string_view name;
    int distortion;
};

constexpr std::array<ModelName, 4> kModels{{{CameraModel::kBrown, "brown", 5},
                                            {CameraModel::kRational, "rational", 8},
                                            {CameraModel::kThinPrism, "thin-prism", 12},
                                            {CameraModel::kFisheye, "fisheye", 4}}};

// Normalised, distorted coordinates and their derivatives.
struct Distorted {
    Eigen::Vector2d at;
    Eigen::Matrix<double, 2, 3> by_point;
    Eigen::Matrix<double, 2, kDistortionMax> by_distortion;
};

bool distort_pinhole(const double* k, int count, const Eigen::Vector3d& point, bool derive,
                     Distorted* out)
{
    if (!(point.z() > 0.0)) {
        return false;
    }
    std::array<double, kDistortionMax> c{};
    std::copy(k, k + count, c.begin());
    const double x = point.x() / point.z();
    const double y = point.y() / point.z();
    const double q = x * x + y * y;
    const double over = 1.0 + q * (c[0] + q * (c[1] + q * c[4]));
    const double under = 1.0 + q * (c[5] + q * (c[6] + q * c[7]));
    const double g = over / under;
    out->at.x() = x * g + 2.0 * c[2] * x * y + c[3] * (q + 2.0 * x * x) + q * (c[8] + q * c[9]);
    out->at.y() = y * g + c[2] * (q + 2.0 * y * y) + 2.0 * c[3] * x * y + q * (c[10] + q * c[11]);
    if (!derive) {
        return true;
    }
    const double over_q = c[0] + q * (2.0 * c[1] + 3.0 * q * c[4]);
    const double under_q = c[5] + q * (2.0 * c[6] + 3.0 * q * c[7]);
    const double g_q = (over_q - g * under_q) / under;
    const double prism_x = c[8] + 2.0 * q * c[9];
    const double prism_y = c[10] + 2.0 * q * c[11];
    Eigen::Matrix2d by_xy;
    by_xy(0, 0) = g + 2.0 * x * x * g_q + 2.0 * c[2] * y + 6.0 * c[3] * x + 2.0 * x * prism_x;
    by_xy(0, 1) = 2.0 * x * y * g_q + 2.0 * c[2] * x + 2.0 * c[3] * y + 2.0 * y * prism_x;
    by_xy(1, 0) = 2.0 * x * y * g_q + 2.0 * c[2] * x + 2.0 * c[3] * y + 2.0 * x * prism_y;
    by_xy(1, 1) = g + 2.0 * y * y * g_q + 6.0 * c[2] * y + 2.0 * c[3] * x + 2.0 * y * prism_y;
    const double z_inverse = 1.0 / point.z();
    Eigen::Matrix<double, 2, 3> xy_by_point;
    xy_by_point << z_inverse, 0.0, -x * z_inverse, 0.0, z_inverse, -y * z_inverse;
    out->by_point = by_xy * xy_by_point;
    const Eigen::Vector2d xy(x, y);
    auto& d = out->by_distortion;
    d.col(0) = xy * (q / under);
    d.col(1) = xy * (q * q / under);
    d.col(2) << 2.0 * x * y, q + 2.0 * y * y;
    d.col(3) << q + 2.0 * x * x, 2.0 * x * y;
    d.col(4) = xy * (q * q * q / under);
    d.col(5) = -xy * (g * q / under);
    d.col(6) = -xy * (g * q * q / under);
    d.col(7) = -xy * (g * q * q * q / under);
    d.col(8) << q, 0.0;
    d.col(9) << q * q, 0.0;
    d.col(10) << 0.0, q;
    d.col(11) << 0.0, q * q;
    return true;
}

bool distort_fisheye(const double* k, const Eigen::Vector3d& point, bool derive, Distorted* out)
{
    const double r2 = point.x() * point.x() + point.y() * point.y();
    const double r = std::sqrt(r2);
    if (r == 0.0 && !(point.z() > 0.0)) {
        return false;
    }
    const double theta = std::atan2(r, point.z());
    const double q = theta * theta;
    const double t = theta * (1.0 + q * (k[0] + q * (k[1] + q * (k[2] + q * k[3]))));
    // On the axis the quotient t / r tends to 1 / z.
    const bool on_axis = r < 1e-9 * std::abs(point.z());
    const double scale = on_axis ? 1.0 / point.z() : t / r;
    const Eigen::Vector2d xy = point.head<2>();
    out->at = scale * xy;
    if (!derive) {
        return true;
    }
    out->by_point.setZero();
    out->by_distortion.setZero();
    if (on_axis) {
        out->by_point(0, 0) = out->by_point(1, 1) = scale;
        out->by_point.col(2) = -xy / (point.z() * point.z());
        return true;
    }
    const double t_theta = 1.0 + q * (3.0 * k[0] + q * (5.0 * k[1] + q * (7.0 * k[2] + q * 9.0 * k[3])));
    const double d2 = r2 + point.z() * point.z();
    const double theta_r = point.z() / d2;
    const double theta_z = -r / d2;
    const double scale_r = (t_theta * theta_r - scale) / r;
    const Eigen::Vector2d direction = xy / r;
    out->by_point.leftCols<2>() =
        scale * Eigen::Matrix2d::Identity() + scale_r * xy * direction.transpose();
    out->by_point.col(2) = t_theta * theta_z * direction;
    double power = theta;
    for (int i = 0; i < 4; ++i) {
        power *= q;
        out->by_distortion.col(i) = power * direction;
    }
    return true;
}

}  // namespace

int distortion_count(CameraModel model)
{
    return kModels[static_cast<std::size_t>(model)].distortion;
}

std::string_view camera_model_name(CameraModel model)
{
    return kModels[static_cast<std::size_t>(model)].name;
}

std::optional<CameraModel> camera_model_from_name(std::string_view name)
{
    for (const ModelName& each : kModels) {
        if (each.name == name) {
            return each.model;
        }
    }
    return std::nullopt;
}

std::vector<std::string> intrinsics_names(CameraModel model)
{
    if (model == CameraModel::kFisheye) {
        return {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"};
    }
    std::vector<std::string> names{"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2",
                                   "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4"};
    names.resize(static_cast<std::size_t>(kPinholeCount + distortion_count(model)));
    return names;
}

bool project_formula(CameraModel model, const double* intrinsics, const Eigen::Vector3d& point_mm,
                     Eigen::Vector2d* pixel, ProjectionJacobian* jacobian)
{
    const double* k = intrinsics + kPinholeCount;
    const int count = distortion_count(model);
    const bool derive = jacobian != nullptr;
    Distorted distorted;
    const bool seen = model == CameraModel::kFisheye
                          ? distort_fisheye(k, point_mm, derive, &distorted)
                          : distort_pinhole(k, count, point_mm, derive, &distorted);
    if (!seen) {
        return false;
    }
    const Eigen::Vector2d focal(intrinsics[0], intrinsics[1]);
    *pixel = focal.cwiseProduct(distorted.at) + Eigen::Vector2d(intrinsics[2], intrinsics[3]);
    if (derive) {
        jacobian->by_point = focal.asDiagonal() * distorted.by_point;
        jacobian->by_intrinsics.leftCols<kPinholeCount>() << distorted.at.x(), 0.0, 1.0, 0.0, 0.0,
            distorted.at.y(), 0.0, 1.0;
        jacobian->by_intrinsics.middleCols(kPinholeCount, count) =
            focal.asDiagonal() * distorted.by_distortion.leftCols(count);
    }
    return true;
}

bool project_lens(const Camera& lens, const double* intrinsics, const Eigen::Vector3d& point_mm,
                  Eigen::Vector2d* pixel, ProjectionJacobian* jacobian)
{
    if (!project_formula(lens.model, intrinsics, point_mm, pixel, jacobian)) {
        return false;
    }
    if (!lens.field.empty()) {
        Eigen::Matrix2d slope;
        *pixel += lens.field.at(*pixel, &slope);
        if (jacobian != nullptr) {
            slope += Eigen::Matrix2d::Identity();
            jacobian->by_point = slope * jacobian->by_point;
            auto by_intrinsics =
                jacobian->by_intrinsics.leftCols(kPinholeCount + distortion_count(lens.model));
            by_intrinsics = (slope * by_intrinsics).eval();
        }
    }
    return true;
}

}  // namespace rig
