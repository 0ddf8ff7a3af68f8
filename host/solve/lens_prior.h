// What is known of a lens before it is seen. The coefficients of a rational lens stand in for one
// another: numerator and denominator may be multiplied alike, so that data leave a valley whose far
// end is as good as its near one where there are points, and has poles where there are none. Real
// lenses are described with coefficients near zero; saying so weakly picks the near end and costs
// nothing where the data speak.
#pragma once

#include <ceres/cost_function.h>

#include <vector>

#include "host/model/camera.h"

namespace rig {

// Standard deviation of each intrinsic about zero; 0: nothing is known of it.
std::vector<double> lens_prior_deviations(CameraModel model);

// The residuals k / deviation of those of which something is known. Parameter: the lens.
class LensPriorCost : public ceres::CostFunction {
public:
    explicit LensPriorCost(CameraModel model);
    bool Evaluate(double const* const* parameters, double* residuals,
                  double** jacobians) const override;

private:
    std::vector<double> deviations_;
};

}  // namespace rig
