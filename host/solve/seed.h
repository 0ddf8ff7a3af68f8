// Starting values of one camera from nothing but its views.
#pragma once

#include <optional>
#include <vector>

#include "host/solve/views.h"

namespace rig {

// A lens with square pixels, the centre of the image and no distortion. Tries focal lengths from a
// third of the image's width to ten times it, and takes the one under which rigid boards fit best:
// median reprojection error over some of the views, which are one camera's.
Camera seed_lens(CameraModel model, const SceneCamera& camera, const std::vector<const View*>& views);

// Pose of a board from one view through a given lens, whose fold_radius() `fold` is; none where it
// has none.
std::optional<Pose> seed_pose(const Camera& lens, double fold, const View& view);

}  // namespace rig
