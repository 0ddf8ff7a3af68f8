// See change.h. With N and g of a frame, its own best value is -N^-1 g, and fitting it lowers the
// sum of squares by g' N^-1 g. Summed over a stretch of frames the same says what one value for the
// stretch gains. T is what two values gain over one, W what each frame's own value would gain
// beyond these. Where all is well both are sums of squares of noise, T of as many as there are
// parameters p, and
//     F = (T / p) / (W / (degrees of freedom of W))
// is near 1; frames that are off at random raise both.
#include "host/solve/change.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace rig {
namespace {

// Chance alone brings F of 6 parameters above 10 once in 1e9 for twenty frames and more, for eight
// frames above 25; there are as many places for a change as frames.
constexpr double kRatioMin = 25.0;
// Root mean square way of the points, in units of their own noise: below, it is no reason to
// refuse.
constexpr double kEffectMin = 1.5;
// The frames that agree least may be wrong ones: they have no vote.
constexpr double kVotingPart = 0.8;
// Eigenvalues below this part of the largest are rounding.
constexpr double kRankPart = 1e-9;

struct Fit {
    Eigen::VectorXd value;
    double gain = 0.0;
    int rank = 0;
};

Fit fit(const Eigen::MatrixXd& normal, const Eigen::VectorXd& gradient)
{
    Fit out;
    const Eigen::VectorXd scale = normal.diagonal().unaryExpr(
        [](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 0.0; });
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * normal
                                                               * scale.asDiagonal());
    const Eigen::VectorXd folded = eigen.eigenvectors().transpose() * scale.cwiseProduct(gradient);
    Eigen::VectorXd solved = Eigen::VectorXd::Zero(gradient.size());
    const double least = kRankPart * eigen.eigenvalues().tail<1>()[0];
    for (Eigen::Index i = 0; i < gradient.size(); ++i) {
        if (eigen.eigenvalues()[i] > least) {
            solved[i] = -folded[i] / eigen.eigenvalues()[i];
            out.gain -= folded[i] * solved[i];
            ++out.rank;
        }
    }
    out.value = scale.cwiseProduct(eigen.eigenvectors() * solved);
    return out;
}

// Of frames [begin, end) that vote.
Fit fit(const std::vector<FrameQuadratic>& frames, const std::vector<bool>& votes, std::size_t begin,
        std::size_t end)
{
    const Eigen::Index size = frames.front().gradient.size();
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(size);
    for (std::size_t i = begin; i < end; ++i) {
        if (votes[i]) {
            normal += frames[i].normal;
            gradient += frames[i].gradient;
        }
    }
    return fit(normal, gradient);
}

// How much more than `value` the frame would like.
double deviation(const FrameQuadratic& frame, double own_gain, const Eigen::VectorXd& value)
{
    return own_gain + 2.0 * frame.gradient.dot(value) + value.dot(frame.normal * value);
}

std::size_t best_split(const std::vector<FrameQuadratic>& frames, const std::vector<bool>& votes)
{
    FrameQuadratic before = frames.front();
    before.normal.setZero();
    before.gradient.setZero();
    FrameQuadratic after = before;
    const auto move = [&](std::size_t i, double sign, FrameQuadratic* to) {
        to->normal += (votes[i] ? sign : 0.0) * frames[i].normal;
        to->gradient += (votes[i] ? sign : 0.0) * frames[i].gradient;
    };
    for (std::size_t i = 0; i < frames.size(); ++i) {
        move(i, 1.0, &after);
    }
    std::size_t best = kChangeFramesMin;
    double best_gain = -HUGE_VAL;
    for (std::size_t k = 1; k + kChangeFramesMin <= frames.size(); ++k) {
        move(k - 1, 1.0, &before);
        move(k - 1, -1.0, &after);
        if (k < kChangeFramesMin) {
            continue;
        }
        const double gain =
            fit(before.normal, before.gradient).gain + fit(after.normal, after.gradient).gain;
        if (gain > best_gain) {
            best_gain = gain;
            best = k;
        }
    }
    return best;
}

// Where frames that had no vote are taken in: the split whose frames deviate least from their
// side's value, each frame counting by the logarithm, so that a wrong one cannot decide.
std::size_t settled_split(const std::vector<FrameQuadratic>& frames, const std::vector<Fit>& own,
                          const Fit& before, const Fit& after, double typical)
{
    const auto cost = [&](std::size_t i, const Fit& side) {
        const double off = deviation(frames[i], own[i].gain, side.value);
        return std::log1p(std::max(0.0, off) / typical);
    };
    double sum = 0.0;
    double best_sum = HUGE_VAL;
    std::size_t best = kChangeFramesMin;
    for (std::size_t i = 0; i < frames.size(); ++i) {
        sum += i < kChangeFramesMin ? cost(i, before) : cost(i, after);
    }
    for (std::size_t k = kChangeFramesMin; k + kChangeFramesMin <= frames.size(); ++k) {
        if (sum < best_sum) {
            best_sum = sum;
            best = k;
        }
        sum += cost(k, before) - cost(k, after);
    }
    return best;
}

}  // namespace

std::optional<Change> find_change(const std::vector<FrameQuadratic>& frames)
{
    if (frames.size() < 2 * kChangeFramesMin) {
        return std::nullopt;
    }
    std::vector<bool> votes(frames.size(), true);
    std::vector<Fit> own;
    for (const FrameQuadratic& frame : frames) {
        own.push_back(fit(frame.normal, frame.gradient));
    }
    std::size_t split = best_split(frames, votes);
    const auto deviation_of = [&](std::size_t i, const Fit& before, const Fit& after) {
        return deviation(frames[i], own[i].gain, i < split ? before.value : after.value);
    };
    Fit before = fit(frames, votes, 0, split);
    Fit after = fit(frames, votes, split, frames.size());
    std::vector<double> sorted;
    for (std::size_t i = 0; i < frames.size(); ++i) {
        sorted.push_back(deviation_of(i, before, after));
    }
    const std::vector<double> deviations = sorted;
    std::sort(sorted.begin(), sorted.end());
    const double limit =
        sorted[static_cast<std::size_t>(kVotingPart * static_cast<double>(sorted.size() - 1))];
    for (std::size_t i = 0; i < frames.size(); ++i) {
        votes[i] = deviations[i] <= limit;
    }
    split = best_split(frames, votes);
    before = fit(frames, votes, 0, split);
    after = fit(frames, votes, split, frames.size());
    const Fit all = fit(frames, votes, 0, frames.size());
    const double gain = before.gain + after.gain - all.gain;
    double within = 0.0;
    double rest = 0.0;
    double freedom = -static_cast<double>(before.rank + after.rank);
    double points = 0.0;
    for (std::size_t i = 0; i < frames.size(); ++i) {
        if (votes[i]) {
            within += deviation_of(i, before, after);
            rest += frames[i].squares - own[i].gain;
            freedom += own[i].rank;
            points += static_cast<double>(frames[i].points);
        }
    }
    // Noise per axis: what is left when each frame has its own value.
    const double noise2 = std::max(0.0, rest) / (2.0 * points);
    const double ratio = gain / all.rank / (std::max(within, 0.0) / std::max(1.0, freedom));
    if (freedom < 1.0 || !(ratio > kRatioMin) || !(gain / points > kEffectMin * kEffectMin * noise2)) {
        return std::nullopt;
    }
    split = settled_split(frames, own, before, after, std::max(sorted[sorted.size() / 2], 1e-300));
    return Change{frames[split - 1].frame, frames[split].frame, after.value - before.value};
}

}  // namespace rig
