// How the views hang together, and a first rig from that. Cameras that see the same board at the
// same place are joined; so are boards of a group that joined cameras see at the same place; and
// where neither helps, a camera and a board on each side, by three places or more (hand_eye.h).
#pragma once

#include "host/solve/views.h"

namespace rig {

struct Connection {
    std::vector<std::vector<int>> parts;  // of cameras; largest first, then by first camera. A camera
                                          // without views is a part of its own
    std::vector<int> part_of_camera;
    std::vector<int> body_of_board;       // first of the boards that are joined with this one
};

// From who saw what alone.
Connection connect(const Scene& scene, const ViewSet& set);

// First values of the parts, from each camera alone: by_view is cam_from_board of each view. Always
// the two heaviest pieces are joined, a pair weighing as many points as were seen of both together;
// their relative pose is the one, of all that they share, that the others agree with most. The
// first camera of each part is its frame. Gives `set` its poses and members. `connection` gets what
// could be joined: less than `connect` says, where boards turned too little to tell their mutual
// pose.
RigState join_cameras(const Scene& scene, const std::vector<Camera>& lenses,
                      const std::vector<Pose>& by_view, ViewSet* set, Connection* connection);

}  // namespace rig
