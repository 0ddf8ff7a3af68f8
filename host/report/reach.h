// How boards were held before the cameras: at which distances, tilted how, seen together with whom. Of
// used points and views that have some.
#pragma once

#include "host/solve/rig.h"

namespace rig {

struct Span {
    double least = 0.0;
    double median = 0.0;
    double most = 0.0;
};

// A view counts as tilted from this angle on; below, it tells little of the focal length.
constexpr double kTiltedDeg = 15.0;

struct CameraReach {
    Span distance_mm;  // of points from the camera
    Span tilt_deg;     // of views: between the board's normal and the camera's axis, 0..90
    // Views tilted by kTiltedDeg and more, by where the board's face then looks in the image.
    std::size_t right = 0;
    std::size_t left = 0;
    std::size_t up = 0;
    std::size_t down = 0;
    std::map<int, std::size_t> shared;  // by other scene camera: board poses that both saw
};

// Views of a board by the side that they saw: from -z, as a viewer who sees it the right way round,
// or from +z.
struct SidesSeen {
    std::size_t minus_z = 0;
    std::size_t plus_z = 0;
};

struct Reach {
    std::map<int, SidesSeen> sides;    // by scene board
    std::vector<CameraReach> cameras;  // in the order of Solution::cameras
    Eigen::Vector3d from_mm = Eigen::Vector3d::Zero();  // box in the rig frame around all points seen by part 0
    Eigen::Vector3d to_mm = Eigen::Vector3d::Zero();
};

Reach make_reach(const Solution& solution);

}  // namespace rig
