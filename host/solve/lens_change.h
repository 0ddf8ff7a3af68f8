// A lens that changed during a recording, or a name that another camera took.
#pragma once

#include <optional>

#include "host/solve/change.h"
#include "host/solve/views.h"

namespace rig {

// Of a camera alone, which is camera 0 of `state`: its views, with their poses.
std::optional<Change> find_lens_change(const RigState& state, const std::vector<View>& views);

}  // namespace rig
