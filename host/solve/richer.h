// Lenses from simple to rich, and how to go from one to the next.
#pragma once

#include <string>
#include <vector>

#include "host/model/camera.h"
#include "host/obs/observation.h"

namespace rig {

// Names of the lenses that a camera may climb to, its own first: models of the pinhole family that are
// at least as rich (a fisheye stands alone), then "spline, N cells" along the image's longer side. Each
// field has about twice the control points of the one before. A lens that has a field climbs finer ones.
std::vector<std::string> lens_ladder(const Camera& lens);

// The coarsest field's name.
std::string first_field();

// The lens of that name, started from a poorer one: it predicts the same pixels, or nearly so where a
// field is carried over to a finer grid.
void enrich_lens(const SceneCamera& camera, const std::string& name, Camera* lens);

// A spline's values on another grid, near enough to start from: what it is where the new control
// points stand.
void resample(const BsplineGrid& from, const double* control, const BsplineGrid& to, double* out);

}  // namespace rig
