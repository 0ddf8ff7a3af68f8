// A map of a board's surface.
#pragma once

#include <string>

#include "host/obs/observation.h"
#include "host/solve/views.h"

namespace rig {

// PNG: heights over the board's plane in micrometres, blue below, white zero, red above (towards +z,
// away from the viewer), with the board's points.
std::string surface_png(const Surface& surface, const Board& board);

}  // namespace rig
