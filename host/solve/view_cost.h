// A view as one block of Ceres, already compressed.
#pragma once

#include <ceres/cost_function.h>

#include "host/solve/pose_chain.h"

namespace rig {

// With the view's normal matrix N and gradient g in its local parameters (view_kernel.h), R a root
// of N (R'R = N, by Cholesky's method with pivots) and y = R'^-1 g, the residual handed to Ceres is
// (y, rest), rest chosen so that its squared length is the view's sum of squares. R, with a row of
// zeros below, is its Jacobian: cost, gradient and Gauss-Newton matrix are those of the full block,
// in one row more than there are local parameters instead of two a point.
struct CompressedView {
    bool usable = false;       // false: a point had no image
    Eigen::VectorXd residual;  // one more than local parameters
    Eigen::MatrixXd root;      // R; rows beyond its rank are zero
    Eigen::Matrix<double, 6, 6> maps[PoseChain::kLinksMax];
};

// Sets residual and root.
void compress(const LocalQuadratic& quadratic, CompressedView* out);

// Compresses the view at this state.
void compress(const View& view, const RigState& state, double cauchy, CompressedView* out);

// Hands over what was compressed before (bundle.cc does it for all views at once). Parameters: the
// lens, cam_from_rig, rig_from_body and, for a member, body_from_board. Borrows `compressed`.
class ViewCost : public ceres::CostFunction {
public:
    ViewCost(const CompressedView* compressed, int lens_count, bool member);
    bool Evaluate(double const* const* parameters, double* residuals,
                  double** jacobians) const override;

private:
    const CompressedView* compressed_;
    int lens_count_;
};

}  // namespace rig
