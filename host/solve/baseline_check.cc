// See baseline_check.h. A camera's centre is c = -R' t; after a small motion (w, d) of its pose,
// which becomes (exp(w) R, t + d), it is c + R' (w x t - d).
#include "host/solve/baseline_check.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>

namespace rig {
namespace {

// Adds what the camera's rows say of the centre's place along `direction`.
void add_rows(const Solution& solution, int camera, const Eigen::Vector3d& direction,
              Eigen::VectorXd* gradient)
{
    const Eigen::Index at = solution.covariance.pose[static_cast<std::size_t>(camera)];
    if (at < 0) {
        return;  // the rig frame itself
    }
    const Pose pose = pose_exp(solution.state.cam_from_rig[static_cast<std::size_t>(camera)]);
    const Eigen::Vector3d turned = pose.rotation * direction;
    gradient->segment<3>(at) += pose.translation_mm.cross(turned);  // turned . (w x t)
    gradient->segment<3>(at + 3) -= turned;
}

Eigen::Vector3d centre_mm(const Solution& solution, int camera)
{
    const auto c = static_cast<std::size_t>(camera);
    return inverse(pose_exp(solution.state.cam_from_rig[c])).translation_mm;
}

std::string sentence(const Scene& scene, const Baseline& known, double found_mm, double sigma_mm)
{
    std::string boards;
    for (const Board& board : scene.boards) {
        boards += (boards.empty() ? "'" : ", '") + board.name + "': " + board.scale;
    }
    return fmt::format(
        "cameras '{}' and '{}' are {:.3f} mm apart by the boards and {:.3f} mm as given, {:.2f} % off "
        "and more than the standard deviations of {:.3f} and {:.3f} mm allow: either the distance is "
        "not the one between their centres of projection, or a length is wrong that sets the scale "
        "({}); measure both",
        scene.cameras[static_cast<std::size_t>(known.camera_a)].name,
        scene.cameras[static_cast<std::size_t>(known.camera_b)].name, found_mm, known.mm,
        100.0 * std::abs(found_mm / known.mm - 1.0), sigma_mm, known.sigma_mm, boards);
}

}  // namespace

Status check_baselines(const Scene& scene, const Solution& solution)
{
    for (const Baseline& known : scene.baselines) {
        const auto a = static_cast<std::size_t>(known.camera_a);
        const auto b = static_cast<std::size_t>(known.camera_b);
        if (solution.covariance.lens[a] < 0 || solution.covariance.lens[b] < 0
            || solution.part_of_camera[a] != solution.part_of_camera[b]) {
            continue;  // not solved, or in parts that have no common frame
        }
        const Eigen::Vector3d between =
            centre_mm(solution, known.camera_b) - centre_mm(solution, known.camera_a);
        const double found_mm = between.norm();
        Eigen::VectorXd gradient = Eigen::VectorXd::Zero(solution.covariance.matrix.rows());
        add_rows(solution, known.camera_b, between.normalized(), &gradient);
        add_rows(solution, known.camera_a, -between.normalized(), &gradient);
        const double variance = gradient.dot(solution.covariance.matrix * gradient);
        const double sigma_mm = std::hypot(std::sqrt(variance), known.sigma_mm);
        if (std::abs(found_mm - known.mm) > kBaselineSigmas * sigma_mm) {
            return Status::failure(sentence(scene, known, found_mm, std::sqrt(variance)));
        }
    }
    return Status();
}

}  // namespace rig
