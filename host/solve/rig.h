// Stage two: the rig. Relative poses with the lenses of stage one held, then everything together.
#pragma once

#include <functional>

#include "host/base/status.h"
#include "host/solve/covariance.h"
#include "host/solve/field_errors.h"
#include "host/solve/heldout.h"
#include "host/solve/intrinsics.h"
#include "host/solve/lens_choice.h"
#include "host/solve/robust.h"

namespace rig {

struct Prior;

struct SolveOptions {
    std::vector<LensChoice> lenses;  // by scene camera
    bool flat = false;     // boards are held flat
    bool partial = false;  // solve each connected part by itself when not all cameras are connected
    int threads = 1;       // does not change the result
    const Prior* prior = nullptr;  // matched with the scene; borrowed; null: none
};

// Standard deviations from the covariance of the joint solution, scaled by its noise factor where
// that is above 1. Zero for the gauge camera's pose.
struct CameraUncertainty {
    std::vector<double> intrinsics;                                  // unit of each
    Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();          // about the camera's axes
    Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();
};

// Over the noise factor squared.
struct FlexibleCovariance {
    Eigen::MatrixXd matrix;          // rows of RigCovariance, the boards' places on bodies before the motions
    std::vector<FieldErrors> fields;  // by scene camera
};

struct Solution {
    std::vector<int> cameras;      // indices into Scene::cameras that were solved, part by part
    std::vector<int> part_of_camera;    // by scene camera
    std::vector<int> gauge_cameras;     // the first of each part: its frame is the part's rig frame
    std::vector<std::string> left_out;  // sentences: what is not in the solution, and why
    ViewSet set;                   // views of the solved cameras, with sigmas, offsets, used points
    RigState state;                // indexed by scene camera
    std::vector<double> noise_factor;      // by scene camera
    ModelChoice choice;
    // With fields and surfaces free and the prior in it (flexible_covariance.h); empty where there are none.
    FlexibleCovariance flexible;
    std::vector<CameraUncertainty> uncertainty;  // by scene camera; empty intrinsics where not solved
    std::vector<FieldErrors> field_errors;  // scaled alike; by scene camera, or none
    RigCovariance covariance;      // of all of them together, scaled alike; by scene camera
};

bool is_gauge(const Solution& solution, int camera);

// Called with one line at the end of each stage.
using Progress = std::function<void(const std::string&)>;

Result<Solution> solve_rig(const Scene& scene, const SolveOptions& options, const Progress& progress);

// Residuals of a view in the solution, px: projected less observed, in the order of its points.
std::vector<Eigen::Vector2d> residuals_px(const Solution& solution, const View& view);

}  // namespace rig
