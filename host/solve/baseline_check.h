// Known distances between cameras against the result: how a print of the wrong size shows where
// nothing else tells.
#pragma once

#include "host/solve/rig.h"

namespace rig {

// `solution` with its covariance. Fails with a sentence when a known distance is further from the
// result's than kBaselineSigmas of both together. They are compared only: the result stays the
// boards' own.
Status check_baselines(const Scene& scene, const Solution& solution);

constexpr double kBaselineSigmas = 6.0;

}  // namespace rig
