// What held-out instants said of the models: as rig.json holds it, and in words.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "host/solve/heldout.h"

namespace rig {

// The object under "held_out" of rig.json; null where there were too few instants to hold any out.
nlohmann::ordered_json choice_json(const ModelChoice& choice);

// Lines for the summary, from rig.json: lens and surface of each, how they were chosen. Empty when
// rig.json says nothing of it.
std::string choice_text(const nlohmann::ordered_json& rig);

// The weak spot when held-out residuals are larger than sigmas allow; empty when they are not.
std::string choice_warning(const nlohmann::ordered_json& rig);

}  // namespace rig
