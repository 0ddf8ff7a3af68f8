// A view with a rolling shutter as one block of Ceres, and what is known of velocities beforehand.
#pragma once

#include <ceres/sized_cost_function.h>

#include "host/solve/rolling_kernel.h"
#include "host/solve/velocity_prior.h"
#include "host/solve/view_cost.h"

namespace rig {

// Body poses have their velocity behind them, in one block.
enum { kMovingBodyCount = 12 };

struct RollingView {
    CompressedView compressed;  // its maps are not set
    RollingMaps maps;
};

// Compresses the view at this state.
void compress(const View& view, const RigState& state, double cauchy, RollingView* out);

// ViewCost's like. Parameters: the lens, cam_from_rig, rig_from_body with its velocity,
// body_from_board for a member, and the row time (s) where it is solved for. Borrows `view`.
class RollingCost : public ceres::CostFunction {
public:
    RollingCost(const RollingView* view, int lens_count, bool member, bool row_time);
    bool Evaluate(double const* const* parameters, double* residuals,
                  double** jacobians) const override;

private:
    Eigen::MatrixXd map_of(std::size_t block) const;  // of a block behind the lens
    const RollingView* view_;
    int lens_count_;
    bool member_;
};

// A velocity's prior (velocity_prior.h): six residuals on a body's block.
class VelocityCost : public ceres::SizedCostFunction<6, kMovingBodyCount> {
public:
    explicit VelocityCost(const Shutter& shutter) : weight_(velocity_weight(shutter)) {}
    bool Evaluate(double const* const* parameters, double* residuals,
                  double** jacobians) const override;

private:
    Vector6 weight_;
};

}  // namespace rig
