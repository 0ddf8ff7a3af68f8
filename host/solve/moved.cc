// See moved.h. At the joint solution each view would like its board, and that is its camera, a
// little elsewhere. What it would like is noise where all is well, and two values where a camera
// moved.
#include "host/solve/moved.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host/solve/frame_quadratic.h"

namespace rig {
namespace {

constexpr double kDegreesPerRadian = 180.0 / 3.14159265358979323846;
// A radian weighs as much as this way: the distance of a board.
constexpr double kArmMm = 1000.0;

// A camera's frames by its motion in its own frame, p' = p + w x p + t, lens and bodies held.
std::optional<Change> change_of(const Solution& solution, int camera)
{
    FrameQuadratics frames;
    const Camera& lens = solution.state.lenses[static_cast<std::size_t>(camera)];
    for (const View& view : solution.set.views) {
        FrameQuadratic frame;
        LocalQuadratic local;
        if (view.camera != camera) {
            continue;
        }
        const Pose pose = cam_from_board(solution.state, view);
        if (!own_quadratic(view, lens, pose, &frame, &local)) {
            continue;
        }
        // The board's motion turns about its own origin, which is at t in the camera.
        Eigen::Matrix<double, 6, 6> turn = Eigen::Matrix<double, 6, 6>::Identity();
        turn.bottomLeftCorner<3, 3>() = -skew(pose.translation_mm);
        frame.normal = turn.transpose() * local.normal.bottomRightCorner<6, 6>() * turn;
        frame.gradient = turn.transpose() * local.gradient.tail<6>();
        frames.add(frame);
    }
    return find_change(frames.list());
}

struct Moved {
    int camera = 0;
    Change change;
    double size() const
    {
        return std::hypot(kArmMm * change.step.head<3>().norm(), change.step.tail<3>().norm());
    }
};

// `cameras` are those of the part: where they are two, nothing tells which of them it was, and each
// shows a share of the motion.
Status sentence(const Scene& scene, const std::vector<Moved>& moved, const std::vector<int>& cameras)
{
    const bool is_pair = cameras.size() == 2;
    const Moved& most = moved.front();
    double turn_rad = 0.0;
    double shift_mm = 0.0;
    for (std::size_t i = 0; i < (is_pair ? moved.size() : 1); ++i) {
        turn_rad += moved[i].change.step.head<3>().norm();
        shift_mm += moved[i].change.step.tail<3>().norm();
    }
    const auto name = [&](int camera) { return scene.cameras[static_cast<std::size_t>(camera)].name; };
    const std::string who =
        is_pair ? fmt::format("cameras '{}' and '{}' moved against each other", name(cameras[0]),
                              name(cameras[1]))
                : fmt::format("camera '{}' moved against the others", name(most.camera));
    return Status::failure(fmt::format(
        "{} between frames {} and {}, by about {:.3f} degrees and {:.1f} mm: solve what was recorded "
        "before and after apart{}",
        who, most.change.last_before, most.change.first_after, kDegreesPerRadian * turn_rad, shift_mm,
        is_pair ? "" : ", or leave that camera out"));
}

}  // namespace

Status check_moved(const Scene& scene, const Solution& solution)
{
    std::map<int, std::vector<Moved>> by_part;
    std::map<int, std::vector<int>> cameras_of_part;
    for (const int camera : solution.cameras) {
        const int part = solution.part_of_camera[static_cast<std::size_t>(camera)];
        cameras_of_part[part].push_back(camera);
        const std::optional<Change> change = change_of(solution, camera);
        if (change) {
            by_part[part].push_back({camera, *change});
        }
    }
    for (auto& [part, moved] : by_part) {
        std::stable_sort(moved.begin(), moved.end(),
                         [](const Moved& a, const Moved& b) { return a.size() > b.size(); });
        if (cameras_of_part[part].size() > 1) {
            return sentence(scene, moved, cameras_of_part[part]);
        }
    }
    return Status();
}

}  // namespace rig
