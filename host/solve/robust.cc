// See robust.h.
#include "host/solve/robust.h"

#include <algorithm>
#include <cmath>

#include "host/base/median.h"
#include "host/base/parallel.h"
#include "host/solve/circle_centre.h"
#include "host/solve/rolling_kernel.h"
#include "host/solve/velocity_prior.h"
#include "host/solve/view_kernel.h"

namespace rig {
namespace {

// Below this the figures of a text file and the model of a circle's centre are what remains.
constexpr double kSigmaMinPx = 1e-4;
constexpr int kRobustRounds = 12;
constexpr int kPlainRounds = 10;
// A Cauchy loss of 3 sigmas: the pull of a point ten times as far is a third of what it was.
constexpr double kCauchySigmas = 3.0;
// Centre offsets that moved by less have no say: a hundredth of the best detector's error, and
// those of a view move together with its pose, which the solve has just settled.
constexpr double kOffsetSettledPx = 2e-5;
// An estimated sigma that changes by less leaves the weights as they were.
constexpr double kSigmaSettledPart = 1e-3;
// Falls of the cost, as parts of it, that end a robust solve. Where the lens still lacks terms the
// next solve, with more of them, changes all that a finer end would tell.
constexpr double kToleranceRobust = 1e-6;
constexpr double kToleranceOnTheWay = 1e-3;
// Near the minimum Gauss and Newton's steps need no damping.
constexpr double kTrustNear = 1e8;
// Brown's lens takes five; coefficients that stand in for one another lead through long valleys.
constexpr int kIterationsNear = 150;

// Where no sigma was given: the camera's noise becomes the sigma of its points. True when that
// changed the weights. With `scale_free` a factor that all points have in common does not count:
// the minimum stays where it is.
bool update_sigmas(bool scale_free, std::vector<double>* factors, std::vector<View>* views)
{
    std::vector<bool> estimated(factors->size(), false);
    // Of what sigmas were multiplied by; that of known ones is 1.
    double least = scale_free ? HUGE_VAL : 1.0;
    double most = scale_free ? 0.0 : 1.0;
    for (View& view : *views) {
        const auto camera = static_cast<std::size_t>(view.camera);
        const double factor = (*factors)[camera];
        const bool settled = std::abs(factor - 1.0) < kSigmaSettledPart;
        for (ViewPoint& point : view.points) {
            double change = 1.0;
            if (!point.sigma_known) {
                estimated[camera] = true;
                if (!settled) {
                    const double sigma = std::max(kSigmaMinPx, point.sigma_px * factor);
                    change = sigma / point.sigma_px;
                    point.sigma_px = static_cast<float>(sigma);
                }
            }
            least = std::min(least, change);
            most = std::max(most, change);
        }
    }
    for (std::size_t camera = 0; camera < factors->size(); ++camera) {
        if (estimated[camera]) {
            (*factors)[camera] = 1.0;
        }
    }
    return most > (1.0 + kSigmaSettledPart) * least;
}

// Applies the rule of robust.h to one view; true when the set of used points changed.
bool select_points(const RigState& state, double limit, View* view)
{
    Eigen::Matrix2Xd residuals;
    view_residuals(*view, state, &residuals);
    const auto all = view->points.size();
    const auto good = (residuals.colwise().norm().array() <= limit).eval();
    const auto count = static_cast<std::size_t>(good.count());
    const bool keep = static_cast<double>(all - count) <= kRejectViewPart * static_cast<double>(all)
                      && count >= kViewPointsMin;
    bool changed = false;
    for (std::size_t i = 0; i < all; ++i) {
        const bool used = keep && good[static_cast<Eigen::Index>(i)];
        changed = changed || used != view->points[i].used;
        view->points[i].used = used;
    }
    return changed;
}

bool select_points(const RigState& state, const std::vector<double>& factors, int threads,
                   std::vector<View>* views)
{
    std::vector<char> changed(views->size(), 0);
    parallel_for(views->size(), threads, 8, [&](std::size_t i) {
        View& view = (*views)[i];
        const double factor = factors[static_cast<std::size_t>(view.camera)];
        changed[i] = select_points(state, kRejectSigmas * std::max(1.0, factor), &view) ? 1 : 0;
    });
    return std::count(changed.begin(), changed.end(), 1) > 0;
}

// circle_centre.h, on the board's surface (null: flat).
Eigen::Vector2d centre_offset(const Camera& lens, const Pose& cam_from_board, const Surface* surface,
                              const ViewPoint& point)
{
    Eigen::Vector2d slope = Eigen::Vector2d::Zero();
    if (surface != nullptr) {
        bspline_value(surface->grid, surface->control.data(), point.at_mm.head<2>(), &slope);
    }
    return circle_centre_offset(lens, cam_from_board, point.at_mm, static_cast<double>(point.radius_mm),
                                slope);
}

// Whether the offsets of some of the view's circles are still what they were: those of a view move
// together.
bool offsets_stand(const Camera& lens, const Pose& cam_from_board, const Surface* surface,
                   const View& view, double* moved)
{
    constexpr std::size_t kLooks = 8;
    constexpr double kStandPx = 0.25 * kOffsetSettledPx;
    *moved = 0.0;
    const std::size_t step = std::max<std::size_t>(1, view.points.size() / kLooks);
    for (std::size_t i = 0; i < view.points.size() && *moved < kStandPx; i += step) {
        const ViewPoint& point = view.points[i];
        const Eigen::Vector2d offset = centre_offset(lens, cam_from_board, surface, point);
        *moved = std::max(*moved, (offset - point.centre_offset_px.cast<double>()).norm());
    }
    return *moved < kStandPx;
}

// Offsets of a view whose board moves while rows are read: that of the circle where its row sees it, and
// what it has moved. Returns the largest change, px.
double update_rolling_offsets(const RigState& state, View* view)
{
    const Camera& lens = state.lenses[static_cast<std::size_t>(view->camera)];
    const Surface* surface = surface_of(state, view->board);
    const RowPoses poses(*view, state);
    double largest = 0.0;
    for (ViewPoint& point : view->points) {
        const Pose there = poses.at(point.pixel.y());
        Eigen::Vector2d offset = shutter_shift(lens, poses.still(), there, point.at_mm);
        if (point.radius_mm > 0.0f) {
            offset += centre_offset(lens, there, surface, point);
        }
        const Eigen::Vector2d before = point.centre_offset_px.cast<double>();
        largest = std::max(largest, (offset - before).norm());
        point.centre_offset_px = offset.cast<float>();
    }
    hold_velocity(state, view);
    return largest;
}

}  // namespace

double update_centre_offsets(const RigState& state, int threads, std::vector<View>* views)
{
    std::vector<double> largest(views->size(), 0.0);
    parallel_for(views->size(), threads, 4, [&](std::size_t i) {
        View& view = (*views)[i];
        if (!state.shutter.empty() && view.clock.moves) {
            largest[i] = update_rolling_offsets(state, &view);
            return;
        }
        const Pose pose = cam_from_board(state, view);
        const Camera& lens = state.lenses[static_cast<std::size_t>(view.camera)];
        const Surface* surface = surface_of(state, view.board);
        if (offsets_stand(lens, pose, surface, view, &largest[i])) {
            return;
        }
        for (ViewPoint& point : view.points) {
            if (point.radius_mm > 0.0f) {
                const Eigen::Vector2f offset = centre_offset(lens, pose, surface, point).cast<float>();
                const double moved = static_cast<double>((offset - point.centre_offset_px).norm());
                largest[i] = std::max(largest[i], moved);
                point.centre_offset_px = offset;
            }
        }
    });
    return views->empty() ? 0.0 : *std::max_element(largest.begin(), largest.end());
}

std::vector<double> noise_factors(const RigState& state, int threads, const std::vector<View>& views)
{
    // Each view's place in its camera's list is known beforehand, so that views can be done in any
    // order.
    std::vector<std::vector<float>> sizes(state.lenses.size());
    std::vector<std::size_t> place(views.size());
    std::vector<std::size_t> total(state.lenses.size(), 0);
    for (std::size_t i = 0; i < views.size(); ++i) {
        std::size_t& end = total[static_cast<std::size_t>(views[i].camera)];
        place[i] = end;
        end += 2 * views[i].points.size();
    }
    for (std::size_t camera = 0; camera < sizes.size(); ++camera) {
        sizes[camera].resize(total[camera]);
    }
    parallel_for(views.size(), threads, 8, [&](std::size_t i) {
        Eigen::Matrix2Xd residuals;
        view_residuals(views[i], state, &residuals);
        float* out = sizes[static_cast<std::size_t>(views[i].camera)].data() + place[i];
        for (Eigen::Index k = 0; k < residuals.size(); ++k) {
            out[k] = static_cast<float>(std::abs(residuals.data()[k]));
        }
    });
    std::vector<double> factors(sizes.size(), 0.0);
    parallel_for(sizes.size(), threads, 1, [&](std::size_t camera) {
        std::vector<float>& list = sizes[camera];
        factors[camera] = list.empty() ? 0.0 : 1.4826 * static_cast<double>(median_of(&list));
    });
    return factors;
}

std::vector<double> noise_px(const RigState& state, const std::vector<View>& views)
{
    std::vector<View> in_px = thinned(views, kApproachPoints);
    for (View& view : in_px) {
        for (ViewPoint& point : view.points) {
            point.sigma_px = 1.0f;
        }
    }
    return noise_factors(state, 1, in_px);
}

bool approach(const BundleOptions& options, const std::vector<View>& views, RigState* state)
{
    std::vector<View> some = thinned(views, kApproachPoints);
    BundleOptions robust = options;
    const bool on_the_way =
        options.lens == LensFreedom::kFocal || options.lens == LensFreedom::kRadial;
    robust.tolerance = on_the_way ? kToleranceOnTheWay : kToleranceRobust;
    double before = HUGE_VAL;
    for (int round = 0; round < kRobustRounds; ++round) {
        update_centre_offsets(*state, options.threads, &some);
        std::vector<double> factors = noise_factors(*state, options.threads, some);
        double total = 0.0;
        for (double& factor : factors) {
            if (!std::isfinite(factor)) {
                return false;
            }
            total += factor;
            factor = kCauchySigmas * std::max(factor, 1e-6);
        }
        if (total > 0.95 * before) {
            return true;
        }
        before = total;
        robust.cauchy = factors;
        if (!bundle(some, robust, state).usable) {
            return false;
        }
    }
    return true;
}

RefineResult settle(const Solve& solve, int threads, std::vector<View>* views, RigState* state,
                    bool scale_free)
{
    RefineResult result;
    // Centre offsets, sigmas and the set of points are held during a solve. They change by a
    // thousandth of what the state does, so that two rounds are the rule.
    bool due = false;
    for (int round = 0; round < kPlainRounds; ++round) {
        const double moved = update_centre_offsets(*state, threads, views);
        result.noise_factor = noise_factors(*state, threads, *views);
        const bool weighed = update_sigmas(scale_free, &result.noise_factor, views);
        const bool changed = select_points(*state, result.noise_factor, threads, views);
        if (round > 0 && !due && !weighed && !changed && moved < kOffsetSettledPx) {
            break;
        }
        if (!solve(views, state)) {
            return result;
        }
        due = !state->shutter.empty()
              && update_velocity_deviation(*views, result.noise_factor, threads, state);
    }
    result.converged = true;
    return result;
}

RefineResult refine_near(const BundleOptions& options, std::vector<View>* views, RigState* state)
{
    BundleOptions near = options;
    near.trust = kTrustNear;
    near.iterations_max = kIterationsNear;
    const auto solve = [&](std::vector<View>* own, RigState* moved) {
        return bundle(*own, near, moved).usable;
    };
    return settle(solve, options.threads, views, state,
                  options.prior == nullptr && state->shutter.empty());
}

RefineResult refine(const BundleOptions& options, std::vector<View>* views, RigState* state)
{
    return approach(options, *views, state) ? refine_near(options, views, state) : RefineResult();
}

}  // namespace rig
