// See reach.h.
#include "host/report/reach.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "host/base/median.h"

namespace rig {
namespace {

constexpr double kDegreesPerRadian = 180.0 / 3.14159265358979323846;

Span span_of(std::vector<double> values)
{
    if (values.empty()) {
        return {};
    }
    const double median = median_of(&values);
    const auto [least, most] = std::minmax_element(values.begin(), values.end());
    return {*least, median, *most};
}

// Of the side that the camera saw, in the camera frame: its z is below 0.
Eigen::Vector3d face_of(const Pose& cam_from_board)
{
    const Eigen::Vector3d normal = cam_from_board.rotation.col(2);
    return normal.z() > 0.0 ? Eigen::Vector3d(-normal) : normal;
}

void count_tilt(const Eigen::Vector3d& face, double tilt_deg, CameraReach* out)
{
    if (tilt_deg < kTiltedDeg) {
        return;
    }
    if (std::abs(face.x()) > std::abs(face.y())) {
        ++(face.x() > 0.0 ? out->right : out->left);
    } else {
        ++(face.y() > 0.0 ? out->down : out->up);
    }
}

}  // namespace

Reach make_reach(const Solution& solution)
{
    Reach out;
    out.from_mm.setConstant(HUGE_VAL);
    out.to_mm.setConstant(-HUGE_VAL);
    std::map<std::size_t, std::set<int>> seers;  // of each board pose
    for (const int camera : solution.cameras) {
        CameraReach own;
        std::vector<double> distances;
        std::vector<double> tilts;
        const Pose cam_from_rig = pose_exp(solution.state.cam_from_rig[static_cast<std::size_t>(camera)]);
        for (const View& view : solution.set.views) {
            if (view.camera != camera) {
                continue;
            }
            const Pose in_rig_from_board = rig_from_board(solution.state, view);
            const std::size_t before = distances.size();
            for (const ViewPoint& point : view.points) {
                if (point.used) {
                    const Eigen::Vector3d in_rig = in_rig_from_board * point.at_mm;
                    if (solution.part_of_camera[static_cast<std::size_t>(camera)] == 0) {
                        out.from_mm = out.from_mm.cwiseMin(in_rig);
                        out.to_mm = out.to_mm.cwiseMax(in_rig);
                    }
                    distances.push_back((cam_from_rig * in_rig).norm());
                }
            }
            if (distances.size() > before) {
                seers[view.pose].insert(camera);
                SidesSeen& sides = out.sides[view.board];
                const double z_mm = inverse(cam_from_rig * in_rig_from_board).translation_mm.z();
                ++(z_mm > 0.0 ? sides.plus_z : sides.minus_z);
                const Eigen::Vector3d face = face_of(cam_from_rig * in_rig_from_board);
                tilts.push_back(kDegreesPerRadian * std::acos(std::min(1.0, -face.z())));
                count_tilt(face, tilts.back(), &own);
            }
        }
        own.distance_mm = span_of(std::move(distances));
        own.tilt_deg = span_of(std::move(tilts));
        out.cameras.push_back(own);
    }
    for (const auto& [pose, cameras] : seers) {
        for (std::size_t i = 0; i < solution.cameras.size(); ++i) {
            for (const int other : cameras) {
                if (cameras.count(solution.cameras[i]) != 0 && other != solution.cameras[i]) {
                    ++out.cameras[i].shared[other];
                }
            }
        }
    }
    return out;
}

}  // namespace rig
