// Observations put together as the solver works on them: a view is what one camera saw of one board
// in one frame. Views that share a pose see the same board at the same place.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "host/base/pose.h"
#include "host/model/camera.h"
#include "host/obs/observation.h"

namespace rig {

struct ViewPoint {
    Eigen::Vector3d at_mm = Eigen::Vector3d::Zero();  // board frame
    double radius_mm = 0.0;
    Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // observed
    double sigma_px = 1.0;                           // whitening; above 0
    bool sigma_known = false;                        // false: sigma_px is the solver's estimate
    Eigen::Vector2d centre_offset_px = Eigen::Vector2d::Zero();  // see circle_centre.h
    bool used = true;                                // false: rejected as an outlier
    std::size_t observation = 0;                     // index into Scene::observations
};

struct View {
    int camera = 0;
    int board = 0;
    std::int64_t frame = 0;
    std::size_t pose = 0;  // index into ViewSet::poses
    std::vector<ViewPoint> points;
};

// One board at one place: a frame's, or a static board's, whose frame is then the first it was seen in.
struct PoseKey {
    int board = 0;
    std::int64_t frame = 0;
};

struct ViewSet {
    std::vector<View> views;      // by camera, frame, board
    std::vector<PoseKey> poses;
    std::map<std::string, std::size_t> rejected;  // observations in no view, by reason
};

// What is solved for. Gauge: cam_from_rig of the first camera that is solved stays the identity.
struct RigState {
    std::vector<Camera> lenses;
    std::vector<Vector6> cam_from_rig;    // six numbers as in pose.h
    std::vector<Vector6> rig_from_board;  // one per ViewSet::poses
};

enum { kViewPointsMin = 6 };

// Groups the scene's observations. Views of fewer than kViewPointsMin points, or of points that all
// lie on a line, do not carry a pose: they are left out and counted.
ViewSet make_views(const Scene& scene);

}  // namespace rig
