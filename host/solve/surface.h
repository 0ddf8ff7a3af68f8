// A board that is not flat: z(x, y) over its plane, as a cubic B-spline. Only z is modelled. A sheet that
// bends without stretching also shortens in its plane, by half the mean square of its slope: a bow of
// 1 mm over 1 m shortens 1 m by 8/3 * 1 mm^2 / 1 m = 2.7 micrometres, a hundredth of a pixel in no
// camera; and a board that was machined or milled bent does not shorten at all, so that assuming the
// one would harm the other. The scale stays with the board's x and y: the patch side.
//
// Piston and tilt of z are the board's pose: they are held at zero over the board's points.
#pragma once

#include <vector>

#include "host/base/bspline.h"
#include "host/solve/views.h"

namespace rig {

// Only boards whose points lie in one plane z = constant can have a surface.
bool can_bend(const Board& board);

// Flat, over the board's points, with `cells` along its longer side.
Surface make_surface(const Board& board, int cells);

// Rows: least-squares piston, x tilt and y tilt of the surface over the board's points, in mm at the
// points' root mean square distance from their middle, by control point.
Eigen::MatrixXd surface_gauge(const Surface& surface, const Board& board);

// Sets the height of each point of the views to its board's and what `state.surfaces` adds.
void lift_points(const RigState& state, const std::vector<Board>& boards, std::vector<View>* views);

// What a person wants to know of a surface, over the board's points.
struct SurfaceFigures {
    double rms_um = 0.0;
    double lowest_um = 0.0;
    double highest_um = 0.0;
};
SurfaceFigures surface_figures(const Surface& surface, const Board& board);

}  // namespace rig
