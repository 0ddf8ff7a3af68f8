/* How the board moves: its pose at any time. Transforms: rig_from_board. Times in nanoseconds. */
#ifndef RENDER_MOTION_H
#define RENDER_MOTION_H

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Geometry>

namespace render {

struct Pose {
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();
};

// An instant at which every camera takes a frame, and the pose as a function of nanoseconds after it.
struct Instant {
    std::int64_t t_ns = 0;
    std::function<Pose(double after_ns)> pose;
};

struct KeyPose {
    std::int64_t t_ns = 0;
    Pose pose;
};

// A board that stands, or moves evenly: mm/s, and a rotation vector in rad/s about the board's origin,
// in rig axes.
std::function<Pose(double)> steady(const Pose& pose, const Eigen::Vector3d& mm_per_s,
                                   const Eigen::Vector3d& rad_per_s);

// Through the key poses at their times (increasing, at least two), with continuous velocity: cubic
// Hermite in translation and in the quaternion. Before the first and after the last it goes on straight.
std::function<Pose(double)> through_keys(const std::vector<KeyPose>& keys, std::int64_t origin_ns);

// Sways about a middle; smooth, and never the same twice within some minutes.
struct Wave {
    std::uint64_t seed = 1;
    Eigen::Vector3d centre_mm{0, 0, 1000}; // of the board's middle, rig frame
    Eigen::Vector3d sway_mm{0, 0, 0};      // amplitudes
    double tilt_deg = 0;                   // largest angle from facing the rig's z axis
    double turn_deg = 0;                   // largest turn in its plane
    double period_s = 4;                   // of the slowest sway
    Eigen::Vector3d middle_mm{0, 0, 0};    // the board's middle in the board frame
};
Pose wave_at(const Wave& wave, double t_s);

} // namespace render

#endif
