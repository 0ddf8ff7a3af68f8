// Cameras whose lens is another one from some frame on.
#pragma once

#include "host/solve/intrinsics.h"
#include "host/solve/lens_choice.h"

namespace rig {

// `change`: what calibrate_alone found, by camera. Fails with a sentence where there was one: two
// cameras that have each other's lens from then on had their names swapped between recordings, else
// a lens was touched.
Status check_lenses(const Scene& scene, const ViewSet& set, const std::vector<LensChoice>& lenses,
                    const std::vector<std::optional<Change>>& change);

}  // namespace rig
