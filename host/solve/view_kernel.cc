// See view_kernel.h. Lenses of the pinhole family have sums of their own (pinhole_kernel.h); any
// other goes point by point through its formula.
#include "host/solve/view_kernel.h"

#include "host/solve/pinhole_kernel.h"

namespace rig {
namespace {

RIG_WIDE bool quadratic_brown(const View& view, const Camera& lens, const Pose& pose, double cauchy,
                              bool derive, LocalQuadratic* out)
{
    return pinhole_quadratic<5>(view, lens, pose, cauchy, derive, out);
}

RIG_WIDE bool quadratic_rational(const View& view, const Camera& lens, const Pose& pose, double cauchy,
                                 bool derive, LocalQuadratic* out)
{
    return pinhole_quadratic<8>(view, lens, pose, cauchy, derive, out);
}

RIG_WIDE bool quadratic_thin_prism(const View& view, const Camera& lens, const Pose& pose, double cauchy,
                                   bool derive, LocalQuadratic* out)
{
    return pinhole_quadratic<12>(view, lens, pose, cauchy, derive, out);
}

RIG_WIDE void residuals_brown(const View& view, const Camera& lens, const Pose& pose, double* out)
{
    pinhole_residuals<5>(view, lens, pose, out);
}

RIG_WIDE void residuals_rational(const View& view, const Camera& lens, const Pose& pose, double* out)
{
    pinhole_residuals<8>(view, lens, pose, out);
}

RIG_WIDE void residuals_thin_prism(const View& view, const Camera& lens, const Pose& pose, double* out)
{
    pinhole_residuals<12>(view, lens, pose, out);
}

// One point by the lens's formula. jacobian may be null.
bool residual_of(const ViewPoint& point, const Camera& lens, const Pose& pose, Eigen::Vector2d* residual,
                 ProjectionJacobian* jacobian)
{
    Eigen::Vector2d pixel;
    if (!project_lens(lens, lens.intrinsics.data(), pose * point.at_mm, &pixel, jacobian)) {
        return false;
    }
    *residual = (pixel + point.centre_offset_px.cast<double>() - point.pixel)
                / static_cast<double>(point.sigma_px);
    return true;
}

bool quadratic_by_formula(const View& view, const Camera& lens, const Pose& pose, double cauchy,
                          bool derive, LocalQuadratic* out)
{
    const auto lens_count = static_cast<Eigen::Index>(lens.intrinsics.size());
    const Eigen::Index count = lens_count + kMotionCount;
    out->squares = 0.0;
    if (derive) {
        out->normal.setZero(count, count);
        out->gradient.setZero(count);
    }
    const double c2 = cauchy * cauchy;
    ProjectionJacobian jacobian;
    Eigen::Matrix<double, 2, Eigen::Dynamic> row(2, count);
    for (const ViewPoint& point : view.points) {
        Eigen::Vector2d residual;
        if (!point.used) {
            continue;
        }
        if (!residual_of(point, lens, pose, &residual, derive ? &jacobian : nullptr)) {
            return false;
        }
        const double s = residual.squaredNorm();
        out->squares += cauchy > 0.0 ? c2 * std::log1p(s / c2) : s;
        if (derive) {
            const double root = cauchy > 0.0 ? std::sqrt(1.0 / (1.0 + s / c2)) : 1.0;
            const double w = root / static_cast<double>(point.sigma_px);
            row.leftCols(lens_count) = w * jacobian.by_intrinsics.leftCols(lens_count);
            row.middleCols<3>(lens_count) =
                -w * jacobian.by_point * skew(pose.rotation * point.at_mm);
            row.middleCols<3>(lens_count + 3) = w * jacobian.by_point;
            out->normal.noalias() += row.transpose() * row;
            out->gradient.noalias() += root * (row.transpose() * residual);
        }
    }
    return true;
}

}  // namespace

bool local_quadratic(const View& view, const Camera& lens, const Pose& cam_from_board, double cauchy,
                     bool derive, LocalQuadratic* out)
{
    if (!lens.field.empty()) {
        return quadratic_by_formula(view, lens, cam_from_board, cauchy, derive, out);
    }
    switch (lens.model) {
        case CameraModel::kBrown:
            return quadratic_brown(view, lens, cam_from_board, cauchy, derive, out);
        case CameraModel::kRational:
            return quadratic_rational(view, lens, cam_from_board, cauchy, derive, out);
        case CameraModel::kThinPrism:
            return quadratic_thin_prism(view, lens, cam_from_board, cauchy, derive, out);
        default:
            return quadratic_by_formula(view, lens, cam_from_board, cauchy, derive, out);
    }
}

void view_residuals(const View& view, const Camera& lens, const Pose& cam_from_board,
                    Eigen::Matrix2Xd* residuals)
{
    residuals->resize(2, static_cast<Eigen::Index>(view.points.size()));
    switch (lens.field.empty() ? lens.model : CameraModel::kFisheye) {
        case CameraModel::kBrown:
            return residuals_brown(view, lens, cam_from_board, residuals->data());
        case CameraModel::kRational:
            return residuals_rational(view, lens, cam_from_board, residuals->data());
        case CameraModel::kThinPrism:
            return residuals_thin_prism(view, lens, cam_from_board, residuals->data());
        default:
            break;
    }
    for (std::size_t i = 0; i < view.points.size(); ++i) {
        Eigen::Vector2d residual;
        if (!residual_of(view.points[i], lens, cam_from_board, &residual, nullptr)) {
            residual.setConstant(std::numeric_limits<double>::infinity());
        }
        residuals->col(static_cast<Eigen::Index>(i)) = residual;
    }
}

void view_residuals(const View& view, const RigState& state, Eigen::Matrix2Xd* residuals)
{
    view_residuals(view, state.lenses[static_cast<std::size_t>(view.camera)], cam_from_board(state, view),
                   residuals);
}

}  // namespace rig
