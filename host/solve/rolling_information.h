// The information that views with rolling shutters give, velocities eliminated: uncertainty.cc's
// sums.
#pragma once

#include <map>

#include "host/solve/views.h"

namespace rig {

// What the views of one body pose say: of the pose together with what is common, and of the pose
// itself.
struct PosePart {
    Eigen::MatrixXd across;  // common rows by 6
    Eigen::Matrix<double, 6, 6> own = Eigen::Matrix<double, 6, 6>::Zero();
};

// Rows of what is common; below 0: held.
struct CommonRows {
    std::vector<Eigen::Index> lens;      // by camera
    std::vector<Eigen::Index> pose;      // by camera
    std::vector<Eigen::Index> member;    // by ViewSet::members
    std::vector<Eigen::Index> row_time;  // by camera; s
    Eigen::Index size = 0;
};

// Adds to the common matrix, and gives each pose's part. Velocities have their prior, which counts
// with noise that is noise_factor times what the sigmas say.
std::map<std::size_t, PosePart> rolling_information(const std::vector<View>& views, const RigState& state,
                                                    const CommonRows& rows, double noise_factor,
                                                    Eigen::MatrixXd* common);

}  // namespace rig
