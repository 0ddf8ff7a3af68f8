// See rolling_kernel.h.
#include "host/solve/rolling_kernel.h"

#include <cmath>

namespace rig {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Rows of J gathered before they are multiplied.
enum { kSlabRows = 64, kColumnsMax = kIntrinsicsMax + kRollingMotionCount };

// Motion of a view's board in the camera's frame, about the board's origin, by a velocity of its
// body, about the body's: with R_c of cam_from_rig and s from the body's origin to the board's, in
// the camera's axes, w_m = R_c w, t_m = R_c v - [s]x R_c w.
Matrix6 motion_by_velocity(const View& view, const RigState& state)
{
    const PoseChain chain = chain_of(state, view);
    const Eigen::Matrix3d turn = rotation_exp(chain.link[0].head<3>());
    Eigen::Vector3d arm = Eigen::Vector3d::Zero();
    if (chain.count == PoseChain::kLinksMax) {
        arm = turn * rotation_exp(chain.link[1].head<3>()) * chain.link[2].tail<3>();
    }
    Matrix6 out;
    out << turn, Eigen::Matrix3d::Zero(), -skew(arm) * turn, turn;
    return out;
}

// Sums of J'J and J'r by slabs of points.
class Sums {
public:
    explicit Sums(Eigen::Index columns) : columns_(columns)
    {
        normal.setZero(columns, columns);
        gradient.setZero(columns);
        slab_.resize(kSlabRows, columns);
    }

    // The next two rows of J.
    auto rows() { return slab_.middleRows<2>(filled_); }
    void take(const Eigen::Vector2d& residual)
    {
        residual_.segment<2>(filled_) = residual;
        filled_ += 2;
        if (filled_ == kSlabRows) {
            flush();
        }
    }

    void flush()
    {
        const auto part = slab_.topRows(filled_);
        normal.noalias() += part.transpose() * part;
        gradient.noalias() += part.transpose() * residual_.head(filled_);
        filled_ = 0;
    }

    Eigen::MatrixXd normal;
    Eigen::VectorXd gradient;

private:
    Eigen::Index columns_;
    Eigen::Index filled_ = 0;
    Eigen::Matrix<double, kSlabRows, Eigen::Dynamic, Eigen::ColMajor, kSlabRows, kColumnsMax> slab_;
    Eigen::Matrix<double, kSlabRows, 1> residual_;
};

}  // namespace

RollingMaps rolling_maps(const View& view, const RigState& state)
{
    RollingMaps out;
    const PoseChain chain = chain_of(state, view);
    Matrix6 maps[PoseChain::kLinksMax];
    motion_maps(chain, maps);
    for (int i = 0; i < chain.count; ++i) {
        out.link[i] << maps[i], Matrix6::Zero();
    }
    out.velocity.setZero();
    out.row_time.setZero();
    if (view.clock.moves) {
        const Matrix6 map = motion_by_velocity(view, state);
        const double row_s = state.shutter.row_time_s[static_cast<std::size_t>(view.camera)];
        out.velocity << view.clock.start_s * map, row_s * map;
        out.row_time.tail<6>() = map * state.shutter.velocity[view.pose];
    }
    return out;
}

MotionChange motion_change(const View& view, const RigState& state)
{
    const RowClock& clock = view.clock;
    if (!clock.moves) {
        return MotionChange();
    }
    const Matrix6 map = motion_by_velocity(view, state);
    const Vector6& velocity = state.shutter.velocity[view.pose];
    const double row_s = state.shutter.row_time_s[static_cast<std::size_t>(view.camera)];
    return {clock.start_s * (map * (velocity - clock.held_velocity)),
            map * (row_s * velocity - clock.held_row_s * clock.held_velocity)};
}

bool rolling_quadratic(const View& view, const RigState& state, double cauchy, bool derive,
                       LocalQuadratic* out)
{
    const Camera& lens = state.lenses[static_cast<std::size_t>(view.camera)];
    const Pose pose = cam_from_board(state, view);
    const MotionChange change = motion_change(view, state);
    const auto count = static_cast<Eigen::Index>(lens.intrinsics.size());
    const double c2 = cauchy * cauchy;
    out->squares = 0.0;
    Sums sums(count + kRollingMotionCount);
    for (const ViewPoint& point : view.points) {
        if (!point.used) {
            continue;
        }
        const Eigen::Vector3d turned = pose.rotation * point.at_mm;
        Eigen::Vector2d pixel;
        ProjectionJacobian jacobian;
        if (!project_lens(lens, lens.intrinsics.data(), turned + pose.translation_mm, &pixel, &jacobian)) {
            return false;
        }
        Eigen::Matrix<double, 2, kMotionCount> by_motion;
        by_motion << -jacobian.by_point * skew(turned), jacobian.by_point;
        const double row = point.pixel.y();
        pixel += by_motion * (change.first + row * change.growth);
        const double weight = 1.0 / static_cast<double>(point.sigma_px);
        const Eigen::Vector2d residual =
            weight * (pixel + point.centre_offset_px.cast<double>() - point.pixel);
        const double s = residual.squaredNorm();
        out->squares += cauchy > 0.0 ? c2 * std::log1p(s / c2) : s;
        if (derive) {
            const double root = cauchy > 0.0 ? std::sqrt(1.0 / (1.0 + s / c2)) : 1.0;
            auto rows = sums.rows();
            rows.leftCols(count) = (root * weight) * jacobian.by_intrinsics.leftCols(count);
            rows.middleCols<kMotionCount>(count) = (root * weight) * by_motion;
            rows.rightCols<kMotionCount>() = (root * weight * row) * by_motion;
            sums.take(root * residual);
        }
    }
    if (derive) {
        sums.flush();
        out->normal = std::move(sums.normal);
        out->gradient = std::move(sums.gradient);
    }
    return true;
}

Eigen::MatrixXd rolling_normal(const LocalQuadratic& quadratic, const RollingMaps& maps, int links)
{
    const Eigen::Index lens = quadratic.normal.rows() - kRollingMotionCount;
    Eigen::MatrixXd by = Eigen::MatrixXd::Zero(lens + kRollingMotionCount, lens + 6 * (links + 1) + 1);
    by.topLeftCorner(lens, lens).setIdentity();
    for (int i = 0; i < links; ++i) {
        by.block<kRollingMotionCount, 6>(lens, lens + 6 * i) = maps.link[i];
    }
    by.block<kRollingMotionCount, 6>(lens, lens + 6 * links) = maps.velocity;
    by.bottomRightCorner<kRollingMotionCount, 1>() = maps.row_time;
    return by.transpose() * quadratic.normal * by;
}

RowPoses::RowPoses(const View& view, const RigState& state)
    : clock_(view.clock), camera_(pose_exp(state.cam_from_rig[static_cast<std::size_t>(view.camera)])),
      body_(pose_exp(state.rig_from_body[view.pose])), still_(cam_from_board(state, view))
{
    if (view.member != kNoMember) {
        member_ = pose_exp(state.body_from_board[static_cast<std::size_t>(view.member)]);
    }
    if (clock_.moves) {
        velocity_ = state.shutter.velocity[view.pose];
        row_time_s_ = state.shutter.row_time_s[static_cast<std::size_t>(view.camera)];
    }
}

Pose RowPoses::at(double row) const
{
    return camera_ * (moved_by(body_, velocity_, clock_.at_s(row_time_s_, row)) * member_);
}

Eigen::Vector2d shutter_shift(const Camera& lens, const Pose& still, const Pose& there,
                              const Eigen::Vector3d& at_mm)
{
    Eigen::Vector2d moved;
    Eigen::Vector2d fixed;
    if (!project_lens(lens, lens.intrinsics.data(), there * at_mm, &moved, nullptr)
        || !project_lens(lens, lens.intrinsics.data(), still * at_mm, &fixed, nullptr)) {
        return Eigen::Vector2d::Zero();
    }
    return moved - fixed;
}

void hold_velocity(const RigState& state, View* view)
{
    if (view->clock.moves) {
        view->clock.held_velocity = state.shutter.velocity[view->pose];
        view->clock.held_row_s = state.shutter.row_time_s[static_cast<std::size_t>(view->camera)];
    }
}

}  // namespace rig
