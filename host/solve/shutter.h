// Rolling shutter: rows are exposed one after another, and each sees a board that moves where it is
// then. Row y of an image is seen at
//     t = stamp + y row_time        (stamp: middle of the exposure of the first row, common/README.md)
// and within an instant a body turns and shifts evenly: s after the time that its pose is given for,
//     rig_from_body(s) = (exp(s w) R, t + s v)       w rad/s, v mm/s: axes of the rig, about the body's origin
//
// Which velocity: six numbers for each body and instant, as the pose is, and none from one instant to the
// next. A board that spans rows shows them by its skew; folders of observations have no times, and a hand
// that turns round between two frames is not what their difference says. What a view shows badly (a board
// that comes nearer looks like one that is tilted, as long as all cameras read rows alike) is settled by
// a prior of mean zero, whose two deviations, of w and of v, are found from the same data, as those
// under which the data are likeliest (velocity_prior.h). Boards that were held still make them so small
// that the velocities are zero and cost nothing: no switch, no threshold.
//
// Only row times times velocities are seen: without one row time that is known, or stamps that differ, a
// row time that is asked for cannot be told (check_row_times).
//
// What the shutter moves a point by in the image stands in centre_offset_px together with what a circle's
// centre is moved by, so that all that works on residuals takes it for a fixed board; it is held during a
// solve, with the velocity that it was made for, and brought up to date between solves. A solve adds what
// a change of velocity does, to first order (rolling_kernel.h).
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/base/pose.h"

namespace rig {

// When a view's rows see its board.
struct RowClock {
    bool moves = false;    // false: the body stands still, or nothing of this scene needs times
    double start_s = 0.0;  // first row's time after the one that the body's pose is given for
    // What the view's offsets were made for.
    Vector6 held_velocity = Vector6::Zero();
    double held_row_s = 0.0;

    double at_s(double row_time_s, double row) const { return moves ? start_s + row_time_s * row : 0.0; }
};

// Of the velocities about zero.
struct VelocityDeviation {
    double turn_rad_s = 3.0;     // an arm that swings; to begin with
    double shift_mm_s = 2000.0;
};

// Part of what is solved for. Empty where no camera that sees a body move has rows to tell apart: then
// everything is as if there were no shutters.
struct Shutter {
    std::vector<Vector6> velocity;   // by ViewSet::poses: w, v
    std::vector<double> row_time_s;  // by camera
    std::vector<char> estimated;     // by camera: its row time is solved for
    VelocityDeviation deviation;
    double told = 6.0;               // of a body's six numbers, how many the data tell: mean over poses
    double wider = 1.0;              // how much wider than these deviations the prior is
    bool row_times_held = false;     // those that were solved for are held at what was found

    bool empty() const { return velocity.empty(); }
};

// rig_from_body, s seconds on.
Pose moved_by(const Pose& rig_from_body, const Vector6& velocity, double s);

}  // namespace rig
