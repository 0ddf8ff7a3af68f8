// Starting values by homographies and, for boards whose points do not lie in a plane, by OpenCV: the
// only solver file that sees it. Pixels become rays first, so one path serves every lens: poses are
// found in the plane z = 1 with a camera matrix of one.
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "host/base/median.h"
#include "host/solve/plane_pose.h"
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

// A view's points in the plane z = 1 and on the board.
struct Rays {
    std::vector<Eigen::Vector3d> board;  // mm; laid flat where planar: then z = 0
    PlanePoints points;                  // the image of each; its place on the plane where planar
    bool planar = false;
    Pose plane_from_board;
    std::optional<Homography> homography;  // where planar and most points agree with one
};

// Right-handed frame whose x-y plane holds the points best.
void lay_flat(Rays* rays)
{
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& point : rays->board) {
        mean += point / static_cast<double>(rays->board.size());
    }
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Eigen::Vector3d& point : rays->board) {
        spread += (point - mean) * (point - mean).transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);
    rays->planar = axes.eigenvalues()[0] < 1e-6 * axes.eigenvalues()[2];
    if (!rays->planar) {
        return;
    }
    Eigen::Matrix3d rotation = axes.eigenvectors().transpose().colwise().reverse();
    if (rotation.determinant() < 0.0) {
        rotation.row(2) = -rotation.row(2);
    }
    rays->plane_from_board = {rotation, -(rotation * mean)};
    for (Eigen::Vector3d& point : rays->board) {
        point = rays->plane_from_board * point;
        point.z() = 0.0;
        rays->points.plane.push_back(point.head<2>());
    }
    rays->homography = find_homography(rays->points, kInlierDistance, kViewPointsMin);
}

Rays rays_of(const Camera& lens, double fold, const View& view)
{
    Rays rays;
    for (const ViewPoint& point : view.points) {
        const Eigen::Vector3d ray = lens.unproject(point.pixel, fold);
        if (ray.allFinite() && ray.z() > 0.1) {
            rays.board.push_back(point.at_mm);
            rays.points.image.emplace_back(ray.x() / ray.z(), ray.y() / ray.z());
        }
    }
    if (rays.board.size() >= kViewPointsMin) {
        lay_flat(&rays);
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

std::optional<Pose> solid_pose(const Rays& rays, double scale)
{
    std::vector<cv::Point3d> board;
    std::vector<cv::Point2d> image;
    for (std::size_t i = 0; i < rays.board.size(); ++i) {
        board.emplace_back(rays.board[i].x(), rays.board[i].y(), rays.board[i].z());
        image.emplace_back(scale * rays.points.image[i].x(), scale * rays.points.image[i].y());
    }
    cv::Mat rotation;
    cv::Mat translation;
    try {
        if (!cv::solvePnPRansac(board, image, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotation,
                                translation, false, kRansacSteps,
                                static_cast<float>(kInlierDistance), kRansacConfidence,
                                cv::noArray(), cv::SOLVEPNP_SQPNP)) {
            return std::nullopt;
        }
    } catch (const cv::Exception&) {
        return std::nullopt;  // points that OpenCV finds degenerate carry no pose
    }
    return to_pose(rotation, translation);
}

// Pose of rays->board in the camera, its image times `scale`.
std::optional<Pose> pose_of(const Rays& rays, double scale)
{
    if (rays.board.size() < kViewPointsMin || (rays.planar && !rays.homography)) {
        return std::nullopt;
    }
    const std::optional<Pose> found =
        rays.planar ? plane_pose(rays.points, *rays.homography, scale) : solid_pose(rays, scale);
    const auto in_front = [&](const Eigen::Vector3d& point) { return (*found * point).z() > 0.0; };
    const bool ahead = found && std::all_of(rays.board.begin(), rays.board.end(), in_front);
    return ahead ? found : std::nullopt;
}

// Median distance between rays, times `scale`, and board points at distance 1, in pixels of the focal
// length.
double median_error_px(const Rays& rays, const Pose& pose, double scale, double focal_px)
{
    std::vector<double> errors;
    errors.reserve(rays.board.size());
    for (std::size_t i = 0; i < rays.board.size(); ++i) {
        const Eigen::Vector3d p = pose * rays.board[i];
        errors.push_back((p.head<2>() / p.z() - scale * rays.points.image[i]).squaredNorm());
    }
    return focal_px * std::sqrt(median_of(&errors));
}

Camera plain_lens(CameraModel model, const SceneCamera& camera, double focal_px)
{
    Camera lens{model, {focal_px, focal_px, 0.5 * (camera.width_px - 1), 0.5 * (camera.height_px - 1)}};
    lens.intrinsics.resize(static_cast<std::size_t>(kPinholeCount + distortion_count(model)), 0.0);
    return lens;
}

}  // namespace

std::optional<Pose> seed_pose(const Camera& lens, double fold, const View& view)
{
    const Rays rays = rays_of(lens, fold, view);
    const std::optional<Pose> found = pose_of(rays, 1.0);
    return found ? std::optional<Pose>(*found * rays.plane_from_board) : std::nullopt;
}

Camera seed_lens(CameraModel model, const SceneCamera& camera, const std::vector<const View*>& views)
{
    const std::size_t step = std::max<std::size_t>(1, views.size() / kScanViews);
    std::vector<View> some;
    for (std::size_t i = 0; i < views.size(); i += step) {
        some.push_back(thinned(*views[i], kScanPoints));
    }
    // Another focal length scales a pinhole camera's rays, and its homographies with them.
    const bool scales = model != CameraModel::kFisheye;
    std::vector<Rays> rays(some.size());
    const auto look = [&](const Camera& lens) {
        const double fold = lens.fold_radius();
        std::transform(some.begin(), some.end(), rays.begin(),
                       [&](const View& view) { return rays_of(lens, fold, view); });
    };
    double best_error = HUGE_VAL;
    Camera best = plain_lens(model, camera, camera.width_px);
    if (scales) {
        look(best);
    }
    for (double part = 0.3; part < 10.0; part *= 1.15) {
        const double focal_px = part * camera.width_px;
        const Camera lens = plain_lens(model, camera, focal_px);
        if (!scales) {
            look(lens);
        }
        const double scale = scales ? 1.0 / part : 1.0;
        std::vector<double> errors;
        for (const Rays& own : rays) {
            const std::optional<Pose> pose = pose_of(own, scale);
            errors.push_back(pose ? median_error_px(own, *pose, scale, focal_px) : camera.width_px);
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
