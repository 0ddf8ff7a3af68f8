// Boards whose sizes contradict each other.
#pragma once

#include "host/base/status.h"
#include "host/solve/views.h"

namespace rig {

// Two cameras are as far apart as the board that both see says: by_view is cam_from_board of each
// view, from each camera alone. Fails with a sentence when two boards put the same cameras at
// distances that differ by more than kScaleWorstPart and more than they scatter.
Status check_scale(const Scene& scene, const ViewSet& set, const std::vector<Pose>& by_view);

// 3 mm a metre: a print at the wrong zoom is off by more, and lenses left unmodelled bend distances
// less.
constexpr double kScaleWorstPart = 0.003;

}  // namespace rig
