// See flexible_covariance.h. With S the information of all columns and T the rows wanted in terms of
// them, the covariance is T S^-1 T' = (L^-1 T')' (L^-1 T').
#include "host/solve/flexible_covariance.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "host/base/median.h"
#include "host/solve/flexible.h"
#include "host/solve/uncertainty.h"

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

// How the boards' motions follow from the columns, and what they do of themselves: -(sum C)^-1 sum B' and
// (sum C)^-1 of each part (uncertainty.cc).
struct Motions {
    Eigen::MatrixXd follow;  // 6 rows a part
    std::vector<Eigen::Matrix<double, 6, 6>> own;
};

Motions motions_of(const FlexibleInformation& information, const Solution& solution)
{
    const std::size_t parts = solution.gauge_cameras.size();
    Motions out;
    out.own.assign(parts, Eigen::Matrix<double, 6, 6>::Zero());
    out.follow.setZero(6 * static_cast<Eigen::Index>(parts), information.layout.size);
    for (std::size_t p = 0; p < solution.set.poses.size(); ++p) {
        const auto at = static_cast<Eigen::Index>(6 * p);
        const auto part = static_cast<std::size_t>(solution.set.poses[p].part);
        const Eigen::Matrix<double, 6, 6> twist = six_by_twist(solution.state.rig_from_body[p]);
        out.own[part] += twist.transpose() * information.own.middleCols<6>(at) * twist;
        out.follow.middleRows<6>(static_cast<Eigen::Index>(6 * part)) -=
            (information.across.middleCols<6>(at) * twist).transpose();
    }
    for (std::size_t part = 0; part < parts; ++part) {
        auto rows = out.follow.middleRows<6>(static_cast<Eigen::Index>(6 * part));
        const auto factor = out.own[part].ldlt();
        rows = factor.solve(rows).eval();
        out.own[part] = factor.solve(Eigen::Matrix<double, 6, 6>::Identity());
    }
    return out;
}

// Median distance of the camera's used points.
double distance_mm(const Solution& solution, int camera)
{
    std::vector<double> distances;
    for (const View& view : solution.set.views) {
        const Pose pose = cam_from_board(solution.state, view);
        for (const ViewPoint& point : view.points) {
            if (view.camera == camera && point.used) {
                distances.push_back((pose * point.at_mm).norm());
            }
        }
    }
    return distances.empty() ? 0.0 : median_of(&distances);
}

// Two rows a place of the map: the pixel of a point fixed to the world by all columns, and the same by the
// rows of the covariance (`wanted`, in terms of the columns), which are to be told apart. Places without a
// ray have none.
struct PixelRows {
    Eigen::MatrixXd whole;
    Eigen::MatrixXd told;
    std::vector<std::size_t> places;
};

PixelRows pixel_rows(const Scene& scene, const Solution& solution, int camera,
                     const FlexibleLayout& layout, const Motions& motions, const Eigen::MatrixXd& wanted,
                     Eigen::Index lens_row)
{
    const auto c = static_cast<std::size_t>(camera);
    const Camera& lens = solution.state.lenses[c];
    const double fold = lens.fold_radius();
    const Vector6& six = solution.state.cam_from_rig[c];
    const Pose pose = pose_exp(six);
    const double distance = distance_mm(solution, camera);
    const Eigen::Index motion = 6 * solution.part_of_camera[c];
    const auto count = static_cast<Eigen::Index>(lens.intrinsics.size());
    const Eigen::Index room = 2 * kFieldErrorColumns * kFieldErrorRows;
    PixelRows out{Eigen::MatrixXd::Zero(room, layout.size), Eigen::MatrixXd::Zero(room, layout.size), {}};
    for (std::size_t place = 0; place < kFieldErrorColumns * kFieldErrorRows; ++place) {
        const Eigen::Vector2d share(static_cast<double>(place % kFieldErrorColumns) / (kFieldErrorColumns - 1.0),
                                    static_cast<double>(place / kFieldErrorColumns) / (kFieldErrorRows - 1.0));
        const Eigen::Vector3d at = distance * lens.unproject(
            share.cwiseProduct(Eigen::Vector2d(scene.cameras[c].width_px - 1.0, scene.cameras[c].height_px - 1.0)),
            fold);
        Eigen::Vector2d before;
        ProjectionJacobian slope;
        if (!at.allFinite() || !project_formula(lens.model, lens.intrinsics.data(), at, &before, &slope)) {
            continue;
        }
        const auto row = static_cast<Eigen::Index>(2 * out.places.size());
        out.places.push_back(place);
        Eigen::Matrix2d bend;
        lens.field.at(before, &bend);
        bend += Eigen::Matrix2d::Identity();
        const Eigen::Matrix<double, 2, 3> by_point = bend * slope.by_point;
        const Eigen::Vector3d in_rig = inverse(pose) * at;
        auto whole = out.whole.middleRows<2>(row);
        Eigen::Matrix<double, 3, 6> by_motion;
        by_motion << -skew(in_rig), Eigen::Matrix3d::Identity();
        whole = by_point * pose.rotation * by_motion * motions.follow.middleRows<6>(motion);
        if (layout.camera[c] >= 0) {
            Eigen::Matrix<double, 3, 6> by_six;
            by_six << -skew(pose.rotation * in_rig) * rotation_right_jacobian(-six.head<3>()),
                Eigen::Matrix3d::Identity();
            whole.middleCols<6>(layout.camera[c]) += by_point * by_six;
        }
        out.told.middleRows<2>(row) =
            whole + bend * slope.by_intrinsics.leftCols(count) * wanted.middleRows(lens_row, count);
        const BsplineGrid& grid = lens.field.grid;
        const BsplineSupport s = bspline_support(grid, before);
        for (int part = 0; part < 2; ++part) {
            for (int j = 0; j < 4; ++j) {
                whole.row(part).segment<4>(layout.field[c] + part * grid.count() + (s.row + j) * grid.columns
                                           + s.column) += s.y[j] * s.x.transpose();
            }
        }
    }
    return out;
}

}  // namespace

FlexibleCovariance flexible_covariance(const Scene& scene, const Solution& solution, const Prior* prior,
                                       double noise)
{
    const FlexibleInformation information = flexible_information(
        solution.set.views, scene.boards, scene.cameras, solution.gauge_cameras, prior, noise, solution.state);
    FlexibleCovariance out;
    if (information.matrix.size() == 0) {
        return out;
    }
    const Eigen::VectorXd scale = information.matrix.diagonal().unaryExpr(
        [](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 1.0; });
    const Eigen::MatrixXd equal = scale.asDiagonal() * information.matrix * scale.asDiagonal();
    const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> llt(equal);
    if (llt.info() != Eigen::Success) {
        return out;
    }
    // The square root of their covariance, for rows in terms of the columns.
    const auto half_of = [&](const Eigen::MatrixXd& rows) {
        return Eigen::MatrixXd(llt.matrixL().solve(scale.asDiagonal() * rows.transpose()));
    };
    const Motions motions = motions_of(information, solution);
    const Eigen::MatrixXd wanted = rows_wanted(solution.set.views, information.layout, solution.cameras,
                                               solution.gauge_cameras, solution.state);
    Eigen::MatrixXd all(wanted.rows() + motions.follow.rows(), wanted.cols());
    all << wanted, motions.follow;
    const Eigen::MatrixXd half = half_of(all);
    out.matrix = half.transpose() * half;
    for (std::size_t part = 0; part < motions.own.size(); ++part) {
        const Eigen::Index at = wanted.rows() + static_cast<Eigen::Index>(6 * part);
        out.matrix.block<6, 6>(at, at) += motions.own[part];
    }
    out.fields.resize(scene.cameras.size());
    Eigen::Index lens_row = 0;
    for (const int camera : solution.cameras) {
        const auto c = static_cast<std::size_t>(camera);
        if (information.layout.field[c] >= 0) {
            const PixelRows rows =
                pixel_rows(scene, solution, camera, information.layout, motions, wanted, lens_row);
            const Eigen::MatrixXd whole = half_of(rows.whole);
            const Eigen::MatrixXd told = half_of(rows.told);
            FieldErrors& field = out.fields[c];
            field = {kFieldErrorColumns, kFieldErrorRows, {}};
            field.px2.assign(kFieldErrorColumns * kFieldErrorRows, Eigen::Matrix2d::Zero());
            for (std::size_t i = 0; i < rows.places.size(); ++i) {
                const auto a = whole.middleCols<2>(static_cast<Eigen::Index>(2 * i));
                const auto b = told.middleCols<2>(static_cast<Eigen::Index>(2 * i));
                field.px2[rows.places[i]] = a.transpose() * a - b.transpose() * b;
            }
        }
        lens_row += static_cast<Eigen::Index>(solution.state.lenses[c].intrinsics.size())
                    + (is_gauge(solution, camera) ? 0 : 6);
    }
    return out;
}

}  // namespace rig
