// Whether row times that are asked for can be told, and what a solution says of shutters.
#pragma once

#include "host/solve/rig.h"

namespace rig {

// A row time is seen only through what boards move from row to row. Where no other camera of its
// part, by a row time that is known, says how fast that is, it could be anything: fails with a
// sentence. `part_of_camera` by scene camera.
Status check_row_time_reference(const Scene& scene, const std::vector<int>& part_of_camera);

// refine (robust.h), row times included. A prior that is as wide as velocities are large draws them
// all a little nearer to zero, and a row time that is solved for away from it: by 0.4 of its
// deviation for 100 boards. So row times are found under one that is three times as wide, which
// leaves a ninth of that, and are then held, because for all else the nearer prior is the better
// one.
RefineResult refine_rolling(const BundleOptions& options, std::vector<View>* views, RigState* state);

// After the solve: fails with a sentence that names the camera where boards moved too little.
Status check_row_times(const Scene& scene, const Solution& solution);

// A row time that is uncertain by more than this over the image's rows is not known: a board that
// passes at 1 m/s is then misplaced by 1 mm between top and bottom.
constexpr double kImageTimeWorstS = 1e-3;

}  // namespace rig
