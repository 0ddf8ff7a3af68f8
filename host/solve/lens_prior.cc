// See lens_prior.h.
#include "host/solve/lens_prior.h"

#include <algorithm>

namespace rig {
namespace {

// k4 k5 k6 of lenses to 120 degrees, fitted over their whole image, lie between -1 and 1. A third
// of that: where data leave the valley open (8 cameras, 20 frames) the image's corners then err by
// 0.2 px as from the truth; with 1 by 0.6, with 3 the lens folds.
constexpr double kDenominator = 0.3;
// Tilts of a lens's elements by a degree make thin-prism terms of 0.01.
constexpr double kPrism = 0.01;

}  // namespace

std::vector<double> lens_prior_deviations(CameraModel model)
{
    const int distortion = distortion_count(model);
    std::vector<double> out(static_cast<std::size_t>(kPinholeCount + distortion), 0.0);
    for (int i = 5; i < distortion; ++i) {
        out[static_cast<std::size_t>(kPinholeCount + i)] = i < 8 ? kDenominator : kPrism;
    }
    return out;
}

LensPriorCost::LensPriorCost(CameraModel model) : deviations_(lens_prior_deviations(model))
{
    mutable_parameter_block_sizes()->push_back(static_cast<int>(deviations_.size()));
    set_num_residuals(static_cast<int>(
        std::count_if(deviations_.begin(), deviations_.end(), [](double d) { return d > 0.0; })));
}

bool LensPriorCost::Evaluate(double const* const* parameters, double* residuals,
                             double** jacobians) const
{
    const std::size_t count = deviations_.size();
    if (jacobians != nullptr && jacobians[0] != nullptr) {
        std::fill_n(jacobians[0], static_cast<std::size_t>(num_residuals()) * count, 0.0);
    }
    std::size_t row = 0;
    for (std::size_t i = 0; i < count; ++i) {
        if (deviations_[i] > 0.0) {
            residuals[row] = parameters[0][i] / deviations_[i];
            if (jacobians != nullptr && jacobians[0] != nullptr) {
                jacobians[0][row * count + i] = 1.0 / deviations_[i];
            }
            ++row;
        }
    }
    return true;
}

}  // namespace rig
