// The fold of a lens and the way back from a pixel to its ray, by bounded iteration.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "host/model/camera.h"

namespace rig {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kPi = 3.14159265358979323846;
constexpr double kRadiusMax = 100.0;  // r/z of a ray 0.57 degrees from the image plane
constexpr int kSteps = 100;
// Rounding of a pixel's coordinates, which no step makes smaller.
constexpr double kExactPx = 1e-10;

// Slope of the radial part along its radius, up to a positive factor.
double radial_slope(const Camera& camera, double radius)
{
    const double q = radius * radius;
    const double* k = camera.intrinsics.data() + kPinholeCount;
    if (camera.model == CameraModel::kFisheye) {
        return 1.0 + q * (3.0 * k[0] + q * (5.0 * k[1] + q * (7.0 * k[2] + q * 9.0 * k[3])));
    }
    const bool divided = distortion_count(camera.model) >= 8;
    const double k4 = divided ? k[5] : 0.0;
    const double k5 = divided ? k[6] : 0.0;
    const double k6 = divided ? k[7] : 0.0;
    const double over = 1.0 + q * (k[0] + q * (k[1] + q * k[4]));
    const double under = 1.0 + q * (k4 + q * (k5 + q * k6));
    const double over_q = k[0] + q * (2.0 * k[1] + 3.0 * q * k[4]);
    const double under_q = k4 + q * (2.0 * k5 + 3.0 * q * k6);
    // A denominator that reached zero ends the lens as surely as a slope that did.
    return under > 0.0 ? (over * under + 2.0 * q * (over_q * under - over * under_q)) : -1.0;
}

// Polar form keeps one iteration good for all models: a ray is a direction on the image plane and a
// radius (r/z, or the angle for the fisheye).
Eigen::Vector3d ray_of(const Camera& camera, const Eigen::Vector2d& at)
{
    if (camera.model != CameraModel::kFisheye) {
        return Eigen::Vector3d(at.x(), at.y(), 1.0).normalized();
    }
    const double theta = at.norm();
    const double sine_over = theta < 1e-8 ? 1.0 : std::sin(theta) / theta;
    return {sine_over * at.x(), sine_over * at.y(), std::cos(theta)};
}

// How far from `pixel` the plane point lands; false when it lies beyond the fold or is no number.
bool miss(const Camera& camera, const Eigen::Vector2d& at, double fold, const Eigen::Vector2d& pixel,
          Eigen::Vector2d* error)
{
    Eigen::Vector2d landed;
    if (!(at.norm() <= fold)
        || !project_formula(camera.model, camera.intrinsics.data(), ray_of(camera, at), &landed,
                            nullptr)) {
        return false;
    }
    *error = landed - pixel;
    return error->allFinite();
}

// Central differences: the derivative steers the iteration, it does not enter its result.
bool newton_step(const Camera& camera, const Eigen::Vector2d& at, const Eigen::Vector2d& error,
                 Eigen::Vector2d* step)
{
    constexpr double kDelta = 1e-6;
    Eigen::Matrix2d slope;
    for (int j = 0; j < 2; ++j) {
        const Eigen::Vector2d delta = kDelta * Eigen::Vector2d::Unit(j);
        Eigen::Vector2d ahead;
        Eigen::Vector2d behind;
        if (!project_formula(camera.model, camera.intrinsics.data(), ray_of(camera, at + delta), &ahead,
                             nullptr)
            || !project_formula(camera.model, camera.intrinsics.data(), ray_of(camera, at - delta),
                                &behind, nullptr)) {
            return false;
        }
        slope.col(j) = (ahead - behind) / (2.0 * kDelta);
    }
    const double determinant = slope.determinant();
    Eigen::Matrix2d adjugate;
    adjugate << slope(1, 1), -slope(0, 1), -slope(1, 0), slope(0, 0);
    *step = -(adjugate * error) / determinant;
    return determinant != 0.0;
}

}  // namespace

double Camera::fold_radius() const
{
    const double end = model == CameraModel::kFisheye ? kPi : kRadiusMax;
    if (std::all_of(intrinsics.begin() + kPinholeCount, intrinsics.end(),
                    [](double k) { return k == 0.0; })) {
        return end;
    }
    double low = 0.0;
    // Steps grow with the radius: 0.5 % finds every fold that is wider than that.
    for (double radius = 0.01; low < end; radius = std::min(radius * 1.005, end)) {
        if (radial_slope(*this, radius) <= 0.0) {
            double high = radius;
            for (int i = 0; i < kSteps; ++i) {
                const double middle = 0.5 * (low + high);
                (radial_slope(*this, middle) > 0.0 ? low : high) = middle;
            }
            return low;
        }
        low = radius;
    }
    return end;
}

Eigen::Vector2d Camera::project(const Eigen::Vector3d& point_mm) const
{
    return project(point_mm, fold_radius());
}

Eigen::Vector2d Camera::project(const Eigen::Vector3d& point_mm, double fold) const
{
    Eigen::Vector2d pixel(kNan, kNan);
    const double across = point_mm.head<2>().norm();
    const double radius = model == CameraModel::kFisheye ? std::atan2(across, point_mm.z())
                                                         : across / point_mm.z();
    if (!point_mm.allFinite() || !(radius >= 0.0) || radius > fold
        || !project_lens(*this, intrinsics.data(), point_mm, &pixel, nullptr)) {
        return {kNan, kNan};
    }
    return pixel;
}

Eigen::Vector3d Camera::unproject(const Eigen::Vector2d& pixel) const
{
    return unproject(pixel, fold_radius());
}

// The field first. Then Newton's method on the plane coordinates, each step halved until the distance shrinks. Ends when a
// step no longer helps; whether that is a solution is asked of the result alone.
Eigen::Vector3d Camera::unproject(const Eigen::Vector2d& seen, double fold) const
{
    const Eigen::Vector2d pixel = field.empty() ? seen : field.undo(seen);
    const Eigen::Vector2d focal(intrinsics[0], intrinsics[1]);
    Eigen::Vector2d at = (pixel - Eigen::Vector2d(intrinsics[2], intrinsics[3])).cwiseQuotient(focal);
    if (at.norm() > 0.9 * fold) {
        at *= 0.9 * fold / at.norm();
    }
    Eigen::Vector2d error;
    if (!miss(*this, at, fold, pixel, &error)) {
        return {kNan, kNan, kNan};
    }
    for (int i = 0; i < kSteps && error.norm() > kExactPx; ++i) {
        Eigen::Vector2d step;
        if (!newton_step(*this, at, error, &step)) {
            break;
        }
        bool better = false;
        for (double part = 1.0; part > 1e-6 && !better; part *= 0.5) {
            Eigen::Vector2d tried;
            better = miss(*this, at + part * step, fold, pixel, &tried) && tried.norm() < error.norm();
            if (better) {
                at += part * step;
                error = tried;
            }
        }
        if (!better) {
            break;
        }
    }
    // A millionth of a pixel: far above what double arithmetic leaves, far below any use.
    return error.norm() < 1e-6 ? ray_of(*this, at) : Eigen::Vector3d(kNan, kNan, kNan);
}

}  // namespace rig
