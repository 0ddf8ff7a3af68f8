// The result as files of others and of our own.
#pragma once

#include <nlohmann/json.hpp>

#include "host/report/statistics.h"

namespace rig {

// Where a result came from. The output's place is left out, so that the same input gives the same bytes.
struct Origin {
    std::string command;
    std::vector<InputFile> inputs;
};

// rig.json: the keys that users rely on, and below them what the summary is made of.
nlohmann::ordered_json rig_json(const Scene& scene, const Solution& solution,
                                const Statistics& statistics, const Origin& origin);

// As it is written: indented, but the covariance in one line a row.
std::string rig_text(const nlohmann::ordered_json& rig);

}  // namespace rig
