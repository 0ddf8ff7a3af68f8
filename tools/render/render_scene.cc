/* Reads scene files. */
#include "tools/render/render_scene.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>

#include <Eigen/LU>
#include <fmt/format.h>

#include "tools/render/scene_fields.h"

namespace render {

namespace {

using nlohmann::json;

constexpr double pi = 3.14159265358979323846;
constexpr double rad = pi / 180;
constexpr std::int64_t time_max = std::int64_t{1} << 62;
constexpr std::int64_t frames_max = 100000;

Eigen::Vector3d to_vector(const std::vector<double>& list)
{
    return {list[0], list[1], list[2]};
}

// `rotation` (9 numbers, row by row) or `rotation_vector_deg`, and `translation_mm`.
Pose read_pose(Fields& fields)
{
    Pose pose;
    if (fields.has("rotation_vector_deg")) {
        const Eigen::Vector3d turn = rad * to_vector(fields.numbers("rotation_vector_deg", 3, 3, 720));
        pose = steady({}, {0, 0, 0}, turn)(1e9);
    } else if (fields.has("rotation")) {
        const std::vector<double> list = fields.numbers("rotation", 9, 9, 1.1);
        pose.rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(list.data());
        const Eigen::Matrix3d rest =
            pose.rotation * pose.rotation.transpose() - Eigen::Matrix3d::Identity();
        if (rest.cwiseAbs().maxCoeff() > 1e-5 || pose.rotation.determinant() < 0) {
            fields.complain("rotation", "is not a rotation matrix (nine numbers, row by row)");
        }
        pose.rotation = Eigen::Quaterniond(pose.rotation).normalized().toRotationMatrix();
    }
    pose.translation_mm = fields.vector_or("translation_mm", {0, 0, 0});
    return pose;
}

Background read_background(Fields fields)
{
    Background out;
    out.level = fields.number_or("level", 0, 1, out.level);
    out.amplitude = fields.number_or("amplitude", 0, 1, out.amplitude);
    out.scale_px = fields.number_or("scale_px", 2, 10000, out.scale_px);
    out.clutter = static_cast<int>(fields.integer_or("clutter", 0, 2000, out.clutter));
    fields.finish();
    return out;
}

Occluder read_occluder(Fields fields)
{
    Occluder out;
    out.level = fields.number_or("level", 0, 1, out.level);
    const json& list = fields.raw("polygon");
    bool good = list.is_array() && list.size() >= 3 && list.size() <= 1000;
    for (std::size_t i = 0; good && i < list.size(); i++) {
        const json& p = list[i];
        good = p.is_array() && p.size() == 2 && p[0].is_number() && p[1].is_number() &&
               std::abs(p[0].get<double>()) < 1e6 && std::abs(p[1].get<double>()) < 1e6;
        if (good) {
            out.polygon.emplace_back(p[0].get<double>(), p[1].get<double>());
        }
    }
    if (!good) {
        fields.complain("polygon", "must be a list of 3 to 1000 points [x, y] in pixels");
    }
    fields.finish();
    return out;
}

void read_lens(Fields& fields, Lens& lens)
{
    lens.width_px = static_cast<int>(fields.integer("width", 8, 16384));
    lens.height_px = static_cast<int>(fields.integer("height", 8, 16384));
    lens.model = fields.text_or("model", "brown");
    if (lens.model != "brown" && lens.model != "rational") {
        fields.complain("model", "must be \"brown\" or \"rational\"");
    }
    lens.fx = fields.number("fx", 1, 1e6);
    lens.fy = fields.number_or("fy", 1, 1e6, lens.fx);
    lens.cx = fields.number_or("cx", -1e5, 1e5, 0.5 * (lens.width_px - 1));
    lens.cy = fields.number_or("cy", -1e5, 1e5, 0.5 * (lens.height_px - 1));
    if (fields.has("distortion")) {
        const std::size_t most = lens.model == "brown" ? 5 : 8;
        const std::vector<double> list = fields.numbers("distortion", 0, most, 100);
        std::copy(list.begin(), list.end(), lens.distortion.begin());
    }
    lens.find_ray_max();
}

Camera read_camera(Fields fields)
{
    Camera camera;
    camera.name = fields.text("name");
    if (camera.name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") !=
        std::string::npos) {
        fields.complain("name", "names a folder: letters, digits, _ and - only");
    }
    read_lens(fields, camera.lens);
    if (fields.has("cam_from_rig")) {
        Fields pose = fields.object("cam_from_rig");
        camera.cam_from_rig = read_pose(pose);
        pose.finish();
    }
    camera.psf_sigma_px = fields.number_or("psf_sigma_px", 0, 20, camera.psf_sigma_px);
    camera.noise = fields.number_or("noise", 0, 255, camera.noise);
    camera.shot_noise = fields.number_or("shot_noise", 0, 255, camera.shot_noise);
    camera.bits = static_cast<int>(fields.integer_or("bits", 8, 16, camera.bits));
    if (camera.bits != 8 && camera.bits != 10 && camera.bits != 12 && camera.bits != 16) {
        fields.complain("bits", "must be 8, 10, 12 or 16");
    }
    camera.black = fields.number_or("black", 0, 255, camera.black);
    camera.white = fields.number_or("white", 0, 255, camera.white);
    camera.gamma = fields.number_or("gamma", 0.1, 10, camera.gamma);
    camera.vignetting = fields.number_or("vignetting", 0, 1, camera.vignetting);
    if (fields.has("shading")) {
        Fields shading = fields.object("shading");
        camera.shading_to = shading.number("to", 0, 1);
        camera.shading_direction_deg = shading.number_or("direction_deg", -360, 360, 0);
        shading.finish();
    }
    camera.exposure_us = fields.number_or("exposure_us", 0, 1e7, camera.exposure_us);
    camera.row_time_us = fields.number_or("row_time_us", 0, 1e5, camera.row_time_us);
    if (fields.has("background")) {
        camera.background = read_background(fields.object("background"));
    }
    if (fields.has("occluders")) {
        for (Fields& occluder : fields.objects("occluders", 0, 1000)) {
            camera.occluders.push_back(read_occluder(occluder));
        }
    }
    fields.finish();
    return camera;
}

std::vector<Camera> read_cameras(Fields& scene)
{
    const json defaults = scene.has("camera_defaults") ? scene.raw("camera_defaults") : json::object();
    Fields checked(defaults, scene.where() + ", camera_defaults"); // only that it is an object
    std::vector<Camera> cameras;
    std::set<std::string> names;
    const json& list = scene.raw("cameras");
    scene.objects("cameras", 1, 256);
    for (std::size_t i = 0; i < list.size(); i++) {
        json merged = defaults;
        merged.update(list[i]);
        cameras.push_back(
            read_camera(Fields(merged, fmt::format("{}, cameras[{}]", scene.where(), i))));
        if (!names.insert(cameras.back().name).second) {
            scene.complain("cameras", fmt::format("has two of the name {}", cameras.back().name));
        }
    }
    return cameras;
}

struct Times {
    std::int64_t start_ns;
    std::int64_t step_ns;
    std::int64_t count;
    std::int64_t at(std::int64_t i) const { return start_ns + i * step_ns; }
};

Times read_times(Fields& path)
{
    return {path.integer_or("start_ns", 0, time_max, 0),
            path.integer_or("step_ns", 1, 1000000000000, 100000000),
            path.integer("count", 1, frames_max)};
}

void read_poses(Fields& path, std::vector<Instant>& out)
{
    std::int64_t next_ns = 0;
    for (Fields& item : path.objects("poses", 1, frames_max)) {
        Instant instant;
        instant.t_ns = item.integer_or("t_ns", 0, time_max, next_ns);
        if (instant.t_ns < next_ns && !out.empty()) {
            item.complain("t_ns", "must grow from pose to pose");
        }
        next_ns = instant.t_ns + 100000000;
        const Pose pose = read_pose(item);
        instant.pose = steady(pose, item.vector_or("velocity_mm_s", {0, 0, 0}),
                              rad * item.vector_or("rotation_rate_deg_s", {0, 0, 0}));
        item.finish();
        next_ns = std::min(next_ns, time_max);
        out.push_back(instant);
    }
}

void read_keys(Fields& path, std::vector<Instant>& out)
{
    const Times times = read_times(path);
    std::vector<KeyPose> keys;
    for (Fields& item : path.objects("keys", 2, frames_max)) {
        KeyPose key;
        key.t_ns = item.integer("t_ns", 0, time_max);
        if (!keys.empty() && key.t_ns <= keys.back().t_ns) {
            item.complain("t_ns", "must grow from key to key");
        }
        key.pose = read_pose(item);
        item.finish();
        keys.push_back(key);
    }
    for (std::int64_t i = 0; i < times.count; i++) {
        out.push_back({times.at(i), through_keys(keys, times.at(i))});
    }
}

Eigen::Vector3d board_middle_mm(const targetfile& target)
{
    return {0.5 * target.target.cols * target.patch_mm * target.measured_scale[0],
            0.5 * target.target.rows * target.patch_mm * target.measured_scale[1], 0};
}

void read_wave(Fields& path, const targetfile& target, std::vector<Instant>& out)
{
    const Times times = read_times(path);
    Wave wave;
    wave.seed = static_cast<std::uint64_t>(path.integer_or("seed", 0, time_max, 1));
    wave.centre_mm = path.vector_or("centre_mm", wave.centre_mm);
    wave.sway_mm = path.vector_or("sway_mm", wave.sway_mm);
    wave.tilt_deg = path.number_or("tilt_deg", 0, 89, 0);
    wave.turn_deg = path.number_or("turn_deg", 0, 360, 0);
    wave.period_s = path.number_or("period_s", 0.01, 1e6, wave.period_s);
    wave.middle_mm = board_middle_mm(target);
    for (std::int64_t i = 0; i < times.count; i++) {
        const double t_s = static_cast<double>(i * times.step_ns) * 1e-9;
        out.push_back({times.at(i), [wave, t_s](double after_ns) {
                           return wave_at(wave, t_s + after_ns * 1e-9);
                       }});
    }
}

// Views of a still board whose middle lies on the first camera's axis, moved by shift_px.
void read_views(Fields& path, const Scene& scene, std::vector<Instant>& out)
{
    const Camera& camera = scene.cameras.front();
    const Eigen::Vector3d middle = board_middle_mm(scene.target);
    std::int64_t t_ns = 0;
    for (Fields& view : path.objects("views", 1, frames_max)) {
        const double patch_px = view.number("patch_px", 1, 1e5);
        const double turn = rad * view.number_or("turn_deg", -360, 360, 0);
        const double tilt = rad * view.number_or("tilt_deg", -89, 89, 0);
        const double axis = rad * view.number_or("tilt_axis_deg", -360, 360, 0);
        const std::vector<double> shift =
            view.has("shift_px") ? view.numbers("shift_px", 2, 2, 1e5) : std::vector<double>{0, 0};
        view.finish();
        const double depth = camera.lens.fx * scene.target.patch_mm / patch_px;
        Pose pose;
        pose.rotation = (Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(axis), std::sin(axis), 0)) *
                         Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()))
                            .toRotationMatrix();
        pose.translation_mm = Eigen::Vector3d(shift[0] * depth / camera.lens.fx,
                                              shift[1] * depth / camera.lens.fy, depth) -
                              pose.rotation * middle;
        const Eigen::Matrix3d back = camera.cam_from_rig.rotation.transpose();
        const Pose in_rig{back * pose.rotation,
                          back * (pose.translation_mm - camera.cam_from_rig.translation_mm)};
        out.push_back({t_ns, steady(in_rig, {0, 0, 0}, {0, 0, 0})});
        t_ns += 100000000;
    }
}

std::vector<Instant> read_path(Fields path, const Scene& scene)
{
    std::vector<Instant> out;
    const std::string kind = path.text("kind");
    if (kind == "poses") {
        read_poses(path, out);
    } else if (kind == "keys") {
        read_keys(path, out);
    } else if (kind == "wave") {
        read_wave(path, scene.target, out);
    } else if (kind == "views") {
        read_views(path, scene, out);
    } else {
        path.complain("kind", "must be \"poses\", \"keys\", \"wave\" or \"views\"");
    }
    path.finish();
    return out;
}

json parse_file(const std::string& path)
{
    std::ifstream in(path, std::ios::binary);
    if (!in || std::filesystem::is_directory(path)) {
        throw UserError(fmt::format("{}: this scene file cannot be read", path));
    }
    try {
        return json::parse(in);
    } catch (const json::exception& error) {
        throw UserError(fmt::format("{}: not JSON: {}", path, error.what()));
    }
}

} // namespace

Scene read_scene(const std::string& path, const std::string& target_path)
{
    Fields fields(parse_file(path), path);
    if (fields.text("format") != "tessera-render-scene") {
        fields.complain("format", "must be \"tessera-render-scene\"");
    }
    fields.integer("version", 1, 1);
    Scene scene;
    if (!target_path.empty()) {
        scene.target_path = target_path;
        fields.text_or("target", "-");
    } else {
        const std::filesystem::path beside = std::filesystem::path(path).parent_path();
        scene.target_path = (beside / fields.text("target")).string();
    }
    char error[TARGETFILE_ERROR_BYTES];
    if (!targetfile_read(scene.target_path.c_str(), &scene.target, error)) {
        throw UserError(error);
    }
    const char* name = scene.target.target.name;
    scene.board = fields.text_or("board", name[0] != '\0' ? name : "board");
    scene.seed = static_cast<std::uint64_t>(fields.integer_or("seed", 0, time_max, 1));
    scene.cameras = read_cameras(fields);
    scene.instants = read_path(fields.object("path"), scene);
    fields.finish();
    return scene;
}

} // namespace render
