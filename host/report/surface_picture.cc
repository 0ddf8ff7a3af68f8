// See surface_picture.h.
#include "host/report/surface_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "host/solve/surface.h"

namespace rig {
namespace {

constexpr int kLongPx = 900;
constexpr int kCaptionPx = 28;

// -1 blue, 0 white, 1 red.
cv::Vec3b colour(double part)
{
    const double t = std::clamp(part, -1.0, 1.0);
    const auto pale = static_cast<unsigned char>(255.0 * (1.0 - std::abs(t)));
    return t < 0.0 ? cv::Vec3b(255, pale, pale) : cv::Vec3b(pale, pale, 255);
}

}  // namespace

std::string surface_png(const Surface& surface, const Board& board)
{
    const BsplineGrid& grid = surface.grid;
    const Eigen::Vector2d size = grid.step.cwiseProduct(Eigen::Vector2d(grid.columns - 3, grid.rows - 3));
    const double zoom = kLongPx / size.maxCoeff();
    const int width = std::max(1, static_cast<int>(zoom * size.x()));
    const int height = std::max(1, static_cast<int>(zoom * size.y()));
    const SurfaceFigures figures = surface_figures(surface, board);
    const double full_um = std::max({1e-9, figures.highest_um, -figures.lowest_um});
    cv::Mat canvas(height + kCaptionPx, std::max(width, kLongPx / 2), CV_8UC3, cv::Scalar(255, 255, 255));
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const Eigen::Vector2d at = grid.origin + Eigen::Vector2d(x + 0.5, y + 0.5) / zoom;
            const double um = 1000.0 * bspline_value(grid, surface.control.data(), at, nullptr);
            canvas.at<cv::Vec3b>(y, x) = colour(um / full_um);
        }
    }
    for (const BoardPoint& point : board.points) {
        const Eigen::Vector2d at = zoom * (point.at_mm.head<2>() - grid.origin);
        cv::circle(canvas, cv::Point(static_cast<int>(at.x()), static_cast<int>(at.y())), 1, {90, 90, 90},
                   cv::FILLED);
    }
    cv::putText(canvas,
                fmt::format("{}: {:+.0f} to {:+.0f} um, RMS {:.0f} um", board.name, figures.lowest_um,
                            figures.highest_um, figures.rms_um),
                {6, height + 19}, cv::FONT_HERSHEY_SIMPLEX, 0.5, {0, 0, 0}, 1, cv::LINE_AA);
    std::vector<unsigned char> bytes;
    cv::imencode(".png", canvas, bytes);
    return {bytes.begin(), bytes.end()};
}

}  // namespace rig
