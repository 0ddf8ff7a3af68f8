// What `--model` says, for all cameras or for some:
//     brown    cam0=spline,cam1=fisheye    rational,cam2=fisheye+spline
// An entry is a lens, or a camera and its lens; one without a camera is for all that are not named, which
// are left to the tool where there is none. Lenses: auto, the models of model/camera.h, spline (a field
// over brown), and a model with "+spline" behind it (a field over that).
#pragma once

#include <string>
#include <vector>

#include "host/base/status.h"
#include "host/obs/observation.h"
#include "host/solve/lens_choice.h"

namespace rig {

// Empty, or what is wrong with the text whatever the cameras are called.
std::string lens_argument_fault(const std::string& text);

// By scene camera. Fails with a sentence when a camera that is named is not in the scene.
Result<std::vector<LensChoice>> lens_choices(const std::string& text,
                                             const std::vector<SceneCamera>& cameras);

}  // namespace rig
