// See view_cost.h.
#include "host/solve/view_cost.h"

#include <cmath>

namespace rig {
namespace {

// Pivots of the equilibrated matrix below this are rounding: the view does not see that direction.
constexpr double kPivotMin = 1e-14;

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace

// Columns are eliminated where they stand: what belongs to those that are done is kept at zero.
void compress(const LocalQuadratic& quadratic, CompressedView* out)
{
    const Eigen::Index count = quadratic.normal.rows();
    const Eigen::VectorXd size = quadratic.normal.diagonal().cwiseMax(0.0).cwiseSqrt();
    const Eigen::VectorXd scale = size.unaryExpr([](double s) { return s > 0.0 ? 1.0 / s : 0.0; });
    Eigen::MatrixXd a(count, count);
    for (Eigen::Index j = 0; j < count; ++j) {
        a.col(j) = scale[j] * scale.cwiseProduct(quadratic.normal.col(j));
    }
    Eigen::VectorXd right = scale.cwiseProduct(quadratic.gradient);
    Eigen::VectorXd row(count);
    out->root.setZero(count, count);
    out->residual.setZero(count + 1);
    double explained = 0.0;
    for (Eigen::Index k = 0; k < count; ++k) {
        Eigen::Index pivot = 0;
        const double largest = a.diagonal().maxCoeff(&pivot);
        if (!(largest > kPivotMin)) {
            break;
        }
        const double root = std::sqrt(largest);
        row = a.col(pivot) / root;
        out->root.row(k) = row.cwiseProduct(size);
        out->residual[k] = right[pivot] / root;
        explained += out->residual[k] * out->residual[k];
        right -= out->residual[k] * row;
        row[pivot] = 0.0;
        a.row(pivot).setZero();
        for (Eigen::Index j = 0; j < count; ++j) {
            if (row[j] != 0.0) {
                a.col(j) -= row[j] * row;
            }
        }
        a.col(pivot).setZero();
    }
    out->residual[count] = std::sqrt(std::max(0.0, quadratic.squares - explained));
}

void compress(const View& view, const RigState& state, double cauchy, CompressedView* out)
{
    LocalQuadratic quadratic;
    out->usable = local_quadratic(view, state.lenses[static_cast<std::size_t>(view.camera)],
                                  cam_from_board(state, view), cauchy, true, &quadratic);
    if (out->usable) {
        compress(quadratic, out);
        motion_maps(chain_of(state, view), out->maps);
    }
}

ViewCost::ViewCost(const CompressedView* compressed, int lens_count, bool member)
    : compressed_(compressed), lens_count_(lens_count)
{
    *mutable_parameter_block_sizes() = {lens_count, 6, 6};
    if (member) {
        mutable_parameter_block_sizes()->push_back(6);
    }
    set_num_residuals(lens_count + kMotionCount + 1);
}

bool ViewCost::Evaluate(double const* const*, double* residuals, double** jacobians) const
{
    if (!compressed_->usable) {
        return false;
    }
    const Eigen::Index count = lens_count_ + kMotionCount;
    Eigen::Map<Eigen::VectorXd>(residuals, count + 1) = compressed_->residual;
    for (std::size_t block = 0; jacobians != nullptr && block < parameter_block_sizes().size(); ++block) {
        if (jacobians[block] == nullptr) {
            continue;
        }
        Eigen::Map<RowMajor> out(jacobians[block], count + 1, parameter_block_sizes()[block]);
        if (block == 0) {
            out.topRows(count) = compressed_->root.leftCols(lens_count_);
        } else {
            out.topRows(count).noalias() =
                compressed_->root.rightCols<kMotionCount>() * compressed_->maps[block - 1];
        }
        out.row(count).setZero();
    }
    return true;
}

}  // namespace rig
