// See flexible_covariance.h. With S the information of all columns and T the rows wanted in terms of
// them, the covariance is T S^-1 T' = (L^-1 T')' (L^-1 T').
#include "host/solve/flexible_covariance.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace rig {
namespace {

constexpr std::size_t kPlaces = 1000;  // at which a field's change is compared with that of intrinsics

// Intrinsics by control points: least squares over the camera's used points.
Eigen::MatrixXd intrinsics_by_field(const std::vector<View>& views, int camera, const Camera& lens)
{
    Camera base = lens;
    base.field = SplineField();
    const double fold = base.fold_radius();
    const BsplineGrid& grid = lens.field.grid;
    const auto count = static_cast<Eigen::Index>(lens.intrinsics.size());
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(count, count);
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(count, 2 * grid.count());
    std::size_t total = 0;
    for (const View& view : views) {
        total += view.camera == camera ? view.points.size() : 0;
    }
    const std::size_t stride = std::max<std::size_t>(1, total / kPlaces);
    std::size_t place = 0;
    for (const View& view : views) {
        for (const ViewPoint& point : view.points) {
            if (view.camera != camera || !point.used || place++ % stride != 0) {
                continue;
            }
            // A field moves little: the pixel itself stands for the one before the field.
            Eigen::Vector2d pixel;
            ProjectionJacobian slope;
            const Eigen::Vector3d ray = base.unproject(point.pixel, fold);
            if (!ray.allFinite()
                || !project_formula(base.model, base.intrinsics.data(), ray, &pixel, &slope)) {
                continue;
            }
            const auto by_lens = slope.by_intrinsics.leftCols(count);
            normal += by_lens.transpose() * by_lens;
            const BsplineSupport s = bspline_support(grid, pixel);
            for (int part = 0; part < 2; ++part) {
                for (int j = 0; j < 4; ++j) {
                    right.middleCols<4>(part * grid.count() + (s.row + j) * grid.columns + s.column) +=
                        by_lens.row(part).transpose() * (s.y[j] * s.x.transpose());
                }
            }
        }
    }
    const Eigen::VectorXd scale = normal.diagonal().unaryExpr(
        [](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 1.0; });
    const Eigen::MatrixXd equal = scale.asDiagonal() * normal * scale.asDiagonal();
    return scale.asDiagonal() * equal.ldlt().solve(scale.asDiagonal() * right);
}

// T: rows wanted by columns of the layout.
Eigen::MatrixXd rows_wanted(const std::vector<View>& views, const FlexibleLayout& layout,
                            const std::vector<int>& cameras, const std::vector<int>& gauge_cameras,
                            const RigState& state)
{
    Eigen::Index size = 6 * static_cast<Eigen::Index>(state.body_from_board.size());
    for (const int camera : cameras) {
        const bool gauge = std::count(gauge_cameras.begin(), gauge_cameras.end(), camera) != 0;
        size += static_cast<Eigen::Index>(state.lenses[static_cast<std::size_t>(camera)].intrinsics.size())
                + (gauge ? 0 : 6) + (layout.row_time[static_cast<std::size_t>(camera)] < 0 ? 0 : 1);
    }
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(size, layout.size);
    Eigen::Index row = 0;
    const auto same = [&](Eigen::Index column, Eigen::Index count) {
        if (column >= 0) {
            out.block(row, column, count, count).setIdentity();
        }
        row += count;
    };
    for (const int camera : cameras) {
        const auto c = static_cast<std::size_t>(camera);
        const auto count = static_cast<Eigen::Index>(state.lenses[c].intrinsics.size());
        if (layout.field[c] >= 0) {
            const Eigen::MatrixXd by_field = intrinsics_by_field(views, camera, state.lenses[c]);
            out.block(row, layout.field[c], count, by_field.cols()) = by_field;
        }
        same(layout.lens[c], count);
        if (std::count(gauge_cameras.begin(), gauge_cameras.end(), camera) == 0) {
            same(layout.camera[c], 6);
        }
    }
    for (const Eigen::Index member : layout.member) {
        same(member, 6);
    }
    for (const int camera : cameras) {
        const Eigen::Index row_time = layout.row_time[static_cast<std::size_t>(camera)];
        same(row_time, row_time < 0 ? 0 : 1);
    }
    return out;
}

}  // namespace

Eigen::MatrixXd flexible_covariance(const std::vector<View>& views, const Scene& scene,
                                    const std::vector<int>& cameras,
                                    const std::vector<int>& gauge_cameras, const Prior* prior,
                                    double noise, const RigState& state)
{
    const FlexibleInformation information =
        flexible_information(views, scene.boards, scene.cameras, gauge_cameras, prior, noise, state);
    if (information.matrix.size() == 0) {
        return {};
    }
    const Eigen::VectorXd scale = information.matrix.diagonal().unaryExpr(
        [](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 1.0; });
    const Eigen::MatrixXd equal = scale.asDiagonal() * information.matrix * scale.asDiagonal();
    const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> llt(equal);
    if (llt.info() != Eigen::Success) {
        return {};
    }
    const Eigen::MatrixXd wanted =
        rows_wanted(views, information.layout, cameras, gauge_cameras, state);
    const Eigen::MatrixXd half = llt.matrixL().solve(scale.asDiagonal() * wanted.transpose());
    return half.transpose() * half;
}

}  // namespace rig
