// Maximum likelihood in the presence of wrong points: robust solves until the noise is known, then
// plain least squares over the points that agree with it.
#pragma once

#include <functional>

#include "host/solve/bundle.h"

namespace rig {

// A point is rejected when its whitened residual is longer than this many times the camera's noise
// factor (at least 1). A Gaussian residual in the plane does so once in 65 million.
constexpr double kRejectSigmas = 6.0;

// A view with more than this part of its points rejected is rejected as a whole: its board, frame
// or time is wrong, and the points that fit do so by chance.
constexpr double kRejectViewPart = 0.5;

// Robust solves only need to come near: they look at this many points of each view.
constexpr std::size_t kApproachPoints = 64;

struct RefineResult {
    bool converged = false;
    std::vector<double> noise_factor;  // by camera: robust scale of the whitened residuals
};

// Start from `state`, which may be tens of pixels off. Sets the centre offsets, the sigmas that are
// not known, and which points are used.
RefineResult refine(const BundleOptions& options, std::vector<View>* views, RigState* state);

// The same from where approach() ended, with the same options.
RefineResult refine_near(const BundleOptions& options, std::vector<View>* views, RigState* state);

// The robust rounds alone, on at most kApproachPoints of each view: a loss whose scale follows the
// residuals down until they stop shrinking. False when no step led to a usable state.
bool approach(const BundleOptions& options, const std::vector<View>& views, RigState* state);

// The plain rounds alone, with any solver: centre offsets, sigmas and the set of used points are brought
// up to date and `solve` is called, until nothing changes. `solve` may move points; false: it failed.
// scale_free: all sigmas times one factor have the same solution, as where residuals alone count.
using Solve = std::function<bool(std::vector<View>*, RigState*)>;
RefineResult settle(const Solve& solve, int threads, std::vector<View>* views, RigState* state,
                    bool scale_free = false);

// Sets each circle's centre_offset_px for the present state, and with a rolling shutter each point's. Returns
// the largest change, px.
double update_centre_offsets(const RigState& state, int threads, std::vector<View>* views);

// Robust standard deviation per axis of the whitened residuals, by camera (0 without any): 1.4826
// times the median of their absolute components, rejected points included.
std::vector<double> noise_factors(const RigState& state, int threads, const std::vector<View>& views);

// The same of residuals in pixels, over some of the points in use.
std::vector<double> noise_px(const RigState& state, const std::vector<View>& views);

}  // namespace rig
