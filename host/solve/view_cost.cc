// See view_cost.h.
#include "host/solve/view_cost.h"

#include <cmath>

namespace rig {
namespace {

// Pivots of the equilibrated matrix below this are rounding: the view does not see that direction.
constexpr double kPivotMin = 1e-14;

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace

void compress(const LocalQuadratic& quadratic, CompressedView* out)
{
    const Eigen::Index count = quadratic.normal.rows();
    const Eigen::VectorXd size = quadratic.normal.diagonal().cwiseMax(0.0).cwiseSqrt();
    const Eigen::VectorXd scale = size.unaryExpr([](double s) { return s > 0.0 ? 1.0 / s : 0.0; });
    Eigen::MatrixXd a = scale.asDiagonal() * quadratic.normal * scale.asDiagonal();
    Eigen::VectorXd right = scale.cwiseProduct(quadratic.gradient);
    Eigen::VectorXi place = Eigen::VectorXi::LinSpaced(count, 0, static_cast<int>(count) - 1);
    out->root.setZero(count, count);
    out->residual.setZero(count + 1);
    double explained = 0.0;
    for (Eigen::Index k = 0; k < count; ++k) {
        Eigen::Index pivot = 0;
        if (!(a.diagonal().tail(count - k).maxCoeff(&pivot) > kPivotMin)) {
            break;
        }
        pivot += k;
        a.row(k).swap(a.row(pivot));
        a.col(k).swap(a.col(pivot));
        std::swap(right[k], right[pivot]);
        std::swap(place[k], place[pivot]);
        const Eigen::Index below = count - k - 1;
        const double root = std::sqrt(a(k, k));
        a(k, k) = root;
        a.col(k).tail(below) /= root;
        a.bottomRightCorner(below, below).noalias() -= a.col(k).tail(below) * a.col(k).tail(below).transpose();
        out->residual[k] = right[k] / root;
        right.tail(below) -= out->residual[k] * a.col(k).tail(below);
        explained += out->residual[k] * out->residual[k];
        for (Eigen::Index j = k; j < count; ++j) {
            out->root(k, place[j]) = a(j, k);
        }
    }
    out->root *= size.asDiagonal();
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
