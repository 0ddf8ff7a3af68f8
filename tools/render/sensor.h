/* From reflectance to what the sensor reads out: light levels, fall-off, gamma, noise. */
#ifndef RENDER_SENSOR_H
#define RENDER_SENSOR_H

#include <cstdint>
#include <vector>

#include "tools/render/raster.h"

namespace render {

// Grey levels of 255, neither rounded nor clipped. Noise comes from `key` and the pixel's index alone.
std::vector<double> expose(const Camera& camera, const Plane& reflectance, std::uint64_t key);

// Rounded to the nearest and clipped to the camera's bits.
std::vector<std::uint16_t> digitise(const Camera& camera, const std::vector<double>& grey);

// What stands behind the board, with a border round the image: a level, a soft texture, sharp shapes.
Plane make_backdrop(const Camera& camera, int border_px, std::uint64_t key);

} // namespace render

#endif
