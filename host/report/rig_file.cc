// See rig_file.h.
#include "host/report/rig_file.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include "host/report/covariance_json.h"
#include "host/report/spline_json.h"

namespace rig {
namespace {

using nlohmann::ordered_json;

// Numbers of a list of known length; empty when it is anything else.
std::vector<double> numbers(const ordered_json& list, std::size_t count)
{
    std::vector<double> out;
    if (list.is_array() && list.size() == count) {
        for (const ordered_json& item : list) {
            if (!item.is_number()) {
                return {};
            }
            out.push_back(item.get<double>());
        }
    }
    return out;
}

Result<RigCamera> read_camera(const ordered_json& entry, const std::string& where)
{
    const auto fault = [&](const std::string& what) { return Status::failure(where + ": " + what); };
    if (!entry.is_object() || !entry.value("name", ordered_json()).is_string()) {
        return fault("needs a 'name'");
    }
    RigCamera camera;
    camera.name = entry["name"];
    for (const auto& [key, out] : {std::pair("width", &camera.width_px), {"height", &camera.height_px}}) {
        const ordered_json value = entry.value(key, ordered_json());
        if (!value.is_number_integer() || value < 1 || value > 1000000) {
            return fault("'" + std::string(key) + "' must be an integer above 0");
        }
        *out = value;
    }
    const ordered_json name = entry.value("model", ordered_json());
    const bool spline = name == "spline";
    const ordered_json base = spline ? entry.value("base", ordered_json()) : name;
    const auto model = camera_model_from_name(base.is_string() ? base.get<std::string>() : "");
    if (!model) {
        return fault(std::string(spline ? "'base'" : "'model'")
                     + " is not one of brown, rational, thin-prism, fisheye"
                     + (spline ? "" : ", spline"));
    }
    if (spline) {
        Result<SplineField> field = read_field(entry.value("spline", ordered_json()), where);
        if (!field.ok()) {
            return field.status();
        }
        camera.lens.field = field.value();
        const Result<FieldErrors> errors =
            read_field_errors(entry["spline"].value("variance_px2", ordered_json()), where);
        if (!errors.ok()) {
            return errors.status();
        }
        camera.field_errors = errors.value();
    }
    camera.lens.model = *model;
    const std::vector<std::string> names = intrinsics_names(*model);
    for (std::size_t i = 0; i < kPinholeCount; ++i) {
        const ordered_json value = entry.value(names[i], ordered_json());
        if (!value.is_number() || !std::isfinite(value.get<double>())) {
            return fault("'" + names[i] + "' must be a number");
        }
        camera.lens.intrinsics.push_back(value);
    }
    if (camera.lens.intrinsics[0] == 0.0 || camera.lens.intrinsics[1] == 0.0) {
        return fault("'fx' and 'fy' must not be 0");
    }
    const auto count = static_cast<std::size_t>(distortion_count(*model));
    const auto distortion = numbers(entry.value("distortion", ordered_json()), count);
    if (distortion.size() != count) {
        return fault("'distortion' must be a list of " + std::to_string(count) + " numbers");
    }
    camera.lens.intrinsics.insert(camera.lens.intrinsics.end(), distortion.begin(), distortion.end());
    const ordered_json pose = entry.value("cam_from_rig", ordered_json::object());
    const auto rotation = numbers(pose.is_object() ? pose.value("rotation", ordered_json()) : pose, 9);
    const auto translation =
        numbers(pose.is_object() ? pose.value("translation_mm", ordered_json()) : pose, 3);
    if (rotation.empty() || translation.empty()) {
        return fault("'cam_from_rig' needs 'rotation' (9 numbers) and 'translation_mm' (3)");
    }
    camera.cam_from_rig.rotation =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation.data());
    camera.cam_from_rig.translation_mm = Eigen::Map<const Eigen::Vector3d>(translation.data());
    const ordered_json part = entry.value("part", ordered_json(0));
    if (!part.is_number_integer() || part < 0 || part > 1000000) {
        return fault("'part' must be an integer from 0 on");
    }
    camera.part = part;
    const ordered_json distances = entry.value("distance_mm", ordered_json());
    for (const char* key : {"least", "median", "most"}) {
        if (distances.is_object() && distances.value(key, 0.0) > 0.0) {
            camera.distances_mm.push_back(distances[key]);
        }
    }
    return camera;
}

}  // namespace

Result<RigFile> read_rig_file(const std::string& path)
{
    std::ifstream file(path);
    if (!file) {
        return Status::failure("cannot open " + path);
    }
    RigFile rig;
    try {
        rig.json = ordered_json::parse(file);
    } catch (const ordered_json::exception& fault) {
        return Status::failure(path + " is not valid JSON: " + fault.what());
    }
    if (!rig.json.is_object() || rig.json.value("format", ordered_json()) != "tessera-rig"
        || rig.json.value("version", ordered_json()) != 1) {
        return Status::failure(path + " is not a rig file: 'format' must be \"tessera-rig\", 'version' 1");
    }
    const ordered_json cameras = rig.json.value("cameras", ordered_json());
    if (!cameras.is_array() || cameras.empty()) {
        return Status::failure(path + ": 'cameras' must be a list that is not empty");
    }
    for (const ordered_json& entry : cameras) {
        Result<RigCamera> camera =
            read_camera(entry, path + ": cameras[" + std::to_string(rig.cameras.size()) + "]");
        if (!camera.ok()) {
            return camera.status();
        }
        rig.cameras.push_back(camera.value());
    }
    const ordered_json volume = rig.json.value("volume_mm", ordered_json::object());
    const auto from = numbers(volume.is_object() ? volume.value("from", ordered_json()) : volume, 3);
    const auto to = numbers(volume.is_object() ? volume.value("to", ordered_json()) : volume, 3);
    if (!from.empty() && !to.empty()) {
        rig.volume_mm.emplace(Eigen::Map<const Eigen::Vector3d>(from.data()),
                              Eigen::Map<const Eigen::Vector3d>(to.data()));
    }
    if (rig.json.contains("covariance")) {
        std::vector<NamedLens> lenses;
        for (const RigCamera& camera : rig.cameras) {
            lenses.push_back({camera.name, &camera.lens, camera.part});
        }
        Result<RigCovariance> covariance =
            read_covariance_json(rig.json["covariance"], lenses, path + ": covariance");
        if (!covariance.ok()) {
            return covariance.status();
        }
        rig.covariance = std::move(covariance.value());
    }
    return rig;
}

bool in_parts(const RigFile& rig)
{
    return std::any_of(rig.cameras.begin(), rig.cameras.end(),
                       [](const RigCamera& camera) { return camera.part != 0; });
}

std::vector<Eigen::Vector3d> volume_grid(const RigFile& rig, int per_axis)
{
    std::vector<Eigen::Vector3d> out;
    const int count = rig.volume_mm ? per_axis : 0;
    for (int i = 0; i < count; ++i) {
        for (int j = 0; j < count; ++j) {
            for (int k = 0; k < count; ++k) {
                const Eigen::Vector3d part = Eigen::Vector3d(i, j, k) / (per_axis - 1.0);
                out.push_back(rig.volume_mm->min() + part.cwiseProduct(rig.volume_mm->sizes()));
            }
        }
    }
    return out;
}

Result<RigCamera> find_camera(const RigFile& rig, const std::string& name)
{
    std::string known;
    for (const RigCamera& camera : rig.cameras) {
        if (camera.name == name) {
            return camera;
        }
        known += (known.empty() ? "" : ", ") + camera.name;
    }
    return Status::failure("the rig has no camera '" + name + "'; it has " + known);
}

}  // namespace rig
