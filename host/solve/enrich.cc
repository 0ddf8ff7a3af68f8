// See enrich.h.
#include "host/solve/enrich.h"

#include <fmt/format.h>

#include <algorithm>

#include "host/solve/flexible.h"
#include "host/solve/flexible_covariance.h"
#include "host/solve/richer.h"
#include "host/solve/surface.h"
#include "host/solve/uncertainty.h"

namespace rig {
namespace {

// Fits everything in `state` to all views.
RefineResult fit_all(const Scene& scene, const Solution& solution, const SolveOptions& how,
                     std::vector<View>* views, RigState* state)
{
    FlexibleOptions options;
    options.gauge_cameras = solution.gauge_cameras;
    options.prior = how.prior;
    const auto solve = [&](std::vector<View>* own, RigState* moved) {
        const bool usable = flexible_bundle(*own, views_in_use(*own), scene.boards, scene.cameras,
                                            options, moved)
                                .usable;
        lift_points(*moved, scene.boards, own);
        return usable;
    };
    return settle(solve, how.threads, views, state);
}

// What a field wants to be told: as many views as a choice of models asks for, in half of its cells a
// point, and ten points to a control point, two numbers each, so that poses and noise leave it its share.
constexpr int kFieldPointsEach = 10;

Status check_data(const SceneCamera& known, int camera, const Camera& lens, const std::vector<View>& views)
{
    const BsplineGrid& grid = lens.field.grid;
    const int across = grid.columns - 3;
    std::vector<char> cells(static_cast<std::size_t>(across * (grid.rows - 3)), 0);
    std::size_t count = 0;
    int usable = 0;
    for (const View& view : views) {
        const std::size_t before = count;
        for (const ViewPoint& point : view.points) {
            if (view.camera == camera && point.used) {
                const BsplineSupport at = bspline_support(grid, point.pixel);
                cells[static_cast<std::size_t>(at.row * across + at.column)] = 1;
                ++count;
            }
        }
        usable += count > before ? 1 : 0;
    }
    const auto wanted = static_cast<std::size_t>(kFieldPointsEach * grid.count());
    const auto filled = static_cast<std::size_t>(std::count(cells.begin(), cells.end(), 1));
    if (usable >= kChoiceInstantsMin && count >= wanted && 2 * filled >= cells.size()) {
        return Status();
    }
    return Status::failure(fmt::format(
        "camera '{}' has too few data for a spline lens: {} views, {} points, in {} of the {} cells of the "
        "coarsest; it wants {} views, {} points, in half of the cells. Record more, or give it --model {}",
        known.name, usable, count, filled, cells.size(), static_cast<int>(kChoiceInstantsMin), wanted,
        camera_model_name(lens.model)));
}

// Gives fields to the cameras that are told to have one; true when there are any.
Result<bool> put_fields(const Scene& scene, const SolveOptions& options, const Solution& solution,
                        RigState* state)
{
    bool any = false;
    for (const int camera : solution.cameras) {
        const auto c = static_cast<std::size_t>(camera);
        if (options.lenses[c].field) {
            enrich_lens(scene.cameras[c], first_field(), &state->lenses[c]);
            const Status status =
                check_data(scene.cameras[c], camera, state->lenses[c], solution.set.views);
            if (!status.ok()) {
                return status;
            }
            any = true;
        }
    }
    return any;
}

}  // namespace

Status enrich(const Scene& scene, const SolveOptions& options, const Progress& progress,
              Solution* solution)
{
    RigState state = solution->state;
    const Result<bool> told = put_fields(scene, options, *solution, &state);
    if (!told.ok()) {
        return told.status();
    }
    ChoiceOptions choice;
    for (const LensChoice& lens : options.lenses) {
        choice.lenses.push_back(lens.richer || lens.field);
    }
    choice.surfaces = !options.flat;
    choice.gauge_cameras = solution->gauge_cameras;
    choice.prior = options.prior;
    if (!choice.surfaces && std::count(choice.lenses.begin(), choice.lenses.end(), 1) == 0) {
        return Status();
    }
    solution->choice = choose_models(scene, solution->set.views, choice, &state);
    for (const ModelTrial& trial : solution->choice.trials) {
        progress(fmt::format("held-out frames, {}: RMS {:.4f} -> {:.4f} sigmas, {:.1f} times what is "
                             "significant{}",
                             trial.what, trial.before, trial.after, trial.significance,
                             trial.taken ? ", taken" : ""));
    }
    if (!solution->choice.changed && !told.value()) {
        return Status();
    }
    std::vector<View> views = solution->set.views;
    const RefineResult refined = fit_all(scene, *solution, options, &views, &state);
    if (!refined.converged && told.value()) {
        return Status::failure("the rig does not settle with spline lenses; record more views, or leave the "
                               "model to --model auto");
    }
    if (!refined.converged) {
        progress("the richer model does not settle over all frames; kept the simple one");
        solution->choice.changed = false;
        return Status();
    }
    solution->state = std::move(state);
    solution->set.views = std::move(views);
    solution->noise_factor = refined.noise_factor;
    solution->flexible = flexible_covariance(scene, *solution, options.prior, noise_of(*solution));
    return Status();
}

}  // namespace rig
