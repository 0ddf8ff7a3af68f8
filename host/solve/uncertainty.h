// Covariance of lenses and camera poses, and whether the data determine them at all.
#pragma once

#include "host/solve/rig.h"

namespace rig {

// Fills solution->covariance, scaled up by the noise factor where that is above 1, and from it
// solution->uncertainty. Fails with a sentence that names the camera when its focal length is known to
// no better than kFocalWorstPart.
Status estimate_uncertainty(const Scene& scene, Solution* solution);

constexpr double kFocalWorstPart = 0.03;

// Covariance for unit noise, board poses marginalised; rows as covariance.h says.
RigCovariance rig_covariance(const Solution& solution);

}  // namespace rig
