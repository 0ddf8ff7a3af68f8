// The normal equations of a rig whose lenses may have fields and whose boards may have surfaces. A
// point feels sixteen control points of each, so that its derivatives are sparse and a view's block,
// dense in all control points, would be wasteful: here points add straight into one matrix, and board
// poses are eliminated from it.
//
// Columns: for each camera its intrinsics (unless it has a field: then they are held) and its
// cam_from_rig (not for the gauge camera); then boards fixed to their body's first; then fields, x control
// points before y; then surfaces; then row times that are solved for. Where shutters roll (shutter.h) each
// pose has a velocity, which is eliminated before it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/solve/views.h"

namespace rig {

// First column of each part; -1 where it is not solved for.
struct FlexibleLayout {
    std::vector<Eigen::Index> lens;     // by camera
    std::vector<Eigen::Index> camera;   // by camera
    std::vector<Eigen::Index> member;   // body_from_board
    std::vector<Eigen::Index> field;    // by camera
    std::vector<Eigen::Index> surface;  // by board
    std::vector<Eigen::Index> row_time;  // by camera
    Eigen::Index size = 0;
};

// Cameras without a view in use, and with poses_only all cameras and boards, have no columns.
FlexibleLayout make_layout(const RigState& state, const std::vector<View>& views,
                           const std::vector<char>& use,
                           const std::vector<int>& gauge_cameras, bool poses_only);

struct FlexibleSystem {
    double squares = 0.0;      // sum of the used points' squared whitened residuals
    std::size_t points = 0;    // used
    Eigen::MatrixXd normal;    // lower triangle
    Eigen::VectorXd gradient;
    // By pose of a body, six each: its coupling with the columns (size rows), its own block, its gradient.
    Eigen::MatrixXd across;
    Eigen::Matrix<double, 6, Eigen::Dynamic> own;
    Eigen::VectorXd pose_gradient;
    // The same of velocities, and their coupling with poses (rows velocity, columns pose); without columns where
    // no shutter rolls.
    Eigen::MatrixXd velocity_across;
    Eigen::Matrix<double, 6, Eigen::Dynamic> velocity_own;
    Eigen::Matrix<double, 6, Eigen::Dynamic> velocity_by_pose;
    Eigen::VectorXd velocity_gradient;
};

// Sums over the views marked in `use`. With derive false only squares and points. False when a used
// point has no image.
bool sum_points(const std::vector<View>& views, const std::vector<char>& use,
                const std::vector<Board>& boards, const RigState& state, const FlexibleLayout& layout,
                bool derive, FlexibleSystem* out);

}  // namespace rig
