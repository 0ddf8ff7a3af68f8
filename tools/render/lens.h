/* A lens: pinhole with OpenCV's `brown` or `rational` distortion. Pixels: (0,0) is the centre of the
 * top-left pixel; camera frame x right, y down, z forward. Rays are given as (x/z, y/z). */
#ifndef RENDER_LENS_H
#define RENDER_LENS_H

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace render {

struct Lens {
    int width_px = 0;
    int height_px = 0;
    std::string model = "brown"; // "brown": 5 coefficients, "rational": 8
    double fx = 0;
    double fy = 0;
    double cx = 0;
    double cy = 0;
    std::array<double, 8> distortion{}; // k1 k2 p1 p2 k3 k4 k5 k6
    // Largest |ray| at which the radial distortion still grows; beyond it nothing has an image.
    double ray_max = 0;

    // Sets ray_max from the distortion.
    void find_ray_max();
    Eigen::Vector2d distort(const Eigen::Vector2d& ray) const;
    // False when the point is behind the camera or beyond ray_max.
    bool project(const Eigen::Vector3d& point_cam_mm, Eigen::Vector2d& pixel) const;
    // Exact inverse (Newton, to 1e-13). `ray` is the starting guess on entry. False when it has none.
    bool unproject(const Eigen::Vector2d& pixel, Eigen::Vector2d& ray) const;
};

// The ray of every pixel centre of the image and of a border round it; NaN where there is none.
struct RayMap {
    int border_px = 0;
    int stride = 0; // width + 2 border
    std::vector<Eigen::Vector2d> rays;

    // Rays of row y, indexed by column + border; y in [-border, height + border).
    const Eigen::Vector2d* row(int y) const
    {
        return rays.data() + static_cast<std::ptrdiff_t>(y + border_px) * stride;
    }
};

RayMap make_ray_map(const Lens& lens, int border_px);

} // namespace render

#endif
