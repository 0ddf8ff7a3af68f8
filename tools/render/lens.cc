/* Distortion and its exact inverse. The Jacobian is written out so that Newton's steps are quadratic. */
#include "tools/render/lens.h"

#include <cmath>
#include <limits>

#include <Eigen/LU>

namespace render {

namespace {

// Radial factor L and dL/d(r^2).
struct Radial {
    double factor;
    double slope;
};

Radial radial_at(const std::array<double, 8>& d, double r2)
{
    const double num = 1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
    const double num_slope = d[0] + r2 * (2 * d[1] + r2 * 3 * d[4]);
    const double den = 1 + r2 * (d[5] + r2 * (d[6] + r2 * d[7]));
    const double den_slope = d[5] + r2 * (2 * d[6] + r2 * 3 * d[7]);
    return {num / den, (num_slope * den - num * den_slope) / (den * den)};
}

// Distorted point and, where asked for, the Jacobian.
Eigen::Vector2d distort_with(const std::array<double, 8>& d, const Eigen::Vector2d& ray,
                             Eigen::Matrix2d* jacobian)
{
    const double x = ray.x();
    const double y = ray.y();
    const double r2 = x * x + y * y;
    const Radial radial = radial_at(d, r2);
    const double p1 = d[2];
    const double p2 = d[3];
    if (jacobian != nullptr) {
        const double cross = 2 * x * y * radial.slope + 2 * p1 * x + 2 * p2 * y;
        (*jacobian)(0, 0) = radial.factor + 2 * x * x * radial.slope + 2 * p1 * y + 6 * p2 * x;
        (*jacobian)(0, 1) = cross;
        (*jacobian)(1, 0) = cross;
        (*jacobian)(1, 1) = radial.factor + 2 * y * y * radial.slope + 6 * p1 * y + 2 * p2 * x;
    }
    return {x * radial.factor + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial.factor + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

} // namespace

void Lens::find_ray_max()
{
    // The derivative of r L(r^2) is L + 2 r^2 L'. A ray of 20 is 87 degrees off the axis.
    constexpr double step = 1e-3;
    constexpr double limit = 20;
    for (double r = step; r < limit; r += step) {
        const Radial radial = radial_at(distortion, r * r);
        if (!(radial.factor > 0) || !(radial.factor + 2 * r * r * radial.slope > 0)) {
            ray_max = r - step;
            return;
        }
    }
    ray_max = limit;
}

Eigen::Vector2d Lens::distort(const Eigen::Vector2d& ray) const
{
    return distort_with(distortion, ray, nullptr);
}

bool Lens::project(const Eigen::Vector3d& point_cam_mm, Eigen::Vector2d& pixel) const
{
    if (!(point_cam_mm.z() > 0)) {
        return false;
    }
    const Eigen::Vector2d ray = point_cam_mm.head<2>() / point_cam_mm.z();
    if (ray.norm() > ray_max) {
        return false;
    }
    const Eigen::Vector2d bent = distort(ray);
    pixel = {fx * bent.x() + cx, fy * bent.y() + cy};
    return true;
}

bool Lens::unproject(const Eigen::Vector2d& pixel, Eigen::Vector2d& ray) const
{
    const Eigen::Vector2d bent((pixel.x() - cx) / fx, (pixel.y() - cy) / fy);
    for (int i = 0; i < 50; i++) {
        Eigen::Matrix2d jacobian;
        const Eigen::Vector2d miss = bent - distort_with(distortion, ray, &jacobian);
        if (miss.squaredNorm() < 1e-26) {
            return ray.norm() <= ray_max;
        }
        if (!(std::abs(jacobian.determinant()) > 1e-9)) {
            return false;
        }
        ray += jacobian.inverse() * miss;
        if (!(ray.squaredNorm() < 1e4)) {
            return false;
        }
    }
    return false;
}

RayMap make_ray_map(const Lens& lens, int border_px)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    RayMap map;
    map.border_px = border_px;
    map.stride = lens.width_px + 2 * border_px;
    const int rows = lens.height_px + 2 * border_px;
    map.rays.resize(static_cast<std::size_t>(map.stride) * static_cast<std::size_t>(rows));
    auto at = map.rays.begin();
    for (int y = -border_px; y < lens.height_px + border_px; y++) {
        Eigen::Vector2d guess;
        bool have_guess = false;
        for (int x = -border_px; x < lens.width_px + border_px; x++, ++at) {
            const Eigen::Vector2d pixel(x, y);
            if (!have_guess) {
                guess = {(x - lens.cx) / lens.fx, (y - lens.cy) / lens.fy};
            }
            have_guess = lens.unproject(pixel, guess);
            if (!have_guess) {
                // Far from the axis Newton from the distorted point may overshoot: shrink the start.
                guess = 0.5 * Eigen::Vector2d((x - lens.cx) / lens.fx, (y - lens.cy) / lens.fy);
                have_guess = lens.unproject(pixel, guess);
            }
            *at = have_guess ? guess : Eigen::Vector2d(nan, nan);
        }
    }
    return map;
}

} // namespace render
