// See residuals.h. With p_rig = rig_from_board p, p_cam = cam_from_rig p_rig, rotation vectors v and
// their right Jacobians J:
//     d p_cam / d v_board = -R_cam R_board [p]x J(v_board)      d p_cam / d t_board = R_cam
//     d p_cam / d v_cam   = -R_cam [p_rig]x J(v_cam)            d p_cam / d t_cam   = 1
#include "host/solve/residuals.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace rig {
namespace {

enum { kPoseCount = 6 };

// A point nearer than this to the plane of the lens is no measurement.
constexpr double kDepthMinMm = 1e-3;

using Row2 = Eigen::Matrix<double, 2, ViewQuadratic::kMax>;

// A view's parameters, unpacked once for all its points.
class Chain {
public:
    Chain(CameraModel model, const double* intrinsics, const double* cam_from_rig,
          const double* rig_from_board)
        : model_(model), intrinsics_(intrinsics), lens_count_(kPinholeCount + distortion_count(model)),
          rig_(pose_exp(Eigen::Map<const Vector6>(cam_from_rig))),
          board_(pose_exp(Eigen::Map<const Vector6>(rig_from_board))),
          rig_jacobian_(rotation_right_jacobian(Eigen::Map<const Vector6>(cam_from_rig).head<3>())),
          board_jacobian_(rotation_right_jacobian(Eigen::Map<const Vector6>(rig_from_board).head<3>())),
          both_(rig_.rotation * board_.rotation)
    {
    }

    bool residual(const ViewPoint& point, Eigen::Vector2d* residual, Row2* row) const
    {
        const Eigen::Vector3d in_rig = board_ * point.at_mm;
        const Eigen::Vector3d in_camera = rig_ * in_rig;
        if (model_ != CameraModel::kFisheye && in_camera.z() < kDepthMinMm) {
            return false;
        }
        Eigen::Vector2d pixel;
        ProjectionJacobian derivative;
        if (!project_formula(model_, intrinsics_, in_camera, &pixel, row ? &derivative : nullptr)) {
            return false;
        }
        const double weight = 1.0 / point.sigma_px;
        *residual = weight * (pixel + point.centre_offset_px - point.pixel);
        if (row != nullptr) {
            const Eigen::Matrix<double, 2, 3> by_point = weight * derivative.by_point;
            const Eigen::Matrix<double, 2, 3> by_rig = by_point * rig_.rotation;
            row->leftCols(lens_count_) = weight * derivative.by_intrinsics.leftCols(lens_count_);
            row->middleCols<3>(lens_count_) = -by_rig * skew(in_rig) * rig_jacobian_;
            row->middleCols<3>(lens_count_ + 3) = by_point;
            row->middleCols<3>(lens_count_ + 6) =
                -by_point * both_ * skew(point.at_mm) * board_jacobian_;
            row->middleCols<3>(lens_count_ + 9) = by_rig;
        }
        return true;
    }

private:
    CameraModel model_;
    const double* intrinsics_;
    int lens_count_;
    Pose rig_;
    Pose board_;
    Eigen::Matrix3d rig_jacobian_;
    Eigen::Matrix3d board_jacobian_;
    Eigen::Matrix3d both_;
};

}  // namespace

int view_parameter_count(CameraModel model)
{
    return kPinholeCount + distortion_count(model) + 2 * kPoseCount;
}

bool view_residuals(const View& view, CameraModel model, const double* intrinsics,
                    const double* cam_from_rig, const double* rig_from_board,
                    Eigen::VectorXd* residuals, Eigen::MatrixXd* jacobian)
{
    const Chain chain(model, intrinsics, cam_from_rig, rig_from_board);
    const int columns = view_parameter_count(model);
    const auto rows = static_cast<Eigen::Index>(2 * view.points.size());
    residuals->resize(rows);
    if (jacobian != nullptr) {
        jacobian->resize(rows, columns);
    }
    Row2 row;
    for (Eigen::Index i = 0; i < rows; i += 2) {
        Eigen::Vector2d residual;
        if (!chain.residual(view.points[static_cast<std::size_t>(i / 2)], &residual,
                            jacobian ? &row : nullptr)) {
            return false;
        }
        residuals->segment<2>(i) = residual;
        if (jacobian != nullptr) {
            jacobian->middleRows<2>(i) = row.leftCols(columns);
        }
    }
    return true;
}

bool view_quadratic(const View& view, CameraModel model, const double* intrinsics,
                    const double* cam_from_rig, const double* rig_from_board, double cauchy,
                    bool derive, ViewQuadratic* out)
{
    // Points are gathered in slabs, so that the products are matrix products and memory stays small.
    enum { kSlabRows = 64 };
    using Slab = Eigen::Matrix<double, kSlabRows, Eigen::Dynamic, Eigen::ColMajor, kSlabRows,
                               ViewQuadratic::kMax>;
    const Chain chain(model, intrinsics, cam_from_rig, rig_from_board);
    const int columns = view_parameter_count(model);
    Slab slab(kSlabRows, columns);
    Eigen::Matrix<double, kSlabRows, 1> slab_residual;
    Eigen::Index filled = 0;
    auto normal = out->normal.topLeftCorner(columns, columns);
    auto gradient = out->gradient.head(columns);
    out->squares = 0.0;
    if (derive) {
        normal.setZero();
        gradient.setZero();
    }
    const auto flush = [&] {
        const auto part = slab.topRows(filled);
        normal.noalias() += part.transpose() * part;
        gradient.noalias() += part.transpose() * slab_residual.head(filled);
        filled = 0;
    };
    Row2 row;
    for (const ViewPoint& point : view.points) {
        Eigen::Vector2d residual;
        if (!point.used) {
            continue;
        }
        if (!chain.residual(point, &residual, derive ? &row : nullptr)) {
            return false;
        }
        const double s = residual.squaredNorm();
        const double c2 = cauchy * cauchy;
        out->squares += cauchy > 0.0 ? c2 * std::log1p(s / c2) : s;
        if (derive) {
            const double root = cauchy > 0.0 ? std::sqrt(1.0 / (1.0 + s / c2)) : 1.0;
            slab.middleRows<2>(filled) = root * row.leftCols(columns);
            slab_residual.segment<2>(filled) = root * residual;
            filled += 2;
            if (filled == kSlabRows) {
                flush();
            }
        }
    }
    if (filled > 0) {
        flush();
    }
    return true;
}

ViewCost::ViewCost(const View* view, CameraModel model, double cauchy)
    : view_(view), model_(model), cauchy_(cauchy)
{
    *mutable_parameter_block_sizes() = {kPinholeCount + distortion_count(model), kPoseCount, kPoseCount};
    set_num_residuals(view_parameter_count(model) + 1);
}

bool ViewCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const
{
    const int count = view_parameter_count(model_);
    ViewQuadratic quadratic;
    const bool derive = jacobians != nullptr;
    if (!view_quadratic(*view_, model_, parameters[0], parameters[1], parameters[2], cauchy_, derive,
                        &quadratic)) {
        return false;
    }
    Eigen::Map<Eigen::VectorXd> compressed(residuals, count + 1);
    compressed.setZero();
    if (!derive) {
        compressed[count] = std::sqrt(quadratic.squares);
        return true;
    }
    // Equilibrated first, so that one threshold tells which directions the view does not see: six at
    // least, because it cannot tell the camera's motion from the board's.
    const Eigen::MatrixXd normal = quadratic.normal.topLeftCorner(count, count);
    const Eigen::VectorXd scale =
        normal.diagonal().unaryExpr([](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 0.0; });
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * normal
                                                               * scale.asDiagonal());
    const Eigen::VectorXd roots =
        eigen.eigenvalues().unaryExpr([](double d) { return d > 1e-15 ? std::sqrt(d) : 0.0; });
    const Eigen::VectorXd folded =
        eigen.eigenvectors().transpose() * scale.cwiseProduct(quadratic.gradient.head(count));
    for (int i = 0; i < count; ++i) {
        compressed[i] = roots[i] > 0.0 ? folded[i] / roots[i] : 0.0;
    }
    const double rest = quadratic.squares - compressed.head(count).squaredNorm();
    compressed[count] = std::sqrt(std::max(0.0, rest));
    Eigen::MatrixXd root = roots.asDiagonal() * eigen.eigenvectors().transpose();
    for (int i = 0; i < count; ++i) {
        root.col(i) *= scale[i] > 0.0 ? 1.0 / scale[i] : 0.0;
    }
    int column = 0;
    for (std::size_t block = 0; block < parameter_block_sizes().size(); ++block) {
        const int width = parameter_block_sizes()[block];
        if (jacobians[block] != nullptr) {
            Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> out(
                jacobians[block], count + 1, width);
            out.topRows(count) = root.middleCols(column, width);
            out.row(count).setZero();
        }
        column += width;
    }
    return true;
}

}  // namespace rig
