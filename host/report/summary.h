// The summary that a person judges a calibration by, made from rig.json alone.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "host/base/status.h"

namespace rig {

// Fails when a key that the summary needs is missing; `source` is what the sentence calls the file.
Result<std::string> summary_text(const nlohmann::ordered_json& rig, const std::string& source);

}  // namespace rig
