// See heat_map.h.
#include "host/report/heat_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "host/base/median.h"

namespace rig {
namespace {

constexpr int kWidthPx = 960;
constexpr int kCaptionPx = 28;
constexpr int kNumberEvery = 8;  // grid points from one number to the next

cv::Vec3f colour(double part)
{
    if (!std::isfinite(part)) {
        return {160.0F, 160.0F, 160.0F};
    }
    const double t = std::clamp(part, 0.0, 1.0);
    return cv::Vec3f(static_cast<float>(255.0 * std::max(0.0, 1.0 - 2.0 * t)),
                     static_cast<float>(200.0 * (1.0 - std::abs(2.0 * t - 1.0))),
                     static_cast<float>(255.0 * std::max(0.0, 2.0 * t - 1.0)));
}

double finite_median(std::vector<double> values)
{
    values.erase(std::remove_if(values.begin(), values.end(), [](double v) { return !std::isfinite(v); }),
                 values.end());
    if (values.empty()) {
        return 0.0;
    }
    return median_of(&values);
}

}  // namespace

std::string heat_png(const RigCamera& camera, double distance_mm, const std::vector<PixelError>& grid)
{
    assert(grid.size() == static_cast<std::size_t>(kHeatColumns) * kHeatRows);
    std::vector<double> values;
    for (const PixelError& error : grid) {
        values.push_back(worst_px(error));
    }
    const double full_px = std::max(1e-9, 3.0 * finite_median(values));
    cv::Mat small(kHeatRows, kHeatColumns, CV_32FC3);
    for (int i = 0; i < kHeatRows * kHeatColumns; ++i) {
        small.at<cv::Vec3f>(i / kHeatColumns, i % kHeatColumns) =
            colour(values[static_cast<std::size_t>(i)] / full_px);
    }
    const int height = std::clamp(kWidthPx * camera.height_px / camera.width_px, 1, 10 * kWidthPx);
    cv::Mat canvas(height + kCaptionPx, kWidthPx, CV_8UC3, cv::Scalar(255, 255, 255));
    cv::Mat large;
    cv::resize(small, large, {kWidthPx, height}, 0.0, 0.0, cv::INTER_LINEAR);
    large.convertTo(canvas.rowRange(0, height), CV_8UC3);
    for (int row = kNumberEvery / 2; row < kHeatRows; row += kNumberEvery) {
        for (int column = kNumberEvery / 2; column < kHeatColumns; column += kNumberEvery) {
            const double value = values[static_cast<std::size_t>(row * kHeatColumns + column)];
            cv::putText(canvas, std::isfinite(value) ? fmt::format("{:.2g}", value) : "-",
                        {column * kWidthPx / kHeatColumns - 14, row * height / kHeatRows + 5},
                        cv::FONT_HERSHEY_SIMPLEX, 0.45, {255, 255, 255}, 1, cv::LINE_AA);
        }
    }
    cv::putText(canvas,
                fmt::format("{}: projection uncertainty at {:.0f} mm, px; blue 0, red {:.2g} and more",
                            camera.name, distance_mm, full_px),
                {6, height + 19}, cv::FONT_HERSHEY_SIMPLEX, 0.5, {0, 0, 0}, 1, cv::LINE_AA);
    std::vector<unsigned char> bytes;
    cv::imencode(".png", canvas, bytes);
    return {bytes.begin(), bytes.end()};
}

}  // namespace rig
