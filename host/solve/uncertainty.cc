// The information matrix of everything is [A B; B' C] with lenses and camera poses in A and board
// poses, block by block, in C. What remains for the first when the second are free is the Schur
// complement S = A - B C^-1 B', and its inverse is their covariance.
#include "host/solve/uncertainty.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include <cmath>

#include "host/solve/pose_chain.h"

namespace rig {
namespace {

// Eigenvalues of the equilibrated matrix below this are rounding, and are raised to it: a direction
// that the data do not see then shows as an enormous deviation, instead of a random one.
constexpr double kEigenvalueMin = 1e-14;

// Floor of the noise for the question whether data determine a parameter: noise-free data of a bad
// recording do not make it a good one.
constexpr double kNoiseMinPx = 0.02;


// One view's part in the Schur complement, gathered by board pose.
struct PosePart {
    Eigen::MatrixXd across;  // B: rows of A by 6
    Eigen::Matrix<double, 6, 6> own = Eigen::Matrix<double, 6, 6>::Zero();
};

}  // namespace

RigCovariance rig_covariance(const Solution& solution)
{
    const RigState& state = solution.state;
    RigCovariance out;
    out.offset.assign(state.lenses.size(), -1);
    Eigen::Index size = 0;
    for (const int camera : solution.cameras) {
        const auto c = static_cast<std::size_t>(camera);
        out.offset[c] = size;
        size += static_cast<Eigen::Index>(state.lenses[c].intrinsics.size())
                + (is_gauge(solution, camera) ? 0 : 6);
    }
    const Eigen::Index members = size;
    size += 6 * static_cast<Eigen::Index>(state.body_from_board.size());
    Eigen::MatrixXd schur = Eigen::MatrixXd::Zero(size, size);
    std::map<std::size_t, PosePart> parts;
    for (const View& view : solution.set.views) {
        const auto c = static_cast<std::size_t>(view.camera);
        LocalQuadratic quadratic;
        if (!local_quadratic(view, state.lenses[c], cam_from_board(state, view), 0.0, true, &quadratic)) {
            continue;
        }
        const Eigen::MatrixXd normal = chain_normal(quadratic, chain_of(state, view));
        const auto lens_count = static_cast<Eigen::Index>(state.lenses[c].intrinsics.size());
        const Eigen::Index own = lens_count + (is_gauge(solution, view.camera) ? 0 : 6);
        const Eigen::Index body = lens_count + 6;
        PosePart& part = parts[view.pose];
        if (part.across.size() == 0) {
            part.across = Eigen::MatrixXd::Zero(size, 6);
        }
        schur.block(out.offset[c], out.offset[c], own, own) += normal.topLeftCorner(own, own);
        part.across.middleRows(out.offset[c], own) += normal.block(0, body, own, 6);
        part.own += normal.block<6, 6>(body, body);
        if (view.member != kNoMember) {
            const Eigen::Index at = members + 6 * view.member;
            const Eigen::MatrixXd by_lens = normal.block(0, body + 6, own, 6);
            schur.block(out.offset[c], at, own, 6) += by_lens;
            schur.block(at, out.offset[c], 6, own) += by_lens.transpose();
            schur.block<6, 6>(at, at) += normal.block<6, 6>(body + 6, body + 6);
            part.across.middleRows<6>(at) += normal.block<6, 6>(body + 6, body);
        }
    }
    for (const auto& [pose, part] : parts) {
        if (part.own.norm() > 0.0) {
            schur.noalias() -= part.across * part.own.ldlt().solve(part.across.transpose());
        }
    }
    const Eigen::VectorXd scale = schur.diagonal().unaryExpr(
        [](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 1.0; });
    const Eigen::MatrixXd equilibrated = scale.asDiagonal() * schur * scale.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(equilibrated);
    const Eigen::MatrixXd inverse =
        eigen.eigenvectors()
        * eigen.eigenvalues().cwiseMax(kEigenvalueMin).cwiseInverse().asDiagonal()
        * eigen.eigenvectors().transpose();
    out.matrix = scale.asDiagonal() * inverse * scale.asDiagonal();
    return out;
}

Status estimate_uncertainty(const Scene& scene, Solution* solution)
{
    const auto undetermined = [&](int camera, const std::string& how) {
        return Status::failure(fmt::format(
            "camera '{}': its views do not determine its lens ({}); record views in which the board "
            "is tilted by 20 to 45 degrees, about different axes, at different distances",
            scene.cameras[static_cast<std::size_t>(camera)].name, how));
    };
    const RigCovariance covariance = rig_covariance(*solution);
    solution->uncertainty.assign(scene.cameras.size(), {});
    double factor = 1.0;
    for (const int camera : solution->cameras) {
        factor = std::max(factor, solution->noise_factor[static_cast<std::size_t>(camera)]);
    }
    for (const int camera : solution->cameras) {
        const auto c = static_cast<std::size_t>(camera);
        const Camera& lens = solution->state.lenses[c];
        const auto count = static_cast<Eigen::Index>(lens.intrinsics.size());
        const Eigen::Index at = covariance.offset[c];
        const auto deviation = [&](Eigen::Index row) {
            return factor * std::sqrt(std::max(0.0, covariance.matrix(row, row)));
        };
        CameraUncertainty& out = solution->uncertainty[c];
        for (Eigen::Index i = 0; i < count; ++i) {
            out.intrinsics.push_back(deviation(at + i));
        }
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
        if (!is_gauge(*solution, camera)) {
            // A change d of the rotation vector turns the camera by the left Jacobian times d.
            const Eigen::Vector3d vector = solution->state.cam_from_rig[c].head<3>();
            const Eigen::Matrix3d left = rotation_right_jacobian(-vector);
            const Eigen::Matrix3d turn =
                left * covariance.matrix.block<3, 3>(at + count, at + count) * left.transpose();
            out.rotation_rad = factor * turn.diagonal().cwiseMax(0.0).cwiseSqrt();
            for (Eigen::Index i = 0; i < 3; ++i) {
                out.translation_mm[i] = deviation(at + count + 3 + i);
            }
        }
    }
    return Status();
}

}  // namespace rig
