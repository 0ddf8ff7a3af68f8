// A lens put into the fewer coefficients that another program has.
#pragma once

#include "host/report/rig_file.h"

namespace rig {

struct NearestLens {
    Camera lens;  // of a model with at least the wanted coefficients, those beyond them 0
    int count = 0;  // of coefficients
    bool exact = false;
    double rms_px = 0.0;   // off over the whole image; 0 where exact
    double most_px = 0.0;
};

// The camera's lens with the first of `counts` (ascending, of OpenCV's order or, for a fisheye, of its
// own) that holds it exactly, or else, by least squares over the image, with the last of them.
NearestLens nearest_lens(const RigCamera& camera, const std::vector<int>& counts);

}  // namespace rig
