// Rigid motions. `a_from_b` maps coordinates of a point in frame b to its coordinates in frame a, so
// that a_from_c = a_from_b * b_from_c reads as it should. Lengths are millimetres, angles radians.
#pragma once

#include <Eigen/Core>

namespace rig {

using Vector6 = Eigen::Matrix<double, 6, 1>;

struct Pose {
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();

    Eigen::Vector3d operator*(const Eigen::Vector3d& point_mm) const
    {
        return rotation * point_mm + translation_mm;
    }
};

// Compose: (a_from_b * b_from_c) is a_from_c.
Pose operator*(const Pose& a_from_b, const Pose& b_from_c);

// The motion back: inverse(a_from_b) is b_from_a.
Pose inverse(const Pose& a_from_b);

// Skew matrix: skew(a) * b is the cross product a x b.
Eigen::Matrix3d skew(const Eigen::Vector3d& a);

// Rotation about `vector` by its length, and back. rotation_log gives the vector of length [0, pi].
Eigen::Matrix3d rotation_exp(const Eigen::Vector3d& vector);
Eigen::Vector3d rotation_log(const Eigen::Matrix3d& rotation);

// rotation_exp(v + d) = rotation_exp(v) * rotation_exp(rotation_right_jacobian(v) * d) to first
// order in d. Singular at |v| = 2 pi.
Eigen::Matrix3d rotation_right_jacobian(const Eigen::Vector3d& vector);

// A pose as six numbers, as the solver holds it: rotation vector, then translation.
Vector6 pose_log(const Pose& pose);
Pose pose_exp(const Vector6& six);

// Angle of the rotation that takes a's axes to b's, radians, [0, pi].
double rotation_distance(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b);

}  // namespace rig
