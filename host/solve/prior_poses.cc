// See prior_poses.h. Relative poses are compared component by component: their median over the
// places at which both cameras see a board, its deviation from the median deviation.
#include "host/solve/prior_poses.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host/base/chi_square.h"
#include "host/base/median.h"
#include "host/solve/scale.h"
#include "host/solve/seed.h"

namespace rig {
namespace {

constexpr double kSigmas = 6.0;
constexpr std::size_t kPlacesMin = 3;  // fewer do not tell how they scatter
// Noise over that of the camera alone from which it is worth a second solution, and over that of
// the second which is no chance: the noise of some hundred points is known to a few per cent.
constexpr double kStrained = 1.3;
constexpr double kWorseByPrior = 1.2;
constexpr double kDegreesPerRadian = 180.0 / 3.14159265358979323846;

// What boards say of a pair of cameras: b_from_a against the prior's.
struct Pair {
    int a = 0;
    int b = 0;
    Pose known;
    std::vector<Pose> seen;
    Eigen::Vector3d shift_mm = Eigen::Vector3d::Zero();        // median translation of b_from_a
    Eigen::Vector3d shift_sigma_mm = Eigen::Vector3d::Zero();
    Eigen::Vector3d turn_rad = Eigen::Vector3d::Zero();        // median turn against the prior
    Eigen::Vector3d turn_sigma_rad = Eigen::Vector3d::Zero();
    double factor() const
    {
        const double distance_mm = known.translation_mm.norm();
        return distance_mm > 0.0 ? shift_mm.norm() / distance_mm : 1.0;
    }
};

// Median and its standard deviation of what `value` makes of each.
template <typename Value>
void settle(const std::vector<Pose>& seen, const Value& value, double* median, double* sigma)
{
    std::vector<double> all;
    for (const Pose& pose : seen) {
        all.push_back(value(pose));
    }
    *median = median_of(&all);
    for (double& each : all) {
        each = std::abs(each - *median);
    }
    *sigma = 1.2533 * 1.4826 * median_of(&all) / std::sqrt(static_cast<double>(all.size()));
}

std::vector<Pair> pairs_of(const Prior& prior, const ViewSet& set)
{
    // A camera's own lens may be known too badly from a few views: its focal length scales
    // distances.
    using Seen = std::vector<std::pair<int, Pose>>;             // cameras
    std::map<std::pair<int, std::int64_t>, Seen> places;  // by board and frame
    for (const View& view : set.views) {
        const int place = prior.place[static_cast<std::size_t>(view.camera)];
        if (place >= 0) {
            const Camera& lens = prior.lenses[static_cast<std::size_t>(place)];
            const auto pose = seed_pose(lens, lens.fold_radius(), thinned(view, kApproachPoints));
            if (pose) {
                places[{view.board, view.frame}].emplace_back(view.camera, *pose);
            }
        }
    }
    std::map<std::pair<int, int>, Pair> pairs;
    for (const auto& [key, views] : places) {
        for (std::size_t i = 0; i < views.size(); ++i) {
            for (std::size_t j = i + 1; j < views.size(); ++j) {
                const auto& [a, a_from_board] = views[i];
                const auto& [b, b_from_board] = views[j];
                Pair& pair = pairs[{a, b}];
                pair.a = a;
                pair.b = b;
                pair.seen.push_back(b_from_board * inverse(a_from_board));
            }
        }
    }
    std::vector<Pair> out;
    for (auto& [cameras, pair] : pairs) {
        if (pair.seen.size() < kPlacesMin) {
            continue;
        }
        const auto place = [&](int camera) {
            return static_cast<std::size_t>(prior.place[static_cast<std::size_t>(camera)]);
        };
        pair.known = prior.cam_from_rig[place(pair.b)] * inverse(prior.cam_from_rig[place(pair.a)]);
        for (int axis = 0; axis < 3; ++axis) {
            settle(pair.seen, [&](const Pose& pose) { return pose.translation_mm[axis]; },
                   &pair.shift_mm[axis], &pair.shift_sigma_mm[axis]);
            settle(pair.seen,
                   [&](const Pose& pose) {
                       return rotation_log(pose.rotation * pair.known.rotation.transpose())[axis];
                   },
                   &pair.turn_rad[axis], &pair.turn_sigma_rad[axis]);
        }
        out.push_back(pair);
    }
    return out;
}

bool turned(const Pair& pair)
{
    return pair.turn_rad.norm() > std::max(kTurnWorstRad, kSigmas * pair.turn_sigma_rad.norm());
}

// Whether the shift is another one than the prior's times `factor`.
bool shifted(const Pair& pair, double factor)
{
    const double off = (pair.shift_mm - factor * pair.known.translation_mm).norm();
    return off > std::max(kScaleWorstPart * pair.known.translation_mm.norm(),
                          kSigmas * pair.shift_sigma_mm.norm());
}

}  // namespace

Status check_prior_poses(const Scene& scene, const Prior& prior, const ViewSet& set)
{
    const std::vector<Pair> pairs = pairs_of(prior, set);
    const auto name = [&](int camera) {
        return scene.cameras[static_cast<std::size_t>(camera)].name;
    };
    std::vector<double> factors;
    for (const Pair& pair : pairs) {
        factors.push_back(pair.factor());
    }
    const double factor = factors.empty() ? 1.0 : median_of(&factors);
    const bool of_size = std::none_of(pairs.begin(), pairs.end(), [&](const Pair& pair) {
        return turned(pair) || shifted(pair, factor);
    });
    for (const Pair& pair : pairs) {
        if (!turned(pair) && !shifted(pair, 1.0)) {
            continue;
        }
        if (of_size) {
            return Status::failure(fmt::format(
                "the boards contradict the prior {} in size: cameras '{}' and '{}' are {:.1f} mm "
                "apart by the boards and {:.1f} mm in the prior, {:.1f} % {}, in the same direction; "
                "measure the print and correct its file, or leave --prior-poses out",
                prior.source, name(pair.a), name(pair.b), pair.shift_mm.norm(),
                pair.known.translation_mm.norm(), 100.0 * std::abs(pair.factor() - 1.0), pair.factor() > 1.0 ? "more" : "less"));
        }
        return Status::failure(fmt::format(
            "cameras '{}' and '{}' do not stand to each other as in the prior {}: they differ by "
            "{:.3f} degrees and {:.1f} mm; one of them was moved since: leave --prior-poses out",
            name(pair.a), name(pair.b), prior.source, kDegreesPerRadian * pair.turn_rad.norm(),
            (pair.shift_mm - pair.known.translation_mm).norm()));
    }
    return Status();
}

Status check_prior_met(const Scene& scene, const BundleOptions& options,
                       const std::vector<double>& alone_px, const Solution& solution)
{
    const Prior& prior = *options.prior;
    double degrees = 0.0;
    std::vector<bool> takes_part(solution.state.lenses.size(), false);
    for (const int camera : solution.cameras) {
        takes_part[static_cast<std::size_t>(camera)] = true;
    }
    const double squares = prior_squares(prior, solution.state, takes_part, &degrees);
    const double sigmas = degrees > 0.0 ? chi_square_normal(squares, degrees) : 0.0;
    const std::string since =
        prior.poses ? "a camera was moved or a lens was changed since, or the boards are not of the "
                      "size that they had; leave --prior-poses out"
                    : "a lens was changed since; leave the prior out";
    if (sigmas > kPriorSigmas) {
        return Status::failure(
            fmt::format("the joint solution contradicts the prior {} by {:.0f} sigmas: {}",
                        prior.source, std::min(sigmas, 999.0), since));
    }
    const std::vector<double> with_px = noise_px(solution.state, solution.set.views);
    const auto strains = [&](int camera) {
        const auto c = static_cast<std::size_t>(camera);
        return with_px[c] > kStrained * alone_px[c];
    };
    if (!prior.poses
        || std::none_of(solution.cameras.begin(), solution.cameras.end(), strains)) {
        return Status();
    }
    Prior lenses = prior;
    lenses.poses = false;
    BundleOptions without = options;
    without.prior = &lenses;
    std::vector<View> views = solution.set.views;
    RigState state = solution.state;
    refine(without, &views, &state);
    const std::vector<double> without_px = noise_px(state, views);
    for (const int camera : solution.cameras) {
        const auto c = static_cast<std::size_t>(camera);
        if (with_px[c] > kWorseByPrior * without_px[c]) {
            return Status::failure(fmt::format(
                "the joint solution contradicts the prior {}: with its poses camera '{}' fits its "
                "boards to {:.3f} px, without them to {:.3f} px: {}",
                prior.source, scene.cameras[c].name, with_px[c], without_px[c], since));
        }
    }
    return Status();
}

}  // namespace rig
