// Views that repeat an earlier frame's: a recording that was copied, or a camera that stood still.
#pragma once

#include "host/obs/observation.h"

namespace rig {

// Takes out what a camera saw of a board in a frame where it is, bit for bit, what it saw of it in
// an earlier one: no two exposures have the same noise, and the same noise twice would count as two
// measurements. Counted in scene->rejected.
void drop_repeats(Scene* scene);

}  // namespace rig
