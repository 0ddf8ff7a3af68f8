// See refine.h.
#include "host/solve/robust.h"

#include <algorithm>
#include <cmath>

#include "host/solve/circle_centre.h"
#include "host/solve/residuals.h"

namespace rig {
namespace {

// Below this the figures of a text file and the model of a circle's centre are what remains.
constexpr double kSigmaMinPx = 1e-4;
constexpr int kRobustRounds = 12;
constexpr int kPlainRounds = 10;
// A Cauchy loss of 3 sigmas: the pull of a point ten times as far is a third of what it was.
constexpr double kCauchySigmas = 3.0;

// Whitened residuals of a view; infinite where the present state gives no image.
Eigen::VectorXd residuals_of(const RigState& state, const View& view)
{
    const auto camera = static_cast<std::size_t>(view.camera);
    const Camera& lens = state.lenses[camera];
    Eigen::VectorXd residuals;
    if (!view_residuals(view, lens.model, lens.intrinsics.data(), state.cam_from_rig[camera].data(),
                        state.rig_from_board[view.pose].data(), &residuals, nullptr)) {
        residuals.setConstant(static_cast<Eigen::Index>(2 * view.points.size()), HUGE_VAL);
    }
    return residuals;
}

// Where no sigma was given: the camera's noise becomes the sigma of its points.
void update_sigmas(std::vector<double>* factors, std::vector<View>* views)
{
    std::vector<bool> estimated(factors->size(), false);
    for (View& view : *views) {
        const auto camera = static_cast<std::size_t>(view.camera);
        for (ViewPoint& point : view.points) {
            if (!point.sigma_known) {
                point.sigma_px = std::max(kSigmaMinPx, point.sigma_px * (*factors)[camera]);
                estimated[camera] = true;
            }
        }
    }
    for (std::size_t camera = 0; camera < factors->size(); ++camera) {
        if (estimated[camera]) {
            (*factors)[camera] = 1.0;
        }
    }
}

// Applies the rule of refine.h; true when the set of used points changed.
bool select_points(const RigState& state, const std::vector<double>& factors,
                   std::vector<View>* views)
{
    bool changed = false;
    for (View& view : *views) {
        const double limit =
            kRejectSigmas * std::max(1.0, factors[static_cast<std::size_t>(view.camera)]);
        const Eigen::VectorXd residuals = residuals_of(state, view);
        std::vector<bool> good(view.points.size());
        std::size_t count = 0;
        for (std::size_t i = 0; i < good.size(); ++i) {
            good[i] = residuals.segment<2>(static_cast<Eigen::Index>(2 * i)).norm() <= limit;
            count += good[i] ? 1u : 0u;
        }
        const bool keep = static_cast<double>(good.size() - count)
                              <= kRejectViewPart * static_cast<double>(good.size())
                          && count >= kViewPointsMin;
        for (std::size_t i = 0; i < good.size(); ++i) {
            const bool used = keep && good[i];
            changed = changed || used != view.points[i].used;
            view.points[i].used = used;
        }
    }
    return changed;
}

}  // namespace

double update_centre_offsets(const RigState& state, std::vector<View>* views)
{
    double largest = 0.0;
    for (View& view : *views) {
        const auto camera = static_cast<std::size_t>(view.camera);
        const Pose cam_from_board =
            pose_exp(state.cam_from_rig[camera]) * pose_exp(state.rig_from_board[view.pose]);
        for (ViewPoint& point : view.points) {
            if (point.radius_mm > 0.0) {
                const Eigen::Vector2d offset = circle_centre_offset(
                    state.lenses[camera], cam_from_board, point.at_mm, point.radius_mm);
                largest = std::max(largest, (offset - point.centre_offset_px).norm());
                point.centre_offset_px = offset;
            }
        }
    }
    return largest;
}

std::vector<double> noise_factors(const RigState& state, const std::vector<View>& views)
{
    std::vector<std::vector<double>> sizes(state.lenses.size());
    for (const View& view : views) {
        const Eigen::VectorXd residuals = residuals_of(state, view);
        auto& list = sizes[static_cast<std::size_t>(view.camera)];
        for (const double residual : residuals) {
            list.push_back(std::abs(residual));
        }
    }
    std::vector<double> factors;
    for (std::vector<double>& list : sizes) {
        const auto middle = list.begin() + static_cast<std::ptrdiff_t>(list.size() / 2);
        std::nth_element(list.begin(), middle, list.end());
        factors.push_back(list.empty() ? 0.0 : 1.4826 * *middle);
    }
    return factors;
}

bool approach(const BundleOptions& options, std::vector<View>* views, RigState* state)
{
    BundleOptions robust = options;
    robust.tolerance = 1e-6;
    double before = HUGE_VAL;
    for (int round = 0; round < kRobustRounds; ++round) {
        update_centre_offsets(*state, views);
        std::vector<double> factors = noise_factors(*state, *views);
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
        if (!bundle(*views, robust, state).usable) {
            return false;
        }
    }
    return true;
}

RefineResult refine(const BundleOptions& options, std::vector<View>* views, RigState* state)
{
    RefineResult result;
    if (!approach(options, views, state)) {
        return result;
    }
    // The centre offsets are held during a solve and change by a thousandth of what the state does,
    // so these rounds converge in a few.
    double cost = HUGE_VAL;
    for (int round = 0; round < kPlainRounds; ++round) {
        const double moved = update_centre_offsets(*state, views);
        result.noise_factor = noise_factors(*state, *views);
        update_sigmas(&result.noise_factor, views);
        const bool changed = select_points(*state, result.noise_factor, views);
        const BundleResult solved = bundle(*views, options, state);
        if (!solved.usable) {
            return result;
        }
        const bool settled = !changed && moved < 1e-5 && round > 1;
        if (settled || (round > 1 && !changed && std::abs(cost - solved.cost) < 1e-9 * cost)) {
            break;
        }
        cost = solved.cost;
    }
    update_centre_offsets(*state, views);
    result.converged = true;
    return result;
}

}  // namespace rig
