// See picture.h.
#include "host/report/picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace rig {
namespace {

constexpr int kWidthPx = 960;
constexpr int kCaptionPx = 28;

// 0 blue, 0.5 green, 1 red.
cv::Scalar colour(double part)
{
    const double t = std::clamp(part, 0.0, 1.0);
    return {255.0 * std::max(0.0, 1.0 - 2.0 * t), 200.0 * (1.0 - std::abs(2.0 * t - 1.0)),
            255.0 * std::max(0.0, 2.0 * t - 1.0)};
}

}  // namespace

std::string residual_png(const Scene& scene, const Solution& solution, const Statistics& statistics,
                         std::size_t place)
{
    const int camera = solution.cameras[place];
    const SceneCamera& known = scene.cameras[static_cast<std::size_t>(camera)];
    const CameraStatistics& own = statistics.cameras[place];
    const double zoom = static_cast<double>(kWidthPx) / known.width_px;
    const int height = std::clamp(static_cast<int>(zoom * known.height_px), 1, 10 * kWidthPx);
    cv::Mat canvas(height + kCaptionPx, kWidthPx, CV_8UC3, cv::Scalar(255, 255, 255));
    for (int i = 1; i < own.coverage.columns; ++i) {
        const int x = i * kWidthPx / own.coverage.columns;
        cv::line(canvas, {x, 0}, {x, height}, {225, 225, 225});
    }
    for (int i = 1; i <= own.coverage.rows; ++i) {
        const int y = i * height / own.coverage.rows;
        cv::line(canvas, {0, y}, {kWidthPx, y}, {225, 225, 225});
    }
    const double full_px = 3.0 * std::max(1e-9, own.lengths.rmse_px);
    for (const View& view : solution.set.views) {
        if (view.camera != camera) {
            continue;
        }
        const std::vector<Eigen::Vector2d> residuals = residuals_px(solution, view);
        for (std::size_t i = 0; i < residuals.size(); ++i) {
            const Eigen::Vector2d at = zoom * (view.points[i].pixel.array() + 0.5).matrix();
            if (!(at.array().abs() < 1e5).all()) {
                continue;
            }
            const cv::Point centre(static_cast<int>(at.x()), static_cast<int>(at.y()));
            if (view.points[i].used) {
                cv::circle(canvas, centre, 1, colour(residuals[i].norm() / full_px), cv::FILLED);
            } else {
                cv::drawMarker(canvas, centre, {0, 0, 0}, cv::MARKER_TILTED_CROSS, 7);
            }
        }
    }
    cv::rectangle(canvas, {0, height}, {kWidthPx, height + kCaptionPx}, {255, 255, 255}, cv::FILLED);
    cv::putText(canvas,
                fmt::format("{}: {} points, RMSE {:.4f} px; blue 0, red {:.3f} px and more; x rejected",
                            known.name, own.lengths.used, own.lengths.rmse_px, full_px),
                {6, height + 19}, cv::FONT_HERSHEY_SIMPLEX, 0.5, {0, 0, 0}, 1, cv::LINE_AA);
    std::vector<unsigned char> bytes;
    cv::imencode(".png", canvas, bytes);
    return {bytes.begin(), bytes.end()};
}

}  // namespace rig
