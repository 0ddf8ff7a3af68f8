// Whether a richer model is worth it, said by instants that it has not seen.
//
// The instants are dealt into two halves, in turn. A model is fitted to one half; then, with lenses,
// cameras and surfaces held, the board's poses alone are fitted to each instant of the other half, and
// the squared residuals that remain are what the model predicts badly; and the same with the halves
// exchanged, so that every instant is predicted once. A model that follows noise loses there what it
// gains where it was fitted.
//
// The rule. For two models, d_f = log(S_simple / S_rich) of an instant's sums of squared residuals. The
// logarithm, because misfits are large in a few instants (a board in a far corner): a plain difference
// is as large as its own deviation then, however plain the gain. Instants are independent of each other,
// so t = mean(d) / (std(d) / sqrt(instants)) follows Student's distribution if the richer model gains
// nothing; it is significant when t lies beyond the quantile of one in a thousand. Where the gain is uneven
// (a lens that differs in the corners only), t is blind to it: Wilcoxon's signed ranks, which ask how
// many instants gain and not how much, may find it instead. It is taken when the sum over all instants is
// smaller as well. What an instant's residuals have in common (one pose, one part of
// the image) is inside d_f and does no harm. A camera's lens is judged by that camera's residuals, a
// board's surface by all.
//
// The order. From the simplest model on, each step tries the next richer lenses and the next finer
// surface, and takes the one that gains most, until none does. It is not begun where the first steps of
// the richer models promise no more than chance (a score test, one sum over the points each).
#pragma once

#include <string>
#include <vector>

#include "host/obs/observation.h"
#include "host/solve/views.h"

namespace rig {

struct Prior;

struct ChoiceOptions {
    std::vector<char> lenses;  // by scene camera: a richer one may be tried
    bool surfaces = true;      // boards may bend
    std::vector<int> gauge_cameras{0};
    const Prior* prior = nullptr;  // known to both halves; borrowed; null: none
};

// One comparison that was made.
struct ModelTrial {
    std::string what;           // "rational", "spline, 9 cells", "surface, 4 cells"
    double before = 0.0;        // whitened RMS of the held-out residuals of the model so far ...
    double after = 0.0;         // ... and of this one
    double significance = 0.0;  // the larger of t and the rank sum over its quantile; above 1: significant
    bool taken = false;
};

struct ModelChoice {
    std::size_t instants = 0;       // that were dealt; 0: too few to choose by
    std::vector<ModelTrial> trials;
    double held_out = 0.0;          // whitened RMS of held-out residuals of the model chosen, a freedom;
                                    // 0: not asked
    double held_out_allowed = 0.0;  // what it may be where the sigmas are right
    bool changed = false;           // the state was given a richer model than it came with
};

enum { kChoiceInstantsMin = 8 };

// `state` is the solution of the simple model over `views`. Returns it with the richer lenses, fields
// and surfaces that were chosen, not yet fitted to all views: values are near, no more.
ModelChoice choose_models(const Scene& scene, const std::vector<View>& views,
                          const ChoiceOptions& options, RigState* state);

// Quantile of one in a thousand of Student's distribution, by Cornish and Fisher's expansion: within 3 %
// from 7 degrees of freedom on.
double student_quantile(double freedom);

}  // namespace rig
