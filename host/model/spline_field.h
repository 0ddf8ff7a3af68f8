// What a parametric lens leaves: a smooth shift of the image, in pixels. A lens with a field puts a
// point at p + field(p), where p is the pixel that its parametric part gives. The field lives over the
// image because the data do: where it is as fine as they carry is decided there, and it is cheap, one
// support of sixteen control points.
//
// The parametric part and the field overlap (focal lengths, centre, distortion), and both overlap with
// the camera's rotation. Where a field is solved for, the parametric part is held, so that it stays the
// best fit of its kind, and the field has no part of a rotation (solve/flexible.h).
#pragma once

#include <vector>

#include "host/base/bspline.h"

namespace rig {

struct SplineField {
    BsplineGrid grid;             // px
    std::vector<double> control;  // px: x of all control points, then y of all; empty: no field

    bool empty() const { return control.empty(); }

    // The shift at p, px; beyond the grid that of its border. slope (may be null) gets its derivative.
    Eigen::Vector2d at(const Eigen::Vector2d& p, Eigen::Matrix2d* slope) const;

    // p with p + field(p) = pixel; nan when the iteration finds none.
    Eigen::Vector2d undo(const Eigen::Vector2d& pixel) const;
};

// No shift, over an image of this size and a margin, with `cells` along its longer side.
SplineField make_spline_field(int width_px, int height_px, int cells);

}  // namespace rig
