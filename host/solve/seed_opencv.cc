// Starting values by OpenCV, the only solver file that sees it. Pixels become rays first, so one
// path serves every lens: poses are found in the plane z = 1 with a camera matrix of one.
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "host/base/median.h"
#include "host/solve/seed.h"

namespace rig {
namespace {

// How far, at distance 1, a point may lie from its board's homography: distortion that is not yet
// known must pass, gross outliers must not.
constexpr double kInlierDistance = 0.03;
constexpr int kRansacSteps = 500;
constexpr double kRansacConfidence = 0.999;
constexpr std::size_t kScanViews = 16;
constexpr std::size_t kScanPoints = 80;

// A view's points in the plane z = 1, and in their own plane when they have one.
struct Rays {
    std::vector<cv::Point3d> board;  // planar: z = 0 after plane_from_board
    std::vector<cv::Point2d> image;
    bool planar = false;
    Pose plane_from_board;
};

// Right-handed frame whose x-y plane holds the points best.
void lay_flat(const std::vector<Eigen::Vector3d>& points, Rays* rays)
{
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& point : points) {
        mean += point / static_cast<double>(points.size());
    }
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Eigen::Vector3d& point : points) {
        spread += (point - mean) * (point - mean).transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);
    rays->planar = axes.eigenvalues()[0] < 1e-6 * axes.eigenvalues()[2];
    if (rays->planar) {
        Eigen::Matrix3d rotation = axes.eigenvectors().transpose().colwise().reverse();
        if (rotation.determinant() < 0.0) {
            rotation.row(2) = -rotation.row(2);
        }
        rays->plane_from_board = {rotation, -(rotation * mean)};
    }
    for (const Eigen::Vector3d& point : points) {
        const Eigen::Vector3d at = rays->plane_from_board * point;
        rays->board.emplace_back(at.x(), at.y(), rays->planar ? 0.0 : at.z());
    }
}

Rays rays_of(const Camera& lens, const View& view, std::size_t points_max)
{
    Rays rays;
    std::vector<Eigen::Vector3d> points;
    const double fold = lens.fold_radius();
    for (const ViewPoint& point : thinned(view, points_max).points) {
        const Eigen::Vector3d ray = lens.unproject(point.pixel, fold);
        if (ray.allFinite() && ray.z() > 0.1) {
            points.push_back(point.at_mm);
            rays.image.emplace_back(ray.x() / ray.z(), ray.y() / ray.z());
        }
    }
    if (points.size() >= kViewPointsMin) {
        lay_flat(points, &rays);
    }
    return rays;
}

std::optional<Pose> to_pose(const cv::Mat& rotation_vector, const cv::Mat& translation)
{
    Vector6 six;
    for (int i = 0; i < 3; ++i) {
        six[i] = rotation_vector.at<double>(i);
        six[3 + i] = translation.at<double>(i);
    }
    return six.allFinite() ? std::optional<Pose>(pose_exp(six)) : std::nullopt;
}

std::optional<Pose> planar_pose(const Rays& rays)
{
    std::vector<cv::Point2d> flat;
    for (const cv::Point3d& point : rays.board) {
        flat.emplace_back(point.x, point.y);
    }
    std::vector<unsigned char> inlier;
    cv::findHomography(flat, rays.image, cv::RANSAC, kInlierDistance, inlier, kRansacSteps,
                       kRansacConfidence);
    std::vector<cv::Point3d> board;
    std::vector<cv::Point2d> image;
    for (std::size_t i = 0; i < inlier.size(); ++i) {
        if (inlier[i] != 0) {
            board.push_back(rays.board[i]);
            image.push_back(rays.image[i]);
        }
    }
    if (board.size() < kViewPointsMin) {
        return std::nullopt;
    }
    cv::Mat rotation;
    cv::Mat translation;
    if (!cv::solvePnP(board, image, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotation, translation,
                      false, cv::SOLVEPNP_IPPE)) {
        return std::nullopt;
    }
    return to_pose(rotation, translation);
}

std::optional<Pose> solid_pose(const Rays& rays)
{
    cv::Mat rotation;
    cv::Mat translation;
    if (!cv::solvePnPRansac(rays.board, rays.image, cv::Mat::eye(3, 3, CV_64F), cv::noArray(),
                            rotation, translation, false, kRansacSteps,
                            static_cast<float>(kInlierDistance), kRansacConfidence, cv::noArray(),
                            cv::SOLVEPNP_SQPNP)) {
        return std::nullopt;
    }
    return to_pose(rotation, translation);
}

std::optional<Pose> pose_of(const Rays& rays)
{
    if (rays.board.size() < kViewPointsMin) {
        return std::nullopt;
    }
    try {
        const std::optional<Pose> found = rays.planar ? planar_pose(rays) : solid_pose(rays);
        if (!found) {
            return std::nullopt;
        }
        const Pose cam_from_board = *found * rays.plane_from_board;
        for (const cv::Point3d& point : rays.board) {
            if ((*found * Eigen::Vector3d(point.x, point.y, point.z)).z() <= 0.0) {
                return std::nullopt;
            }
        }
        return cam_from_board;
    } catch (const cv::Exception&) {
        return std::nullopt;  // points that OpenCV finds degenerate carry no pose
    }
}

// Median distance between rays and board points at distance 1, in pixels of the focal length.
double median_error_px(const Rays& rays, const Pose& cam_from_board, double focal_px)
{
    const Pose cam_from_plane = cam_from_board * inverse(rays.plane_from_board);
    std::vector<double> errors;
    for (std::size_t i = 0; i < rays.board.size(); ++i) {
        const cv::Point3d& b = rays.board[i];
        const Eigen::Vector3d p = cam_from_plane * Eigen::Vector3d(b.x, b.y, b.z);
        errors.push_back(std::hypot(p.x() / p.z() - rays.image[i].x, p.y() / p.z() - rays.image[i].y));
    }
    return focal_px * median_of(&errors);
}

Camera plain_lens(CameraModel model, const SceneCamera& camera, double focal_px)
{
    Camera lens{model, {focal_px, focal_px, 0.5 * (camera.width_px - 1), 0.5 * (camera.height_px - 1)}};
    lens.intrinsics.resize(static_cast<std::size_t>(kPinholeCount + distortion_count(model)), 0.0);
    return lens;
}

}  // namespace

std::optional<Pose> seed_pose(const Camera& lens, const View& view)
{
    return pose_of(rays_of(lens, view, view.points.size()));
}

Camera seed_lens(CameraModel model, const SceneCamera& camera, const std::vector<const View*>& views)
{
    const std::size_t step = std::max<std::size_t>(1, views.size() / kScanViews);
    double best_error = HUGE_VAL;
    Camera best = plain_lens(model, camera, camera.width_px);
    for (double part = 0.3; part < 10.0; part *= 1.15) {
        const double focal_px = part * camera.width_px;
        const Camera lens = plain_lens(model, camera, focal_px);
        std::vector<double> errors;
        for (std::size_t i = 0; i < views.size(); i += step) {
            const Rays rays = rays_of(lens, *views[i], kScanPoints);
            const std::optional<Pose> pose = pose_of(rays);
            errors.push_back(pose ? median_error_px(rays, *pose, focal_px) : camera.width_px);
        }
        std::sort(errors.begin(), errors.end());
        double sum = 0.0;
        // The worst quarter may be wrong frames: they do not vote.
        for (std::size_t i = 0; i < (3 * errors.size() + 3) / 4; ++i) {
            sum += errors[i];
        }
        if (sum < best_error) {
            best_error = sum;
            best = lens;
        }
    }
    return best;
}

}  // namespace rig
