// See spline_field.h.
#include "host/model/spline_field.h"

#include <Eigen/LU>
#include <limits>

namespace rig {
namespace {

constexpr int kSteps = 30;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// The parametric part may put p this part of the longer side outside of the image whose edge the
// sum lands on; a lens that leaves more than 2 % unmodelled has the wrong parametric part.
constexpr double kMarginPart = 0.02;

}  // namespace

Eigen::Vector2d SplineField::at(const Eigen::Vector2d& p, Eigen::Matrix2d* slope) const
{
    const BsplineSupport s = bspline_support(grid, p);
    Eigen::Vector2d value = Eigen::Vector2d::Zero();
    Eigen::Matrix2d by_p = Eigen::Matrix2d::Zero();
    for (int part = 0; part < 2; ++part) {
        const double* of_part = control.data() + part * grid.count();
        for (int j = 0; j < 4; ++j) {
            const Eigen::Map<const Eigen::Vector4d> line(of_part + (s.row + j) * grid.columns + s.column);
            const double along = s.x.dot(line);
            value[part] += s.y[j] * along;
            by_p(part, 0) += s.y[j] * s.slope_x.dot(line);
            by_p(part, 1) += s.slope_y[j] * along;
        }
    }
    if (slope != nullptr) {
        *slope = by_p;
    }
    return value;
}

// Newton's method from the pixel itself; a field bends little, so steps are kept only while they help.
Eigen::Vector2d SplineField::undo(const Eigen::Vector2d& pixel) const
{
    Eigen::Vector2d p = pixel - at(pixel, nullptr);
    Eigen::Matrix2d slope;
    Eigen::Vector2d error = p + at(p, &slope) - pixel;
    for (int i = 0; i < kSteps && error.norm() > 0.0; ++i) {
        const Eigen::Vector2d tried =
            p - (Eigen::Matrix2d::Identity() + slope).inverse() * error;
        Eigen::Matrix2d slope_there;
        const Eigen::Vector2d error_there = tried + at(tried, &slope_there) - pixel;
        if (!(error_there.norm() < error.norm())) {
            break;
        }
        p = tried;
        error = error_there;
        slope = slope_there;
    }
    // Well below the millionth of a pixel that the way back through the parametric part is held to.
    return error.norm() < 1e-7 ? p : Eigen::Vector2d(kNan, kNan);
}

SplineField make_spline_field(int width_px, int height_px, int cells)
{
    const double margin = kMarginPart * std::max(width_px, height_px);
    SplineField field;
    field.grid = make_bspline_grid({-0.5 - margin, -0.5 - margin},
                                   {width_px - 0.5 + margin, height_px - 0.5 + margin}, cells);
    field.control.assign(static_cast<std::size_t>(2 * field.grid.count()), 0.0);
    return field;
}

}  // namespace rig
