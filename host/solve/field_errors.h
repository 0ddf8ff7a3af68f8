// What a lens's field adds to the variance of a pixel, over the image. The covariance of a rig has rows for
// intrinsics, poses and boards (covariance.h); of a field it has those intrinsics that come nearest to what the
// field may do. What is left is too much for a file (a field has up to a thousand control points) and belongs
// to places: here it is as a map, the variance with the whole field less that by those rows, for points as far
// from the camera as those that it was calibrated from. It can be negative where the rows say too much.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace rig {

enum { kFieldErrorColumns = 17, kFieldErrorRows = 13 };

struct FieldErrors {
    int columns = 0;
    int rows = 0;
    std::vector<Eigen::Matrix2d> px2;  // row by row, from the corner pixels' centres; empty: no field

    bool empty() const { return px2.empty(); }

    // Between the places of the map, linear in both directions; zero where there is no field.
    Eigen::Matrix2d at(const Eigen::Vector2d& pixel, int width_px, int height_px) const;
};

}  // namespace rig
