// Gauss-Newton on the motion, in three stages: plain least squares; cameras weighted by the inverse of
// their RMS of whitened differences, towards the least sum of lengths, which has one minimum and stays near
// the majority; and by its fourth power from there, so that a camera that moved does not pull at all. Weights
// are 1 up to an RMS of kAgrees, and so for all cameras where both calibrations saw one rig: what follows
// from the parameters is then that of plain least squares.
#include "host/report/compare_rows.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace rig {
namespace {

constexpr double kAgrees = 3.0;  // a mean of squares over some ten directions is rarely above 9
constexpr int kRoundsMax = 30;   // of each stage
constexpr double kSettled = 1e-9;  // squared length of a step, whitened

// Of two cameras neither can be outvoted, and of one nothing is left to compare it with.
const std::vector<double>& stages(std::size_t cameras)
{
    static const std::vector<double> plain{0.0};
    static const std::vector<double> robust{0.0, 1.0, 4.0};
    return cameras > 2 ? robust : plain;
}

double camera_weight(const DifferenceRows& rows, double power)
{
    const double mean = rows.difference.cwiseProduct(rows.weight).squaredNorm()
                        / static_cast<double>(std::max<Eigen::Index>(1, rows.difference.size()));
    return std::pow(kAgrees / std::max(kAgrees, std::sqrt(mean)), power);
}

struct Normal {
    Eigen::Matrix<double, 6, 6> matrix = Eigen::Matrix<double, 6, 6>::Zero();
    Vector6 gradient = Vector6::Zero();
    Eigen::MatrixXd across_a;
    Eigen::MatrixXd across_b;
};

Normal normal_of(const RigFile& a, const RigFile& b, const std::vector<SharedCamera>& cameras,
                 const Pose& b_from_a, double power, bool all)
{
    Normal out;
    for (const SharedCamera& camera : cameras) {
        const DifferenceRows rows = difference_rows(a, b, camera, camera.points_mm, b_from_a, all);
        const Eigen::MatrixXd pull =
            camera_weight(rows, power) * (rows.weight.cwiseAbs2().asDiagonal() * rows.by_motion).transpose();
        out.matrix += pull * rows.by_motion;
        out.gradient += pull * rows.difference;
        if (all) {
            const bool first = &camera == &cameras.front();
            out.across_a = first ? Eigen::MatrixXd(pull * rows.by_a) : out.across_a + pull * rows.by_a;
            out.across_b = first ? Eigen::MatrixXd(pull * rows.by_b) : out.across_b + pull * rows.by_b;
        }
    }
    return out;
}

// From A's camera to B's: of the intrinsics, and a small motion on the left of cam_from_rig. No intrinsics where the
// lenses' models differ.
struct CameraChange {
    Eigen::VectorXd lens;
    Vector6 pose;
};

CameraChange change_of(const RigFile& a, const RigFile& b, const SharedCamera& camera, const Pose& b_from_a)
{
    const RigCamera& one = a.cameras[camera.in_a];
    const RigCamera& other = b.cameras[camera.in_b];
    CameraChange out;
    out.pose = pose_log(other.cam_from_rig * b_from_a * inverse(one.cam_from_rig));
    if (one.lens.model == other.lens.model && one.lens.intrinsics.size() == other.lens.intrinsics.size()) {
        const auto size = static_cast<Eigen::Index>(one.lens.intrinsics.size());
        out.lens = Eigen::Map<const Eigen::VectorXd>(other.lens.intrinsics.data(), size)
                   - Eigen::Map<const Eigen::VectorXd>(one.lens.intrinsics.data(), size);
    }
    return out;
}

Eigen::Vector2d second_order(const Sensitivity& of_a, const Sensitivity& of_b, const CameraChange& change)
{
    Eigen::Vector2d out = (of_b.by_pose - of_a.by_pose) * change.pose;
    if (change.lens.size() == of_a.by_lens.cols() && change.lens.size() == of_b.by_lens.cols()) {
        out += (of_b.by_lens - of_a.by_lens) * change.lens;
    }
    return out;
}

}  // namespace

DifferenceRows difference_rows(const RigFile& a, const RigFile& b, const SharedCamera& camera,
                               const std::vector<Eigen::Vector3d>& points_mm, const Pose& b_from_a,
                               bool all)
{
    const auto room = static_cast<Eigen::Index>(2 * points_mm.size());
    DifferenceRows out;
    out.difference.resize(room);
    out.weight.resize(room);
    out.second_order.resize(room);
    const CameraChange change = change_of(a, b, camera, b_from_a);
    out.by_motion.resize(room, 6);
    out.by_a = Eigen::MatrixXd::Zero(all ? room : 0, a.covariance ? a.covariance->matrix.cols() : 0);
    out.by_b = Eigen::MatrixXd::Zero(all ? room : 0, b.covariance ? b.covariance->matrix.cols() : 0);
    Eigen::Index filled = 0;
    for (std::size_t i = 0; i < points_mm.size(); ++i) {
        const Eigen::Vector3d in_b = b_from_a * points_mm[i];
        Sensitivity of_a;
        Sensitivity of_b;
        if (!sense(a.cameras[camera.in_a], camera.fold_a, points_mm[i], &of_a)
            || !sense(b.cameras[camera.in_b], camera.fold_b, in_b, &of_b)) {
            continue;
        }
        out.pixels.push_back(of_a.pixel);
        out.difference.segment<2>(filled) = of_b.pixel - of_a.pixel;
        out.weight.segment<2>(filled).setConstant(1.0 / (i < camera.sigma_px.size() ? camera.sigma_px[i] : 1.0));
        out.second_order.segment<2>(filled) = second_order(of_a, of_b, change);
        out.by_motion.middleRows<2>(filled) = of_b.by_point * point_by_motion(in_b);
        Eigen::MatrixXd pair;
        for (const auto& [rig, sensitivity, rows, index, sign] :
             {std::tuple(&a, &of_a, &out.by_a, camera.in_a, -1.0),
              std::tuple(&b, &of_b, &out.by_b, camera.in_b, 1.0)}) {
            if (all && rig->covariance) {
                pair = Eigen::MatrixXd::Zero(2, rows->cols());
                add_camera_columns(sign * Eigen::Matrix2d::Identity(), *sensitivity, *rig->covariance, index,
                                   &pair);
                rows->middleRows<2>(filled) = pair;
            }
        }
        filled += 2;
    }
    out.difference.conservativeResize(filled);
    out.weight.conservativeResize(filled);
    out.second_order.conservativeResize(filled);
    out.by_motion.conservativeResize(filled, 6);
    if (all) {
        out.by_a.conservativeResize(filled, out.by_a.cols());
        out.by_b.conservativeResize(filled, out.by_b.cols());
    }
    return out;
}

ImpliedMotion fit_motion(const RigFile& a, const RigFile& b, const std::vector<SharedCamera>& cameras,
                         const Pose& start)
{
    ImpliedMotion out;
    out.b_from_a = start;
    for (const double power : stages(cameras.size())) {
        for (int round = 0; round < kRoundsMax; ++round) {
            const Normal normal = normal_of(a, b, cameras, out.b_from_a, power, false);
            const Vector6 step = -normal.matrix.ldlt().solve(normal.gradient);
            if (!step.allFinite()) {
                break;
            }
            out.b_from_a = Pose{rotation_exp(step.head<3>()), step.tail<3>()} * out.b_from_a;
            if (step.dot(normal.matrix * step) < kSettled) {
                break;
            }
        }
    }
    const Normal normal =
        normal_of(a, b, cameras, out.b_from_a, stages(cameras.size()).back(), true);
    const auto factor = normal.matrix.ldlt();
    out.follow_a = -factor.solve(normal.across_a);
    out.follow_b = -factor.solve(normal.across_b);
    return out;
}

}  // namespace rig
