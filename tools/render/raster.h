/* What a camera's sensor sees of the moving board, in reflectance: lens, blur, pixel area and exposure. */
#ifndef RENDER_RASTER_H
#define RENDER_RASTER_H

#include <vector>

#include "tools/render/mosaic.h"
#include "tools/render/render_scene.h"

namespace render {

// Row by row, reflectance [0, 1] averaged over pixel, blur and exposure.
using Plane = std::vector<float>;

// Everything about a camera that does not change from frame to frame.
class Stage {
public:
    // `fine`: sub-cells a pixel along each axis.
    Stage(const Camera& camera, const Mosaic& mosaic, const Plane& backdrop, int border_px, int fine);

    // Rendering reads the stage only: threads may share it.
    Plane render(const Instant& instant) const;

    // Border of pixels round the image that the blur reaches into, plus one.
    static int border_for(const Camera& camera);

private:
    struct Row;
    struct Pass;
    std::vector<Pass> make_passes(const Instant& instant) const;
    void map_row(const Instant& instant, int y, const Pass& pass, std::vector<Eigen::Vector2d>& out,
                 bool& from_behind) const;
    void add_row(const Pass& pass, int y, std::vector<float>& cells) const;
    void cover(int y, std::vector<float>& cells) const;
    void blur_along(const float* cells, float* out) const;

    const Camera& camera_;
    const Mosaic& mosaic_;
    const Plane& backdrop_;
    int border_;
    int fine_;
    int reach_;               // pixels that the blur reaches
    RayMap rays_;
    std::vector<float> taps_; // weight of each sub-cell from -reach to +reach
};

} // namespace render

#endif
