// Starting values of one camera from nothing but its views.
#pragma once

#include <optional>
#include <vector>

#include "host/solve/views.h"

namespace rig {

struct CameraSeed {
    Camera lens;                                     // square pixels, centre of the image, no distortion
    std::vector<std::optional<Pose>> cam_from_board;  // by view; none where no pose was found
};

// Tries focal lengths from a third of the image's width to ten times it, and takes the one under which
// rigid boards fit best: median reprojection error over some views. `views` are one camera's.
CameraSeed seed_camera(CameraModel model, const SceneCamera& camera,
                       const std::vector<const View*>& views);

// Pose of a board from one view through a given lens.
std::optional<Pose> seed_pose(const Camera& lens, const View& view);

}  // namespace rig
