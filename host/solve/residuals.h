// The residual of one view, and its derivatives. A point's residual is
//     (projection + centre_offset_px - observed) / sigma_px
// without unit, so that J'J is the information matrix.
#pragma once

#include <ceres/cost_function.h>

#include "host/solve/views.h"

namespace rig {

// Parameters of a view's block, in this order: intrinsics, cam_from_rig (6), rig_from_board (6).
int view_parameter_count(CameraModel model);

// Sum of a view's squared residuals with robust weights, and the quadratic model of it: with w the
// loss's derivative, normal = sum w J'J and gradient = sum w J'r over the points in use. The first
// view_parameter_count rows and columns count.
struct ViewQuadratic {
    enum { kMax = kIntrinsicsMax + 12 };
    double squares = 0.0;  // sum of loss(|r|^2)
    Eigen::Matrix<double, kMax, kMax> normal;
    Eigen::Matrix<double, kMax, 1> gradient;
};

// Residuals of all points, 2 rows each in the points' order, used or not; jacobian (may be null) gets
// view_parameter_count columns. False when a point has no image under these parameters: the step to
// them is impossible.
bool view_residuals(const View& view, CameraModel model, const double* intrinsics,
                    const double* cam_from_rig, const double* rig_from_board,
                    Eigen::VectorXd* residuals, Eigen::MatrixXd* jacobian);

// cauchy: scale of the Cauchy loss in units of sigma; 0: plain squares. With derive false only
// `squares` is written.
bool view_quadratic(const View& view, CameraModel model, const double* intrinsics,
                    const double* cam_from_rig, const double* rig_from_board, double cauchy,
                    bool derive, ViewQuadratic* out);

// A view as one Ceres block, already compressed. With a square root R of the normal matrix (R'R equals
// it, by its eigenvectors) and the gradient g, the residual handed over is (R'^-1 g, rest), rest chosen
// so that its squared length is the view's sum of squares. R, with a row of zeros below, is its
// Jacobian: cost, gradient and Gauss-Newton matrix are those of the full block, in
// view_parameter_count + 1 rows instead of two a point. Borrows the view.
class ViewCost : public ceres::CostFunction {
public:
    ViewCost(const View* view, CameraModel model, double cauchy);
    bool Evaluate(double const* const* parameters, double* residuals,
                  double** jacobians) const override;

private:
    const View* view_;
    CameraModel model_;
    double cauchy_;
};

}  // namespace rig
