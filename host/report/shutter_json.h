// What rig.json and the summary say of rolling shutters and of how fast boards moved.
#pragma once

#include <nlohmann/json.hpp>

#include "host/solve/rig.h"

namespace rig {

// Adds "row_time_ns" and "row_time_sigma_ns" to a camera; nothing where no shutter of the scene
// rolls.
void add_row_time(const Scene& scene, const Solution& solution, std::size_t camera,
                  nlohmann::ordered_json* out);

// Adds to a frame how its board moved, and when it was where `rig_from_board` says; nothing where
// it stood still or no shutter rolls.
void add_velocity(const Solution& solution, const View& view, nlohmann::ordered_json* out);

// How fast boards moved, each about its middle; null where no shutter rolls.
nlohmann::ordered_json motion_json(const Scene& scene, const Solution& solution);

// The summary's paragraph; empty where no shutter rolls.
std::string shutter_text(const nlohmann::ordered_json& rig);

}  // namespace rig
