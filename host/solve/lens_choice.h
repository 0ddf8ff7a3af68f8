// Which lens a camera gets: told, or left to held-out instants.
#pragma once

#include "host/model/camera.h"

namespace rig {

struct LensChoice {
    CameraModel model = CameraModel::kBrown;  // of the parametric lens, or of a field's base
    bool richer = false;  // go beyond it where held-out instants gain by it
    bool field = false;   // with a field, whatever held-out instants say; they say how fine it is
};

}  // namespace rig
