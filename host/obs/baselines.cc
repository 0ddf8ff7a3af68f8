// See baselines.h.
#include "host/obs/baselines.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace rig {
namespace {

using nlohmann::json;

Status add(const std::string& a, const std::string& b, double mm, double sigma_mm,
           const std::string& where, Scene* scene)
{
    Baseline baseline;
    for (const auto& [name, camera] :
         {std::pair(&a, &baseline.camera_a), std::pair(&b, &baseline.camera_b)}) {
        const auto is_it = [&](const SceneCamera& each) { return each.name == *name; };
        const auto found = std::find_if(scene->cameras.begin(), scene->cameras.end(), is_it);
        if (found == scene->cameras.end()) {
            return Status::failure(where + " names camera '" + *name
                                   + "', which is not among those recorded");
        }
        *camera = static_cast<int>(found - scene->cameras.begin());
    }
    if (baseline.camera_a == baseline.camera_b) {
        return Status::failure(where + " needs two different cameras");
    }
    if (!(mm > 0.0 && sigma_mm > 0.0 && std::isfinite(mm) && std::isfinite(sigma_mm))) {
        return Status::failure(where
                               + " needs a distance and its standard deviation in mm, both above 0");
    }
    baseline.mm = mm;
    baseline.sigma_mm = sigma_mm;
    scene->baselines.push_back(baseline);
    return Status();
}

bool shaped(const json& entry)
{
    if (!entry.is_object() || entry.size() != 3) {
        return false;
    }
    const json cameras = entry.value("cameras", json());
    return cameras.is_array() && cameras.size() == 2 && cameras[0].is_string()
           && cameras[1].is_string() && entry.value("mm", json()).is_number()
           && entry.value("sigma_mm", json()).is_number();
}

}  // namespace

Status read_baselines(const json& list, const std::string& where, Scene* scene)
{
    if (!list.is_array() || !std::all_of(list.begin(), list.end(), shaped)) {
        return Status::failure(where
                               + ": key 'baselines' must be a list of {\"cameras\": [two names], "
                                 "\"mm\": distance, \"sigma_mm\": its standard deviation}");
    }
    for (const json& entry : list) {
        const Status status = add(entry["cameras"][0], entry["cameras"][1], entry["mm"],
                                  entry["sigma_mm"], where + ": key 'baselines'", scene);
        if (!status.ok()) {
            return status;
        }
    }
    return Status();
}

Status add_baseline(const std::string& text, const std::string& option, Scene* scene)
{
    std::vector<std::string> words(1);
    for (const char letter : text) {
        if (letter == ',') {
            words.emplace_back();
        } else {
            words.back() += letter;
        }
    }
    double numbers[2] = {0.0, 0.0};
    bool whole = words.size() == 4;
    for (std::size_t i = 0; whole && i < 2; ++i) {
        char* end = nullptr;
        numbers[i] = std::strtod(words[i + 2].c_str(), &end);
        whole = !words[i + 2].empty() && *end == '\0';
    }
    if (!whole) {
        return Status::failure(option + " " + text
                               + ": give two cameras, their distance in mm and its standard "
                                 "deviation, as in left,right,300,0.1");
    }
    return add(words[0], words[1], numbers[0], numbers[1], option, scene);
}

}  // namespace rig
