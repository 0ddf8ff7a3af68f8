// See prior.h. Motions are on the left: exp(w) R0 = R, d = t - t0, with (R, t) the pose of a camera in the
// frame of the prior's first one that is in the scene, whatever the rig frame of either is. The prior's
// covariance is by its own rig frame; motions m_c of camera c and m_g of that first one make the motion
// between them m_c - Ad(rel) m_g, where Ad moves (w, d) through rel = c_from_g.
#include "host/solve/prior.h"

#include <ceres/dynamic_autodiff_cost_function.h>
#include <ceres/problem.h>
#include <ceres/rotation.h>
#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <memory>

namespace rig {
namespace {

// Directions of the equilibrated covariance below this are rounding: they are held no tighter.
constexpr double kEigenvalueMin = 1e-12;

// Cameras of the prior that take part, the first one first.
struct Known {
    std::vector<std::size_t> scene;
    std::vector<std::size_t> place;
};

Known known_cameras(const Prior& prior, const std::vector<bool>& takes_part)
{
    Known out;
    for (std::size_t place = 0; place < prior.names.size(); ++place) {
        for (std::size_t c = 0; c < prior.place.size(); ++c) {
            if (prior.place[c] == static_cast<int>(place) && takes_part[c]) {
                out.scene.push_back(c);
                out.place.push_back(place);
            }
        }
    }
    return out;
}

// Rows by the prior's own: lens after lens, then the motion of each camera but the first.
Eigen::MatrixXd rows_of(const Prior& prior, const Known& known)
{
    Eigen::Index count = 0;
    for (const std::size_t place : known.place) {
        count += static_cast<Eigen::Index>(prior.lenses[place].intrinsics.size());
    }
    const auto motions = static_cast<Eigen::Index>(prior.poses ? known.place.size() - 1 : 0);
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(count + 6 * motions, prior.covariance.matrix.cols());
    Eigen::Index at = 0;
    for (const std::size_t place : known.place) {
        for (std::size_t i = 0; i < prior.lenses[place].intrinsics.size(); ++i) {
            rows(at++, prior.covariance.lens[place] + static_cast<Eigen::Index>(i)) = 1.0;
        }
    }
    const std::size_t first = known.place.front();
    for (Eigen::Index i = 0; i < motions; ++i, at += 6) {
        const std::size_t place = known.place[static_cast<std::size_t>(i) + 1];
        const Pose rel = prior.cam_from_rig[place] * inverse(prior.cam_from_rig[first]);
        if (prior.covariance.pose[place] >= 0) {
            rows.block<6, 6>(at, prior.covariance.pose[place]).setIdentity();
        }
        if (prior.covariance.pose[first] >= 0) {
            // rel = C_c C_g^-1. A motion (w, d) of g, whose own translation is t_g: C_g^-1 becomes
            // (R_g' exp(-w), ...), so that rel turns by -R_rel w and shifts by R_rel (w x t_g - d); what the
            // turn does to R_rel t_g is in the first term.
            const Eigen::Vector3d t_g = prior.cam_from_rig[first].translation_mm;
            auto block = rows.block<6, 6>(at, prior.covariance.pose[first]);
            block.topLeftCorner<3, 3>() = -rel.rotation;
            block.bottomLeftCorner<3, 3>() = -rel.rotation * skew(t_g);
            block.bottomRightCorner<3, 3>() = -rel.rotation;
        }
        if (prior.covariance.pose[place] >= 0) {
            // The shift of rel by a motion of c turns R_rel t_g as well: t_rel = t_c - R_rel t_g.
            const Eigen::Vector3d turned = rel.rotation * prior.cam_from_rig[first].translation_mm;
            rows.block<3, 3>(at + 3, prior.covariance.pose[place]) += skew(turned);
        }
    }
    return rows;
}

// W with W'W the inverse of a covariance.
Eigen::MatrixXd whitening(const Eigen::MatrixXd& covariance)
{
    const Eigen::VectorXd scale = covariance.diagonal().unaryExpr(
        [](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 1.0; });
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * covariance
                                                               * scale.asDiagonal());
    return eigen.eigenvalues().cwiseMax(kEigenvalueMin).cwiseSqrt().cwiseInverse().asDiagonal()
           * eigen.eigenvectors().transpose() * scale.asDiagonal();
}

// Whitened difference; parameter blocks: lenses, then with poses the cameras' six numbers.
struct PriorResidual {
    std::vector<std::vector<double>> lenses;
    std::vector<Pose> relative;  // to the first camera, the others'
    Eigen::MatrixXd white;

    template <typename T>
    bool operator()(T const* const* blocks, T* residuals) const
    {
        using Vector = Eigen::Matrix<T, Eigen::Dynamic, 1>;
        Vector difference(white.cols());
        Eigen::Index at = 0;
        for (std::size_t i = 0; i < lenses.size(); ++i) {
            for (std::size_t k = 0; k < lenses[i].size(); ++k) {
                difference[at++] = blocks[i][k] - lenses[i][k];
            }
        }
        for (std::size_t i = 0; i < relative.size(); ++i, at += 6) {
            motion_between(blocks[lenses.size()], blocks[lenses.size() + i + 1], relative[i],
                           difference.data() + at);
        }
        Eigen::Map<Vector>(residuals, white.rows()) = white.template cast<T>() * difference;
        return true;
    }

    template <typename T>
    static void motion_between(const T* first, const T* other, const Pose& known, T* out)
    {
        using Matrix = Eigen::Matrix<T, 3, 3>;
        using Vector = Eigen::Matrix<T, 3, 1>;
        Matrix turn_first;
        Matrix turn_other;
        ceres::AngleAxisToRotationMatrix(first, turn_first.data());
        ceres::AngleAxisToRotationMatrix(other, turn_other.data());
        const Matrix rotation = turn_other * turn_first.transpose();
        const Matrix turn = rotation * known.rotation.transpose().template cast<T>();
        const Vector shift = Eigen::Map<const Vector>(other + 3) - rotation * Eigen::Map<const Vector>(first + 3)
                             - known.translation_mm.template cast<T>();
        ceres::RotationMatrixToAngleAxis(turn.data(), out);
        Eigen::Map<Vector>(out + 3) = shift;
    }
};

std::unique_ptr<ceres::CostFunction> prior_cost(const Prior& prior, const Known& known)
{
    auto residual = std::make_unique<PriorResidual>();
    const Eigen::MatrixXd rows = rows_of(prior, known);
    residual->white = whitening(rows * prior.covariance.matrix * rows.transpose());
    for (const std::size_t place : known.place) {
        residual->lenses.push_back(prior.lenses[place].intrinsics);
    }
    for (std::size_t i = 1; prior.poses && i < known.place.size(); ++i) {
        residual->relative.push_back(prior.cam_from_rig[known.place[i]]
                                     * inverse(prior.cam_from_rig[known.place.front()]));
    }
    const auto count = static_cast<int>(residual->white.rows());
    const bool poses = !residual->relative.empty();
    auto cost = std::make_unique<ceres::DynamicAutoDiffCostFunction<PriorResidual, 8>>(residual.release());
    for (const std::size_t place : known.place) {
        cost->AddParameterBlock(static_cast<int>(prior.lenses[place].intrinsics.size()));
    }
    for (std::size_t i = 0; poses && i < known.place.size(); ++i) {
        cost->AddParameterBlock(6);
    }
    cost->SetNumResiduals(count);
    return cost;
}

}  // namespace

Status match_prior(const Scene& scene, const std::vector<Eigen::Vector2i>& sizes_px,
                   std::vector<LensChoice>* lenses, Prior* prior)
{
    prior->place.assign(scene.cameras.size(), -1);
    bool any = false;
    for (std::size_t c = 0; c < scene.cameras.size(); ++c) {
        const SceneCamera& camera = scene.cameras[c];
        const auto found = std::find(prior->names.begin(), prior->names.end(), camera.name);
        if (found == prior->names.end()) {
            continue;
        }
        const auto place = static_cast<std::size_t>(found - prior->names.begin());
        if (sizes_px[place] != Eigen::Vector2i(camera.width_px, camera.height_px)) {
            return Status::failure(fmt::format(
                "camera '{}' has images of {} x {}, but of {} x {} in the prior {}: a prior holds for the image "
                "it was made from", camera.name, camera.width_px, camera.height_px, sizes_px[place].x(),
                sizes_px[place].y(), prior->source));
        }
        const Camera& known = prior->lenses[place];
        const std::string_view model = camera_model_name(known.model);
        if (!known.field.empty()) {
            return Status::failure(fmt::format(
                "camera '{}' has a spline lens in the prior {}, and what is known of its field is not in the "
                "file: solve that recording with --model {} to make it a prior", camera.name, prior->source,
                model));
        }
        LensChoice& lens = (*lenses)[c];
        if (lens.richer) {
            lens = {known.model, false, false};
        }
        if (lens.field || lens.model != known.model) {
            return Status::failure(fmt::format(
                "camera '{}' has a {} lens in the prior {}, not a {} one: give --model {}", camera.name, model,
                prior->source, lens.field ? "spline" : camera_model_name(lens.model), model));
        }
        prior->place[c] = static_cast<int>(place);
        any = true;
    }
    return any ? Status()
               : Status::failure("no camera of the prior " + prior->source + " is among those recorded");
}

void add_prior(const Prior& prior, const PriorBlocks& blocks, ceres::Problem* problem)
{
    std::vector<bool> takes_part;
    for (const double* lens : blocks.lens) {
        takes_part.push_back(lens != nullptr);
    }
    const Known known = known_cameras(prior, takes_part);
    if (known.scene.empty()) {
        return;
    }
    std::vector<double*> parameters;
    for (const std::size_t c : known.scene) {
        parameters.push_back(blocks.lens[c]);
    }
    for (std::size_t i = 0; prior.poses && known.scene.size() > 1 && i < known.scene.size(); ++i) {
        parameters.push_back(blocks.cam_from_rig[known.scene[i]]);
    }
    problem->AddResidualBlock(prior_cost(prior, known).release(), nullptr, parameters);
}

double prior_squares(const Prior& prior, const RigState& state, const std::vector<bool>& takes_part,
                     double* degrees)
{
    const Known known = known_cameras(prior, takes_part);
    *degrees = 0.0;
    if (known.scene.empty()) {
        return 0.0;
    }
    const std::unique_ptr<ceres::CostFunction> cost = prior_cost(prior, known);
    std::vector<const double*> parameters;
    for (const std::size_t c : known.scene) {
        parameters.push_back(state.lenses[c].intrinsics.data());
    }
    for (std::size_t i = known.scene.size(); i < cost->parameter_block_sizes().size(); ++i) {
        parameters.push_back(state.cam_from_rig[known.scene[i - known.scene.size()]].data());
    }
    Eigen::VectorXd residuals(cost->num_residuals());
    cost->Evaluate(parameters.data(), residuals.data(), nullptr);
    *degrees = static_cast<double>(residuals.size());
    return residuals.squaredNorm();
}

PriorTerm::PriorTerm(const Prior* prior, const std::vector<Eigen::Index>& lens,
                     const std::vector<Eigen::Index>& pose)
{
    if (prior == nullptr) {
        return;
    }
    std::vector<bool> takes_part;
    for (const Eigen::Index at : lens) {
        takes_part.push_back(at >= 0);
    }
    const Known known = known_cameras(*prior, takes_part);
    if (known.scene.empty()) {
        return;
    }
    cost_ = prior_cost(*prior, known);
    cameras_ = known.scene;
    for (std::size_t i = 0; i < cost_->parameter_block_sizes().size(); ++i) {
        const std::size_t camera = cameras_[i % cameras_.size()];
        columns_.push_back(i < cameras_.size() ? lens[camera] : pose[camera]);
    }
}

PriorTerm::~PriorTerm() = default;

Eigen::VectorXd PriorTerm::at(const RigState& state, Eigen::Index columns, Eigen::MatrixXd* slope) const
{
    if (cost_ == nullptr) {
        return {};
    }
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    std::vector<const double*> parameters;
    std::vector<RowMajor> slopes;
    std::vector<double*> pointers;
    for (std::size_t i = 0; i < columns_.size(); ++i) {
        const std::size_t camera = cameras_[i % cameras_.size()];
        parameters.push_back(i < cameras_.size() ? state.lenses[camera].intrinsics.data()
                                                 : state.cam_from_rig[camera].data());
        slopes.emplace_back(cost_->num_residuals(), cost_->parameter_block_sizes()[i]);
    }
    for (RowMajor& each : slopes) {
        pointers.push_back(each.data());
    }
    Eigen::VectorXd residuals(cost_->num_residuals());
    cost_->Evaluate(parameters.data(), residuals.data(), slope != nullptr ? pointers.data() : nullptr);
    if (slope != nullptr) {
        slope->setZero(residuals.size(), columns);
        for (std::size_t i = 0; i < slopes.size(); ++i) {
            if (columns_[i] >= 0) {
                slope->middleCols(columns_[i], slopes[i].cols()) = slopes[i];
            }
        }
    }
    return residuals;
}

Eigen::MatrixXd prior_information(const Prior& prior, const RigState& state, const RigCovariance& places,
                                  Eigen::Index rows)
{
    const PriorTerm term(&prior, places.lens, places.pose);
    Eigen::MatrixXd slope;
    return term.at(state, rows, &slope).size() > 0 ? Eigen::MatrixXd(slope.transpose() * slope)
                                                   : Eigen::MatrixXd::Zero(rows, rows);
}

}  // namespace rig
