// See pose_chain.h.
#include "host/solve/pose_chain.h"

namespace rig {

PoseChain chain_of(const RigState& state, const View& view)
{
    PoseChain chain;
    chain.link[chain.count++] = state.cam_from_rig[static_cast<std::size_t>(view.camera)];
    chain.link[chain.count++] = state.rig_from_body[view.pose];
    if (view.member != kNoMember) {
        chain.link[chain.count++] = state.body_from_board[static_cast<std::size_t>(view.member)];
    }
    return chain;
}

void motion_maps(const PoseChain& chain, Eigen::Matrix<double, 6, 6> maps[PoseChain::kLinksMax])
{
    Pose behind;  // what follows link i
    Eigen::Vector3d shift[PoseChain::kLinksMax];
    for (int i = chain.count - 1; i >= 0; --i) {
        shift[i] = behind.translation_mm;
        behind = pose_exp(chain.link[i]) * behind;
    }
    Eigen::Matrix3d before = Eigen::Matrix3d::Identity();
    for (int i = 0; i < chain.count; ++i) {
        const Eigen::Vector3d vector = chain.link[i].head<3>();
        const Eigen::Matrix3d turned = before * rotation_exp(vector);
        const Eigen::Matrix3d turn = turned * rotation_right_jacobian(vector);
        maps[i].topLeftCorner<3, 3>() = turn;
        maps[i].topRightCorner<3, 3>().setZero();
        maps[i].bottomLeftCorner<3, 3>() = -skew(turned * shift[i]) * turn;
        maps[i].bottomRightCorner<3, 3>() = before;
        before = turned;
    }
}

Eigen::MatrixXd chain_normal(const LocalQuadratic& quadratic, const PoseChain& chain)
{
    const Eigen::Index lens = quadratic.normal.rows() - kMotionCount;
    Eigen::MatrixXd by_parameters =
        Eigen::MatrixXd::Zero(lens + kMotionCount, lens + kMotionCount * chain.count);
    by_parameters.topLeftCorner(lens, lens).setIdentity();
    Eigen::Matrix<double, 6, 6> maps[PoseChain::kLinksMax];
    motion_maps(chain, maps);
    for (int i = 0; i < chain.count; ++i) {
        by_parameters.block<6, 6>(lens, lens + kMotionCount * i) = maps[i];
    }
    return by_parameters.transpose() * quadratic.normal * by_parameters;
}

}  // namespace rig
