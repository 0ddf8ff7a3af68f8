// Uniform cubic B-splines over a rectangle of the plane, as a tensor product: smooth to the second
// derivative, each control point felt in four by four cells only. Units are the caller's.
#pragma once

#include <Eigen/Core>

namespace rig {

// `columns` by `rows` control points, row by row, carry (columns - 3) by (rows - 3) cells of size
// `step` from `origin` on. Beyond the outer cells the spline goes on as its value at the nearest point
// of the rectangle: constant across the border, so it can do no harm where nothing holds it.
struct BsplineGrid {
    Eigen::Vector2d origin = Eigen::Vector2d::Zero();
    Eigen::Vector2d step = Eigen::Vector2d::Ones();
    int columns = 0;
    int rows = 0;

    bool empty() const { return columns == 0; }
    Eigen::Index count() const { return static_cast<Eigen::Index>(columns) * rows; }
};

// A grid whose cells are squares, or nearly so: `cells` of them along the longer side of the
// rectangle from `low` to `high`, at least one along the shorter.
BsplineGrid make_bspline_grid(const Eigen::Vector2d& low, const Eigen::Vector2d& high, int cells);

// The sixteen control points that a place feels: columns column .. column + 3, rows row .. row + 3.
// The weight of control point (column + i, row + j) is x[i] y[j], and the spline's value the sum of
// weight times control; slopes of the weights are slope_x[i] y[j] and x[i] slope_y[j].
struct BsplineSupport {
    int column = 0;
    int row = 0;
    Eigen::Vector4d x, y;
    Eigen::Vector4d slope_x, slope_y;  // per unit of the plane; zero beyond the border
};
BsplineSupport bspline_support(const BsplineGrid& grid, const Eigen::Vector2d& at);

// Value of a spline; slope (may be null) gets its derivatives by x and y.
double bspline_value(const BsplineGrid& grid, const double* control, const Eigen::Vector2d& at,
                     Eigen::Vector2d* slope);

// Thin-plate energy of the control points, as a quadratic form: c' R c is the sum of squares of their
// second differences (mixed ones twice). Planes have none.
Eigen::MatrixXd bspline_roughness(const BsplineGrid& grid);

}  // namespace rig
