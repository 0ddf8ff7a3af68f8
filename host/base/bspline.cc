// See bspline.h. With t in [0, 1) inside a cell, the four weights are the usual
//     (1 - t)^3 / 6,  (3 t^3 - 6 t^2 + 4) / 6,  (-3 t^3 + 3 t^2 + 3 t + 1) / 6,  t^3 / 6.
#include "host/base/bspline.h"

#include <algorithm>
#include <cmath>

namespace rig {
namespace {

// Weights along one axis and the first control point they belong to.
void support_along(double place, double step, int points, int* first, Eigen::Vector4d* weight,
                   Eigen::Vector4d* slope)
{
    const int cells = points - 3;
    const double at = std::clamp(place / step, 0.0, static_cast<double>(cells));
    const int cell = std::min(static_cast<int>(at), cells - 1);
    const double t = at - cell;
    const double s = 1.0 - t;
    *first = cell;
    *weight << s * s * s, 3.0 * t * t * t - 6.0 * t * t + 4.0, 3.0 * s * s * s - 6.0 * s * s + 4.0,
        t * t * t;
    *weight /= 6.0;
    *slope << -s * s, 3.0 * t * t - 4.0 * t, -3.0 * s * s + 4.0 * s, t * t;
    const bool inside = place >= 0.0 && place <= step * cells;
    *slope *= inside ? 0.5 / step : 0.0;
}

}  // namespace

BsplineGrid make_bspline_grid(const Eigen::Vector2d& low, const Eigen::Vector2d& high, int cells)
{
    const Eigen::Vector2d size = high - low;
    const double target = size.maxCoeff() / cells;
    BsplineGrid grid;
    grid.origin = low;
    for (int axis = 0; axis < 2; ++axis) {
        const int own = std::max(1, static_cast<int>(std::lround(size[axis] / target)));
        grid.step[axis] = size[axis] / own;
        (axis == 0 ? grid.columns : grid.rows) = own + 3;
    }
    return grid;
}

BsplineSupport bspline_support(const BsplineGrid& grid, const Eigen::Vector2d& at)
{
    BsplineSupport out;
    const Eigen::Vector2d place = at - grid.origin;
    support_along(place.x(), grid.step.x(), grid.columns, &out.column, &out.x, &out.slope_x);
    support_along(place.y(), grid.step.y(), grid.rows, &out.row, &out.y, &out.slope_y);
    return out;
}

double bspline_value(const BsplineGrid& grid, const double* control, const Eigen::Vector2d& at,
                     Eigen::Vector2d* slope)
{
    const BsplineSupport s = bspline_support(grid, at);
    double value = 0.0;
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
    for (int j = 0; j < 4; ++j) {
        const Eigen::Map<const Eigen::Vector4d> line(control + (s.row + j) * grid.columns + s.column);
        const double along = s.x.dot(line);
        value += s.y[j] * along;
        gradient.x() += s.y[j] * s.slope_x.dot(line);
        gradient.y() += s.slope_y[j] * along;
    }
    if (slope != nullptr) {
        *slope = gradient;
    }
    return value;
}

Eigen::MatrixXd bspline_roughness(const BsplineGrid& grid)
{
    const Eigen::Index count = grid.count();
    Eigen::MatrixXd form = Eigen::MatrixXd::Zero(count, count);
    const auto add = [&](std::initializer_list<std::pair<Eigen::Index, double>> row, double weight) {
        for (const auto& [i, a] : row) {
            for (const auto& [j, b] : row) {
                form(i, j) += weight * a * b;
            }
        }
    };
    const int across = grid.columns;
    for (int y = 0; y < grid.rows; ++y) {
        for (int x = 0; x < across; ++x) {
            const Eigen::Index at = static_cast<Eigen::Index>(y) * across + x;
            if (x + 2 < across) {
                add({{at, 1.0}, {at + 1, -2.0}, {at + 2, 1.0}}, 1.0);
            }
            if (y + 2 < grid.rows) {
                add({{at, 1.0}, {at + across, -2.0}, {at + 2 * across, 1.0}}, 1.0);
            }
            if (x + 1 < across && y + 1 < grid.rows) {
                add({{at, 1.0}, {at + 1, -1.0}, {at + across, -1.0}, {at + across + 1, 1.0}}, 2.0);
            }
        }
    }
    return form;
}

}  // namespace rig
