// The pose of a plane from one image of its points, as a start: plane coordinates in mm, image in
// the plane z = 1 of a camera.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "host/base/pose.h"

namespace rig {

// Points of one view, index by index.
struct PlanePoints {
    std::vector<Eigen::Vector2d> plane;  // mm; their mean near 0
    std::vector<Eigen::Vector2d> image;
};

// image ~ map * (plane, 1), with map(2, 2) = 1: the plane's origin is in front of the camera.
struct Homography {
    Eigen::Matrix3d map;
    std::vector<std::uint32_t> agree;  // indices of the points that lie within the distance of it
};

// The homography that most points agree with: of four points each, taken at random but alike at
// each call, then by least squares over those within `distance` (unit of the image). None where
// fewer than `count_min` agree with any.
std::optional<Homography> find_homography(const PlanePoints& points, double distance,
                                          std::size_t count_min);

// cam_from_plane, where the homography's agreeing points are seen: the better of the two poses that
// the plane's affine image near its origin allows (Collins and Bartoli, Infinitesimal plane-based
// pose estimation, 2014), by the distance of the agreeing points. None where a point would lie
// behind. `scale` multiplies the image: that of a lens of 1 / scale times the focal length.
std::optional<Pose> plane_pose(const PlanePoints& points, const Homography& homography,
                               double scale);

}  // namespace rig
