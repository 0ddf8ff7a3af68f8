// See covariance_json.h.
#include "host/report/covariance_json.h"

#include <algorithm>
#include <cmath>

namespace rig {
namespace {

using nlohmann::ordered_json;

void add_motion(const std::string& of, std::vector<std::string>* names)
{
    for (const char* kind : {".rotation_", ".translation_"}) {
        for (const char* axis : {"x", "y", "z"}) {
            names->push_back(of + kind + axis);
        }
    }
}

// Rows without numbers, and what they are called.
RigCovariance lay_out(const std::vector<NamedLens>& cameras, std::vector<std::string>* names)
{
    RigCovariance out;
    for (const NamedLens& camera : cameras) {
        out.lens.push_back(static_cast<Eigen::Index>(names->size()));
        for (const std::string& parameter : intrinsics_names(camera.lens->model)) {
            names->push_back(camera.name + "." + parameter);
        }
        const bool first = &camera == &cameras.front() || camera.part != (&camera - 1)->part;
        out.pose.push_back(first ? -1 : static_cast<Eigen::Index>(names->size()));
        if (!first) {
            add_motion(camera.name, names);
        }
    }
    const auto motions = static_cast<Eigen::Index>(names->size());
    int parts = 0;
    for (const NamedLens& camera : cameras) {
        out.motion.push_back(motions + 6 * camera.part);
        parts = std::max(parts, camera.part + 1);
    }
    for (int part = 0; part < parts; ++part) {
        add_motion(part == 0 ? "boards" : "boards " + std::to_string(part), names);
    }
    return out;
}

}  // namespace

ordered_json covariance_json(const RigCovariance& covariance, const std::vector<NamedLens>& cameras,
                             const std::vector<std::size_t>& order)
{
    std::vector<std::string> names;
    const RigCovariance places = lay_out(cameras, &names);
    std::vector<Eigen::Index> rows(names.size());
    const auto copy = [&](Eigen::Index to, Eigen::Index from, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i) {
            rows[static_cast<std::size_t>(to) + i] = from + static_cast<Eigen::Index>(i);
        }
    };
    for (std::size_t i = 0; i < cameras.size(); ++i) {
        copy(places.lens[i], covariance.lens[order[i]], cameras[i].lens->intrinsics.size());
        if (places.pose[i] >= 0) {
            copy(places.pose[i], covariance.pose[order[i]], 6);
        }
        copy(places.motion[i], covariance.motion[order[i]], 6);
    }
    ordered_json lower = ordered_json::array();
    for (std::size_t i = 0; i < rows.size(); ++i) {
        for (std::size_t j = 0; j <= i; ++j) {
            lower.push_back(covariance.matrix(rows[i], rows[j]));
        }
    }
    return {{"parameters", names}, {"lower", lower}};
}

Result<RigCovariance> read_covariance_json(const ordered_json& json,
                                           const std::vector<NamedLens>& cameras,
                                           const std::string& where)
{
    std::vector<std::string> names;
    RigCovariance out = lay_out(cameras, &names);
    if (!json.is_object() || json.value("parameters", ordered_json()) != ordered_json(names)) {
        return Status::failure(where + ": 'parameters' are not those of the file's cameras in their order");
    }
    const ordered_json lower = json.value("lower", ordered_json());
    const std::size_t count = names.size() * (names.size() + 1) / 2;
    if (!lower.is_array() || lower.size() != count) {
        return Status::failure(where + ": 'lower' must be a list of " + std::to_string(count) + " numbers");
    }
    const auto size = static_cast<Eigen::Index>(names.size());
    out.matrix.resize(size, size);
    std::size_t at = 0;
    for (Eigen::Index i = 0; i < size; ++i) {
        for (Eigen::Index j = 0; j <= i; ++j, ++at) {
            if (!lower[at].is_number() || !std::isfinite(lower[at].get<double>())) {
                return Status::failure(where + ": lower[" + std::to_string(at) + "] must be a number");
            }
            out.matrix(i, j) = out.matrix(j, i) = lower[at];
        }
        if (!(out.matrix(i, i) >= 0.0)) {
            return Status::failure(where + ": the variance of " + names[static_cast<std::size_t>(i)]
                                   + " is below 0");
        }
    }
    return out;
}

}  // namespace rig
