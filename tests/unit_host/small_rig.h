// A small rig with known truth for tests of what the solver says about its own errors: three Brown
// cameras of 640 x 480 on an arc, a board of 8 x 6 points, 15 poses. Points, not circles, so that the
// projection is the whole model.
#pragma once

#include <Eigen/Cholesky>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>

#include "host/report/rig_file.h"
#include "host/solve/bundle.h"
#include "host/solve/prior.h"
#include "host/solve/view_kernel.h"
#include "host/solve/rig.h"
#include "host/solve/uncertainty.h"
#include "unity.h"

namespace small_rig {

constexpr int kCameras = 3;
constexpr int kPoses = 15;
constexpr double kNoisePx = 0.05;

inline rig::Scene scene()
{
    rig::Scene out;
    for (int c = 0; c < kCameras; ++c) {
        out.cameras.push_back({"cam" + std::to_string(c), 640, 480});
    }
    out.boards.emplace_back();
    out.boards.back().name = "a";
    for (int k = 0; k < 48; ++k) {
        rig::BoardPoint point;
        point.at_mm = {50.0 * (k % 8), 50.0 * (k / 8), 0.0};
        out.boards.back().points.push_back(point);
    }
    return out;
}

inline rig::RigState truth(std::mt19937* random)
{
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    rig::RigState state;
    for (int c = 0; c < kCameras; ++c) {
        state.lenses.push_back({rig::CameraModel::kBrown,
                                {500.0 + 20.0 * c, 502.0 + 20.0 * c, 321.0 - c, 238.0 + 2.0 * c, -0.2,
                                 0.06, 4e-4, -3e-4, -0.01}});
        rig::Vector6 pose;
        pose << 0.02 * c, 0.14 * c, 0.01 * c, -260.0 * c, 10.0 * c, 15.0 * c;
        state.cam_from_rig.push_back(pose);
    }
    for (int i = 0; i < kPoses; ++i) {
        rig::Vector6 pose;
        const double depth = 1000.0 + 500.0 * unit(*random);
        pose << 0.6 * unit(*random), 0.6 * unit(*random), 0.4 * unit(*random),
            -175.0 + 120.0 + 250.0 * unit(*random), -125.0 + 180.0 * unit(*random), depth;
        state.rig_from_body.push_back(pose);
    }
    return state;
}

// The first `count` board poses only.
inline rig::RigState shortened(rig::RigState state, std::size_t count)
{
    state.rig_from_body.resize(count);
    return state;
}

// Every point that has an image; observed where it projects, with sigma_px known to be kNoisePx.
inline rig::ViewSet views(const rig::RigState& state)
{
    rig::ViewSet set;
    for (std::size_t i = 0; i < state.rig_from_body.size(); ++i) {
        set.poses.push_back({0, static_cast<std::int64_t>(i)});
    }
    for (int c = 0; c < kCameras; ++c) {
        const auto camera = static_cast<std::size_t>(c);
        for (std::size_t i = 0; i < set.poses.size(); ++i) {
            rig::View view;
            view.camera = c;
            view.frame = static_cast<std::int64_t>(i);
            view.pose = i;
            const rig::Pose cam_from_board =
                rig::pose_exp(state.cam_from_rig[camera]) * rig::pose_exp(state.rig_from_body[i]);
            for (int k = 0; k < 48; ++k) {
                rig::ViewPoint point;
                point.at_mm = {50.0 * (k % 8), 50.0 * (k / 8), 0.0};
                point.point = static_cast<std::uint32_t>(k);
                point.pixel = state.lenses[camera].project(cam_from_board * point.at_mm);
                point.sigma_px = static_cast<float>(kNoisePx);
                point.sigma_known = true;
                const Eigen::Vector2d& at = point.pixel;
                if (at.x() > 0.0 && at.x() < 639.0 && at.y() > 0.0 && at.y() < 479.0) {
                    view.points.push_back(point);
                }
            }
            if (view.points.size() >= rig::kViewPointsMin) {
                set.views.push_back(view);
            }
        }
    }
    return set;
}

inline void add_noise(std::mt19937* random, std::vector<rig::View>* views)
{
    std::normal_distribution<double> normal(0.0, kNoisePx);
    for (rig::View& view : *views) {
        for (rig::ViewPoint& point : view.points) {
            point.pixel.x() += normal(*random);
            point.pixel.y() += normal(*random);
        }
    }
}

// The joint solution of observations, started at `start`.
inline rig::Solution solve(const rig::ViewSet& set, const rig::RigState& start,
                           const rig::Prior* prior = nullptr)
{
    rig::Solution solution;
    solution.cameras = {0, 1, 2};
    solution.gauge_cameras = {0};
    solution.part_of_camera.assign(kCameras, 0);
    solution.set = set;
    solution.state = start;
    solution.noise_factor.assign(kCameras, 1.0);
    rig::BundleOptions options;
    options.prior = prior;
    rig::bundle(solution.set.views, options, &solution.state);
    return solution;
}

// How many simulated solves to make.
inline int draws()
{
    const char* text = std::getenv("TESSERA_DRAWS");
    return text != nullptr ? std::atoi(text) : 60;
}

// Motion from b to a on the left: exp(w) R_b = R_a, d = t_a - t_b.
inline rig::Vector6 left_motion(const rig::Vector6& a, const rig::Vector6& b)
{
    rig::Vector6 out;
    out << rig::rotation_log(rig::pose_exp(a).rotation * rig::pose_exp(b).rotation.transpose()), a.tail<3>() - b.tail<3>();
    return out;
}

// The boards' motion from truth to solution, weighted by information, the slow way: from all points'
// derivatives by differences of a motion of the world.
inline rig::Vector6 boards_motion(const rig::Solution& found, const rig::RigState& truth)
{
    Eigen::Matrix<double, 6, 6> weights = Eigen::Matrix<double, 6, 6>::Zero();
    rig::Vector6 sum = rig::Vector6::Zero();
    for (const rig::View& view : found.set.views) {
        const auto c = static_cast<std::size_t>(view.camera);
        Eigen::MatrixXd slope(2 * static_cast<Eigen::Index>(view.points.size()), 6);
        const rig::Pose board = rig::pose_exp(found.state.rig_from_body[view.pose]);
        const rig::Pose camera = rig::pose_exp(found.state.cam_from_rig[c]);
        for (int k = 0; k < 6; ++k) {
            // 1e-5 rad at 1 m is 0.01 mm; a step of 0.01 mm likewise: pixels change by 5e-3.
            const rig::Vector6 step = (k < 3 ? 1e-5 : 1e-2) * rig::Vector6::Unit(k);
            Eigen::Matrix2Xd ahead;
            Eigen::Matrix2Xd behind;
            rig::view_residuals(view, found.state.lenses[c], camera * (rig::pose_exp(step) * board), &ahead);
            rig::view_residuals(view, found.state.lenses[c], camera * (rig::pose_exp(-step) * board), &behind);
            slope.col(k) = (ahead - behind).reshaped() / (2.0 * step[k]);
        }
        const rig::Pose turn = board * rig::inverse(rig::pose_exp(truth.rig_from_body[view.pose]));
        const Eigen::Matrix<double, 6, 6> weight = slope.transpose() * slope;
        weights += weight;
        sum += weight * rig::pose_log(turn);
    }
    return weights.ldlt().solve(sum);
}

// Of lenses, camera poses and the boards' motion, by the rows of found.covariance.
inline Eigen::VectorXd errors_of(const rig::Solution& found, const rig::RigState& truth)
{
    const rig::RigCovariance& places = found.covariance;
    Eigen::VectorXd out(places.matrix.cols());
    for (std::size_t c = 0; c < kCameras; ++c) {
        for (std::size_t i = 0; i < truth.lenses[c].intrinsics.size(); ++i) {
            out[places.lens[c] + static_cast<Eigen::Index>(i)] =
                found.state.lenses[c].intrinsics[i] - truth.lenses[c].intrinsics[i];
        }
        if (places.pose[c] >= 0) {
            out.segment<6>(places.pose[c]) =
                left_motion(found.state.cam_from_rig[c], truth.cam_from_rig[c]);
        }
    }
    out.tail<6>() = boards_motion(found, truth);
    return out;
}

// Mean of e' S^-1 e / n over draws; 1 when errors are as large as the covariance says.
struct Honesty {
    double sum = 0.0;
    double dimensions = 0.0;
    void add(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance)
    {
        const Eigen::VectorXd scale = covariance.diagonal().cwiseSqrt().cwiseInverse();
        const Eigen::MatrixXd even = scale.asDiagonal() * covariance * scale.asDiagonal();
        const Eigen::VectorXd whitened = scale.cwiseProduct(error);
        sum += whitened.dot(even.ldlt().solve(whitened));
        dimensions += static_cast<double>(error.size());
    }
    // A chi-square of N degrees over N scatters by sqrt(2 / N): four of these.
    void check(const char* what) const
    {
        const double ratio = sum / dimensions;
        const double width = 4.0 * std::sqrt(2.0 / dimensions);
        std::printf("%s: squared error over variance %.4f, expected 1 +- %.4f\n", what, ratio, width);
        TEST_ASSERT_TRUE_MESSAGE(std::abs(ratio - 1.0) < width, what);
    }
};

// A solution as rig.json gives it back.
inline rig::RigFile file_of(const rig::RigState& state)
{
    rig::RigFile out;
    for (std::size_t c = 0; c < kCameras; ++c) {
        out.cameras.push_back({"cam" + std::to_string(c), 640, 480, state.lenses[c],
                               rig::pose_exp(state.cam_from_rig[c]), 0, {700.0, 1000.0, 1500.0}});
    }
    return out;
}

// A calibration from new observations of a rig whose boards lie as in `state`.
inline rig::RigFile calibrated(const rig::RigState& state, std::mt19937* random)
{
    rig::ViewSet set = views(state);
    add_noise(random, &set.views);
    const rig::Solution solution = solve(set, state);
    rig::RigFile out = file_of(solution.state);
    out.covariance = rig::rig_covariance(solution);
    out.volume_mm.emplace(Eigen::Vector3d(-300, -250, 700), Eigen::Vector3d(400, 250, 1500));
    return out;
}

}  // namespace small_rig
