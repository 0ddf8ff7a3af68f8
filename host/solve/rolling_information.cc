// See rolling_information.h.
#include "host/solve/rolling_information.h"

#include <Eigen/Cholesky>

#include "host/solve/rolling_kernel.h"
#include "host/solve/velocity_prior.h"

namespace rig {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Pose and velocity of one body at one place.
struct MovingPart {
    Eigen::MatrixXd across;  // common rows by 12
    Eigen::Matrix<double, 12, 12> own = Eigen::Matrix<double, 12, 12>::Zero();
};

// Where the columns of rolling_normal go: common rows, below 0 for those held, and -2 - k for
// column k of the body's twelve.
std::vector<Eigen::Index> places_of(const View& view, const CommonRows& rows, Eigen::Index lens_count)
{
    const auto camera = static_cast<std::size_t>(view.camera);
    std::vector<Eigen::Index> out;
    const auto add = [&](Eigen::Index first, Eigen::Index count) {
        for (Eigen::Index i = 0; i < count; ++i) {
            out.push_back(first < 0 ? -1 : first + i);
        }
    };
    const auto add_body = [&](Eigen::Index first) {
        for (Eigen::Index i = 0; i < 6; ++i) {
            out.push_back(-2 - first - i);
        }
    };
    add(rows.lens[camera], lens_count);
    add(rows.pose[camera], 6);
    add_body(0);
    if (view.member != kNoMember) {
        add(rows.member[static_cast<std::size_t>(view.member)], 6);
    }
    add_body(6);
    add(rows.row_time[camera], 1);
    return out;
}

void add_view(const Eigen::MatrixXd& normal, const std::vector<Eigen::Index>& places,
              Eigen::MatrixXd* common, MovingPart* part)
{
    for (std::size_t i = 0; i < places.size(); ++i) {
        for (std::size_t j = 0; j < places.size(); ++j) {
            const double value = normal(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
            const Eigen::Index a = places[i];
            const Eigen::Index b = places[j];
            if (a >= 0 && b >= 0) {
                (*common)(a, b) += value;
            } else if (a >= 0 && b <= -2) {
                part->across(a, -2 - b) += value;
            } else if (a <= -2 && b <= -2) {
                part->own(-2 - a, -2 - b) += value;
            }
        }
    }
}

// The velocity's Schur complement: from what is common, from the pose, and from what they share.
PosePart without_velocity(const MovingPart& part, const Vector6& known, Eigen::MatrixXd* common)
{
    Matrix6 velocity = part.own.bottomRightCorner<6, 6>();
    velocity.diagonal() += known;
    const Eigen::LLT<Matrix6> factor(velocity);
    const Eigen::MatrixXd by_common = factor.solve(part.across.rightCols<6>().transpose());
    const Matrix6 by_pose = factor.solve(part.own.bottomLeftCorner<6, 6>());
    PosePart out;
    common->noalias() -= part.across.rightCols<6>() * by_common;
    out.across = part.across.leftCols<6>() - part.across.rightCols<6>() * by_pose;
    out.own = part.own.topLeftCorner<6, 6>() - part.own.topRightCorner<6, 6>() * by_pose;
    return out;
}

}  // namespace

std::map<std::size_t, PosePart> rolling_information(const std::vector<View>& views, const RigState& state,
                                                    const CommonRows& rows, double noise_factor,
                                                    Eigen::MatrixXd* common)
{
    std::map<std::size_t, MovingPart> parts;
    for (const View& view : views) {
        LocalQuadratic quadratic;
        if (!rolling_quadratic(view, state, 0.0, true, &quadratic)) {
            continue;
        }
        MovingPart& part = parts[view.pose];
        if (part.across.size() == 0) {
            part.across = Eigen::MatrixXd::Zero(rows.size, 12);
        }
        const auto lens_count = static_cast<Eigen::Index>(
            state.lenses[static_cast<std::size_t>(view.camera)].intrinsics.size());
        const int links = view.member == kNoMember ? 2 : 3;
        add_view(rolling_normal(quadratic, rolling_maps(view, state), links),
                 places_of(view, rows, lens_count), common, &part);
    }
    const Vector6 known = noise_factor * noise_factor * velocity_weight(state.shutter);
    std::map<std::size_t, PosePart> out;
    for (const auto& [pose, part] : parts) {
        out[pose] = without_velocity(part, known, common);
    }
    return out;
}

}  // namespace rig
