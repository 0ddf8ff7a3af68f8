// Whether cameras stand to each other as a prior says: a target of another size, or a camera that
// moved since.
#pragma once

#include "host/solve/prior.h"
#include "host/solve/rig.h"

namespace rig {

// Before both are brought together: what boards that two cameras see at once make of their relative
// pose, through the prior's lenses, against the prior's. Fails with a sentence where they differ by
// more than kScaleWorstPart of the distance or kTurnWorstRad, and than they scatter: a board of
// another size where it is the distances alone, by one factor; else a camera that moved.
Status check_prior_poses(const Scene& scene, const Prior& prior, const ViewSet& set);

// Afterwards: fails where the joint solution is further from the prior than kPriorSigmas, or where
// it fits its points worse than it does without the prior's poses. The noise of points without
// sigmas is estimated, so a tight prior that is wrong would pass for noise. alone_px: by camera, of
// each alone; only where the solution is far above it is it solved for again, with `options`.
Status check_prior_met(const Scene& scene, const BundleOptions& options,
                       const std::vector<double>& alone_px, const Solution& solution);

// 3 mm a metre, as kScaleWorstPart: what the prior's lenses may leave. The joint solution tells the
// rest.
constexpr double kTurnWorstRad = 0.003;

}  // namespace rig
