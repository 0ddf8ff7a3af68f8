// Velocities of boards taken out of the normal equations of flexible_system.h: what remains is a
// system of columns and poses as it is without shutters.
#pragma once

#include "host/solve/flexible_system.h"

namespace rig {

// Sum of squares that the velocities' prior adds (velocity_prior.h); 0 where no shutter rolls.
double velocity_cost(const Shutter& shutter);

// Adds the prior and eliminates. Does nothing where no shutter rolls.
class VelocityElimination {
public:
    VelocityElimination(const Shutter& shutter, FlexibleSystem* system);

    // The velocities' part of a step, from that of columns and poses.
    Eigen::VectorXd step(const FlexibleSystem& system, const Eigen::VectorXd& columns,
                         const Eigen::VectorXd& poses) const;
    // What their own pull lowers the sum of squares by.
    double gain() const { return gain_; }

private:
    // Of each velocity's own block.
    std::vector<Eigen::Matrix<double, 6, 6>> inverse_;
    double gain_ = 0.0;
};

}  // namespace rig
