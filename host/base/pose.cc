// Rodrigues' formula and what hangs on it. Near zero each quotient is replaced by its series; the
// switch is where the next series term drops below the double's last bit.
#include "host/base/pose.h"

#include <Eigen/Geometry>
#include <cmath>

namespace rig {
namespace {

// The next term of the series below is angle^4 / 120 or smaller: 1e-18 at this angle.
constexpr double kSmallAngle = 1e-4;

}  // namespace

Pose operator*(const Pose& a_from_b, const Pose& b_from_c)
{
    return {a_from_b.rotation * b_from_c.rotation, a_from_b * b_from_c.translation_mm};
}

Pose inverse(const Pose& a_from_b)
{
    const Eigen::Matrix3d rotation = a_from_b.rotation.transpose();
    return {rotation, -(rotation * a_from_b.translation_mm)};
}

Eigen::Matrix3d skew(const Eigen::Vector3d& a)
{
    Eigen::Matrix3d matrix;
    matrix << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
    return matrix;
}

Eigen::Matrix3d rotation_exp(const Eigen::Vector3d& vector)
{
    const double angle2 = vector.squaredNorm();
    const double angle = std::sqrt(angle2);
    const bool small = angle < kSmallAngle;
    const double s = small ? 1.0 - angle2 / 6.0 : std::sin(angle) / angle;
    const double half = 0.5 * angle;
    const double c = small ? 0.5 - angle2 / 24.0 : 2.0 * std::sin(half) * std::sin(half) / angle2;
    const Eigen::Matrix3d k = skew(vector);
    return Eigen::Matrix3d::Identity() + s * k + c * k * k;
}

Eigen::Vector3d rotation_log(const Eigen::Matrix3d& rotation)
{
    // By way of the quaternion, which stays well conditioned at half a turn.
    Eigen::Quaterniond q(rotation);
    q.normalize();
    if (q.w() < 0.0) {
        q.coeffs() = -q.coeffs();
    }
    const double sine = q.vec().norm();
    const double angle = 2.0 * std::atan2(sine, q.w());
    const double factor = sine < kSmallAngle ? 2.0 / q.w() * (1.0 - sine * sine / (3.0 * q.w() * q.w()))
                                             : angle / sine;
    return factor * q.vec();
}

Eigen::Matrix3d rotation_right_jacobian(const Eigen::Vector3d& vector)
{
    const double angle2 = vector.squaredNorm();
    const double angle = std::sqrt(angle2);
    const bool small = angle < kSmallAngle;
    const double half = 0.5 * angle;
    const double a = small ? 0.5 - angle2 / 24.0 : 2.0 * std::sin(half) * std::sin(half) / angle2;
    // (x - sin x) / x^3 loses digits long before x is small: use the series up to 0.1, where its
    // fourth term is 1e-12 of the first.
    const double b = angle < 0.1 ? 1.0 / 6.0 - angle2 / 120.0 + angle2 * angle2 / 5040.0
                                       - angle2 * angle2 * angle2 / 362880.0
                                 : (angle - std::sin(angle)) / (angle2 * angle);
    const Eigen::Matrix3d k = skew(vector);
    return Eigen::Matrix3d::Identity() - a * k + b * k * k;
}

Vector6 pose_log(const Pose& pose)
{
    Vector6 six;
    six << rotation_log(pose.rotation), pose.translation_mm;
    return six;
}

Pose pose_exp(const Vector6& six)
{
    return {rotation_exp(six.head<3>()), six.tail<3>()};
}

double rotation_distance(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b)
{
    return rotation_log(a.transpose() * b).norm();
}

}  // namespace rig
