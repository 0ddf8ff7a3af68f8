// After the joint solution with parametric lenses and flat boards: richer lenses and surfaces where
// held-out instants ask for them (heldout.h), fitted to all views.
#pragma once

#include "host/solve/rig.h"

namespace rig {

// Sets solution->choice and, where something richer was chosen or told, state, used points, sigmas, centre
// offsets and noise factors. Keeps the solution as it is where what was chosen does not settle. Fails with a
// sentence where a camera that is to have a field has too few data for one.
Status enrich(const Scene& scene, const SolveOptions& options, const Progress& progress,
            Solution* solution);

}  // namespace rig
