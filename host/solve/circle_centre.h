// The centre of an imaged circle's edge is not the image of the circle's centre: perspective moves
// it, and distortion moves it further.
#pragma once

#include "host/base/pose.h"
#include "host/model/camera.h"

namespace rig {

// Centre of the ellipse that fits the imaged edge of a circle on the board, less the image of its
// centre; px. Distortion makes the edge no ellipse, so "its" ellipse needs a definition: the one
// with the least squared distances to edge points spread evenly along the edge in the image, which
// is what the detector's fit to edge pixels comes to. The board rises there by `slope` along its x
// and y: zero in the plane z = constant. Zero for radius 0, and where the edge has no image.
Eigen::Vector2d circle_centre_offset(const Camera& lens, const Pose& cam_from_board,
                                     const Eigen::Vector3d& centre_mm, double radius_mm,
                                     const Eigen::Vector2d& slope = Eigen::Vector2d::Zero());

}  // namespace rig
