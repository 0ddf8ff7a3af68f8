// See rolling_cost.h.
#include "host/solve/rolling_cost.h"

#include <cmath>

namespace rig {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace

void compress(const View& view, const RigState& state, double cauchy, RollingView* out)
{
    LocalQuadratic quadratic;
    out->compressed.usable = rolling_quadratic(view, state, cauchy, true, &quadratic);
    if (out->compressed.usable) {
        compress(quadratic, &out->compressed);
        out->maps = rolling_maps(view, state);
    }
}

RollingCost::RollingCost(const RollingView* view, int lens_count, bool member, bool row_time)
    : view_(view), lens_count_(lens_count), member_(member)
{
    *mutable_parameter_block_sizes() = {lens_count, 6, kMovingBodyCount};
    if (member) {
        mutable_parameter_block_sizes()->push_back(6);
    }
    if (row_time) {
        mutable_parameter_block_sizes()->push_back(1);
    }
    set_num_residuals(lens_count + kRollingMotionCount + 1);
}

Eigen::MatrixXd RollingCost::map_of(std::size_t block) const
{
    const RollingMaps& maps = view_->maps;
    if (block == 1) {
        return maps.link[0];
    }
    if (block == 2) {
        Eigen::MatrixXd out(static_cast<int>(kRollingMotionCount), static_cast<int>(kMovingBodyCount));
        out << maps.link[1], maps.velocity;
        return out;
    }
    return block == 3 && member_ ? Eigen::MatrixXd(maps.link[2]) : Eigen::MatrixXd(maps.row_time);
}

bool RollingCost::Evaluate(double const* const*, double* residuals, double** jacobians) const
{
    const CompressedView& compressed = view_->compressed;
    if (!compressed.usable) {
        return false;
    }
    const Eigen::Index count = lens_count_ + kRollingMotionCount;
    Eigen::Map<Eigen::VectorXd>(residuals, count + 1) = compressed.residual;
    for (std::size_t block = 0; jacobians != nullptr && block < parameter_block_sizes().size(); ++block) {
        if (jacobians[block] == nullptr) {
            continue;
        }
        Eigen::Map<RowMajor> out(jacobians[block], count + 1, parameter_block_sizes()[block]);
        if (block == 0) {
            out.topRows(count) = compressed.root.leftCols(lens_count_);
        } else {
            out.topRows(count).noalias() =
                compressed.root.rightCols<kRollingMotionCount>() * map_of(block);
        }
        out.row(count).setZero();
    }
    return true;
}

bool VelocityCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const
{
    for (int i = 0; i < 6; ++i) {
        const double weight = std::sqrt(weight_[i]);
        residuals[i] = weight * parameters[0][6 + i];
        if (jacobians != nullptr && jacobians[0] != nullptr) {
            std::fill_n(jacobians[0] + i * kMovingBodyCount, static_cast<int>(kMovingBodyCount), 0.0);
            jacobians[0][i * kMovingBodyCount + 6 + i] = weight;
        }
    }
    return true;
}

}  // namespace rig
