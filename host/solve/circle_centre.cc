// The mathematics. The edge is sampled at N points, evenly in the angle on the board, q_k. Its mean
// and first harmonic give an affine map to a frame in which the edge is nearly the unit circle:
//     q_k = m + M u_k,   m = mean(q),   M = (2 / N) sum q_k [cos, sin]
// In that frame the conic  |u|^2 - 1 + p0 + p1 u + p2 v + p3 (u^2 - v^2) + p4 u v = 0  is fitted by
// linear least squares. Its algebraic residual is twice the distance to the edge there, to first
// order in the deviation from an ellipse; the deviation itself is of second order in the radius. A
// distance along the normal u there is 1 / |M^-T u| times that in the image. So weights are the
// length of edge that a sample stands for in the image, over |M^-T u|^2. Without the latter the
// ends of a long ellipse would count for too much: 0.002 px of the centre for a radius of 14 px, 60
// degrees of tilt and k1 = -0.28, 0.04 px for 40 px and k1 = 0.33. With it 0.0001 px are left of
// the true least distances. The fitted conic's centre then goes back through M. For an undistorted
// circle the conic is exact, whatever N.
#include "host/solve/circle_centre.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <array>
#include <cmath>

namespace rig {
namespace {

constexpr int kSamples = 16;  // harmonics up to the sixth do not alias into the fit
constexpr double kPi = 3.14159265358979323846;

using Samples = Eigen::Matrix<double, 2, kSamples>;

struct Angles {
    Samples unit;
    Angles()
    {
        for (int k = 0; k < kSamples; ++k) {
            unit.col(k) << std::cos(2.0 * kPi * k / kSamples), std::sin(2.0 * kPi * k / kSamples);
        }
    }
};

const Samples& unit_circle()
{
    static const Angles angles;
    return angles.unit;
}

// Of the conic through the samples. Zero where they do not spread.
Eigen::Vector2d conic_centre(const Samples& edge)
{
    const Samples& unit = unit_circle();
    const Eigen::Vector2d mean = edge.rowwise().mean();
    const Eigen::Matrix2d axes = (2.0 / kSamples) * edge * unit.transpose();
    if (std::abs(axes.determinant()) < 1e-12) {
        return Eigen::Vector2d::Zero();
    }
    const Eigen::Matrix2d inverse_axes = axes.inverse();
    const Samples u = inverse_axes * (edge.colwise() - mean);
    const Samples gradient = inverse_axes.transpose() * u;
    // Lower triangle of the normal matrix of the columns 1, u, v, u^2 - v^2, u v, and the right
    // side.
    std::array<double, 15> sums{};
    Eigen::Matrix<double, 5, 1> right = Eigen::Matrix<double, 5, 1>::Zero();
    for (int k = 0; k < kSamples; ++k) {
        const int before = (k + kSamples - 1) % kSamples;
        const int after = (k + 1) % kSamples;
        const double weight =
            std::sqrt((edge.col(after) - edge.col(before)).squaredNorm()) / gradient.col(k).squaredNorm();
        const double x = u(0, k);
        const double y = u(1, k);
        const std::array<double, 5> row{1.0, x, y, x * x - y * y, x * y};
        const double distance = weight * (x * x + y * y - 1.0);
        std::size_t at = 0;
        for (std::size_t i = 0; i < row.size(); ++i) {
            right[static_cast<int>(i)] -= distance * row[i];
            for (std::size_t j = 0; j <= i; ++j) {
                sums[at++] += weight * row[i] * row[j];
            }
        }
    }
    Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
    for (int i = 0, at = 0; i < 5; ++i) {
        for (int j = 0; j <= i; ++j) {
            normal(i, j) = sums[static_cast<std::size_t>(at++)];
        }
    }
    const Eigen::Matrix<double, 5, 1> p = normal.llt().solve(right);
    Eigen::Matrix2d quadratic;
    quadratic << 2.0 * (1.0 + p[3]), p[4], p[4], 2.0 * (1.0 - p[3]);
    const Eigen::Vector2d centre = -quadratic.inverse() * p.segment<2>(1);
    return mean + axes * centre;
}

}  // namespace

Eigen::Vector2d circle_centre_offset(const Camera& lens, const Pose& cam_from_board,
                                     const Eigen::Vector3d& centre_mm, double radius_mm,
                                     const Eigen::Vector2d& slope)
{
    const Eigen::Vector2d none = Eigen::Vector2d::Zero();
    Eigen::Vector2d image_of_centre;
    if (radius_mm == 0.0
        || !project_lens(lens, lens.intrinsics.data(), cam_from_board * centre_mm, &image_of_centre,
                         nullptr)) {
        return none;
    }
    // Relative to the image of the centre: small numbers keep their digits.
    const Samples& unit = unit_circle();
    Samples edge;
    for (int k = 0; k < kSamples; ++k) {
        const Eigen::Vector2d step = radius_mm * unit.col(k);
        const Eigen::Vector3d at = centre_mm + Eigen::Vector3d(step.x(), step.y(), slope.dot(step));
        Eigen::Vector2d pixel;
        if (!project_lens(lens, lens.intrinsics.data(), cam_from_board * at, &pixel, nullptr)) {
            return none;
        }
        edge.col(k) = pixel - image_of_centre;
    }
    return conic_centre(edge);
}

}  // namespace rig
