// A camera that moved against the others during a recording.
#pragma once

#include "host/solve/rig.h"

namespace rig {

// Fails with a sentence that names the camera, or both where there are only two and nothing tells
// which of them it was, and the frames between which it moved.
Status check_moved(const Scene& scene, const Solution& solution);

}  // namespace rig
