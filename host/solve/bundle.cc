// See bundle.h. Ceres runs on one thread, so that sums have one order and the same input gives the
// same bits.
#include "host/solve/bundle.h"

#include <ceres/manifold.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <memory>
#include <set>

#include "host/solve/residuals.h"

namespace rig {
namespace {

// Indices of the intrinsics that are held; empty when all are free.
std::vector<int> held_intrinsics(CameraModel model, LensFreedom freedom)
{
    std::vector<int> held;
    const int count = kPinholeCount + distortion_count(model);
    for (int i = 2; i < count; ++i) {
        const bool radial = i == kPinholeCount || i == kPinholeCount + 1;
        if (freedom == LensFreedom::kFocal || (freedom == LensFreedom::kRadial && !radial)) {
            held.push_back(i);
        }
    }
    return held;
}

bool has_used_points(const View& view)
{
    return std::any_of(view.points.begin(), view.points.end(),
                       [](const ViewPoint& point) { return point.used; });
}

// All parameters in one array. Ceres orders the blocks of a group by their addresses, so separate
// allocations would let the heap decide in which order sums are made.
class Parameters {
public:
    explicit Parameters(const RigState& state)
    {
        for (const Vector6& pose : state.rig_from_board) {
            boards_.push_back(append(pose.data(), pose.data() + 6));
        }
        for (const Camera& lens : state.lenses) {
            lenses_.push_back(append(lens.intrinsics.data(), lens.intrinsics.data() + lens.intrinsics.size()));
        }
        for (const Vector6& pose : state.cam_from_rig) {
            cameras_.push_back(append(pose.data(), pose.data() + 6));
        }
    }
    double* board(std::size_t pose) { return values_.data() + boards_[pose]; }
    double* lens(std::size_t camera) { return values_.data() + lenses_[camera]; }
    double* camera(std::size_t camera) { return values_.data() + cameras_[camera]; }
    void copy_to(RigState* state)
    {
        for (std::size_t i = 0; i < boards_.size(); ++i) {
            state->rig_from_board[i] = Eigen::Map<const Vector6>(board(i));
        }
        for (std::size_t i = 0; i < lenses_.size(); ++i) {
            std::vector<double>& numbers = state->lenses[i].intrinsics;
            if (!numbers.empty()) {
                std::copy_n(lens(i), numbers.size(), numbers.begin());
            }
            state->cam_from_rig[i] = Eigen::Map<const Vector6>(camera(i));
        }
    }

private:
    std::size_t append(const double* begin, const double* end)
    {
        values_.insert(values_.end(), begin, end);
        return values_.size() - static_cast<std::size_t>(end - begin);
    }
    std::vector<double> values_;
    std::vector<std::size_t> boards_;
    std::vector<std::size_t> lenses_;
    std::vector<std::size_t> cameras_;
};

}  // namespace

BundleResult bundle(const std::vector<View>& views, const BundleOptions& options, RigState* state)
{
    ceres::Problem problem;
    Parameters parameters(*state);
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    std::set<std::size_t> cameras;
    for (const View& view : views) {
        if (!has_used_points(view)) {
            continue;
        }
        const auto camera = static_cast<std::size_t>(view.camera);
        const double cauchy = options.cauchy.empty() ? 0.0 : options.cauchy[camera];
        auto cost = std::make_unique<ViewCost>(&view, state->lenses[camera].model, cauchy);
        double* board = parameters.board(view.pose);
        problem.AddResidualBlock(cost.release(), nullptr, parameters.lens(camera),
                                 parameters.camera(camera), board);
        ordering->AddElementToGroup(board, 0);
        cameras.insert(camera);
    }
    for (const std::size_t camera : cameras) {
        const Camera& lens = state->lenses[camera];
        double* intrinsics = parameters.lens(camera);
        const std::vector<int> held = held_intrinsics(lens.model, options.lens);
        if (options.lens == LensFreedom::kNone) {
            problem.SetParameterBlockConstant(intrinsics);
        } else if (!held.empty()) {
            auto manifold = std::make_unique<ceres::SubsetManifold>(
                static_cast<int>(lens.intrinsics.size()), held);
            problem.SetManifold(intrinsics, manifold.release());
        }
        ordering->AddElementToGroup(intrinsics, 1);
        ordering->AddElementToGroup(parameters.camera(camera), 1);
        if (static_cast<int>(camera) == options.gauge_camera) {
            problem.SetParameterBlockConstant(parameters.camera(camera));
        }
    }
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::DENSE_SCHUR;
    solver.linear_solver_ordering = ordering;
    solver.num_threads = 1;
    solver.max_num_iterations = options.iterations_max;
    solver.function_tolerance = options.tolerance;
    solver.gradient_tolerance = 1e-14;
    solver.parameter_tolerance = 1e-12;
    solver.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);
    if (summary.IsSolutionUsable()) {
        parameters.copy_to(state);
    }
    return {summary.IsSolutionUsable(), summary.final_cost,
            static_cast<int>(summary.iterations.size())};
}

}  // namespace rig
