// See bundle.h. All views are evaluated together, on several threads, before Ceres asks for the
// first of them; Ceres itself runs on one thread and sums them in one order, so that the same input
// gives the same bits.
#include "host/solve/bundle.h"

#include <ceres/evaluation_callback.h>
#include <ceres/iteration_callback.h>
#include <ceres/manifold.h>
#include <ceres/normal_prior.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <set>

#include "host/base/parallel.h"
#include "host/solve/lens_prior.h"
#include "host/solve/prior.h"
#include "host/solve/rolling_cost.h"

namespace rig {
namespace {

// About zero, of a row time that is solved for: ten times that of a slow camera.
constexpr double kRowTimeDeviationS = 1e-3;

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
        for (std::size_t i = 0; i < state.rig_from_body.size(); ++i) {
            append(state.rig_from_body[i].data(), 6, &bodies_);
            if (!state.shutter.empty()) {  // behind the pose: one block
                values_.insert(values_.end(), state.shutter.velocity[i].begin(),
                               state.shutter.velocity[i].end());
            }
        }
        for (const Camera& lens : state.lenses) {
            append(lens.intrinsics.data(), lens.intrinsics.size(), &lenses_);
        }
        for (const Vector6& pose : state.cam_from_rig) {
            append(pose.data(), 6, &cameras_);
        }
        for (const Vector6& pose : state.body_from_board) {
            append(pose.data(), 6, &members_);
        }
        for (const double& row_time_s : state.shutter.row_time_s) {
            append(&row_time_s, 1, &row_times_);
        }
    }
    double* body(std::size_t pose) { return values_.data() + bodies_[pose]; }
    double* lens(std::size_t camera) { return values_.data() + lenses_[camera]; }
    double* camera(std::size_t camera) { return values_.data() + cameras_[camera]; }
    double* member(std::size_t member) { return values_.data() + members_[member]; }
    double* row_time(std::size_t camera) { return values_.data() + row_times_[camera]; }
    void copy_to(RigState* state) const
    {
        for (std::size_t i = 0; i < bodies_.size(); ++i) {
            state->rig_from_body[i] = Eigen::Map<const Vector6>(values_.data() + bodies_[i]);
            if (!state->shutter.empty()) {
                state->shutter.velocity[i] = Eigen::Map<const Vector6>(values_.data() + bodies_[i] + 6);
            }
        }
        for (std::size_t i = 0; i < lenses_.size(); ++i) {
            std::vector<double>& numbers = state->lenses[i].intrinsics;
            std::copy_n(values_.begin() + static_cast<std::ptrdiff_t>(lenses_[i]), numbers.size(),
                        numbers.begin());
            state->cam_from_rig[i] = Eigen::Map<const Vector6>(values_.data() + cameras_[i]);
        }
        for (std::size_t i = 0; i < members_.size(); ++i) {
            state->body_from_board[i] = Eigen::Map<const Vector6>(values_.data() + members_[i]);
        }
        for (std::size_t i = 0; i < row_times_.size(); ++i) {
            state->shutter.row_time_s[i] = values_[row_times_[i]];
        }
    }

private:
    void append(const double* numbers, std::size_t count, std::vector<std::size_t>* places)
    {
        places->push_back(values_.size());
        values_.insert(values_.end(), numbers, numbers + count);
    }
    std::vector<double> values_;
    std::vector<std::size_t> bodies_;
    std::vector<std::size_t> lenses_;
    std::vector<std::size_t> cameras_;
    std::vector<std::size_t> members_;
    std::vector<std::size_t> row_times_;
};

// Compresses all views whenever Ceres goes to another point. Most steps are taken, so derivatives
// are made with the first look at a point.
class Evaluation : public ceres::EvaluationCallback {
public:
    Evaluation(const BundleOptions& options, const RigState& state)
        : options_(options), parameters_(state), state_(state)
    {
    }
    void add(const View& view) { views_.push_back(&view); }
    void reserve_all() { rolls() ? rolling_.resize(views_.size()) : compressed_.resize(views_.size()); }
    bool rolls() const { return !state_.shutter.empty(); }
    const CompressedView* compressed(std::size_t i) const { return &compressed_[i]; }
    const RollingView* rolling(std::size_t i) const { return &rolling_[i]; }
    const std::vector<const View*>& views() const { return views_; }
    Parameters& parameters() { return parameters_; }
    void PrepareForEvaluation(bool, bool is_new) override
    {
        if (!is_new) {
            return;
        }
        parameters_.copy_to(&state_);
        parallel_for(views_.size(), options_.threads, 4, [&](std::size_t i) {
            const auto camera = static_cast<std::size_t>(views_[i]->camera);
            const double cauchy = options_.cauchy.empty() ? 0.0 : options_.cauchy[camera];
            if (rolls()) {
                compress(*views_[i], state_, cauchy, &rolling_[i]);
            } else {
                compress(*views_[i], state_, cauchy, &compressed_[i]);
            }
        });
    }

private:
    const BundleOptions& options_;
    Parameters parameters_;
    RigState state_;
    std::vector<const View*> views_;
    std::vector<CompressedView> compressed_;
    std::vector<RollingView> rolling_;
};

// The block of one view, and what else hangs on its parameters where shutters roll.
std::unique_ptr<ceres::CostFunction> view_cost(const RigState& state, const Evaluation& evaluation,
                                               std::size_t i)
{
    const View& view = *evaluation.views()[i];
    const auto camera = static_cast<std::size_t>(view.camera);
    const auto lens_count = static_cast<int>(state.lenses[camera].intrinsics.size());
    const bool is_member = view.member != kNoMember;
    if (evaluation.rolls()) {
        return std::make_unique<RollingCost>(evaluation.rolling(i), lens_count, is_member,
                                             state.shutter.estimated[camera] != 0);
    }
    return std::make_unique<ViewCost>(evaluation.compressed(i), lens_count, is_member);
}

// Velocities have a prior each; row times that are solved for come after all else.
void add_shutter(const RigState& state, const std::set<double*>& bodies,
                 const std::set<std::size_t>& cameras, Parameters* parameters, ceres::Problem* problem,
                 ceres::ParameterBlockOrdering* ordering)
{
    for (double* body : bodies) {
        auto known = std::make_unique<VelocityCost>(state.shutter);
        problem->AddResidualBlock(known.release(), nullptr, body);
    }
    for (const std::size_t camera : cameras) {
        if (state.shutter.estimated[camera] != 0) {
            // A weak word, so that there is a step while no velocity is known yet.
            auto known = std::make_unique<ceres::NormalPrior>(
                Eigen::MatrixXd::Constant(1, 1, 1.0 / kRowTimeDeviationS), Eigen::VectorXd::Zero(1));
            problem->AddResidualBlock(known.release(), nullptr, parameters->row_time(camera));
            ordering->AddElementToGroup(parameters->row_time(camera), 1);
            if (state.shutter.row_times_held) {
                problem->SetParameterBlockConstant(parameters->row_time(camera));
            }
        }
    }
}

// Adds the views' blocks; returns the cameras that take part.
std::set<std::size_t> add_views(const RigState& state, Evaluation* evaluation, ceres::Problem* problem,
                                ceres::ParameterBlockOrdering* ordering)
{
    std::set<std::size_t> cameras;
    std::set<double*> bodies;
    Parameters& parameters = evaluation->parameters();
    for (std::size_t i = 0; i < evaluation->views().size(); ++i) {
        const View& view = *evaluation->views()[i];
        const auto camera = static_cast<std::size_t>(view.camera);
        const bool is_member = view.member != kNoMember;
        auto cost = view_cost(state, *evaluation, i);
        double* body = parameters.body(view.pose);
        std::vector<double*> blocks{parameters.lens(camera), parameters.camera(camera), body};
        if (is_member) {
            blocks.push_back(parameters.member(static_cast<std::size_t>(view.member)));
            ordering->AddElementToGroup(blocks.back(), 1);
        }
        if (evaluation->rolls() && state.shutter.estimated[camera] != 0) {
            blocks.push_back(parameters.row_time(camera));
        }
        problem->AddResidualBlock(cost.release(), nullptr, blocks);
        ordering->AddElementToGroup(body, 0);
        bodies.insert(body);
        cameras.insert(camera);
    }
    if (evaluation->rolls()) {
        add_shutter(state, bodies, cameras, &parameters, problem, ordering);
    }
    return cameras;
}

// Says where a solve is, some seconds apart, so that short ones say nothing. Ends it where another
// step would: falls of the cost shrink at least as fast as from the last step to this one, and what
// the next would bring is below the tolerance. Ceres makes that step to see it, and then drops it. Not
// where velocities are unknowns: their falls do not shrink so.
class Reporter : public ceres::IterationCallback {
public:
    Reporter(const BundleOptions& options, bool foresees) : options_(options), foresees_(foresees) {}
    ceres::CallbackReturnType operator()(const ceres::IterationSummary& step) override
    {
        if (options_.progress && step.cumulative_time_in_seconds > said_s_ + kEverySeconds) {
            said_s_ = step.cumulative_time_in_seconds;
            options_.progress(fmt::format("  iteration {}, cost {:.6g}", step.iteration, step.cost));
        }
        const double before = step.iteration > 0 ? fall_ : 0.0;
        fall_ = step.step_is_successful ? step.cost_change : 0.0;
        const bool ends =
            foresees_ && before > 0.0 && fall_ > 0.0
            && fall_ * std::min(1.0, fall_ / before) <= options_.tolerance * step.cost;
        return ends ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
    }

private:
    static constexpr double kEverySeconds = 3.0;
    const BundleOptions& options_;
    const bool foresees_;
    double said_s_ = 0.0;
    double fall_ = 0.0;
};

ceres::Solver::Options solver_options(const BundleOptions& options)
{
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::DENSE_SCHUR;
    solver.num_threads = 1;
    solver.max_num_iterations = options.iterations_max;
    solver.function_tolerance = options.tolerance;
    solver.gradient_tolerance = 1e-14;
    solver.parameter_tolerance = 1e-12;
    solver.initial_trust_region_radius = options.trust;
    solver.logging_type = ceres::SILENT;
    return solver;
}

}  // namespace

BundleResult bundle(const std::vector<View>& views, const BundleOptions& options, RigState* state)
{
    Evaluation evaluation(options, *state);
    for (const View& view : views) {
        if (has_used_points(view)) {
            evaluation.add(view);
        }
    }
    evaluation.reserve_all();
    Parameters& parameters = evaluation.parameters();
    ceres::Problem::Options problem_options;
    problem_options.evaluation_callback = &evaluation;
    ceres::Problem problem(problem_options);
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    PriorBlocks blocks;
    blocks.lens.assign(state->lenses.size(), nullptr);
    blocks.cam_from_rig.assign(state->lenses.size(), nullptr);
    for (const std::size_t camera : add_views(*state, &evaluation, &problem, ordering.get())) {
        const Camera& lens = state->lenses[camera];
        double* intrinsics = parameters.lens(camera);
        const std::vector<int> held = held_intrinsics(lens.model, options.lens);
        auto prior = std::make_unique<LensPriorCost>(lens.model);
        if (options.lens == LensFreedom::kAll && prior->num_residuals() > 0) {
            problem.AddResidualBlock(prior.release(), nullptr, intrinsics);
        }
        if (options.lens == LensFreedom::kNone) {
            problem.SetParameterBlockConstant(intrinsics);
        } else if (!held.empty()) {
            auto manifold = std::make_unique<ceres::SubsetManifold>(
                static_cast<int>(lens.intrinsics.size()), held);
            problem.SetManifold(intrinsics, manifold.release());
        }
        blocks.lens[camera] = intrinsics;
        blocks.cam_from_rig[camera] = parameters.camera(camera);
        ordering->AddElementToGroup(intrinsics, 1);
        ordering->AddElementToGroup(parameters.camera(camera), 1);
        if (std::count(options.gauge_cameras.begin(), options.gauge_cameras.end(),
                       static_cast<int>(camera)) != 0) {
            problem.SetParameterBlockConstant(parameters.camera(camera));
        }
    }
    if (options.prior != nullptr) {
        add_prior(*options.prior, blocks, &problem);
    }
    Reporter reporter(options, state->shutter.empty());
    ceres::Solver::Options solver = solver_options(options);
    solver.callbacks.push_back(&reporter);
    solver.linear_solver_ordering = ordering;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);
    if (summary.IsSolutionUsable()) {
        parameters.copy_to(state);
    }
    return {summary.IsSolutionUsable(), summary.final_cost,
            static_cast<int>(summary.iterations.size())};
}

}  // namespace rig
