// One least-squares solve over views for rigs with fields and surfaces (solve/flexible_system.h):
// lenses or their fields, camera poses, surfaces and board poses together, by Levenberg and Marquardt.
//
// Kinds of rows that are added to the points'. Prior: what an earlier result says (prior.h). Smoothness: curvature has mean 0 and the deviation below,
// as large as it gets in earnest, so that a handful of points outweighs it and it acts only where there
// are none. Gauge: what a field or surface shares with a pose is held at zero: the rotation that fits a
// field best over the image, a surface's piston and tilt over its board's points.
#pragma once

#include <vector>

#include "host/solve/flexible_system.h"

namespace rig {

struct Prior;

// Second derivative times the longer side squared: that of 2 px with a wavelength of half the image
// (4 pi)^2 2 px, and of a dent of 1 mm whose sigma is a tenth of the board. A second difference of
// control points deviates by this over the number of cells squared.
constexpr double kFieldBendPx = 300.0;
constexpr double kSurfaceBendMm = 100.0;

struct FlexibleOptions {
    std::vector<int> gauge_cameras{0};
    const Prior* prior = nullptr;  // borrowed; null: none
    bool poses_only = false;  // lenses, cameras and surfaces are held
    int iterations_max = 30;  // 0: only first_gain is wanted
    double tolerance = 1e-9;  // relative fall of the cost that ends the solve
};

struct FlexibleResult {
    bool usable = false;
    double squares = 0.0;     // sum of the points' squared whitened residuals at the end
    double first_gain = 0.0;  // by how much the first step was predicted to lower the sum of squares
    std::size_t points = 0;
    int unknowns = 0;         // lenses, cameras, fields, surfaces; gauge rows taken off
    int iterations = 0;
};

// Board poses without a view in use do not move.
FlexibleResult flexible_bundle(const std::vector<View>& views, const std::vector<char>& use,
                               const std::vector<Board>& boards,
                               const std::vector<SceneCamera>& cameras, const FlexibleOptions& options,
                               RigState* state);

// The views with a point in use.
std::vector<char> views_in_use(const std::vector<View>& views);

// Information of all columns at a solution, for points of unit noise, smoothness and gauge included, body
// poses eliminated; lower triangle. The prior's is `noise` squared times what it is, so that dividing all by
// noise squared leaves the points' share as that noise makes it and the prior's as it is. Empty matrix when
// a point has no image or a pose is not determined.
struct FlexibleInformation {
    FlexibleLayout layout;
    Eigen::MatrixXd matrix;
    // As in FlexibleSystem: what was eliminated.
    Eigen::MatrixXd across;
    Eigen::Matrix<double, 6, Eigen::Dynamic> own;
};
FlexibleInformation flexible_information(const std::vector<View>& views,
                                         const std::vector<Board>& boards,
                                         const std::vector<SceneCamera>& cameras,
                                         const std::vector<int>& gauge_cameras, const Prior* prior,
                                         double noise, const RigState& state);

}  // namespace rig
