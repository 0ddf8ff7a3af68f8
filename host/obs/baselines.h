// Known distances between cameras: key 'baselines' of scene.json, and an option's text.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "host/base/status.h"
#include "host/obs/observation.h"

namespace rig {

// [{"cameras": ["a", "b"], "mm": 300.0, "sigma_mm": 0.1}, ...]. `where` begins the sentences: the
// file.
Status read_baselines(const nlohmann::json& list, const std::string& where, Scene* scene);

// "a,b,300,0.1" as given to `option`: two cameras of the scene, mm, and their standard deviation.
Status add_baseline(const std::string& text, const std::string& option, Scene* scene);

}  // namespace rig
