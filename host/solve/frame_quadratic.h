// What single frames say of a lens or a camera's place (change.h), gathered from their views.
#pragma once

#include <map>

#include "host/solve/change.h"
#include "host/solve/view_kernel.h"

namespace rig {

// The view's quadratic over the points that agree with most of it, whatever was rejected before: a
// view that was rejected as a whole is what is looked for. Sets frame, points and squares of
// `frame`. False where there are too few points.
bool own_quadratic(const View& view, const Camera& lens, const Pose& cam_from_board,
                   FrameQuadratic* frame, LocalQuadratic* out);

// Quadratics of one frame become one.
class FrameQuadratics {
public:
    void add(const FrameQuadratic& view);
    std::vector<FrameQuadratic> list() const;  // by frame

private:
    std::map<std::int64_t, FrameQuadratic> by_frame_;
};

}  // namespace rig
