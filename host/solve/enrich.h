// After the joint solution with parametric lenses and flat boards: richer lenses and surfaces where
// held-out instants ask for them (heldout.h), fitted to all views.
#pragma once

#include "host/solve/rig.h"

namespace rig {

// Sets solution->choice and, where something richer was chosen, state, used points, sigmas, centre
// offsets and noise factors. Keeps the solution as it is where the richer one does not settle.
void enrich(const Scene& scene, const SolveOptions& options, const Progress& progress,
            Solution* solution);

}  // namespace rig
