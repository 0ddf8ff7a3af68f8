// Which cameras saw the same board at the same place, and a first rig from that.
#pragma once

#include "host/solve/intrinsics.h"

namespace rig {

// Groups of cameras joined by poses that two of them share; largest first, then by first camera.
// A camera without views is a group of its own.
std::vector<std::vector<int>> connected_parts(const ViewSet& set, std::size_t camera_count);

// First values of a connected rig, from each camera alone. Cameras are joined along the maximum
// spanning tree over pairs, a pair weighing as many points as both saw together; a pair's relative
// pose is the one, of all its shared boards', that the others agree with most. The first camera of
// `cameras` is the rig frame. `set` holds only views of these cameras, each with a pose alone[i].
// by_view: cam_from_board of each view in `set`.
RigState join_cameras(const ViewSet& set, const std::vector<int>& cameras,
                      const std::vector<Camera>& lenses, const std::vector<Pose>& by_view);

}  // namespace rig
