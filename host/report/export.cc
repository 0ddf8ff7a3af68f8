// See export.h.
#include "host/report/export.h"

#include <tuple>

#include "common/version.h"
#include "host/report/choice_report.h"
#include "host/report/covariance_json.h"
#include "host/report/shutter_json.h"
#include "host/report/spline_json.h"

namespace rig {
namespace {

using nlohmann::ordered_json;

constexpr double kDegreesPerRadian = 180.0 / 3.14159265358979323846;

ordered_json pose_json(const Pose& pose)
{
    ordered_json rotation = ordered_json::array();
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) {
            rotation.push_back(pose.rotation(row, column));
        }
    }
    const Eigen::Vector3d& t = pose.translation_mm;
    return {{"rotation", rotation}, {"translation_mm", {t.x(), t.y(), t.z()}}};
}

std::vector<double> list(const Eigen::Vector3d& v)
{
    return {v.x(), v.y(), v.z()};
}

void add_lengths(const LengthStatistics& lengths, ordered_json* out)
{
    (*out)["rmse_px"] = lengths.rmse_px;
    (*out)["rmse_all_px"] = lengths.rmse_all_px;
    (*out)["mean_px"] = lengths.mean_px;
    (*out)["std_px"] = lengths.deviation_px;
    (*out)["whitened_rms"] = lengths.whitened_rms;
    (*out)["observations"] = lengths.used;
    (*out)["rejected"] = lengths.rejected;
}

ordered_json camera_json(const Scene& scene, const Solution& solution, std::size_t camera,
                         const CameraStatistics& statistics)
{
    const SceneCamera& known = scene.cameras[camera];
    const Camera& lens = solution.state.lenses[camera];
    const std::vector<double>& numbers = lens.intrinsics;
    ordered_json out{{"name", known.name}, {"width", known.width_px}, {"height", known.height_px}};
    out["model"] = lens.name();
    const std::vector<std::string> names = intrinsics_names(lens.model);
    for (std::size_t i = 0; i < kPinholeCount; ++i) {
        out[names[i]] = numbers[i];
    }
    out["distortion"] = std::vector<double>(numbers.begin() + kPinholeCount, numbers.end());
    if (!lens.field.empty()) {
        out["base"] = camera_model_name(lens.model);
        out["spline"] = field_json(lens.field);
        if (camera < solution.field_errors.size() && !solution.field_errors[camera].empty()) {
            out["spline"]["variance_px2"] = field_errors_json(solution.field_errors[camera]);
        }
    }
    out["cam_from_rig"] = pose_json(pose_exp(solution.state.cam_from_rig[camera]));
    if (solution.gauge_cameras.size() > 1) {
        out["part"] = solution.part_of_camera[camera];
    }
    add_row_time(scene, solution, camera, &out);
    add_lengths(statistics.lengths, &out);
    out["views"] = statistics.views;
    out["points_per_frame"] = statistics.points_per_view;
    out["noise_factor"] = solution.noise_factor[camera];
    const Coverage& coverage = statistics.coverage;
    out["coverage"] = {{"columns", coverage.columns},
                       {"rows", coverage.rows},
                       {"part", coverage.part},
                       {"weak", coverage.weak}};
    const CameraUncertainty& deviation = solution.uncertainty[camera];
    ordered_json deviations;
    for (std::size_t i = 0; i < kPinholeCount; ++i) {
        deviations[names[i]] = deviation.intrinsics[i];
    }
    deviations["distortion"] = std::vector<double>(deviation.intrinsics.begin() + kPinholeCount,
                                                   deviation.intrinsics.end());
    deviations["rotation_deg"] = list(deviation.rotation_rad * kDegreesPerRadian);
    deviations["translation_mm"] = list(deviation.translation_mm);
    out["standard_deviation"] = deviations;
    return out;
}

ordered_json span_json(const Span& span)
{
    return {{"least", span.least}, {"median", span.median}, {"most", span.most}};
}

void add_reach(const Scene& scene, const CameraReach& reach, ordered_json* out)
{
    (*out)["distance_mm"] = span_json(reach.distance_mm);
    (*out)["tilt_deg"] = span_json(reach.tilt_deg);
    (*out)["tilted_views"] = {
        {"left", reach.left}, {"right", reach.right}, {"up", reach.up}, {"down", reach.down}};
    (*out)["shared_views"] = ordered_json::object();
    for (const auto& [other, count] : reach.shared) {
        (*out)["shared_views"][scene.cameras[static_cast<std::size_t>(other)].name] = count;
    }
}

// Null where no view of it is used.
ordered_json seen_from(const Reach& reach, int board)
{
    const auto found = reach.sides.find(board);
    if (found == reach.sides.end()) {
        return nullptr;
    }
    return found->second.plus_z == 0 ? "-z" : found->second.minus_z == 0 ? "+z" : "both";
}

// Every frame a board was seen in; a static board has the same pose in all of them.
ordered_json frames_json(const Scene& scene, const Solution& solution)
{
    std::map<std::tuple<std::int64_t, int, int>, const View*> view_of;
    for (const View& view : solution.set.views) {
        view_of.emplace(std::tuple(view.frame, view.board, solution.set.poses[view.pose].part), &view);
    }
    const bool has_parts = solution.gauge_cameras.size() > 1;
    ordered_json frames = ordered_json::array();
    for (const auto& [key, view] : view_of) {
        const auto& [frame, board, part] = key;
        frames.push_back({{"frame", frame},
                          {"board", scene.boards[static_cast<std::size_t>(board)].name},
                          {"rig_from_board", pose_json(rig_from_board(solution.state, *view))}});
        add_velocity(solution, *view, &frames.back());
        if (has_parts) {
            frames.back()["part"] = part;
        }
    }
    return frames;
}

ordered_json all_covariance(const Scene& scene, const Solution& solution)
{
    std::vector<NamedLens> cameras;
    std::vector<std::size_t> order;
    for (const int camera : solution.cameras) {
        order.push_back(static_cast<std::size_t>(camera));
        cameras.push_back({scene.cameras[order.back()].name, &solution.state.lenses[order.back()],
                           solution.part_of_camera[order.back()]});
    }
    return covariance_json(solution.covariance, cameras, order);
}

}  // namespace

ordered_json rig_json(const Scene& scene, const Solution& solution, const Statistics& statistics,
                      const Origin& origin)
{
    ordered_json out{{"format", "tessera-rig"}, {"version", 1}};
    add_lengths(statistics.rig, &out);
    std::size_t rejected = 0;
    for (const auto& [reason, count] : statistics.rejected) {
        rejected += count;
    }
    out["rejected"] = rejected;
    out["rejected_by_reason"] = statistics.rejected;
    out["cameras"] = ordered_json::array();
    for (std::size_t i = 0; i < solution.cameras.size(); ++i) {
        const auto camera = static_cast<std::size_t>(solution.cameras[i]);
        out["cameras"].push_back(
            camera_json(scene, solution, camera, statistics.cameras[i]));
        add_reach(scene, statistics.reach.cameras[i], &out["cameras"].back());
    }
    out["volume_mm"] = {{"from", list(statistics.reach.from_mm)}, {"to", list(statistics.reach.to_mm)}};
    out["covariance"] = all_covariance(scene, solution);
    out["boards"] = ordered_json::array();
    for (std::size_t b = 0; b < scene.boards.size(); ++b) {
        const Surface* surface = surface_of(solution.state, static_cast<int>(b));
        out["boards"].push_back(
            {{"name", scene.boards[b].name},
             {"surface", surface_json(surface != nullptr ? *surface : Surface(), scene.boards[b])},
             {"scale", scene.boards[b].scale},
             {"seen_from", seen_from(statistics.reach, static_cast<int>(b))}});
    }
    out["frames"] = frames_json(scene, solution);
    const ordered_json motion = motion_json(scene, solution);
    if (!motion.is_null()) {
        out["motion"] = motion;
    }
    out["held_out"] = choice_json(solution.choice);
    out["left_out"] = solution.left_out;
    ordered_json inputs = ordered_json::array();
    for (const InputFile& input : origin.inputs) {
        inputs.push_back({{"path", input.path}, {"fnv1a64", input.digest}});
    }
    out["made_by"] = {{"program", "tessera-rig " TESSERA_VERSION},
                      {"command", origin.command},
                      {"inputs", inputs}};
    return out;
}

std::string rig_text(const ordered_json& rig)
{
    if (!rig.contains("covariance")) {
        return rig.dump(2) + "\n";
    }
    ordered_json frame = rig;
    ordered_json lower;
    std::swap(lower, frame["covariance"]["lower"]);
    std::string text = frame.dump(2) + "\n";
    std::string rows = "[";
    std::size_t in_row = 0;
    std::size_t row = 0;
    for (std::size_t i = 0; i < lower.size(); ++i) {
        rows += (i == 0 ? "\n" : in_row == 0 ? ",\n" : ",") + lower[i].dump();
        in_row = in_row == row ? 0 : in_row + 1;
        row += in_row == 0 ? 1 : 0;
    }
    // Inside of a JSON string a quotation mark has a backslash before it, so this is the key.
    const std::string key = "\"lower\": ";
    return text.replace(text.find(key + "null") + key.size(), 4, rows + "]");
}

}  // namespace rig
