// Journals and targets to observations: packets that belong together become one frame.
#pragma once

#include <string>
#include <vector>

#include "host/base/status.h"
#include "host/obs/observation.h"

namespace rig {

struct ObserveOptions {
    std::int64_t tolerance_ns = -1;  // between captures of one instant; below 0: see instants.h
};

// Cameras are named by their serials and sorted by name. Packets that came twice and patches on none
// of the targets are counted in Scene::rejected. Fails with a sentence when a packet was made with
// another target than those given, when two targets share a patch, or when clocks cannot be compared.
Result<Scene> observe(const std::vector<std::string>& journals,
                      const std::vector<std::string>& targets, const ObserveOptions& options);

}  // namespace rig
