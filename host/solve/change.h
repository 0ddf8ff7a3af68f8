// Whether something that should stand still during a recording changed at one frame: a lens, or a
// camera's place.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "host/base/pose.h"

namespace rig {

// What the views of one frame say of the parameters in question, held at one common value: the
// quadratic model of their sum of squares, other parameters of these views eliminated.
struct FrameQuadratic {
    std::int64_t frame = 0;
    std::size_t points = 0;
    double squares = 0.0;
    Eigen::MatrixXd normal;
    Eigen::VectorXd gradient;
};

struct Change {
    std::int64_t last_before = 0;
    std::int64_t first_after = 0;
    Eigen::VectorXd step;  // after less before
};

enum { kChangeFramesMin = 3 };  // on each side

// The frames' quadratics, by frame. A change is reported where two values, one before and one
// after, fit so much better than one that neither noise nor frames that differ at random explain
// it, and where it moves points by more than their noise.
std::optional<Change> find_change(const std::vector<FrameQuadratic>& frames);

}  // namespace rig
