// Whether a camera's own views agree with the prior, before both are brought together: afterwards the
// disagreement would show as points that fit nothing.
#include <Eigen/Cholesky>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "host/base/chi_square.h"
#include "host/solve/enrich.h"
#include "host/solve/prior.h"
#include "host/solve/robust.h"
#include "host/solve/seed.h"
#include "host/solve/uncertainty.h"

namespace rig {
namespace {

// The camera alone, as a rig of one.
Solution alone_of(std::size_t camera, const ViewSet& set, const Camera& lens,
                  const std::vector<Pose>& by_view)
{
    Solution out;
    out.cameras = {0};
    out.gauge_cameras = {0};
    out.part_of_camera = {0};
    out.state.lenses = {lens};
    out.state.cam_from_rig = {Vector6::Zero()};
    for (std::size_t i = 0; i < set.views.size(); ++i) {
        if (static_cast<std::size_t>(set.views[i].camera) == camera) {
            // As many points as the lens was found from.
            View view = thinned(set.views[i], kApproachPoints);
            view.camera = 0;
            view.pose = out.set.poses.size();
            view.member = kNoMember;
            out.set.poses.push_back({view.board, view.frame, 0});
            out.state.rig_from_body.push_back(pose_log(by_view[i]));
            out.set.views.push_back(std::move(view));
        }
    }
    return out;
}

// The camera alone once more, with boards that bend. False where held-out instants do not ask for that.
bool bend(const Scene& scene, std::size_t camera, Solution* alone)
{
    Scene own;
    own.cameras = {scene.cameras[camera]};
    own.boards = scene.boards;
    const RefineResult refined = refine(BundleOptions(), &alone->set.views, &alone->state);
    if (!refined.converged) {
        return false;
    }
    alone->noise_factor = refined.noise_factor;
    SolveOptions options;
    options.lenses = {LensChoice{alone->state.lenses[0].model, false, false}};
    return enrich(own, options, [](const std::string&) {}, alone).ok() && alone->choice.changed;
}

// How many sigmas a lens is from one of the prior, as the value of a unit Gaussian that is as unlikely.
double sigmas_from(const Camera& lens, const Eigen::MatrixXd& covariance, const Prior& prior,
                   std::size_t place)
{
    const Camera& known = prior.lenses[place];
    const auto count = static_cast<Eigen::Index>(known.intrinsics.size());
    const Eigen::Index at = prior.covariance.lens[place];
    const Eigen::MatrixXd sum = covariance + prior.covariance.matrix.block(at, at, count, count);
    const Eigen::VectorXd difference =
        Eigen::Map<const Eigen::VectorXd>(lens.intrinsics.data(), count)
        - Eigen::Map<const Eigen::VectorXd>(known.intrinsics.data(), count);
    const Eigen::VectorXd scale = sum.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::VectorXd whitened = scale.cwiseProduct(difference);
    const Eigen::MatrixXd even = scale.asDiagonal() * sum * scale.asDiagonal();
    return chi_square_normal(whitened.dot(even.ldlt().solve(whitened)), static_cast<double>(count));
}

// Off by this many pixels a lens is another one, however few the views.
constexpr double kMisfitPx = 1.0;

}  // namespace

bool in_prior(const Prior* prior, std::size_t camera)
{
    return prior != nullptr && prior->place[camera] >= 0;
}

Result<CameraAlone> poses_through_prior(const Scene& scene, const Prior& prior, const ViewSet& set,
                                        std::size_t camera)
{
    CameraAlone out;
    out.lens = prior.lenses[static_cast<std::size_t>(prior.place[camera])];
    const double fold = out.lens.fold_radius();
    for (std::size_t i = 0; i < set.views.size(); ++i) {
        if (static_cast<std::size_t>(set.views[i].camera) != camera) {
            continue;
        }
        const View thin = thinned(set.views[i], kApproachPoints);
        if (const std::optional<Pose> pose = seed_pose(out.lens, fold, thin)) {
            out.views.push_back(i);
            out.cam_from_board.push_back(*pose);
        } else {
            out.points_without_pose += set.views[i].points.size();
        }
    }
    ViewSet own;
    for (std::size_t i = 0; i < out.views.size(); ++i) {
        own.views.push_back(set.views[out.views[i]]);
        for (ViewPoint& point : own.views.back().points) {
            point.sigma_px = 1.0f;
        }
    }
    if (own.views.empty()) {
        return Status::failure("camera '" + scene.cameras[camera].name
                               + "' has no usable view: record frames in which it sees the board");
    }
    const Solution alone = alone_of(camera, own, out.lens, out.cam_from_board);
    out.noise_px = noise_factors(alone.state, 1, alone.set.views)[0];
    if (!(out.noise_px < kMisfitPx)) {
        return Status::failure(fmt::format(
            "camera '{}' contradicts the prior {}: its points lie {:.1f} px from where that lens puts them; its "
            "lens was changed, or the name is another camera's", scene.cameras[camera].name, prior.source,
            out.noise_px));
    }
    return out;
}

Status check_prior(const Scene& scene, const Prior& prior, const ViewSet& set,
                   const std::vector<Camera>& lenses, const std::vector<Pose>& by_view, bool flat)
{
    for (std::size_t c = 0; c < scene.cameras.size(); ++c) {
        if (prior.place[c] < 0 || lenses[c].intrinsics.empty()) {
            continue;
        }
        const auto place = static_cast<std::size_t>(prior.place[c]);
        Solution alone = alone_of(c, set, lenses[c], by_view);
        if (alone.set.views.empty()) {
            continue;
        }
        // Where no sigmas are given, 1 px stands for them, and the residuals tell the noise.
        const bool known = alone.set.views.front().points.front().sigma_known;
        const double noise = noise_factors(alone.state, 1, alone.set.views)[0];
        const double factor = known ? std::max(1.0, noise) : noise;
        const auto count = static_cast<Eigen::Index>(lenses[c].intrinsics.size());
        Eigen::MatrixXd covariance =
            factor * factor * rig_covariance(alone).matrix.topLeftCorner(count, count);
        double sigmas = sigmas_from(lenses[c], covariance, prior, place);
        if (sigmas > kPriorSigmas && !flat && bend(scene, c, &alone)) {
            covariance = rig_covariance(alone, noise_of(alone)).matrix.topLeftCorner(count, count);
            sigmas = sigmas_from(alone.state.lenses[0], covariance, prior, place);
        }
        if (sigmas <= kPriorSigmas) {
            continue;
        }
        const Camera& lens = alone.state.lenses[0];
        for (std::size_t other = 0; other < prior.names.size(); ++other) {
            if (other != place && prior.lenses[other].model == lens.model
                && sigmas_from(lens, covariance, prior, other) <= kPriorSigmas) {
                return Status::failure(fmt::format(
                    "camera '{}' does not have the lens that it has in the prior {}, but that of '{}': were "
                    "the names swapped?", scene.cameras[c].name, prior.source, prior.names[other]));
            }
        }
        return Status::failure(fmt::format(
            "camera '{}' contradicts the prior {} by {:.0f} sigmas (fx {:.2f} here, {:.2f} there): its lens was "
            "changed, or the name is another camera's; leave the prior out to calibrate it anew",
            scene.cameras[c].name, prior.source, std::min(sigmas, 999.0), lens.intrinsics[0],
            prior.lenses[place].intrinsics[0]));
    }
    return Status();
}

}  // namespace rig
