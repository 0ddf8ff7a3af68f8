// The information matrix of everything is [A B; B' C] with lenses and camera poses in A and board
// poses, block by block, in C. What remains for the first when the second are free is the Schur
// complement S = A - B C^-1 B', and its inverse is their covariance.
//
// Given the first, a; board pose i is c_i = -C_i^-1 B_i' a + e_i with cov e_i = C_i^-1, independent of a.
// The mean of the boards' motions weighted by C_i, m = (sum C)^-1 sum C_i c_i, is then K a + e with
// K = -(sum C)^-1 sum B_i' and cov e = (sum C)^-1: the joint covariance of a and m is
// [S^-1, S^-1 K'; K S^-1, K S^-1 K' + (sum C)^-1]. All motions are twists in the rig frame, so that they
// can be summed.
#include "host/solve/uncertainty.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <fmt/format.h>

#include <cmath>

#include "host/solve/lens_prior.h"
#include "host/solve/pose_chain.h"
#include "host/solve/prior.h"
#include "host/solve/rolling_information.h"

namespace rig {
namespace {

// Eigenvalues of the equilibrated matrix below this are rounding, and are raised to it: a direction
// that the data do not see then shows as an enormous deviation, instead of a random one.
constexpr double kEigenvalueMin = 1e-14;

// Floor of the noise for the question whether data determine a parameter: noise-free data of a bad
// recording do not make it a good one.
constexpr double kNoiseMinPx = 0.02;

// Sums over a part of the rig, as twists.
struct MotionPart {
    Eigen::Matrix<double, 6, 6> own = Eigen::Matrix<double, 6, 6>::Zero();  // of C
    Eigen::MatrixXd across;                                                 // of B
};

struct Information {
    Eigen::MatrixXd schur;            // S
    std::vector<MotionPart> motions;  // by part
};

RigCovariance lay_out(const Solution& solution)
{
    const std::size_t cameras = solution.state.lenses.size();
    RigCovariance out;
    out.lens.assign(cameras, -1);
    out.pose.assign(cameras, -1);
    out.motion.assign(cameras, -1);
    Eigen::Index size = 0;
    for (const int camera : solution.cameras) {
        const auto c = static_cast<std::size_t>(camera);
        out.lens[c] = size;
        size += static_cast<Eigen::Index>(solution.state.lenses[c].intrinsics.size());
        if (!is_gauge(solution, camera)) {
            out.pose[c] = size;
            size += 6;
        }
    }
    for (const int camera : solution.cameras) {
        const auto c = static_cast<std::size_t>(camera);
        out.motion[c] = size + 6 * solution.part_of_camera[c];
    }
    return out;
}

// How many rows stand before the implied motions.
Eigen::Index own_rows(const Solution& solution, const RigCovariance& places)
{
    return places.motion[static_cast<std::size_t>(solution.gauge_cameras.front())];
}

// Adds what one view says. `at` is the row of its camera's lens, `own` how many rows the camera has,
// `member` the row of its board's place on its body, below 0 where it has none.
void add_view(const Eigen::MatrixXd& normal, Eigen::Index lens_count, Eigen::Index at, Eigen::Index own,
              Eigen::Index member, Eigen::MatrixXd* schur, PosePart* part)
{
    const Eigen::Index body = lens_count + 6;
    schur->block(at, at, own, own) += normal.topLeftCorner(own, own);
    part->across.middleRows(at, own) += normal.block(0, body, own, 6);
    part->own += normal.block<6, 6>(body, body);
    if (member >= 0) {
        const Eigen::MatrixXd by_lens = normal.block(0, body + 6, own, 6);
        schur->block(at, member, own, 6) += by_lens;
        schur->block(member, at, 6, own) += by_lens.transpose();
        schur->block<6, 6>(member, member) += normal.block<6, 6>(body + 6, body + 6);
        part->across.middleRows<6>(member) += normal.block<6, 6>(body + 6, body);
    }
}

// Rows of everything but board poses: those of `places`, boards on bodies, row times.
CommonRows common_rows(const Solution& solution, const RigCovariance& places)
{
    CommonRows out{places.lens, places.pose, {}, std::vector<Eigen::Index>(places.lens.size(), -1),
                   own_rows(solution, places)};
    for (std::size_t i = 0; i < solution.state.body_from_board.size(); ++i) {
        out.member.push_back(out.size);
        out.size += 6;
    }
    for (const int camera : solution.cameras) {
        const auto c = static_cast<std::size_t>(camera);
        if (!solution.state.shutter.empty() && solution.state.shutter.estimated[c] != 0) {
            out.row_time[c] = out.size++;
        }
    }
    return out;
}

// What the views say of each board pose, and of all else.
std::map<std::size_t, PosePart> gather_views(const Solution& solution, const CommonRows& rows,
                                             double noise_factor, Eigen::MatrixXd* schur)
{
    const RigState& state = solution.state;
    if (!state.shutter.empty()) {
        return rolling_information(solution.set.views, state, rows, noise_factor, schur);
    }
    std::map<std::size_t, PosePart> parts;
    for (const View& view : solution.set.views) {
        const auto c = static_cast<std::size_t>(view.camera);
        LocalQuadratic quadratic;
        if (!local_quadratic(view, state.lenses[c], cam_from_board(state, view), 0.0, true, &quadratic)) {
            continue;
        }
        PosePart& part = parts[view.pose];
        if (part.across.size() == 0) {
            part.across = Eigen::MatrixXd::Zero(rows.size, 6);
        }
        const auto lens_count = static_cast<Eigen::Index>(state.lenses[c].intrinsics.size());
        add_view(chain_normal(quadratic, chain_of(state, view)), lens_count, rows.lens[c],
                 lens_count + (rows.pose[c] < 0 ? 0 : 6),
                 view.member == kNoMember ? -1 : rows.member[static_cast<std::size_t>(view.member)], schur,
                 &part);
    }
    return parts;
}

// `places` gives the first rows; its matrix is not read.
Information gather(const Solution& solution, const RigCovariance& places, double noise_factor)
{
    const RigState& state = solution.state;
    const CommonRows rows = common_rows(solution, places);
    const Eigen::Index size = rows.size;
    Information out;
    out.schur = Eigen::MatrixXd::Zero(size, size);
    for (const int camera : solution.cameras) {
        const auto c = static_cast<std::size_t>(camera);
        const std::vector<double> deviations = lens_prior_deviations(state.lenses[c].model);
        for (std::size_t i = 0; i < deviations.size(); ++i) {
            const Eigen::Index at = places.lens[c] + static_cast<Eigen::Index>(i);
            out.schur(at, at) += deviations[i] > 0.0 ? 1.0 / (deviations[i] * deviations[i]) : 0.0;
        }
    }
    const std::map<std::size_t, PosePart> parts = gather_views(solution, rows, noise_factor, &out.schur);
    out.motions.resize(solution.gauge_cameras.size());
    for (MotionPart& motion : out.motions) {
        motion.across = Eigen::MatrixXd::Zero(size, 6);
    }
    for (const auto& [pose, part] : parts) {
        if (part.own.norm() > 0.0) {
            out.schur.noalias() -= part.across * part.own.ldlt().solve(part.across.transpose());
            const Eigen::Matrix<double, 6, 6> twist = six_by_twist(state.rig_from_body[pose]);
            MotionPart& motion = out.motions[static_cast<std::size_t>(solution.set.poses[pose].part)];
            motion.own += twist.transpose() * part.own * twist;
            motion.across += part.across * twist;
        }
    }
    return out;
}

Eigen::MatrixXd invert(const Eigen::MatrixXd& information)
{
    const Eigen::VectorXd scale = information.diagonal().unaryExpr(
        [](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 1.0; });
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * information
                                                               * scale.asDiagonal());
    const Eigen::MatrixXd inverse =
        eigen.eigenvectors()
        * eigen.eigenvalues().cwiseMax(kEigenvalueMin).cwiseInverse().asDiagonal()
        * eigen.eigenvectors().transpose();
    return scale.asDiagonal() * inverse * scale.asDiagonal();
}

// The deviations of row times, from a covariance in the order of common_rows.
void take_row_times(const Solution& solution, const Eigen::MatrixXd& covariance, RigCovariance* out)
{
    for (const Eigen::Index row : common_rows(solution, *out).row_time) {
        out->row_time_s.push_back(row < 0 ? 0.0 : std::sqrt(covariance(row, row)));
    }
}

// The covariance of parametric lenses and flat boards.
void fill(const Solution& solution, double noise_factor, const Prior* prior, RigCovariance* out)
{
    Information information = gather(solution, *out, noise_factor);
    const double share = 1.0 / (noise_factor * noise_factor);
    information.schur *= share;
    for (MotionPart& motion : information.motions) {
        motion.own *= share;
        motion.across *= share;
    }
    if (prior != nullptr) {
        information.schur += prior_information(*prior, solution.state, *out, information.schur.rows());
    }
    const Eigen::Index own = own_rows(solution, *out);
    const auto parts = static_cast<Eigen::Index>(information.motions.size());
    const Eigen::MatrixXd covariance = invert(information.schur);
    take_row_times(solution, covariance, out);
    Eigen::MatrixXd follow(6 * parts, covariance.cols());
    for (Eigen::Index part = 0; part < parts; ++part) {
        const MotionPart& motion = information.motions[static_cast<std::size_t>(part)];
        const auto factor = motion.own.ldlt();
        follow.middleRows<6>(6 * part) = -factor.solve(motion.across.transpose());
        out->matrix.block<6, 6>(own + 6 * part, own + 6 * part) =
            factor.solve(Eigen::MatrixXd::Identity(6, 6));
    }
    const Eigen::MatrixXd across = follow * covariance;
    out->matrix.topLeftCorner(own, own) = covariance.topLeftCorner(own, own);
    out->matrix.bottomLeftCorner(6 * parts, own) = across.leftCols(own);
    out->matrix.topRightCorner(own, 6 * parts) = across.leftCols(own).transpose();
    out->matrix.bottomRightCorner(6 * parts, 6 * parts) += across * follow.transpose();
}

}  // namespace

Eigen::Matrix<double, 6, 6> six_by_twist(const Vector6& six)
{
    Eigen::Matrix<double, 6, 6> out = Eigen::Matrix<double, 6, 6>::Identity();
    const Eigen::Vector3d vector = six.head<3>();
    out.topLeftCorner<3, 3>() = rotation_right_jacobian(-vector).inverse();
    out.bottomLeftCorner<3, 3>() = -skew(six.tail<3>());
    return out;
}

double noise_of(const Solution& solution)
{
    double factor = 1.0;
    for (const int camera : solution.cameras) {
        factor = std::max(factor, solution.noise_factor[static_cast<std::size_t>(camera)]);
    }
    return factor;
}

RigCovariance rig_covariance(const Solution& solution, double noise_factor, const Prior* prior)
{
    RigCovariance out = lay_out(solution);
    const Eigen::Index own = own_rows(solution, out);
    const auto parts = static_cast<Eigen::Index>(solution.gauge_cameras.size());
    const Eigen::MatrixXd& flexible = solution.flexible.matrix;
    out.matrix.setZero(own + 6 * parts, own + 6 * parts);
    if (flexible.size() > 0) {
        std::vector<Eigen::Index> rows(static_cast<std::size_t>(own + 6 * parts));
        for (Eigen::Index i = 0; i < own + 6 * parts; ++i) {
            rows[static_cast<std::size_t>(i)] = i < own ? i : flexible.rows() - (own + 6 * parts) + i;
        }
        out.matrix = noise_factor * noise_factor * flexible(rows, rows);
        take_row_times(solution, noise_factor * noise_factor * flexible, &out);
    } else {
        fill(solution, noise_factor, prior, &out);
    }
    // A change d of a rotation vector turns the camera by the left Jacobian times d.
    for (const int camera : solution.cameras) {
        const auto c = static_cast<std::size_t>(camera);
        if (out.pose[c] >= 0) {
            const Eigen::Vector3d vector = solution.state.cam_from_rig[c].head<3>();
            const Eigen::Matrix3d left = rotation_right_jacobian(-vector);
            out.matrix.middleRows<3>(out.pose[c]) = (left * out.matrix.middleRows<3>(out.pose[c])).eval();
            out.matrix.middleCols<3>(out.pose[c]) =
                (out.matrix.middleCols<3>(out.pose[c]) * left.transpose()).eval();
        }
    }
    out.matrix = (0.5 * (out.matrix + out.matrix.transpose())).eval();
    return out;
}

Status estimate_uncertainty(const Scene& scene, const Prior* prior, Solution* solution)
{
    const auto undetermined = [&](int camera, const std::string& how) {
        return Status::failure(fmt::format(
            "camera '{}': its views do not determine its lens ({}); record views in which the board "
            "is tilted by 20 to 45 degrees, about different axes, at different distances",
            scene.cameras[static_cast<std::size_t>(camera)].name, how));
    };
    solution->covariance = rig_covariance(*solution, noise_of(*solution), prior);
    solution->field_errors = solution->flexible.fields;
    for (FieldErrors& field : solution->field_errors) {
        for (Eigen::Matrix2d& px2 : field.px2) {
            px2 *= noise_of(*solution) * noise_of(*solution);
        }
    }
    const Eigen::VectorXd deviation =
        solution->covariance.matrix.diagonal().cwiseMax(0.0).cwiseSqrt();
    solution->uncertainty.assign(scene.cameras.size(), {});
    for (const int camera : solution->cameras) {
        const auto c = static_cast<std::size_t>(camera);
        const Camera& lens = solution->state.lenses[c];
        const double* own = deviation.data() + solution->covariance.lens[c];
        CameraUncertainty& out = solution->uncertainty[c];
        out.intrinsics.assign(own, own + lens.intrinsics.size());
        // The smallest sigma of the camera's points raised to the floor scales what is asked here.
        double sigma_px = HUGE_VAL;
        for (const View& view : solution->set.views) {
            for (const ViewPoint& point : view.points) {
                const auto own_px = static_cast<double>(point.sigma_px);
                sigma_px = view.camera == camera ? std::min(sigma_px, own_px) : sigma_px;
            }
        }
        const double raise = std::max(1.0, kNoiseMinPx / sigma_px);
        const double part = raise * out.intrinsics[0] / std::abs(lens.intrinsics[0]);
        if (!(part < kFocalWorstPart)) {
            return undetermined(camera, part < 1.0 ? fmt::format("its focal length is uncertain by {:.0f} %",
                                                                 100.0 * part)
                                                   : "nothing tells its focal length");
        }
        if (solution->covariance.pose[c] >= 0) {
            out.rotation_rad = deviation.segment<3>(solution->covariance.pose[c]);
            out.translation_mm = deviation.segment<3>(solution->covariance.pose[c] + 3);
        }
    }
    return Status();
}

}  // namespace rig
