/* Where every circle of the board lands in an image: the ellipse that its edge makes. */
#ifndef RENDER_RIM_TRUTH_H
#define RENDER_RIM_TRUTH_H

#include <vector>

#include "tools/render/mosaic.h"
#include "tools/render/render_scene.h"

namespace render {

struct RimTruth {
    unsigned patch = 0;
    unsigned feature = 0;
    Eigen::Vector2d centre;      // of the ellipse, pixels
    double major_px = 0;         // semi-axes
    double minor_px = 0;
    double angle_deg = 0;        // of the major axis from +x towards +y, [-90, 90)
    bool white = false;
    Eigen::Vector2d circle_centre; // image of the circle's centre
    bool visible = false;
};

// The circles that are at least partly in the image, at the middle of the exposure of the rows where
// they lie.
std::vector<RimTruth> find_rims(const Camera& camera, const Mosaic& mosaic, const Instant& instant);

// The ellipse with the least sum of squared distances to the points of a closed curve, each weighted by
// the length of curve that it stands for. False when the points make none.
struct Ellipse {
    Eigen::Vector2d centre;
    double major;
    double minor;
    double angle_rad;
};
bool fit_ellipse(const std::vector<Eigen::Vector2d>& curve, Ellipse& out);

} // namespace render

#endif
