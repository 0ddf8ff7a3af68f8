// One least-squares solve over views: lenses, camera poses, body poses and the boards' places on
// their bodies together. Body poses are eliminated first (Schur), one block a view. Where shutters roll
// (shutter.h) a body's velocity goes with its pose, and row times that are asked for with the lenses.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "host/solve/views.h"

namespace rig {

struct Prior;

// How much of a lens may move. Focal: fx, fy. Radial: these and the first two distortion
// coefficients.
enum class LensFreedom { kNone, kFocal, kRadial, kAll };

struct BundleOptions {
    LensFreedom lens = LensFreedom::kAll;
    std::vector<double> cauchy;         // loss scale by camera, in units of sigma; empty or 0: plain squares
    std::vector<int> gauge_cameras{0};  // their cam_from_rig is held: one of each part
    int iterations_max = 50;
    double tolerance = 1e-10;           // relative fall of the cost that ends the solve
    double trust = 1e4;                 // Ceres' first trust region: the inverse of the damping
    int threads = 1;                    // over views; does not change the result
    std::function<void(const std::string&)> progress = {};  // told of steps when a solve takes long
    const Prior* prior = nullptr;       // borrowed; null: none
};

struct BundleResult {
    bool usable = false;  // the state was improved or was a minimum already
    double cost = 0.0;    // half the sum of squares
    int iterations = 0;
};

// Views whose points are all rejected do not take part.
BundleResult bundle(const std::vector<View>& views, const BundleOptions& options, RigState* state);

}  // namespace rig
