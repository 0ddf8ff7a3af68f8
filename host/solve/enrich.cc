// See enrich.h.
#include "host/solve/enrich.h"

#include <fmt/format.h>

#include "host/solve/flexible_covariance.h"
#include "host/solve/surface.h"

namespace rig {
namespace {

// Fits everything in `state` to all views.
RefineResult fit_all(const Scene& scene, const Solution& solution, int threads, std::vector<View>* views,
                     RigState* state)
{
    FlexibleOptions options;
    options.gauge_cameras = solution.gauge_cameras;
    const auto solve = [&](std::vector<View>* own, RigState* moved) {
        const bool usable = flexible_bundle(*own, views_in_use(*own), scene.boards, scene.cameras,
                                            options, moved)
                                .usable;
        lift_points(*moved, scene.boards, own);
        return usable;
    };
    return settle(solve, threads, views, state);
}

}  // namespace

void enrich(const Scene& scene, const SolveOptions& options, const Progress& progress,
            Solution* solution)
{
    const ChoiceOptions choice{options.choose_lens, !options.flat, solution->gauge_cameras};
    if (!choice.lenses && !choice.surfaces) {
        return;
    }
    RigState state = solution->state;
    solution->choice = choose_models(scene, solution->set.views, choice, &state);
    for (const ModelTrial& trial : solution->choice.trials) {
        progress(fmt::format("held-out frames, {}: RMS {:.4f} -> {:.4f} sigmas, {:.1f} times what is "
                             "significant{}",
                             trial.what, trial.before, trial.after, trial.significance,
                             trial.taken ? ", taken" : ""));
    }
    if (!solution->choice.changed) {
        return;
    }
    std::vector<View> views = solution->set.views;
    const RefineResult refined = fit_all(scene, *solution, options.threads, &views, &state);
    if (!refined.converged) {
        progress("the richer model does not settle over all frames; kept the simple one");
        solution->choice.changed = false;
        return;
    }
    solution->state = std::move(state);
    solution->set.views = std::move(views);
    solution->noise_factor = refined.noise_factor;
    solution->spline_covariance =
        flexible_covariance(solution->set.views, scene, solution->cameras, solution->gauge_cameras,
                            solution->state);
}

}  // namespace rig
