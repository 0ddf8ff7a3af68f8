// See heldout.h.
#include "host/solve/heldout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "host/solve/flexible.h"
#include "host/solve/richer.h"
#include "host/solve/surface.h"

namespace rig {
namespace {

constexpr int kSurfaceCells[] = {1, 2, 3, 5, 8, 12};
constexpr int kLookAhead = 2;     // steps of a ladder that are tried at once
constexpr int kAdoptionsMax = 16;
constexpr std::size_t kChoicePoints = 150000;  // over all views: enough for any choice
constexpr std::size_t kChoiceViewPointsMin = 40;
// Beyond it lies a thousandth of the normal distribution.
constexpr double kNormalQuantile = 3.0902;
// Score test: a gain this many standard deviations above chance is worth a trial.
constexpr double kPromiseDeviations = 4.0;

struct Halves {
    std::vector<View> views;
    std::vector<char> in[2];          // by view
    std::vector<std::size_t> instant;  // by view
    std::size_t instants = 0;
};

// One model, fitted to each half, and what it leaves in the other.
struct Fitted {
    bool usable = false;
    RigState half[2];
    FlexibleResult fit[2];
    Eigen::MatrixXd squares;  // held out: instants by cameras
    double total = 0.0;
    double freedom = 0.0;     // of the held-out residuals
};

Halves deal(const std::vector<View>& views)
{
    Halves out;
    const std::size_t each =
        std::max(kChoiceViewPointsMin, kChoicePoints / std::max<std::size_t>(1, views.size()));
    out.views = thinned(views, each);
    std::map<std::int64_t, std::size_t> place;
    for (const View& view : out.views) {
        place.emplace(view.frame, 0);
    }
    for (auto& [frame, at] : place) {
        at = out.instants++;
    }
    for (const View& view : out.views) {
        const bool any = std::any_of(view.points.begin(), view.points.end(),
                                     [](const ViewPoint& point) { return point.used; });
        const std::size_t at = place[view.frame];
        out.instant.push_back(at);
        out.in[0].push_back(any && at % 2 == 0);
        out.in[1].push_back(any && at % 2 == 1);
    }
    return out;
}

// t of the mean over its quantile.
double student_significance(const Eigen::ArrayXd& gain)
{
    const auto count = static_cast<double>(gain.size());
    const double mean = gain.mean();
    const double deviation = std::sqrt((gain - mean).square().sum() / (count - 1.0));
    return deviation > 0.0 ? mean / (deviation / std::sqrt(count)) / student_quantile(count - 1.0) : 0.0;
}

// Wilcoxon's sum of the signed ranks over its quantile, by the normal approximation; below ten it
// cannot reach one in a thousand.
double rank_significance(const Eigen::ArrayXd& gain)
{
    std::vector<Eigen::Index> order(static_cast<std::size_t>(gain.size()));
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) {
        return std::abs(gain[a]) < std::abs(gain[b]);
    });
    double sum = 0.0;
    for (std::size_t i = 0; i < order.size(); ++i) {
        const double rank = static_cast<double>(i + 1);
        sum += gain[order[i]] > 0.0 ? rank : -rank;
    }
    const auto n = static_cast<double>(gain.size());
    return n < 10.0 ? 0.0 : sum / std::sqrt(n * (n + 1.0) * (2.0 * n + 1.0) / 6.0) / kNormalQuantile;
}

// Of a board's place at one instant, and of its velocity there as many as the data tell.
double unknowns_of_pose(const RigState& state)
{
    return 6.0 + (state.shutter.empty() ? 0.0 : state.shutter.told);
}

class Chooser {
public:
    Chooser(const Scene& scene, const Halves& halves, const ChoiceOptions& options)
        : scene_(scene), halves_(halves)
    {
        fit_.gauge_cameras = options.gauge_cameras;
        fit_.prior = options.prior;
        fit_.iterations_max = 12;
        fit_.tolerance = 1e-7;
    }

    // From the states given, one a half.
    Fitted fit(const RigState start[2]) const
    {
        Fitted out;
        out.squares.setZero(static_cast<Eigen::Index>(halves_.instants),
                            static_cast<Eigen::Index>(scene_.cameras.size()));
        FlexibleOptions poses = fit_;
        poses.poses_only = true;
        for (int h = 0; h < 2; ++h) {
            out.half[h] = start[h];
            out.fit[h] = bundle(halves_.in[h], fit_, &out.half[h]);
            const FlexibleResult held =
                bundle(halves_.in[1 - h], poses, &out.half[h]);
            if (!out.fit[h].usable || !held.usable || !measure(h, out.half[h], &out)) {
                return out;
            }
            out.freedom += 2.0 * static_cast<double>(held.points)
                           - unknowns_of_pose(start[h]) * static_cast<double>(poses_in(1 - h));
        }
        out.total = out.squares.sum();
        out.usable = std::isfinite(out.total);
        return out;
    }

    // The first step from a state, over all instants: what it promises to gain.
    FlexibleResult look(const RigState& state) const
    {
        FlexibleOptions one_step = fit_;
        one_step.iterations_max = 0;
        std::vector<char> all(halves_.in[0]);
        for (std::size_t i = 0; i < all.size(); ++i) {
            all[i] = all[i] || halves_.in[1][i];
        }
        RigState copy = state;
        return bundle(all, one_step, &copy);
    }

    // By how many deviations the first step of a richer model beats chance. Both states predict the
    // same pixels.
    double promise(const FlexibleResult& simple, const RigState& richer) const
    {
        const FlexibleResult rich = look(richer);
        const double more = rich.unknowns - simple.unknowns;
        const double freedom = 2.0 * static_cast<double>(simple.points) - simple.unknowns
                               - unknowns_of_pose(richer) * static_cast<double>(poses_in(0) + poses_in(1));
        const double variance = (simple.squares - simple.first_gain) / std::max(1.0, freedom);
        if (!rich.usable || !simple.usable || more <= 0.0 || !(variance > 0.0)) {
            return 0.0;
        }
        return ((rich.first_gain - simple.first_gain) / variance - more) / std::sqrt(2.0 * more);
    }

    // t over its quantile for the instants' squares before and after, over some cameras; 0 where the
    // sum does not fall.
    double significance(const Fitted& before, const Fitted& after, const std::vector<char>& cameras) const
    {
        Eigen::VectorXd simple = Eigen::VectorXd::Zero(before.squares.rows());
        Eigen::VectorXd rich = simple;
        for (std::size_t c = 0; c < cameras.size(); ++c) {
            if (cameras[c]) {
                simple += before.squares.col(static_cast<Eigen::Index>(c));
                rich += after.squares.col(static_cast<Eigen::Index>(c));
            }
        }
        std::vector<double> gains;
        for (Eigen::Index i = 0; i < simple.size(); ++i) {
            if (simple[i] > 0.0 && rich[i] > 0.0) {
                gains.push_back(std::log(simple[i] / rich[i]));
            }
        }
        const Eigen::Map<const Eigen::ArrayXd> gain(gains.data(), static_cast<Eigen::Index>(gains.size()));
        if (gain.size() < kChoiceInstantsMin || !(rich.sum() < simple.sum())) {
            return 0.0;
        }
        return std::max(student_significance(gain), rank_significance(gain));
    }

private:
    FlexibleResult bundle(const std::vector<char>& use, const FlexibleOptions& options,
                          RigState* state) const
    {
        return flexible_bundle(halves_.views, use, scene_.boards, scene_.cameras, options, state);
    }

    bool measure(int half, const RigState& state, Fitted* out) const
    {
        const FlexibleLayout none = make_layout(state, halves_.views, halves_.in[half], {}, true);
        std::vector<char> one(halves_.views.size(), 0);
        for (std::size_t i = 0; i < halves_.views.size(); ++i) {
            if (halves_.in[1 - half][i]) {
                FlexibleSystem sums;
                one[i] = 1;
                if (!sum_points(halves_.views, one, scene_.boards, state, none, false, &sums)) {
                    return false;
                }
                one[i] = 0;
                out->squares(static_cast<Eigen::Index>(halves_.instant[i]), halves_.views[i].camera) +=
                    sums.squares;
            }
        }
        return true;
    }

    std::size_t poses_in(int half) const
    {
        std::vector<std::size_t> poses;
        for (std::size_t i = 0; i < halves_.views.size(); ++i) {
            if (halves_.in[half][i]) {
                poses.push_back(halves_.views[i].pose);
            }
        }
        std::sort(poses.begin(), poses.end());
        return static_cast<std::size_t>(std::unique(poses.begin(), poses.end()) - poses.begin());
    }

    const Scene& scene_;
    const Halves& halves_;
    FlexibleOptions fit_;
};

// The walk up the ladders.
class Walk {
public:
    Walk(const Scene& scene, const Halves& halves, const ChoiceOptions& options, const RigState& state)
        : scene_(scene), options_(options), chooser_(scene, halves, options), whole_(state),
          at_(scene.cameras.size(), 0)
    {
        for (const Camera& lens : state.lenses) {
            ladders_.push_back(lens_ladder(lens));
        }
        whole_.surfaces.resize(scene.boards.size());
        instants_ = halves.instants;
        seen_.assign(scene.cameras.size(), 0);
        climbs_.assign(scene.cameras.size(), 0);
        std::vector<char> boards(scene.boards.size(), 0);
        for (const View& view : halves.views) {
            seen_[static_cast<std::size_t>(view.camera)] = 1;
            climbs_[static_cast<std::size_t>(view.camera)] = options.lenses[static_cast<std::size_t>(view.camera)];
            boards[static_cast<std::size_t>(view.board)] = 1;
            for (const ViewPoint& point : view.points) {
                sigmas_known_ = sigmas_known_ && point.sigma_known;
            }
        }
        for (std::size_t b = 0; b < boards.size(); ++b) {
            if (boards[b] && can_bend(scene.boards[b])) {
                bendable_.push_back(b);
            }
        }
    }

    ModelChoice run()
    {
        ModelChoice choice;
        choice.instants = instants_;
        simple_ = chooser_.look(whole_);
        const bool promising = some_promise();
        if (!promising && !lenses_climb()) {
            return choice;
        }
        const RigState start[2] = {whole_, whole_};
        now_ = chooser_.fit(start);
        for (int step = 0; step < kAdoptionsMax && promising && now_.usable && take_best(&choice); ++step) {
            choice.changed = true;
        }
        if (now_.usable) {
            judge(&choice);
        }
        return choice;
    }

    const RigState& state() const { return whole_; }

private:
    struct Candidate {
        std::string what;
        std::size_t lens_steps = 0;  // up the ladder of lenses; 0: a surface
        std::size_t surface = 0;     // place in kSurfaceCells
        std::vector<char> cameras;   // that gain
        Fitted fitted;
        ModelTrial trial;
    };

    // Whether any first richer step is worth the fits to both halves.
    bool some_promise() const
    {
        for (std::size_t up = 1; lenses_climb() && up <= 3; ++up) {
            if (chooser_.promise(simple_, with_lenses(whole_, up, climbs_)) >= kPromiseDeviations) {
                return true;
            }
        }
        for (std::size_t place = 0; options_.surfaces && !bendable_.empty() && place < 3; ++place) {
            if (chooser_.promise(simple_, with_surface(whole_, place)) >= kPromiseDeviations) {
                return true;
            }
        }
        return false;
    }

    // Parameters fitted to one half add their share of variance to the other: one freedom's for each.
    // Beyond that, four deviations of a mean of squares. Without known sigmas the yardstick is the
    // residuals of the halves that were fitted.
    void judge(ModelChoice* choice) const
    {
        const double unknowns = now_.fit[0].unknowns + now_.fit[1].unknowns;
        const double fitted = now_.fit[0].squares + now_.fit[1].squares;
        const double yardstick =
            sigmas_known_ ? 1.0 : fitted / std::max(1.0, now_.freedom - unknowns);
        choice->held_out = std::sqrt(now_.total / now_.freedom);
        choice->held_out_allowed = std::sqrt(
            yardstick * (1.0 + unknowns / now_.freedom + 4.0 * std::sqrt(2.0 / now_.freedom)));
    }

    bool take_best(ModelChoice* choice)
    {
        std::vector<Candidate> candidates;
        // From formulas on, one step more: past rational and thin prism stands the first field.
        const std::size_t ahead = static_cast<std::size_t>(kLookAhead) + (field_used() ? 0 : 1);
        for (std::size_t up = 1; lenses_climb() && up <= ahead; ++up) {
            try_lens(up, &candidates);
        }
        for (std::size_t up = 0; options_.surfaces && up < static_cast<std::size_t>(kLookAhead); ++up) {
            try_surface(next_surface_ + up, &candidates);
        }
        Candidate* best = nullptr;
        for (Candidate& candidate : candidates) {
            if (candidate.trial.significance > 1.0
                && (best == nullptr || candidate.fitted.total < best->fitted.total)) {
                best = &candidate;
            }
        }
        if (best != nullptr) {
            best->trial.taken = true;
            take(*best);
        }
        for (const Candidate& candidate : candidates) {
            choice->trials.push_back(candidate.trial);
        }
        return best != nullptr;
    }

    bool lenses_climb() const { return std::count(climbs_.begin(), climbs_.end(), 1) > 0; }

    bool field_used() const
    {
        return std::any_of(whole_.lenses.begin(), whole_.lenses.end(),
                           [](const Camera& lens) { return !lens.field.empty(); });
    }

    RigState with_lenses(const RigState& state, std::size_t up, const std::vector<char>& cameras) const
    {
        RigState out = state;
        for (std::size_t c = 0; c < out.lenses.size(); ++c) {
            if (cameras[c]) {
                const std::size_t place = std::min(at_[c] + up, ladders_[c].size() - 1);
                enrich_lens(scene_.cameras[c], ladders_[c][place], &out.lenses[c]);
            }
        }
        return out;
    }

    RigState with_surface(const RigState& state, std::size_t place) const
    {
        RigState out = state;
        for (const std::size_t b : bendable_) {
            Surface finer = make_surface(scene_.boards[b], kSurfaceCells[place]);
            if (!out.surfaces[b].empty()) {
                resample(out.surfaces[b].grid, out.surfaces[b].control.data(), finer.grid,
                         finer.control.data());
            }
            out.surfaces[b] = std::move(finer);
        }
        return out;
    }

    void finish(const std::string& what, const std::vector<char>& judged, Candidate* candidate) const
    {
        candidate->what = what;
        candidate->trial.what = what;
        candidate->trial.before = std::sqrt(now_.total / now_.freedom);
        candidate->trial.after = std::sqrt(candidate->fitted.total / candidate->fitted.freedom);
        candidate->trial.significance = chooser_.significance(now_, candidate->fitted, judged);
    }

    // Lenses of all cameras `up` steps richer; then, where only some gain, of these alone.
    void try_lens(std::size_t up, std::vector<Candidate>* out) const
    {
        Candidate candidate;
        candidate.lens_steps = up;
        candidate.cameras = climbs_;
        std::string what;
        for (std::size_t c = 0; c < climbs_.size(); ++c) {
            candidate.cameras[c] = climbs_[c] && at_[c] + up < ladders_[c].size();
            what = candidate.cameras[c] ? ladders_[c][at_[c] + up] : what;
        }
        if (what.empty() || !fit(candidate.cameras, &candidate)) {
            return;
        }
        std::vector<char> gaining = candidate.cameras;
        for (std::size_t c = 0; c < gaining.size(); ++c) {
            std::vector<char> alone(gaining.size(), 0);
            alone[c] = gaining[c];
            gaining[c] = gaining[c] && chooser_.significance(now_, candidate.fitted, alone) > 1.0;
        }
        if (gaining != candidate.cameras && std::count(gaining.begin(), gaining.end(), 1) > 0) {
            if (!fit(gaining, &candidate)) {
                return;
            }
        }
        finish(what, candidate.cameras, &candidate);
        out->push_back(std::move(candidate));
    }

    bool fit(const std::vector<char>& cameras, Candidate* candidate) const
    {
        const std::size_t up = candidate->lens_steps;
        const RigState start[2] = {with_lenses(now_.half[0], up, cameras),
                                   with_lenses(now_.half[1], up, cameras)};
        candidate->cameras = cameras;
        candidate->fitted = chooser_.fit(start);
        return candidate->fitted.usable;
    }

    void try_surface(std::size_t place, std::vector<Candidate>* out) const
    {
        if (place >= std::size(kSurfaceCells) || bendable_.empty()) {
            return;
        }
        const RigState start[2] = {with_surface(now_.half[0], place), with_surface(now_.half[1], place)};
        Candidate candidate;
        candidate.surface = place;
        candidate.cameras = seen_;
        candidate.fitted = chooser_.fit(start);
        if (candidate.fitted.usable) {
            finish(fmt::format("surface, {} cells", kSurfaceCells[place]), seen_, &candidate);
            out->push_back(std::move(candidate));
        }
    }

    void take(const Candidate& candidate)
    {
        if (candidate.lens_steps > 0) {
            whole_ = with_lenses(whole_, candidate.lens_steps, candidate.cameras);
            for (std::size_t c = 0; c < at_.size(); ++c) {
                at_[c] += candidate.cameras[c] ? candidate.lens_steps : 0;
            }
        } else {
            whole_ = with_surface(whole_, candidate.surface);
            next_surface_ = candidate.surface + 1;
        }
        now_ = candidate.fitted;
    }

    const Scene& scene_;
    const ChoiceOptions& options_;
    Chooser chooser_;
    RigState whole_;
    std::vector<std::vector<std::string>> ladders_;  // by camera
    std::vector<std::size_t> at_;                    // place on it
    std::size_t next_surface_ = 0;
    std::vector<std::size_t> bendable_;              // boards
    std::vector<char> seen_;                         // by camera
    std::vector<char> climbs_;                       // seen, and richer lenses may be tried
    std::size_t instants_ = 0;
    bool sigmas_known_ = true;
    FlexibleResult simple_;                          // first step of the simplest model
    Fitted now_;
};

}  // namespace

double student_quantile(double freedom)
{
    constexpr double z = kNormalQuantile;
    const double first = (z * z * z + z) / 4.0;
    const double second = (5.0 * std::pow(z, 5) + 16.0 * z * z * z + 3.0 * z) / 96.0;
    return z + first / freedom + second / (freedom * freedom);
}

ModelChoice choose_models(const Scene& scene, const std::vector<View>& views,
                          const ChoiceOptions& options, RigState* state)
{
    const Halves halves = deal(views);
    if (halves.instants < kChoiceInstantsMin) {
        return ModelChoice();
    }
    Walk walk(scene, halves, options, *state);
    const ModelChoice choice = walk.run();
    *state = walk.state();
    return choice;
}

}  // namespace rig
