// An earlier result with its covariance as a Gaussian prior on lenses and, where asked, camera poses.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "host/base/status.h"
#include "host/solve/covariance.h"
#include "host/solve/intrinsics.h"
#include "host/solve/lens_choice.h"

namespace ceres {
class CostFunction;
class Problem;
}

namespace rig {

// Cameras as they stand in the earlier result, and which of the scene's they are.
struct Prior {
    std::string source;               // what sentences call it
    std::vector<std::string> names;
    std::vector<Camera> lenses;
    std::vector<Pose> cam_from_rig;   // of one rig
    RigCovariance covariance;         // by these cameras
    bool poses = false;               // the cameras stand to each other as they did
    std::vector<int> place;           // by scene camera: index into the above; -1 where it is not in it
};

// Cameras are matched by name; those whose lens is left open get the prior's (`lenses`, by scene camera).
// Fails with a sentence when none is in the scene, or when one has images of another size (`sizes_px` of
// the earlier result), another lens than it is told to have, or a field there, whose covariance no file holds.
Status match_prior(const Scene& scene, const std::vector<Eigen::Vector2i>& sizes_px,
                   std::vector<LensChoice>* lenses, Prior* prior);

// Where the blocks of a solve lie, by scene camera; null where a camera takes no part.
struct PriorBlocks {
    std::vector<double*> lens;
    std::vector<double*> cam_from_rig;
};

// Adds the prior as one residual block: W (x - x0) with W'W the inverse of the prior's covariance of what
// it is about, x lenses and, with `poses`, the motions of the cameras against the earlier result's first
// that is in the scene. Nothing is added when fewer than one camera of the prior takes part.
void add_prior(const Prior& prior, const PriorBlocks& blocks, ceres::Problem* problem);

// The same residuals for a solver that makes its own equations.
class PriorTerm {
public:
    // First columns of each scene camera's intrinsics and pose; -1 where it has none. Cameras without
    // columns for their intrinsics take no part; a prior that is null has nothing to say.
    PriorTerm(const Prior* prior, const std::vector<Eigen::Index>& lens,
              const std::vector<Eigen::Index>& pose);
    ~PriorTerm();

    // W (x - x0) at a state; `slope` (may be null) gets its derivatives, `columns` of them, by the numbers
    // of the state. Without a row where no camera takes part.
    Eigen::VectorXd at(const RigState& state, Eigen::Index columns, Eigen::MatrixXd* slope) const;

private:
    std::unique_ptr<ceres::CostFunction> cost_;  // null: no camera takes part
    std::vector<std::size_t> cameras_;           // its blocks: their lenses, then with poses their poses
    std::vector<Eigen::Index> columns_;          // by block
};

// Its information about a state: rows as covariance.h says, but a pose's six numbers are those of the
// state. `places` gives the rows of the result; it is zero elsewhere.
Eigen::MatrixXd prior_information(const Prior& prior, const RigState& state, const RigCovariance& places,
                                  Eigen::Index rows);

// Sum of its squared whitened differences from a state, and how many they are. takes_part: by scene camera.
double prior_squares(const Prior& prior, const RigState& state, const std::vector<bool>& takes_part,
                     double* degrees);

// Whether the prior (null: none) has this scene camera.
bool in_prior(const Prior* prior, std::size_t camera);

// For a camera with too few views to be calibrated alone: the prior's lens, and the poses of its views
// through it. Fails with a sentence when it has none, or when its points do not fit this lens.
Result<CameraAlone> poses_through_prior(const Scene& scene, const Prior& prior, const ViewSet& set,
                                        std::size_t camera);

// A camera whose own views contradict the prior: fails with a sentence that names it, tells by how much,
// and whose lens it has instead. by_view: cam_from_board of each view in `set`.
// Unless boards are held `flat`, a camera contradicts only if it does so with boards that bend, too.
Status check_prior(const Scene& scene, const Prior& prior, const ViewSet& set,
                   const std::vector<Camera>& lenses, const std::vector<Pose>& by_view, bool flat);

constexpr double kPriorSigmas = 5.0;

}  // namespace rig
