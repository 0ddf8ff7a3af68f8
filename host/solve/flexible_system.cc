// See flexible_system.h. With w the weights of a point's control points, e the derivative of its
// whitened residual by everything dense (intrinsics, motion) and h that by the board's height:
//     field x by dense  w e_x'     field by field  w w' / sigma^2     surface by surface  w w' |h|^2
#include "host/solve/flexible_system.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <optional>

#include "host/solve/rolling_kernel.h"

namespace rig {
namespace {

// A point nearer than this to the plane of the lens is no measurement.
constexpr double kDepthMinMm = 1e-3;

enum { kDenseMax = kIntrinsicsMax + kRollingMotionCount, kSlabRows = 64 };

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// What one point adds. Motion: a small turn and shift of the board in the camera's frame,
//     p_cam = q + w x q + t_motion + translation,  q = R p_board,  motion = (w, t_motion).
struct PointRow {
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, kDenseMax> dense;  // intrinsics, motion, and where shutters roll its growth
    Eigen::Vector2d by_height;
    BsplineSupport field;
    BsplineSupport surface;
    double weight = 0.0;  // 1 / sigma
};

// Weights of the sixteen control points, four a row.
Eigen::Matrix4d tensor(const BsplineSupport& s)
{
    return s.x * s.y.transpose();  // column j: row j of the support
}

// A view's pose, lens and surface, unpacked once for all its points.
class Sight {
public:
    Sight(const View& view, const RigState& state, const std::vector<Board>& boards)
        : lens_(state.lenses[static_cast<std::size_t>(view.camera)]),
          board_(boards[static_cast<std::size_t>(view.board)]), pose_(cam_from_board(state, view)),
          lens_count_(static_cast<Eigen::Index>(lens_.intrinsics.size())),
          surface_(surface_of(state, view.board)), rolls_(!state.shutter.empty())
    {
        if (rolls_) {
            change_ = motion_change(view, state);
        }
    }

    bool row(const ViewPoint& point, bool derive, PointRow* out) const
    {
        Eigen::Vector3d at = board_.points[point.point].at_mm;
        if (surface_ != nullptr) {
            out->surface = bspline_support(surface_->grid, at.head<2>());
            at.z() += bspline_value(surface_->grid, surface_->control.data(), at.head<2>(), nullptr);
        }
        const Eigen::Vector3d turned = pose_.rotation * at;
        const Eigen::Vector3d in_camera = turned + pose_.translation_mm;
        Eigen::Vector2d pixel;
        ProjectionJacobian derivative;
        if ((lens_.model != CameraModel::kFisheye && in_camera.z() < kDepthMinMm)
            || !project_formula(lens_.model, lens_.intrinsics.data(), in_camera, &pixel,
                                derive || rolls_ ? &derivative : nullptr)) {
            return false;
        }
        Eigen::Matrix2d bend = Eigen::Matrix2d::Identity();
        if (!lens_.field.empty()) {
            out->field = bspline_support(lens_.field.grid, pixel);
            Eigen::Matrix2d slope;
            pixel += lens_.field.at(pixel, &slope);
            bend += slope;
        }
        if (rolls_) {
            const Vector6 motion = change_.first + point.pixel.y() * change_.growth;
            pixel += bend * derivative.by_point * (motion.head<3>().cross(turned) + motion.tail<3>());
        }
        out->weight = 1.0 / point.sigma_px;
        out->residual = out->weight * (pixel + point.centre_offset_px.cast<double>() - point.pixel);
        if (derive) {
            const Eigen::Matrix2d scale = out->weight * bend;
            const Eigen::Matrix<double, 2, 3> by_point = scale * derivative.by_point;
            out->dense.leftCols(lens_count_) = scale * derivative.by_intrinsics.leftCols(lens_count_);
            out->dense.middleCols<3>(lens_count_) = -by_point * skew(turned);
            out->dense.middleCols<3>(lens_count_ + 3) = by_point;
            out->by_height = by_point * pose_.rotation.col(2);
            if (rolls_) {
                out->dense.middleCols<6>(lens_count_ + 6) =
                    point.pixel.y() * out->dense.middleCols<6>(lens_count_);
            }
        }
        return true;
    }

    Eigen::Index lens_count() const { return lens_count_; }
    Eigen::Index dense_count() const { return lens_count_ + (rolls_ ? kRollingMotionCount : 6); }
    const Surface* surface() const { return surface_; }
    const SplineField& field() const { return lens_.field; }

private:
    const Camera& lens_;
    const Board& board_;
    Pose pose_;
    Eigen::Index lens_count_;
    const Surface* surface_;
    bool rolls_;
    MotionChange change_;
};

// A pose of the chain between board and camera that has columns in the system, and how the motion
// follows it.
struct Link {
    Eigen::Index at = 0;
    Matrix6 map;
};

// What a view's motion leads on to: the board pose that is eliminated, and the links with columns.
struct Links {
    Matrix6 pose;
    std::vector<Link> others;
};

Links links_of(const View& view, const RigState& state, const FlexibleLayout& layout)
{
    const PoseChain chain = chain_of(state, view);
    Matrix6 maps[PoseChain::kLinksMax];
    motion_maps(chain, maps);
    Links links{maps[1], {}};
    const Eigen::Index camera = layout.camera[static_cast<std::size_t>(view.camera)];
    if (camera >= 0) {
        links.others.push_back({camera, maps[0]});
    }
    const Eigen::Index member =
        view.member == kNoMember ? -1 : layout.member[static_cast<std::size_t>(view.member)];
    if (member >= 0) {
        links.others.push_back({member, maps[2]});
    }
    return links;
}

// The same where shutters roll: motion and its growth, the velocity eliminated as well.
struct RollingLinks {
    Matrix12x6 pose;
    Matrix12x6 velocity;
    std::vector<std::pair<Eigen::Index, Eigen::MatrixXd>> others;  // first column, map
};

RollingLinks rolling_links_of(const View& view, const RigState& state, const FlexibleLayout& layout)
{
    const RollingMaps maps = rolling_maps(view, state);
    RollingLinks links{maps.link[1], maps.velocity, {}};
    const auto add = [&](Eigen::Index at, const Eigen::MatrixXd& map) {
        if (at >= 0) {
            links.others.emplace_back(at, map);
        }
    };
    add(layout.camera[static_cast<std::size_t>(view.camera)], maps.link[0]);
    if (view.member != kNoMember) {
        add(layout.member[static_cast<std::size_t>(view.member)], maps.link[2]);
    }
    add(layout.row_time[static_cast<std::size_t>(view.camera)], maps.row_time);
    return links;
}

// Sums of one view, gathered apart and then put in place: its dense block, and what its control points
// have to do with the dense columns. What control points have to do with each other goes to the
// system at once.
class ViewSums {
public:
    ViewSums(const View& view, const Sight& sight, const FlexibleLayout& layout, FlexibleSystem* system)
        : view_(view), sight_(sight), system_(system), columns_(sight.dense_count()),
          lens_(layout.lens[static_cast<std::size_t>(view.camera)]),
          field_(layout.field[static_cast<std::size_t>(view.camera)]),
          surface_(layout.surface[static_cast<std::size_t>(view.board)])
    {
        dense_.setZero(columns_, columns_);
        gradient_.setZero(columns_);
        slab_.resize(kSlabRows, columns_);
        if (field_ >= 0) {
            fields_.setZero(2 * sight.field().grid.count(), columns_);
        }
        if (surface_ >= 0) {
            heights_.setZero(sight.surface()->grid.count(), columns_);
        }
    }

    void add(const PointRow& row)
    {
        slab_.middleRows<2>(filled_) = row.dense.leftCols(columns_);
        slab_residual_.segment<2>(filled_) = row.residual;
        filled_ += 2;
        if (filled_ == kSlabRows) {
            flush();
        }
        if (field_ >= 0) {
            add_field(row);
        }
        if (surface_ >= 0) {
            add_surface(row);
        }
        if (field_ >= 0 && surface_ >= 0) {
            add_both(row);
        }
    }

    void finish(const Links& links)
    {
        flush();
        const Eigen::Index k = sight_.lens_count();
        const auto pose = static_cast<Eigen::Index>(6 * view_.pose);
        const Matrix6 motion = dense_.bottomRightCorner(6, 6);
        const Eigen::Matrix<double, 6, 1> pull = gradient_.tail<6>();
        system_->own.middleCols<6>(pose) += links.pose.transpose() * motion * links.pose;
        system_->pose_gradient.segment<6>(pose) += links.pose.transpose() * pull;
        if (lens_ >= 0) {
            system_->normal.block(lens_, lens_, k, k) += dense_.topLeftCorner(k, k);
            system_->gradient.segment(lens_, k) += gradient_.head(k);
            system_->across.block(lens_, pose, k, 6) += dense_.topRightCorner(k, 6) * links.pose;
        }
        for (std::size_t i = 0; i < links.others.size(); ++i) {
            const Link& link = links.others[i];
            const Matrix6 half = link.map.transpose() * motion;
            system_->gradient.segment<6>(link.at) += link.map.transpose() * pull;
            system_->across.block<6, 6>(link.at, pose) += half * links.pose;
            for (std::size_t j = 0; j <= i; ++j) {
                system_->normal.block<6, 6>(link.at, links.others[j].at) += half * links.others[j].map;
            }
            if (lens_ >= 0) {
                system_->normal.block(link.at, lens_, 6, k) +=
                    link.map.transpose() * dense_.bottomLeftCorner(6, k);
            }
        }
        couple(field_, fields_, links);
        couple(surface_, heights_, links);
    }

    // Columns that stand further right are always rows of the lower triangle: row times come last.
    void finish(const RollingLinks& links)
    {
        flush();
        const Eigen::Index k = sight_.lens_count();
        const auto pose = static_cast<Eigen::Index>(6 * view_.pose);
        const Eigen::MatrixXd motion = dense_.bottomRightCorner<12, 12>();
        const Vector12 pull = gradient_.tail<12>();
        const Eigen::MatrixXd by_pose = motion * links.pose;
        const Eigen::MatrixXd by_velocity = motion * links.velocity;
        system_->own.middleCols<6>(pose) += links.pose.transpose() * by_pose;
        system_->pose_gradient.segment<6>(pose) += links.pose.transpose() * pull;
        system_->velocity_own.middleCols<6>(pose) += links.velocity.transpose() * by_velocity;
        system_->velocity_by_pose.middleCols<6>(pose) += links.velocity.transpose() * by_pose;
        system_->velocity_gradient.segment<6>(pose) += links.velocity.transpose() * pull;
        if (lens_ >= 0) {
            system_->normal.block(lens_, lens_, k, k) += dense_.topLeftCorner(k, k);
            system_->gradient.segment(lens_, k) += gradient_.head(k);
            add_across(lens_, dense_.topRightCorner(k, 12), links);
        }
        for (std::size_t i = 0; i < links.others.size(); ++i) {
            const auto& [at, map] = links.others[i];
            const Eigen::MatrixXd half = map.transpose() * motion;
            system_->gradient.segment(at, map.cols()) += map.transpose() * pull;
            add_across(at, half, links);
            for (std::size_t j = 0; j <= i; ++j) {
                const auto& [before, other] = links.others[j];
                system_->normal.block(at, before, map.cols(), other.cols()) += half * other;
            }
            if (lens_ >= 0) {
                system_->normal.block(at, lens_, map.cols(), k) +=
                    map.transpose() * dense_.bottomLeftCorner(12, k);
            }
        }
        couple(field_, fields_, links);
        couple(surface_, heights_, links);
    }

private:
    // By motion and growth: `rows` columns of the system from `at` on.
    void add_across(Eigen::Index at, const Eigen::MatrixXd& by_motion, const RollingLinks& links)
    {
        const auto pose = static_cast<Eigen::Index>(6 * view_.pose);
        system_->across.block(at, pose, by_motion.rows(), 6) += by_motion * links.pose;
        system_->velocity_across.block(at, pose, by_motion.rows(), 6) += by_motion * links.velocity;
    }

    void couple(Eigen::Index at, const Eigen::MatrixXd& coupling, const RollingLinks& links)
    {
        if (at < 0) {
            return;
        }
        const Eigen::Index k = sight_.lens_count();
        const Eigen::MatrixXd by_motion = coupling.rightCols<12>();
        add_across(at, by_motion, links);
        if (lens_ >= 0) {
            system_->normal.block(at, lens_, coupling.rows(), k) += coupling.leftCols(k);
        }
        for (const auto& [other, map] : links.others) {
            const Eigen::MatrixXd block = by_motion * map;
            if (other < at) {
                system_->normal.block(at, other, block.rows(), block.cols()) += block;
            } else {
                system_->normal.block(other, at, block.cols(), block.rows()) += block.transpose();
            }
        }
    }

    void flush()
    {
        const auto part = slab_.topRows(filled_);
        dense_.noalias() += part.transpose() * part;
        gradient_.noalias() += part.transpose() * slab_residual_.head(filled_);
        filled_ = 0;
    }

    // Rows of control points, in this view's coupling or in the system.
    static Eigen::Index line(const BsplineGrid& grid, const BsplineSupport& s, int j)
    {
        return static_cast<Eigen::Index>(s.row + j) * grid.columns + s.column;
    }

    void add_field(const PointRow& row)
    {
        const BsplineGrid& grid = sight_.field().grid;
        const Eigen::Matrix4d w = row.weight * tensor(row.field);
        for (int part = 0; part < 2; ++part) {
            const Eigen::Index first = field_ + part * grid.count();
            for (int j = 0; j < 4; ++j) {
                const Eigen::Index at = line(grid, row.field, j);
                fields_.middleRows<4>(part * grid.count() + at).noalias() +=
                    w.col(j) * row.dense.row(part).head(columns_);
                system_->gradient.segment<4>(first + at) += row.residual[part] * w.col(j);
                for (int i = 0; i <= j; ++i) {
                    system_->normal.block<4, 4>(first + at, first + line(grid, row.field, i)).noalias() +=
                        w.col(j) * w.col(i).transpose();
                }
            }
        }
    }

    void add_surface(const PointRow& row)
    {
        const BsplineGrid& grid = sight_.surface()->grid;
        const Eigen::Matrix4d w = tensor(row.surface);
        const Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, kDenseMax> by_dense =
            row.by_height.transpose() * row.dense.leftCols(columns_);
        const double square = row.by_height.squaredNorm();
        const double slope = row.by_height.dot(row.residual);
        for (int j = 0; j < 4; ++j) {
            const Eigen::Index at = line(grid, row.surface, j);
            heights_.middleRows<4>(at).noalias() += w.col(j) * by_dense;
            system_->gradient.segment<4>(surface_ + at) += slope * w.col(j);
            for (int i = 0; i <= j; ++i) {
                system_->normal.block<4, 4>(surface_ + at, surface_ + line(grid, row.surface, i))
                    .noalias() += square * w.col(j) * w.col(i).transpose();
            }
        }
    }

    void add_both(const PointRow& row)
    {
        const BsplineGrid& of_field = sight_.field().grid;
        const BsplineGrid& of_surface = sight_.surface()->grid;
        const Eigen::Matrix4d w = row.weight * tensor(row.field);
        const Eigen::Matrix4d v = tensor(row.surface);
        for (int part = 0; part < 2; ++part) {
            const Eigen::Index first = field_ + part * of_field.count();
            for (int j = 0; j < 4; ++j) {
                const Eigen::Vector4d scaled = row.by_height[part] * v.col(j);
                for (int i = 0; i < 4; ++i) {
                    system_->normal
                        .block<4, 4>(surface_ + line(of_surface, row.surface, j),
                                     first + line(of_field, row.field, i))
                        .noalias() += scaled * w.col(i).transpose();
                }
            }
        }
    }

    void couple(Eigen::Index at, const Eigen::MatrixXd& coupling, const Links& links)
    {
        if (at < 0) {
            return;
        }
        const Eigen::Index k = sight_.lens_count();
        const Eigen::Index rows = coupling.rows();
        system_->across.block(at, static_cast<Eigen::Index>(6 * view_.pose), rows, 6) +=
            coupling.rightCols<6>() * links.pose;
        if (lens_ >= 0) {
            system_->normal.block(at, lens_, rows, k) += coupling.leftCols(k);
        }
        for (const Link& link : links.others) {
            system_->normal.block(at, link.at, rows, 6) += coupling.rightCols<6>() * link.map;
        }
    }

    const View& view_;
    const Sight& sight_;
    FlexibleSystem* system_;
    Eigen::Index columns_;
    Eigen::Index lens_;
    Eigen::Index field_;
    Eigen::Index surface_;
    Eigen::MatrixXd dense_;
    Eigen::VectorXd gradient_;
    Eigen::MatrixXd fields_;
    Eigen::MatrixXd heights_;
    Eigen::Matrix<double, kSlabRows, Eigen::Dynamic, Eigen::ColMajor, kSlabRows, kDenseMax> slab_;
    Eigen::Matrix<double, kSlabRows, 1> slab_residual_;
    Eigen::Index filled_ = 0;
};

}  // namespace

bool sum_points(const std::vector<View>& views, const std::vector<char>& use,
                const std::vector<Board>& boards, const RigState& state, const FlexibleLayout& layout,
                bool derive, FlexibleSystem* out)
{
    out->squares = 0.0;
    out->points = 0;
    if (derive) {
        const auto poses = static_cast<Eigen::Index>(6 * state.rig_from_body.size());
        out->normal.setZero(layout.size, layout.size);
        out->gradient.setZero(layout.size);
        out->across.setZero(layout.size, poses);
        out->own.setZero(6, poses);
        out->pose_gradient.setZero(poses);
        const Eigen::Index moving = state.shutter.empty() ? 0 : poses;
        out->velocity_across.setZero(layout.size, moving);
        out->velocity_own.setZero(6, moving);
        out->velocity_by_pose.setZero(6, moving);
        out->velocity_gradient.setZero(moving);
    }
    PointRow row;
    for (std::size_t i = 0; i < views.size(); ++i) {
        if (!use[i]) {
            continue;
        }
        const Sight sight(views[i], state, boards);
        std::optional<ViewSums> sums;
        if (derive) {
            sums.emplace(views[i], sight, layout, out);
        }
        for (const ViewPoint& point : views[i].points) {
            if (!point.used) {
                continue;
            }
            if (!sight.row(point, derive, &row)) {
                return false;
            }
            out->squares += row.residual.squaredNorm();
            ++out->points;
            if (sums) {
                sums->add(row);
            }
        }
        if (sums && state.shutter.empty()) {
            sums->finish(links_of(views[i], state, layout));
        } else if (sums) {
            sums->finish(rolling_links_of(views[i], state, layout));
        }
    }
    return true;
}

}  // namespace rig
