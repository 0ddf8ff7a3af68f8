// See shutter_json.h.
#include "host/report/shutter_json.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>

namespace rig {
namespace {

using nlohmann::ordered_json;

constexpr double kDegreesPerRadian = 180.0 / 3.14159265358979323846;

std::vector<double> list(const Eigen::Vector3d& v)
{
    return {v.x(), v.y(), v.z()};
}

Eigen::Vector3d middle_of(const Board& board)
{
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const BoardPoint& point : board.points) {
        sum += point.at_mm;
    }
    return sum / static_cast<double>(std::max<std::size_t>(1, board.points.size()));
}

// Velocity in the rig of a place on the view's board.
Eigen::Vector3d velocity_of(const Solution& solution, const View& view, const Eigen::Vector3d& at_mm)
{
    const Vector6& velocity = solution.state.shutter.velocity[view.pose];
    const Eigen::Vector3d arm =
        rig_from_board(solution.state, view) * at_mm - solution.state.rig_from_body[view.pose].tail<3>();
    return velocity.tail<3>() + velocity.head<3>().cross(arm);
}

}  // namespace

void add_row_time(const Scene& scene, const Solution& solution, std::size_t camera, ordered_json* out)
{
    const Shutter& shutter = solution.state.shutter;
    if (!shutter.empty()) {
        (*out)["row_time_ns"] = 1e9 * shutter.row_time_s[camera];
        (*out)["row_time_sigma_ns"] = 1e9 * solution.covariance.row_time_s[camera];
    } else if (scene.cameras[camera].row_time_ns != 0.0) {  // whatever it sees stands still
        (*out)["row_time_ns"] = scene.cameras[camera].row_time_ns;
        (*out)["row_time_sigma_ns"] = 0.0;
    }
}

void add_velocity(const Solution& solution, const View& view, ordered_json* out)
{
    if (solution.state.shutter.empty() || !view.clock.moves) {
        return;
    }
    (*out)["time_us"] = 1e6 * solution.set.poses[view.pose].time_s;
    (*out)["velocity_mm_s"] = list(velocity_of(solution, view, Eigen::Vector3d::Zero()));
    (*out)["rotation_rate_deg_s"] =
        list(kDegreesPerRadian * solution.state.shutter.velocity[view.pose].head<3>());
}

ordered_json motion_json(const Scene& scene, const Solution& solution)
{
    if (solution.state.shutter.empty()) {
        return nullptr;
    }
    double fastest_mm_s = 0.0;
    double fastest_deg_s = 0.0;
    std::int64_t frame = 0;
    for (const View& view : solution.set.views) {
        if (!view.clock.moves) {
            continue;
        }
        const Eigen::Vector3d middle = middle_of(scene.boards[static_cast<std::size_t>(view.board)]);
        const double mm_s = velocity_of(solution, view, middle).norm();
        frame = mm_s > fastest_mm_s ? view.frame : frame;
        fastest_mm_s = std::max(fastest_mm_s, mm_s);
        const Vector6& velocity = solution.state.shutter.velocity[view.pose];
        fastest_deg_s = std::max(fastest_deg_s, kDegreesPerRadian * velocity.head<3>().norm());
    }
    const VelocityDeviation& deviation = solution.state.shutter.deviation;
    return {{"fastest_mm_s", fastest_mm_s},
            {"fastest_deg_s", fastest_deg_s},
            {"fastest_frame", frame},
            {"deviation_mm_s", deviation.shift_mm_s},
            {"deviation_deg_s", kDegreesPerRadian * deviation.turn_rad_s}};
}

std::string shutter_text(const ordered_json& rig)
{
    if (!rig.contains("motion") || rig.at("motion").is_null()) {
        return {};
    }
    std::string text;
    for (const ordered_json& camera : rig.at("cameras")) {
        const double row_time_ns = camera.at("row_time_ns");
        const double sigma_ns = camera.at("row_time_sigma_ns");
        const std::string how =
            sigma_ns > 0.0 ? fmt::format("{:.1f} +- {:.1f} ns a row, estimated", row_time_ns, sigma_ns)
            : row_time_ns != 0.0 ? fmt::format("{:.1f} ns a row, as given", row_time_ns)
                                 : "global shutter";
        text += fmt::format("    {}: {}\n", camera.at("name").get<std::string>(), how);
    }
    const ordered_json& motion = rig.at("motion");
    return text + fmt::format("    fastest: a board's middle at {:.0f} mm/s in frame {}; turning at {:.0f} "
                              "degrees/s\n",
                              motion.at("fastest_mm_s").get<double>(),
                              motion.at("fastest_frame").get<std::int64_t>(),
                              motion.at("fastest_deg_s").get<double>());
}

}  // namespace rig
