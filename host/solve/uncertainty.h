// Covariance of lenses and camera poses, and whether the data determine them at all.
#pragma once

#include "host/solve/rig.h"

namespace rig {

// Fills solution->covariance, that of the data scaled up by the noise factor where that is above 1, and from it
// solution->uncertainty. Fails with a sentence that names the camera when its focal length is known to
// no better than kFocalWorstPart.
Status estimate_uncertainty(const Scene& scene, const Prior* prior, Solution* solution);

constexpr double kFocalWorstPart = 0.03;

// Change of a pose's six numbers by a twist (w, d) in the rig frame: p becomes p + w x p + d.
Eigen::Matrix<double, 6, 6> six_by_twist(const Vector6& six);

// How much larger the noise is than the sigmas say, at least 1: the noisiest camera's factor stands for all.
double noise_of(const Solution& solution);

// Covariance, board poses marginalised; rows as covariance.h says. noise_factor: how much larger the
// noise is than the sigmas say. prior (null: none) adds its information.
RigCovariance rig_covariance(const Solution& solution, double noise_factor = 1.0,
                             const Prior* prior = nullptr);

}  // namespace rig
