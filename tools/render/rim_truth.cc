/* The truth of a circle's image. Lens distortion bends the imaged edge off an ellipse by some
 * thousandths of a pixel, so "its" ellipse needs a definition: least squares of the distance along the
 * edge, every length of edge counting alike; what a perfect detector of edge points would report.
 *
 * The fit starts from the conic of least algebraic distance and goes on by Gauss-Newton on centre and
 * shape. With p = c + B (cos a, sin a), B symmetric, the distance of a point q to the ellipse is to first
 * order (|B^-1 (q - c)| - 1) / |gradient|, exact enough as the distances are far below the radius. */
#include "tools/render/rim_truth.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

namespace render {

namespace {

constexpr double pi = 3.14159265358979323846;
constexpr int rim_points = 96;

// Where a point of the board (lattice frame) lands. With a rolling shutter the time depends on the row.
bool land(const Camera& camera, const Mosaic& mosaic, const Instant& instant,
          const Eigen::Vector2d& lattice, Eigen::Vector2d& pixel)
{
    const Eigen::Vector3d mm(lattice.x() * mosaic.mm_per_unit().x(),
                             lattice.y() * mosaic.mm_per_unit().y(), 0);
    double row = 0;
    const int rounds = camera.row_time_us > 0 ? 20 : 1;
    for (int i = 0; i < rounds; i++) {
        const Pose board = instant.pose(1e3 * camera.row_time_us * row);
        const Eigen::Vector3d in_rig = board.rotation * mm + board.translation_mm;
        if (!camera.lens.project(camera.cam_from_rig.rotation * in_rig +
                                     camera.cam_from_rig.translation_mm,
                                 pixel)) {
            return false;
        }
        if (std::abs(pixel.y() - row) < 1e-9) {
            break;
        }
        row = pixel.y();
    }
    return true;
}

bool in_image(const Lens& lens, const Eigen::Vector2d& p)
{
    return p.x() >= -0.5 && p.y() >= -0.5 && p.x() <= lens.width_px - 0.5 &&
           p.y() <= lens.height_px - 0.5;
}

bool in_polygon(const std::vector<Eigen::Vector2d>& polygon, const Eigen::Vector2d& p)
{
    bool inside = false;
    for (std::size_t i = 0; i < polygon.size(); i++) {
        const Eigen::Vector2d& a = polygon[i];
        const Eigen::Vector2d& b = polygon[(i + 1) % polygon.size()];
        if ((a.y() <= p.y()) != (b.y() <= p.y()) &&
            p.x() < a.x() + (p.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x())) {
            inside = !inside;
        }
    }
    return inside;
}

// True when the polygon and the ellipse, grown by `grow`, have a point in common.
bool hides(const Occluder& occluder, const Ellipse& ellipse, double grow)
{
    const std::size_t count = occluder.polygon.size();
    if (in_polygon(occluder.polygon, ellipse.centre)) {
        return true;
    }
    // In the frame where the ellipse is the unit circle, look at the polygon's sides.
    Eigen::Matrix2d to_circle;
    const double c = std::cos(ellipse.angle_rad);
    const double s = std::sin(ellipse.angle_rad);
    to_circle << c / (ellipse.major * grow), s / (ellipse.major * grow), -s / (ellipse.minor * grow),
        c / (ellipse.minor * grow);
    for (std::size_t i = 0; i < count; i++) {
        const Eigen::Vector2d a = to_circle * (occluder.polygon[i] - ellipse.centre);
        const Eigen::Vector2d b = to_circle * (occluder.polygon[(i + 1) % count] - ellipse.centre);
        const Eigen::Vector2d along = b - a;
        const double length2 = along.squaredNorm();
        const double t = length2 > 0 ? std::clamp(-a.dot(along) / length2, 0.0, 1.0) : 0;
        if ((a + t * along).squaredNorm() < 1) {
            return true;
        }
    }
    return false;
}

// Algebraic start: the conic A u^2 + B u v + C v^2 + D u + E v = 1 about the curve's middle.
bool start_ellipse(const std::vector<Eigen::Vector2d>& curve, Eigen::Vector2d& centre,
                   Eigen::Matrix2d& shape)
{
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& p : curve) {
        middle += p / static_cast<double>(curve.size());
    }
    double scale = 0;
    for (const Eigen::Vector2d& p : curve) {
        scale = std::max(scale, (p - middle).norm());
    }
    if (!(scale > 0)) {
        return false;
    }
    Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
    Eigen::Matrix<double, 5, 1> right = Eigen::Matrix<double, 5, 1>::Zero();
    for (const Eigen::Vector2d& p : curve) {
        const Eigen::Vector2d q = (p - middle) / scale;
        Eigen::Matrix<double, 5, 1> row;
        row << q.x() * q.x(), q.x() * q.y(), q.y() * q.y(), q.x(), q.y();
        normal += row * row.transpose();
        right += row;
    }
    const Eigen::Matrix<double, 5, 1> conic = normal.ldlt().solve(right);
    Eigen::Matrix2d form;
    form << conic[0], 0.5 * conic[1], 0.5 * conic[1], conic[2];
    const Eigen::Vector2d linear(conic[3], conic[4]);
    if (!(form.determinant() > 0)) {
        return false;
    }
    const Eigen::Vector2d offset = -0.5 * form.inverse() * linear;
    const double level = 1 + offset.dot(form * offset);
    // (q - offset)' form (q - offset) = level, so shape = B^-1 with B^-2 = form / level.
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(form / level);
    if (!(eigen.eigenvalues().minCoeff() > 0)) {
        return false;
    }
    centre = middle + scale * offset;
    shape = eigen.operatorSqrt() / scale;
    return true;
}

} // namespace

bool fit_ellipse(const std::vector<Eigen::Vector2d>& curve, Ellipse& out)
{
    Eigen::Vector2d centre;
    Eigen::Matrix2d shape; // symmetric: |shape (p - centre)| = 1 on the ellipse
    if (curve.size() < 6 || !start_ellipse(curve, centre, shape)) {
        return false;
    }
    const std::size_t n = curve.size();
    for (int step = 0; step < 20; step++) {
        Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
        Eigen::Matrix<double, 5, 1> right = Eigen::Matrix<double, 5, 1>::Zero();
        for (std::size_t i = 0; i < n; i++) {
            const Eigen::Vector2d away = curve[i] - centre;
            const Eigen::Vector2d unit = shape * away;
            const double length = unit.norm();
            const Eigen::Vector2d gradient = shape * unit / length;
            const double slope = gradient.norm();
            const double weight = 0.5 * (curve[(i + 1) % n] - curve[(i + n - 1) % n]).norm();
            Eigen::Matrix<double, 5, 1> row; // of the distance, by centre and shape (xx, xy, yy)
            row << -gradient.x(), -gradient.y(), unit.x() * away.x() / length,
                (unit.x() * away.y() + unit.y() * away.x()) / length, unit.y() * away.y() / length;
            row /= slope;
            normal += weight * row * row.transpose();
            right -= weight * row * (length - 1) / slope;
        }
        const Eigen::Matrix<double, 5, 1> change = normal.ldlt().solve(right);
        if (!std::isfinite(change.sum())) {
            return false;
        }
        centre += change.head<2>();
        shape(0, 0) += change[2];
        shape(0, 1) += change[3];
        shape(1, 0) += change[3];
        shape(1, 1) += change[4];
        if (change.head<2>().norm() < 1e-12 * (1 + centre.norm())) {
            break;
        }
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(shape);
    if (!(eigen.eigenvalues()[0] > 0)) {
        return false;
    }
    const Eigen::Vector2d axis = eigen.eigenvectors().col(0); // smallest of B^-1: the major axis
    out.centre = centre;
    out.major = 1 / eigen.eigenvalues()[0];
    out.minor = 1 / eigen.eigenvalues()[1];
    out.angle_rad = std::atan2(axis.y(), axis.x());
    if (out.angle_rad >= 0.5 * pi) {
        out.angle_rad -= pi;
    } else if (out.angle_rad < -0.5 * pi) {
        out.angle_rad += pi;
    }
    return true;
}

std::vector<RimTruth> find_rims(const Camera& camera, const Mosaic& mosaic, const Instant& instant)
{
    std::vector<RimTruth> out;
    const Pose board = instant.pose(0.5e3 * camera.row_time_us * camera.lens.height_px);
    const Eigen::Vector3d normal =
        camera.cam_from_rig.rotation * board.rotation * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d origin =
        camera.cam_from_rig.rotation * board.translation_mm + camera.cam_from_rig.translation_mm;
    if (normal.dot(origin) <= 0) {
        return out; // its back is seen
    }
    constexpr double grown = 1.5;
    std::vector<Eigen::Vector2d> rim(rim_points);
    for (const Disc& disc : mosaic.discs()) {
        bool lands = true;
        bool seen = false;
        bool whole = true;
        for (int k = 0; lands && k < rim_points; k++) {
            const double a = 2 * pi * k / rim_points;
            const Eigen::Vector2d radial(disc.radius * std::cos(a), disc.radius * std::sin(a));
            Eigen::Vector2d& on_rim = rim[static_cast<std::size_t>(k)];
            Eigen::Vector2d round;
            lands = land(camera, mosaic, instant, disc.centre + radial, on_rim) &&
                    land(camera, mosaic, instant, disc.centre + grown * radial, round);
            seen = seen || (lands && in_image(camera.lens, on_rim));
            whole = whole && lands && in_image(camera.lens, round);
        }
        RimTruth truth;
        Ellipse ellipse;
        lands = lands && land(camera, mosaic, instant, disc.centre, truth.circle_centre);
        seen = seen || (lands && in_image(camera.lens, truth.circle_centre));
        if (!lands || !seen || !fit_ellipse(rim, ellipse)) {
            continue;
        }
        for (const Occluder& occluder : camera.occluders) {
            whole = whole && !hides(occluder, ellipse, grown);
        }
        truth.patch = disc.patch;
        truth.feature = disc.feature;
        truth.centre = ellipse.centre;
        truth.major_px = ellipse.major;
        truth.minor_px = ellipse.minor;
        truth.angle_deg = ellipse.angle_rad * 180 / pi;
        truth.white = disc.white;
        truth.visible = whole;
        out.push_back(truth);
    }
    return out;
}

} // namespace render
