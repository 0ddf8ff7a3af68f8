// How fast bodies move, as the data themselves tell it. With S_p the information that the views of
// body pose p give about its velocity (the pose free, lenses and cameras held) and b_p what they
// pull it by, b = S v for the velocity v that suits them best, and D the diagonal of the two
// deviations' squares, the velocity's mean is (S + D^-1)^-1 b and its covariance P = (S + D^-1)^-1.
// The deviations under which the data are likeliest obey (MacKay 1992)
//     d^2 = sum |v|^2 / sum (3 - trace P / d^2)         over the poses, turn and shift apart
// which is iterated. A body whose views show nothing of its velocity adds to neither sum.
#pragma once

#include "host/solve/views.h"

namespace rig {

// To be called at a minimum for the deviations that stand in the state, whose offsets may be made
// for any velocity. noise_factor by camera. Sets the state's deviations; true where they changed by
// so much that another solve is due.
bool update_velocity_deviation(const std::vector<View>& views, const std::vector<double>& noise_factor,
                               int threads, RigState* state);

// What the prior adds to the information of each velocity: the inverse of its variance.
Vector6 velocity_weight(const Shutter& shutter);

// Zero velocities for every pose, row times of the scene's cameras, and each view's clock. Nothing
// where no view of a body that moves has a row time.
void start_shutter(const Scene& scene, ViewSet* set, RigState* state);

// The same for one camera's views alone, each with a pose of its own that is given for the image's
// middle row. A row time that is not known makes no difference to lens and poses: any will do.
void start_own_shutter(const Scene& scene, const SceneCamera& camera, std::vector<View>* views,
                       RigState* state);

}  // namespace rig
