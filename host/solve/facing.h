// Which side of a board a camera saw: a mirrored image or target shows as a board seen from behind.
#pragma once

#include "host/base/status.h"
#include "host/solve/views.h"

namespace rig {

// by_view: cam_from_board of each view. Fails when a camera sees most views of a one-sided board from
// behind, or when two cameras see one flat board from different sides.
Status check_facing(const Scene& scene, const ViewSet& set, const std::vector<Pose>& by_view);

}  // namespace rig
