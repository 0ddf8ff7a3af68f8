// See velocity_elimination.h. With V the velocity's own block, g its gradient, P its coupling with
// the pose and A that with the columns (rows), the others lose P' V^-1 P, A V^-1 A', A V^-1 P, A
// V^-1 g and P' V^-1 g, and the velocity's step is -V^-1 (g + P poses + A' columns).
#include "host/solve/velocity_elimination.h"

#include <Eigen/Cholesky>

#include "host/solve/velocity_prior.h"

namespace rig {

double velocity_cost(const Shutter& shutter)
{
    double sum = 0.0;
    for (const Vector6& velocity : shutter.velocity) {
        sum += velocity.dot(velocity_weight(shutter).cwiseProduct(velocity));
    }
    return sum;
}

VelocityElimination::VelocityElimination(const Shutter& shutter, FlexibleSystem* system)
{
    const Eigen::Index count = system->velocity_own.cols();
    if (count == 0) {
        return;
    }
    const Vector6 known = velocity_weight(shutter);
    Eigen::MatrixXd half(system->normal.rows(), count);
    for (Eigen::Index p = 0; p < count; p += 6) {
        Eigen::Matrix<double, 6, 6> own = system->velocity_own.middleCols<6>(p);
        own.diagonal() += known;
        system->velocity_gradient.segment<6>(p) +=
            known.cwiseProduct(shutter.velocity[static_cast<std::size_t>(p / 6)]);
        inverse_.push_back(own.llt().solve(Eigen::Matrix<double, 6, 6>::Identity()));
        const Eigen::Matrix<double, 6, 6>& inverse = inverse_.back();
        const Vector6 gradient = system->velocity_gradient.segment<6>(p);
        const Eigen::Matrix<double, 6, 6> by_pose = system->velocity_by_pose.middleCols<6>(p);
        const Vector6 rest = inverse * gradient;
        half.middleCols<6>(p) = system->velocity_across.middleCols<6>(p) * inverse;
        system->across.middleCols<6>(p) -= half.middleCols<6>(p) * by_pose;
        system->gradient -= half.middleCols<6>(p) * gradient;
        system->own.middleCols<6>(p) -= by_pose.transpose() * inverse * by_pose;
        system->pose_gradient.segment<6>(p) -= by_pose.transpose() * rest;
        gain_ += gradient.dot(rest);
    }
    system->normal.triangularView<Eigen::Lower>() -= half * system->velocity_across.transpose();
}

Eigen::VectorXd VelocityElimination::step(const FlexibleSystem& system, const Eigen::VectorXd& columns,
                                          const Eigen::VectorXd& poses) const
{
    Eigen::VectorXd out(system.velocity_gradient.size());
    for (Eigen::Index p = 0; p < out.size(); p += 6) {
        Vector6 pull = system.velocity_gradient.segment<6>(p)
                       + system.velocity_by_pose.middleCols<6>(p) * poses.segment<6>(p);
        if (columns.size() > 0) {
            pull += system.velocity_across.middleCols<6>(p).transpose() * columns;
        }
        out.segment<6>(p) = -(inverse_[static_cast<std::size_t>(p / 6)] * pull);
    }
    return out;
}

}  // namespace rig
