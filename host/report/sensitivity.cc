// See sensitivity.h.
#include "host/report/sensitivity.h"

namespace rig {

bool sense(const RigCamera& camera, double fold, const Eigen::Vector3d& point_mm, Sensitivity* out)
{
    const Eigen::Vector3d in_camera = camera.cam_from_rig * point_mm;
    out->pixel = camera.lens.project(in_camera, fold);
    ProjectionJacobian slope;
    Eigen::Vector2d pixel;
    if (!out->pixel.allFinite()
        || !project_lens(camera.lens, camera.lens.intrinsics.data(), in_camera, &pixel, &slope)) {
        return false;
    }
    const Eigen::Vector3d turned = camera.cam_from_rig.rotation * point_mm;
    out->by_point = slope.by_point * camera.cam_from_rig.rotation;
    out->by_lens = slope.by_intrinsics.leftCols(static_cast<Eigen::Index>(camera.lens.intrinsics.size()));
    out->by_pose << -slope.by_point * skew(turned), slope.by_point;
    return true;
}

Eigen::Matrix<double, 3, 6> point_by_motion(const Eigen::Vector3d& point_mm)
{
    Eigen::Matrix<double, 3, 6> out;
    out << -skew(point_mm), Eigen::Matrix3d::Identity();
    return out;
}

void add_camera_columns(const Eigen::MatrixXd& block, const Sensitivity& sensitivity,
                        const RigCovariance& places, std::size_t camera, Eigen::MatrixXd* rows)
{
    rows->middleCols(places.lens[camera], sensitivity.by_lens.cols()) += block * sensitivity.by_lens;
    if (places.pose[camera] >= 0) {
        rows->middleCols<6>(places.pose[camera]) += block * sensitivity.by_pose;
    }
}

bool inside(const RigCamera& camera, const Eigen::Vector2d& pixel)
{
    return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() < camera.width_px - 0.5
           && pixel.y() < camera.height_px - 0.5;
}

std::vector<Eigen::Vector2d> image_grid(const RigCamera& camera, int columns, int rows)
{
    std::vector<Eigen::Vector2d> out;
    for (int row = 0; row < rows; ++row) {
        for (int column = 0; column < columns; ++column) {
            out.emplace_back((camera.width_px - 1.0) * column / (columns - 1),
                             (camera.height_px - 1.0) * row / (rows - 1));
        }
    }
    return out;
}

}  // namespace rig
