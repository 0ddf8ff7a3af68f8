// Stage one: each camera alone, from nothing to a lens and a pose of the board in each of its
// views.
#pragma once

#include "host/base/status.h"
#include "host/solve/change.h"
#include "host/solve/views.h"

namespace rig {

enum { kCameraViewsMin = 3 };

struct CameraAlone {
    Camera lens;
    std::vector<std::size_t> views;      // indices into ViewSet::views; those without a pose left out
    std::vector<Pose> cam_from_board;    // one each
    double noise_px = 0.0;               // robust standard deviation of its residuals per axis
    std::size_t points_without_pose = 0;  // observations of the views left out
    std::optional<Change> change;         // of the lens, during the recording
};

// `camera` indexes scene.cameras. Fails with a sentence when there are fewer than kCameraViewsMin
// usable views, or when no lens of the model with rigid boards explains them.
Result<CameraAlone> calibrate_alone(const Scene& scene, const ViewSet& set, int camera,
                                    CameraModel model);

}  // namespace rig
