// See plane_pose.h.
#include "host/solve/plane_pose.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <random>

namespace rig {
namespace {

constexpr int kSamplesMax = 500;
// Samples are drawn until one of right points only is among them with all but this probability.
constexpr double kMissed = 1e-3;
// A sample three of whose points span less than this part of what the others do lies on a line.
constexpr double kSpanMin = 1e-3;
constexpr int kFits = 3;

using Sample = std::array<std::uint32_t, 4>;

// The matrix whose columns are the first three points, each times what makes their sum the fourth.
// False where three of them lie on a line.
bool basis_of(const std::vector<Eigen::Vector2d>& points, const Sample& sample,
              Eigen::Matrix3d* basis, Eigen::Vector3d* factor)
{
    for (int i = 0; i < 3; ++i) {
        basis->col(i) = points[sample[static_cast<std::size_t>(i)]].homogeneous();
    }
    const Eigen::Vector3d last = points[sample[3]].homogeneous();
    // Areas of triangles: Cramer's rule.
    const double whole = basis->determinant();
    double largest = std::abs(whole);
    for (int i = 0; i < 3; ++i) {
        Eigen::Matrix3d replaced = *basis;
        replaced.col(i) = last;
        (*factor)[i] = replaced.determinant();
        largest = std::max(largest, std::abs((*factor)[i]));
    }
    if (!(std::min(std::abs(whole), factor->cwiseAbs().minCoeff()) > kSpanMin * largest)) {
        return false;
    }
    *factor /= whole;
    *basis *= factor->asDiagonal();
    return true;
}

// From four points. False where they do not determine it, or where it would put some of them behind
// the camera.
bool map_of_four(const PlanePoints& points, const Sample& sample, Eigen::Matrix3d* map)
{
    Eigen::Matrix3d from;
    Eigen::Matrix3d to;
    Eigen::Vector3d from_factor;
    Eigen::Vector3d to_factor;
    if (!basis_of(points.plane, sample, &from, &from_factor)
        || !basis_of(points.image, sample, &to, &to_factor)
        || (from_factor.array() * to_factor.array()).minCoeff() <= 0.0) {
        return false;
    }
    *map = to * from.inverse();
    *map /= (*map)(2, 2);
    return map->allFinite();
}

// Indices of the points within `distance`, in front of the camera.
void find_agreeing(const PlanePoints& points, const Eigen::Matrix3d& map, double distance,
                   std::vector<std::uint32_t>* agree)
{
    agree->clear();
    for (std::size_t i = 0; i < points.plane.size(); ++i) {
        const Eigen::Vector3d at = map * points.plane[i].homogeneous();
        // Multiplied by the depth instead of divided.
        const double reach = distance * at.z();
        if (reach > 0.0
            && (at.head<2>() - at.z() * points.image[i]).squaredNorm() <= reach * reach) {
            agree->push_back(static_cast<std::uint32_t>(i));
        }
    }
}

// Least squares over the given points of (at.xy - at.z image) / depth, with the depth of the
// present map: repeated, that is the distance in the image. Unknown are all entries but the last.
bool fit(const PlanePoints& points, const std::vector<std::uint32_t>& indices, Eigen::Matrix3d* map)
{
    Eigen::Matrix<double, 8, 8> normal = Eigen::Matrix<double, 8, 8>::Zero();
    Eigen::Matrix<double, 8, 1> right = Eigen::Matrix<double, 8, 1>::Zero();
    double size = 0.0;
    for (const std::uint32_t i : indices) {
        size = std::max(size, points.plane[i].cwiseAbs().maxCoeff());
    }
    for (const std::uint32_t i : indices) {
        const Eigen::Vector3d p(points.plane[i].x() / size, points.plane[i].y() / size, 1.0);
        const Eigen::Vector2d& seen = points.image[i];
        const double depth = map->row(2).dot(points.plane[i].homogeneous());
        const Eigen::Matrix3d pp = p * p.transpose() / (depth * depth);
        normal.topLeftCorner<3, 3>() += pp;
        normal.block<3, 2>(0, 6) -= seen.x() * pp.leftCols<2>();
        normal.block<3, 2>(3, 6) -= seen.y() * pp.leftCols<2>();
        normal.block<2, 2>(6, 6) += seen.squaredNorm() * pp.topLeftCorner<2, 2>();
        right.head<3>() += seen.x() * pp.col(2);
        right.segment<3>(3) += seen.y() * pp.col(2);
        right.tail<2>() -= seen.squaredNorm() * pp.block<2, 1>(0, 2);
    }
    normal.block<3, 3>(3, 3) = normal.topLeftCorner<3, 3>();
    normal.block<2, 6>(6, 0) = normal.block<6, 2>(0, 6).transpose();
    const Eigen::Matrix<double, 8, 1> found = normal.ldlt().solve(right);
    *map << found[0] / size, found[1] / size, found[2], found[3] / size, found[4] / size, found[5],
        found[6] / size, found[7] / size, 1.0;
    return map->allFinite();
}

// How many samples it takes where `share` of the points are right.
int samples_for(double share)
{
    const double all_right = share * share * share * share;
    const double count =
        all_right < 1.0 - kMissed ? std::log(kMissed) / std::log1p(-all_right) + 1.0 : 1.0;
    return static_cast<int>(std::min<double>(kSamplesMax, count));
}

// Turns the z axis to the direction (p, q, 1).
Eigen::Matrix3d turn_to(const Eigen::Vector2d& at)
{
    const Eigen::Vector3d to = at.homogeneous().normalized();
    const Eigen::Vector3d axis(-to.y(), to.x(), 0.0);
    // 1 + cos stands below: the direction is in front of the camera.
    return to.z() * Eigen::Matrix3d::Identity() + skew(axis)
           + axis * axis.transpose() / (1.0 + to.z());
}

// The translation that puts the points nearest to their rays, weighted by depth; and their mean
// square distance in the image, infinite where one lies behind.
double place(const PlanePoints& points, const std::vector<std::uint32_t>& indices, double scale,
             Pose* pose)
{
    // Rows (1, 0, -x) t = x Z - X and (0, 1, -y) t = y Z - Y.
    const auto count = static_cast<double>(indices.size());
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    Eigen::Vector2d sum_miss = Eigen::Vector2d::Zero();
    double squares = 0.0;
    double along = 0.0;
    for (const std::uint32_t i : indices) {
        const Eigen::Vector2d seen = scale * points.image[i];
        const Eigen::Vector3d turned = pose->rotation.leftCols<2>() * points.plane[i];
        const Eigen::Vector2d miss = seen * turned.z() - turned.head<2>();
        sum += seen;
        sum_miss += miss;
        squares += seen.squaredNorm();
        along += seen.dot(miss);
    }
    // The first two eliminated.
    const double depth =
        (sum.dot(sum_miss) / count - along) / (squares - sum.squaredNorm() / count);
    pose->translation_mm << (sum_miss + depth * sum) / count, depth;
    double total = 0.0;
    for (const std::uint32_t i : indices) {
        const Eigen::Vector3d at =
            pose->rotation.leftCols<2>() * points.plane[i] + pose->translation_mm;
        if (!(at.z() > 0.0)) {
            return HUGE_VAL;
        }
        total += (at.head<2>() / at.z() - scale * points.image[i]).squaredNorm();
    }
    return total / count;
}

}  // namespace

std::optional<Homography> find_homography(const PlanePoints& points, double distance,
                                          std::size_t count_min)
{
    const std::size_t count = points.plane.size();
    Homography best;
    std::vector<std::uint32_t> agree;
    std::minstd_rand random(1);
    int wanted = count >= count_min && count >= 4 ? kSamplesMax : 0;
    for (int sampled = 0; sampled < wanted; ++sampled) {
        Sample sample;
        for (std::uint32_t& index : sample) {
            index = static_cast<std::uint32_t>(random() % count);
        }
        Eigen::Matrix3d map;
        if (!map_of_four(points, sample, &map)) {
            continue;
        }
        find_agreeing(points, map, distance, &agree);
        if (agree.size() > best.agree.size()) {
            best = {map, agree};
            const double share = static_cast<double>(agree.size()) / static_cast<double>(count);
            wanted = std::min(wanted, samples_for(share));
        }
    }
    if (best.agree.size() < count_min) {
        return std::nullopt;
    }
    for (int i = 0; i < kFits; ++i) {
        Eigen::Matrix3d map = best.map;
        if (!fit(points, best.agree, &map)) {
            break;
        }
        find_agreeing(points, map, distance, &agree);
        if (agree.size() < count_min) {
            break;
        }
        best = {map, agree};
    }
    return best;
}

std::optional<Pose> plane_pose(const PlanePoints& points, const Homography& homography,
                               double scale)
{
    const Eigen::Matrix3d& h = homography.map;
    const Eigen::Vector2d at = scale * h.topRightCorner<2, 1>();
    // The image's derivative by the plane's coordinates at its origin.
    const Eigen::Matrix2d slope = scale * h.topLeftCorner<2, 2>() - at * h.bottomLeftCorner<1, 2>();
    const Eigen::Matrix3d turn = turn_to(at);
    const Eigen::Matrix2d ahead = turn.topLeftCorner<2, 2>() - at * turn.bottomLeftCorner<1, 2>();
    const Eigen::Matrix2d affine = ahead.inverse() * slope;
    const Eigen::Matrix2d square = affine * affine.transpose();
    const double largest = std::sqrt(
        0.5 * (square.trace() + std::hypot(square(0, 0) - square(1, 1), 2.0 * square(0, 1))));
    const Eigen::Matrix2d flat = affine / largest;
    const double first = std::sqrt(std::max(0.0, 1.0 - flat.col(0).squaredNorm()));
    const double second = std::copysign(std::sqrt(std::max(0.0, 1.0 - flat.col(1).squaredNorm())),
                                        -flat.col(0).dot(flat.col(1)));
    Pose best;
    double least = HUGE_VAL;
    for (const double sign : {1.0, -1.0}) {
        Eigen::Matrix3d tilted;
        tilted.col(0) << flat.col(0), sign * first;
        tilted.col(1) << flat.col(1), sign * second;
        tilted.col(2) = tilted.col(0).cross(tilted.col(1));
        Pose pose;
        pose.rotation = turn * tilted;
        const double error = place(points, homography.agree, scale, &pose);
        if (error < least) {
            least = error;
            best = pose;
        }
    }
    const bool found = least < HUGE_VAL && pose_log(best).allFinite();
    return found ? std::optional<Pose>(best) : std::nullopt;
}

}  // namespace rig
