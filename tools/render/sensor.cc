/* Light levels, noise, digits; and the backdrop. */
#include "tools/render/sensor.h"

#include <algorithm>
#include <cmath>

#include "tools/render/noise.h"

namespace render {

namespace {

constexpr double pi = 3.14159265358979323846;
constexpr double grey_max = 255;

// Smooth noise in [-1, 1]: random values at the corners of a grid, blended.
double value_noise(std::uint64_t key, double x, double y)
{
    const double ix = std::floor(x);
    const double iy = std::floor(y);
    const auto smooth = [](double t) { return t * t * t * (t * (6 * t - 15) + 10); };
    const double fx = smooth(x - ix);
    const double fy = smooth(y - iy);
    const auto corner = [&](int dx, int dy) {
        const auto column = static_cast<std::uint32_t>(static_cast<std::int32_t>(ix) + dx);
        const auto row = static_cast<std::uint32_t>(static_cast<std::int32_t>(iy) + dy);
        return 2 * noise_uniform(key, (std::uint64_t{row} << 32) | column) - 1;
    };
    const double top = corner(0, 0) + fx * (corner(1, 0) - corner(0, 0));
    const double bottom = corner(0, 1) + fx * (corner(1, 1) - corner(0, 1));
    return top + fy * (bottom - top);
}

// Rectangles and ellipses, turned any way, each of one level, edges softened over a pixel.
void add_clutter(const Camera& camera, int border_px, std::uint64_t key, Plane& plane)
{
    const int stride = camera.lens.width_px + 2 * border_px;
    const int rows = camera.lens.height_px + 2 * border_px;
    const double size = 0.25 * std::min(stride, rows);
    for (int i = 0; i < camera.background.clutter; i++) {
        const auto pick = [&](unsigned k) {
            return noise_uniform(key, static_cast<std::uint64_t>(8 * i) + k);
        };
        const double cx = pick(0) * stride;
        const double cy = pick(1) * rows;
        const double a = std::max(3.0, size * pick(2) * pick(2));
        const double b = std::max(3.0, size * pick(3) * pick(3));
        const double cos_turn = std::cos(pi * pick(4));
        const double sin_turn = std::sin(pi * pick(4));
        const double level = pick(5);
        const bool ellipse = pick(6) < 0.5;
        const double reach = std::hypot(a, b) + 2;
        const int low_y = std::max(0, static_cast<int>(cy - reach));
        const int high_y = std::min(rows, static_cast<int>(cy + reach));
        const int low_x = std::max(0, static_cast<int>(cx - reach));
        const int high_x = std::min(stride, static_cast<int>(cx + reach));
        for (int y = low_y; y < high_y; y++) {
            for (int x = low_x; x < high_x; x++) {
                const double u = (x - cx) * cos_turn + (y - cy) * sin_turn;
                const double v = (y - cy) * cos_turn - (x - cx) * sin_turn;
                const double inside = ellipse
                                          ? std::min(a, b) * (1 - std::hypot(u / a, v / b))
                                          : std::min(a - std::abs(u), b - std::abs(v));
                const double share = std::clamp(inside + 0.5, 0.0, 1.0);
                float& value = plane[static_cast<std::size_t>(y * stride + x)];
                value += static_cast<float>(share) * (static_cast<float>(level) - value);
            }
        }
    }
}

} // namespace

Plane make_backdrop(const Camera& camera, int border_px, std::uint64_t key)
{
    const Background& background = camera.background;
    const int stride = camera.lens.width_px + 2 * border_px;
    const int rows = camera.lens.height_px + 2 * border_px;
    Plane plane(static_cast<std::size_t>(stride) * static_cast<std::size_t>(rows),
                static_cast<float>(background.level));
    if (background.amplitude > 0) {
        for (int y = 0; y < rows; y++) {
            for (int x = 0; x < stride; x++) {
                double sum = 0;
                for (unsigned octave = 0; octave < 3; octave++) {
                    const double scale = background.scale_px / (1 << octave);
                    sum += value_noise(key + octave, x / scale, y / scale) / (1 << octave);
                }
                float& value = plane[static_cast<std::size_t>(y * stride + x)];
                value = static_cast<float>(std::clamp(
                    static_cast<double>(value) + background.amplitude * sum, 0.0, 1.0));
            }
        }
    }
    add_clutter(camera, border_px, noise_bits(key, 1), plane);
    return plane;
}

std::vector<double> expose(const Camera& camera, const Plane& reflectance, std::uint64_t key)
{
    const int width = camera.lens.width_px;
    const int height = camera.lens.height_px;
    const double mid_x = 0.5 * (width - 1);
    const double mid_y = 0.5 * (height - 1);
    const double corner2 = mid_x * mid_x + mid_y * mid_y;
    const double direction = camera.shading_direction_deg * pi / 180;
    const double dir_x = std::cos(direction);
    const double dir_y = std::sin(direction);
    const double half = std::abs(dir_x) * mid_x + std::abs(dir_y) * mid_y;
    const bool noisy = camera.noise > 0 || camera.shot_noise > 0;
    std::vector<double> grey(reflectance.size());
    double normal[2] = {0, 0};
    std::size_t i = 0;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++, i++) {
            const double dx = x - mid_x;
            const double dy = y - mid_y;
            const double across = 0.5 + 0.5 * (dx * dir_x + dy * dir_y) / half;
            const double light = (1 - camera.vignetting * (dx * dx + dy * dy) / corner2) *
                                 (1 - (1 - camera.shading_to) * across);
            double value = (camera.black + (camera.white - camera.black) *
                                               static_cast<double>(reflectance[i])) * light;
            if (camera.gamma != 1) {
                value = grey_max * std::pow(std::max(value, 0.0) / grey_max, 1 / camera.gamma);
            }
            if (noisy) {
                if (i % 2 == 0) {
                    noise_normal_pair(key, i / 2, normal);
                }
                const double variance = camera.noise * camera.noise +
                                        camera.shot_noise * std::max(value, 0.0);
                value += std::sqrt(variance) * normal[i % 2];
            }
            grey[i] = value;
        }
    }
    return grey;
}

std::vector<std::uint16_t> digitise(const Camera& camera, const std::vector<double>& grey)
{
    const double top = (1 << camera.bits) - 1;
    std::vector<std::uint16_t> out(grey.size());
    for (std::size_t i = 0; i < grey.size(); i++) {
        const double digit = std::floor(grey[i] * top / grey_max + 0.5);
        out[i] = static_cast<std::uint16_t>(std::clamp(digit, 0.0, top));
    }
    return out;
}

} // namespace render
