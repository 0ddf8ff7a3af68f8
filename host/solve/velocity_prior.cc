// See velocity_prior.h.
#include "host/solve/velocity_prior.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "host/base/parallel.h"
#include "host/solve/rolling_kernel.h"

namespace rig {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix12 = Eigen::Matrix<double, 12, 12>;

// A board that is held still; a point 1 m from its origin then moves by less than a hundredth of a
// pixel in a tenth of a second.
constexpr double kTurnMinRadS = 1e-5;
constexpr double kShiftMinMmS = 1e-2;
constexpr int kRounds = 300;
constexpr double kSettledPart = 1e-6;
// Residuals larger than that are no noise, but what is still to be solved for: if they counted as
// noise, no velocity would rise above it.
constexpr double kFactorMost = 3.0;
// Deviations that change by less leave the solution where it was: its share in what is known of a
// velocity is small where boards move, and velocities are zero where they do not.
constexpr double kDuePart = 0.05;
// Of a camera whose row time is not known: what it takes to read an image, to start with.
constexpr double kImageTimeS = 0.02;

// Diagonal of D^-1.
Vector6 weight_of(const VelocityDeviation& deviation)
{
    Vector6 out;
    out.head<3>().setConstant(1.0 / (deviation.turn_rad_s * deviation.turn_rad_s));
    out.tail<3>().setConstant(1.0 / (deviation.shift_mm_s * deviation.shift_mm_s));
    return out;
}

double row_time_to_start_s(const SceneCamera& camera)
{
    return camera.estimate_row_time ? kImageTimeS / camera.height_px : 1e-9 * camera.row_time_ns;
}

struct Pull {
    Matrix6 information;
    Vector6 pull;
};

// Pose and velocity by one view.
bool body_information(const View& view, const RigState& state, Matrix12* out)
{
    LocalQuadratic quadratic;
    if (!rolling_quadratic(view, state, 0.0, true, &quadratic)) {
        return false;
    }
    const RollingMaps maps = rolling_maps(view, state);
    Eigen::Matrix<double, kRollingMotionCount, 12> by;
    by << maps.link[1], maps.velocity;
    *out = by.transpose() * quadratic.normal.bottomRightCorner<12, 12>() * by;
    return true;
}

std::vector<Pull> pulls_of(const std::vector<View>& views, const std::vector<double>& noise_factor,
                           int threads, const RigState& state)
{
    std::vector<Matrix12> own(views.size(), Matrix12::Zero());
    parallel_for(views.size(), threads, 4, [&](std::size_t i) {
        const double factor =
            std::clamp(noise_factor[static_cast<std::size_t>(views[i].camera)], 1.0, kFactorMost);
        if (!views[i].clock.moves || !body_information(views[i], state, &own[i])) {
            own[i].setZero();
        }
        own[i] /= factor * factor;
    });
    std::vector<Matrix12> by_pose(state.shutter.velocity.size(), Matrix12::Zero());
    for (std::size_t i = 0; i < views.size(); ++i) {
        by_pose[views[i].pose] += own[i];
    }
    const Vector6 weight = velocity_weight(state.shutter);
    std::vector<Pull> out;
    for (std::size_t p = 0; p < by_pose.size(); ++p) {
        const Matrix12& n = by_pose[p];
        const Eigen::LLT<Matrix6> pose(n.topLeftCorner<6, 6>());
        if (n.bottomRightCorner<6, 6>().trace() <= 0.0 || pose.info() != Eigen::Success) {
            continue;
        }
        const Matrix6 across = n.topRightCorner<6, 6>();
        Pull pull;
        pull.information = n.bottomRightCorner<6, 6>() - across.transpose() * pose.solve(across);
        pull.pull = pull.information * state.shutter.velocity[p]
                    + weight.cwiseProduct(state.shutter.velocity[p]);
        out.push_back(pull);
    }
    return out;
}

VelocityDeviation next(const std::vector<Pull>& pulls, const VelocityDeviation& now, double* all_told)
{
    const Vector6 weight = weight_of(now);
    Eigen::Vector2d squares = Eigen::Vector2d::Zero();
    Eigen::Vector2d told = Eigen::Vector2d::Zero();
    for (const Pull& pull : pulls) {
        Matrix6 sum = pull.information;
        sum.diagonal() += weight;
        const Eigen::LLT<Matrix6> factor(sum);
        const Matrix6 covariance = factor.solve(Matrix6::Identity());
        const Vector6 velocity = covariance * pull.pull;
        for (int part = 0; part < 2; ++part) {
            squares[part] += velocity.segment<3>(3 * part).squaredNorm();
            told[part] += 3.0 - weight[3 * part] * covariance.diagonal().segment<3>(3 * part).sum();
        }
    }
    *all_told = told.sum();
    const auto root = [&](int part) {
        return told[part] > 0.0 ? std::sqrt(squares[part] / told[part]) : 0.0;
    };
    return {std::max(kTurnMinRadS, root(0)), std::max(kShiftMinMmS, root(1))};
}

bool differ(const VelocityDeviation& a, const VelocityDeviation& b, double part)
{
    return std::abs(a.turn_rad_s / b.turn_rad_s - 1.0) > part
           || std::abs(a.shift_mm_s / b.shift_mm_s - 1.0) > part;
}

// Bodies that do not move have one time; the others' views that of their stamp. A pose is given for
// the mean time of the rows that saw it, so that its own error has least to do with its velocity's.
void set_clocks(const Scene& scene, ViewSet* set)
{
    std::vector<double> sum(set->poses.size(), 0.0);
    std::vector<double> count(set->poses.size(), 0.0);
    for (View& view : set->views) {
        const SceneCamera& camera = scene.cameras[static_cast<std::size_t>(view.camera)];
        const auto stamp = scene.stamps_ns.find({view.camera, view.frame});
        view.clock = RowClock();
        view.clock.moves = !scene.boards[static_cast<std::size_t>(view.board)].is_static;
        if (stamp != scene.stamps_ns.end()) {
            view.clock.start_s = 1e-9 * static_cast<double>(stamp->second);
        }
        for (const ViewPoint& point : view.points) {
            sum[view.pose] += view.clock.at_s(row_time_to_start_s(camera), point.pixel.y());
            count[view.pose] += 1.0;
        }
    }
    for (std::size_t p = 0; p < set->poses.size(); ++p) {
        set->poses[p].time_s = count[p] > 0.0 ? sum[p] / count[p] : 0.0;
    }
    for (View& view : set->views) {
        view.clock.start_s -= set->poses[view.pose].time_s;
    }
}

}  // namespace

Vector6 velocity_weight(const Shutter& shutter)
{
    return weight_of(shutter.deviation) / (shutter.wider * shutter.wider);
}

bool update_velocity_deviation(const std::vector<View>& views, const std::vector<double>& noise_factor,
                               int threads, RigState* state)
{
    const std::vector<Pull> pulls = pulls_of(views, noise_factor, threads, *state);
    const VelocityDeviation before = state->shutter.deviation;
    VelocityDeviation now = before;
    if (pulls.empty()) {
        return false;
    }
    double told = 0.0;
    for (int round = 0; round < kRounds; ++round) {
        const VelocityDeviation then = next(pulls, now, &told);
        const bool settled = !differ(then, now, kSettledPart);
        now = then;
        if (settled) {
            break;
        }
    }
    state->shutter.deviation = now;
    state->shutter.told = told / static_cast<double>(pulls.size());
    return differ(now, before, kDuePart);
}

void start_shutter(const Scene& scene, ViewSet* set, RigState* state)
{
    state->shutter = Shutter();
    const bool rolls = std::any_of(set->views.begin(), set->views.end(), [&](const View& view) {
        const SceneCamera& camera = scene.cameras[static_cast<std::size_t>(view.camera)];
        return !scene.boards[static_cast<std::size_t>(view.board)].is_static
               && (camera.row_time_ns != 0.0 || camera.estimate_row_time);
    });
    if (!rolls) {
        return;
    }
    state->shutter.velocity.assign(set->poses.size(), Vector6::Zero());
    for (const SceneCamera& camera : scene.cameras) {
        state->shutter.row_time_s.push_back(row_time_to_start_s(camera));
        state->shutter.estimated.push_back(camera.estimate_row_time);
    }
    set_clocks(scene, set);
}

void start_own_shutter(const Scene& scene, const SceneCamera& camera, std::vector<View>* views,
                       RigState* state)
{
    const double row_s = row_time_to_start_s(camera);
    bool moves = false;
    for (View& view : *views) {
        view.clock = RowClock();
        view.clock.moves = row_s != 0.0 && !scene.boards[static_cast<std::size_t>(view.board)].is_static;
        view.clock.start_s = -0.5 * row_s * (camera.height_px - 1);
        moves = moves || view.clock.moves;
    }
    if (moves) {
        state->shutter.velocity.assign(state->rig_from_body.size(), Vector6::Zero());
        state->shutter.row_time_s = {row_s};
        state->shutter.estimated = {0};
    }
}

}  // namespace rig
