// Observations put together as the solver works on them: a view is what one camera saw of one board
// in one frame. A body is what moves as one piece: a board, or a group of boards fixed to each
// other. Views that share a pose see the same body at the same place:
//     cam_from_board = cam_from_rig * rig_from_body * body_from_board
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "host/base/bspline.h"
#include "host/base/pose.h"
#include "host/model/camera.h"
#include "host/obs/observation.h"
#include "host/solve/shutter.h"

namespace rig {

// 64 bytes: there are millions of them.
struct ViewPoint {
    Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // observed
    Eigen::Vector3d at_mm = Eigen::Vector3d::Zero();  // board frame
    Eigen::Vector2f centre_offset_px = Eigen::Vector2f::Zero();  // see circle_centre.h, shutter.h
    float radius_mm = 0.0f;
    float sigma_px = 1.0f;     // whitening; above 0
    std::uint32_t point = 0;   // index into Board::points
    bool sigma_known = false;  // false: sigma_px is the solver's estimate
    bool used = true;          // false: rejected as an outlier
};

constexpr int kNoMember = -1;

struct View {
    int camera = 0;
    int board = 0;
    std::int64_t frame = 0;
    std::size_t pose = 0;    // index into ViewSet::poses
    int member = kNoMember;  // index into ViewSet::members; kNoMember: the board's frame is the body's
    std::vector<ViewPoint> points;
    RowClock clock = {};
};

// One body at one place: a frame's, or that of a body that does not move, whose frame is then the
// first it was seen in. A body is called by its first board, whose frame is its own.
struct PoseKey {
    int body = 0;
    std::int64_t frame = 0;
    int part = 0;  // parts of the rig that nothing connects have poses of their own
    double time_s = 0.0;  // that the pose is given for, after the instant's earliest stamp
};

struct ViewSet {
    std::vector<View> views;      // by camera, frame, board
    std::vector<PoseKey> poses;   // empty until assign_poses
    std::vector<int> members;     // boards fixed to the first of their body
    std::map<std::string, std::size_t> rejected;  // observations in no view, by reason
};

// A board's height over its plane z = constant, mm; see surface.h.
struct Surface {
    BsplineGrid grid;             // mm, board frame
    std::vector<double> control;  // mm; empty: flat

    bool empty() const { return control.empty(); }
};

// What is solved for. Gauge: cam_from_rig of the first camera of each part stays the identity.
struct RigState {
    std::vector<Camera> lenses;
    std::vector<Vector6> cam_from_rig;     // six numbers as in pose.h
    std::vector<Vector6> rig_from_body;    // one per ViewSet::poses
    std::vector<Vector6> body_from_board;  // one per ViewSet::members
    std::vector<Surface> surfaces = {};    // by scene board; may be shorter: the others are flat
    Shutter shutter = {};
};

// Null for a flat board.
const Surface* surface_of(const RigState& state, int board);

// The pose of a view's board in the rig and in its camera.
Pose rig_from_board(const RigState& state, const View& view);
Pose cam_from_board(const RigState& state, const View& view);

enum { kViewPointsMin = 6 };

// Groups the scene's observations. Views of fewer than kViewPointsMin points, or of points that all
// lie on a line, do not carry a pose: they are left out and counted. Poses are not yet given.
ViewSet make_views(const Scene& scene);

// Gives every view its pose and member: cameras belong to parts (by camera; a negative one has no
// views), boards to bodies (by board: the first board of its body).
void assign_poses(const Scene& scene, const std::vector<int>& part_of_camera,
                  const std::vector<int>& body_of_board, ViewSet* set);

// The views with at most `points_max` of their used points each, spread over the view.
std::vector<View> thinned(const std::vector<View>& views, std::size_t points_max);
View thinned(const View& view, std::size_t points_max);

}  // namespace rig
