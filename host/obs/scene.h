// Reads an observation folder: scene.json, observations.csv, and the boards' files named there.
#pragma once

#include <string>

#include "host/base/status.h"
#include "host/obs/observation.h"

namespace rig {

// Strict: an unknown key, name or point, a duplicated observation or a pixel that is no number is
// refused with a sentence that names file and line.
Result<Scene> read_scene(const std::string& folder);

// A Tessera target as a board. The name is the file's own, or the file's path without one.
// digest (may be null) gets what names the pattern in packets.
Result<Board> read_target_board(const std::string& path, std::uint64_t* digest);

}  // namespace rig
