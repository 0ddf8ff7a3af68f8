/* Paths of the board. */
#include "tools/render/motion.h"

#include <algorithm>
#include <cmath>

#include "tools/render/noise.h"

namespace render {

namespace {

constexpr double pi = 3.14159265358979323846;

Eigen::Matrix3d rotation_by(const Eigen::Vector3d& vector_rad)
{
    const double angle = vector_rad.norm();
    if (angle < 1e-15) {
        return Eigen::Matrix3d::Identity();
    }
    return Eigen::AngleAxisd(angle, vector_rad / angle).toRotationMatrix();
}

using Vector7 = Eigen::Matrix<double, 7, 1>;

struct Spline {
    std::vector<double> t_ns;
    std::vector<Vector7> at;
    std::vector<Vector7> slope; // per ns
};

Spline make_spline(const std::vector<KeyPose>& keys, std::int64_t origin_ns)
{
    Spline spline;
    for (const KeyPose& key : keys) {
        Eigen::Quaterniond q(key.pose.rotation);
        Vector7 value;
        value << q.coeffs(), key.pose.translation_mm;
        // Of the two quaternions of a rotation the one nearer to the key before.
        if (!spline.at.empty() && spline.at.back().head<4>().dot(value.head<4>()) < 0) {
            value.head<4>() = -value.head<4>();
        }
        spline.t_ns.push_back(static_cast<double>(key.t_ns - origin_ns));
        spline.at.push_back(value);
    }
    const std::size_t last = keys.size() - 1;
    for (std::size_t i = 0; i <= last; i++) {
        const std::size_t a = i == 0 ? 0 : i - 1;
        const std::size_t b = std::min(i + 1, last);
        spline.slope.push_back((spline.at[b] - spline.at[a]) / (spline.t_ns[b] - spline.t_ns[a]));
    }
    return spline;
}

} // namespace

std::function<Pose(double)> steady(const Pose& pose, const Eigen::Vector3d& mm_per_s,
                                   const Eigen::Vector3d& rad_per_s)
{
    return [=](double after_ns) {
        const double s = after_ns * 1e-9;
        return Pose{rotation_by(rad_per_s * s) * pose.rotation, pose.translation_mm + mm_per_s * s};
    };
}

std::function<Pose(double)> through_keys(const std::vector<KeyPose>& keys, std::int64_t origin_ns)
{
    const Spline spline = make_spline(keys, origin_ns);
    return [spline](double t) {
        const std::size_t last = spline.t_ns.size() - 1;
        std::size_t i = 0;
        while (i + 1 < last && t >= spline.t_ns[i + 1]) {
            i++;
        }
        Vector7 value;
        if (t <= spline.t_ns.front() || t >= spline.t_ns.back()) {
            const std::size_t end = t <= spline.t_ns.front() ? 0 : last;
            value = spline.at[end] + spline.slope[end] * (t - spline.t_ns[end]);
        } else {
            const double span = spline.t_ns[i + 1] - spline.t_ns[i];
            const double s = (t - spline.t_ns[i]) / span;
            const double s2 = s * s;
            const double s3 = s2 * s;
            value = (2 * s3 - 3 * s2 + 1) * spline.at[i] + (3 * s2 - 2 * s3) * spline.at[i + 1] +
                    span * ((s3 - 2 * s2 + s) * spline.slope[i] + (s3 - s2) * spline.slope[i + 1]);
        }
        const Eigen::Quaterniond q(Eigen::Vector4d(value.head<4>().normalized()));
        return Pose{q.toRotationMatrix(), value.tail<3>()};
    };
}

Pose wave_at(const Wave& wave, double t_s)
{
    // Frequencies in ratios that do not close soon; phases from the seed.
    static const double ratio[6] = {1.0, 1.324718, 1.618034, 1.220744, 1.465571, 0.754878};
    double swing[6];
    for (unsigned i = 0; i < 6; i++) {
        const double phase = 2 * pi * noise_uniform(wave.seed, i);
        swing[i] = std::sin(2 * pi * ratio[i] * t_s / wave.period_s + phase);
    }
    const double rad = pi / 180;
    // The tilt's two components are kept on a disc of radius 1, so that tilt_deg is the largest angle.
    Eigen::Vector3d tilt(swing[3], swing[4], 0);
    tilt /= std::max(1.0, tilt.norm());
    Pose pose;
    pose.rotation = rotation_by(tilt * wave.tilt_deg * rad) *
                    rotation_by(Eigen::Vector3d(0, 0, swing[5] * wave.turn_deg * rad));
    const Eigen::Vector3d sway(swing[0] * wave.sway_mm.x(), swing[1] * wave.sway_mm.y(),
                               swing[2] * wave.sway_mm.z());
    pose.translation_mm = wave.centre_mm + sway - pose.rotation * wave.middle_mm;
    return pose;
}

} // namespace render
