// See hand_eye.h. Rotations first: with S of b_from_a, A of a_from_p, B of b_from_q and W the
// inverse of p_from_q's, S A = B W is linear and homogeneous in the 18 numbers of S and W: they are
// the eigenvector of the smallest eigenvalue. Then translations, t_b = S A t_pq + S t_a + t_ba,
// linear in t_pq and t_ba.
#include "host/solve/hand_eye.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace rig {
namespace {

constexpr int kRounds = 6;  // of weights after the first
// Disagreements count in these units, and by Cauchy's weight in units of them.
constexpr double kTurnUnit = 0.01;   // rad
constexpr double kShiftUnit = 0.01;  // of the distance
// The second smallest eigenvalue as a part of the largest. Places that turn about one axis only
// leave it at their noise; turning by 10 degrees about two axes makes it 0.005.
constexpr double kSpreadMin = 3e-4;

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix)
{
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Vector3d sign(1.0, 1.0, (svd.matrixU() * svd.matrixV().transpose()).determinant());
    return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

bool solve_rotations(const std::vector<Sighted>& places, const std::vector<double>& weights,
                     HandEye* out)
{
    Eigen::Matrix<double, 18, 18> normal = Eigen::Matrix<double, 18, 18>::Zero();
    for (std::size_t i = 0; i < places.size(); ++i) {
        const Eigen::Matrix3d& a = places[i].a_from_p.rotation;
        const Eigen::Matrix3d& b = places[i].b_from_q.rotation;
        // Column by column: (S A) e_j = sum_k S e_k A_kj, (B W) e_j = B (W e_j).
        Eigen::Matrix<double, 9, 18> rows = Eigen::Matrix<double, 9, 18>::Zero();
        for (int j = 0; j < 3; ++j) {
            for (int k = 0; k < 3; ++k) {
                rows.block<3, 3>(3 * j, 3 * k) = a(k, j) * Eigen::Matrix3d::Identity();
            }
            rows.block<3, 3>(3 * j, 9 + 3 * j) = -b;
        }
        normal += weights[i] * rows.transpose() * rows;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 18, 18>> eigen(normal);
    if (eigen.eigenvalues()[1] < kSpreadMin * eigen.eigenvalues()[17]) {
        return false;
    }
    const Eigen::Matrix<double, 18, 1> found = eigen.eigenvectors().col(0);
    Eigen::Matrix3d s = Eigen::Map<const Eigen::Matrix3d>(found.data());
    Eigen::Matrix3d w = Eigen::Map<const Eigen::Matrix3d>(found.data() + 9);
    if (s.determinant() < 0.0) {
        s = -s;
        w = -w;
    }
    out->b_from_a.rotation = nearest_rotation(s);
    out->p_from_q.rotation = nearest_rotation(w).transpose();
    return true;
}

void solve_translations(const std::vector<Sighted>& places, const std::vector<double>& weights,
                        HandEye* out)
{
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
    for (std::size_t i = 0; i < places.size(); ++i) {
        Eigen::Matrix<double, 3, 6> rows;
        rows.leftCols<3>() = out->b_from_a.rotation * places[i].a_from_p.rotation;
        rows.rightCols<3>().setIdentity();
        const Eigen::Vector3d known =
            places[i].b_from_q.translation_mm
            - out->b_from_a.rotation * places[i].a_from_p.translation_mm;
        normal += weights[i] * rows.transpose() * rows;
        right += weights[i] * rows.transpose() * known;
    }
    const Eigen::Matrix<double, 6, 1> found = normal.ldlt().solve(right);
    out->p_from_q.translation_mm = found.head<3>();
    out->b_from_a.translation_mm = found.tail<3>();
}

}  // namespace

std::optional<HandEye> solve_hand_eye(const std::vector<Sighted>& places)
{
    if (places.size() < kHandEyeMin) {
        return std::nullopt;
    }
    std::vector<double> weights(places.size(), 1.0);
    HandEye found;
    for (int round = 0; round <= kRounds; ++round) {
        if (!solve_rotations(places, weights, &found)) {
            return std::nullopt;
        }
        solve_translations(places, weights, &found);
        for (std::size_t i = 0; i < places.size(); ++i) {
            const Pose expected = found.b_from_a * places[i].a_from_p * found.p_from_q;
            const double turn = rotation_distance(expected.rotation, places[i].b_from_q.rotation);
            const double shift = (expected.translation_mm - places[i].b_from_q.translation_mm).norm()
                                 / places[i].b_from_q.translation_mm.norm();
            const double off = std::hypot(turn / kTurnUnit, shift / kShiftUnit);
            weights[i] = 1.0 / (1.0 + off * off);
        }
    }
    return found;
}

}  // namespace rig
