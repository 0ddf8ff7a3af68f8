// The quadratic model of a view whose rows see a moving board one after another (shutter.h). To the
// view's own parameters (view_kernel.h) come six more: what the motion grows by from row to row,
//     motion of a point seen in row y = motion + y growth
// so that its derivative by the growth is y times that by the motion, and velocity, row time, pose
// and stamps all act through these twelve. A point's residual is
//     (projection + centre_offset_px + shift - observed) / sigma_px
// with the shift that which the state's velocity differs by from the one the offset was made for:
//     shift = d projection / d motion * M (s v - s_held v_held),   s = start_s + y row_time
// M leads from a body's velocity to the motion of its board in the camera's frame.
#pragma once

#include "host/solve/pose_chain.h"

namespace rig {

enum { kRollingMotionCount = 2 * kMotionCount };

using Matrix12x6 = Eigen::Matrix<double, kRollingMotionCount, 6>;
using Vector12 = Eigen::Matrix<double, kRollingMotionCount, 1>;

// Motion and growth by the parameters: each pose of the chain, the body's velocity (per rad/s and
// mm/s) and the camera's row time (per second).
struct RollingMaps {
    Matrix12x6 link[PoseChain::kLinksMax];  // camera, body, member
    Matrix12x6 velocity;
    Vector12 row_time;
};

RollingMaps rolling_maps(const View& view, const RigState& state);

// What the state's velocity adds to the motion beyond what is in the view's offsets: at row 0, and
// a row.
struct MotionChange {
    Vector6 first = Vector6::Zero();
    Vector6 growth = Vector6::Zero();
};

MotionChange motion_change(const View& view, const RigState& state);

// local_quadratic's like. Columns of `out`: the lens's intrinsics, motion, growth.
bool rolling_quadratic(const View& view, const RigState& state, double cauchy, bool derive,
                       LocalQuadratic* out);

// The normal matrix by the lens's parameters, six of each link (two or three), the velocity's six
// and the row time.
Eigen::MatrixXd rolling_normal(const LocalQuadratic& quadratic, const RollingMaps& maps, int links);

// Where a view's board is for each of its rows.
class RowPoses {
public:
    RowPoses(const View& view, const RigState& state);
    // cam_from_board at the time that the body's pose is given for.
    const Pose& still() const { return still_; }
    Pose at(double row) const;

private:
    RowClock clock_;
    Pose camera_;
    Pose body_;
    Pose member_;
    Pose still_;
    Vector6 velocity_ = Vector6::Zero();
    double row_time_s_ = 0.0;
};

// What the shutter moves a point by in the image, px: `there` is where its row sees the board. Zero
// where it has no image.
Eigen::Vector2d shutter_shift(const Camera& lens, const Pose& still, const Pose& there,
                              const Eigen::Vector3d& at_mm);

// Takes the state's velocity as the one that the view's offsets are made for.
void hold_velocity(const RigState& state, View* view);

}  // namespace rig
