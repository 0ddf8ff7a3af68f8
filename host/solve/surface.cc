// See surface.h.
#include "host/solve/surface.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace rig {
namespace {

constexpr double kFlatMm = 1e-6;  // points further than this from one plane make a body, not a board

// Lowest and highest corner of the points' x and y.
std::pair<Eigen::Vector2d, Eigen::Vector2d> extent(const Board& board)
{
    Eigen::Vector2d low = board.points.front().at_mm.head<2>();
    Eigen::Vector2d high = low;
    for (const BoardPoint& point : board.points) {
        low = low.cwiseMin(point.at_mm.head<2>());
        high = high.cwiseMax(point.at_mm.head<2>());
    }
    return {low, high};
}

}  // namespace

bool can_bend(const Board& board)
{
    if (board.points.empty()) {
        return false;
    }
    const double z = board.points.front().at_mm.z();
    const auto [low, high] = extent(board);
    return (high - low).minCoeff() > 0.0
           && std::all_of(board.points.begin(), board.points.end(), [&](const BoardPoint& point) {
                  return std::abs(point.at_mm.z() - z) <= kFlatMm;
              });
}

Surface make_surface(const Board& board, int cells)
{
    const auto [low, high] = extent(board);
    Surface surface;
    surface.grid = make_bspline_grid(low, high, cells);
    surface.control.assign(static_cast<std::size_t>(surface.grid.count()), 0.0);
    return surface;
}

Eigen::MatrixXd surface_gauge(const Surface& surface, const Board& board)
{
    const auto count = static_cast<double>(board.points.size());
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const BoardPoint& point : board.points) {
        middle += point.at_mm.head<2>() / count;
    }
    double square = 0.0;
    for (const BoardPoint& point : board.points) {
        square += (point.at_mm.head<2>() - middle).squaredNorm() / count;
    }
    const double size = std::sqrt(square);
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(3, surface.grid.count());
    for (const BoardPoint& point : board.points) {
        const Eigen::Vector2d at = point.at_mm.head<2>();
        const Eigen::Vector3d plane(1.0, (at - middle).x() / size, (at - middle).y() / size);
        normal += plane * plane.transpose();
        const BsplineSupport s = bspline_support(surface.grid, at);
        for (int j = 0; j < 4; ++j) {
            rows.middleCols<4>((s.row + j) * surface.grid.columns + s.column) +=
                plane * (s.y[j] * s.x.transpose());
        }
    }
    return normal.ldlt().solve(rows);
}

void lift_points(const RigState& state, const std::vector<Board>& boards, std::vector<View>* views)
{
    for (View& view : *views) {
        const auto board = static_cast<std::size_t>(view.board);
        const bool flat = board >= state.surfaces.size() || state.surfaces[board].empty();
        for (ViewPoint& point : view.points) {
            point.at_mm = boards[board].points[point.point].at_mm;
            if (!flat) {
                const Surface& surface = state.surfaces[board];
                point.at_mm.z() += bspline_value(surface.grid, surface.control.data(),
                                                 point.at_mm.head<2>(), nullptr);
            }
        }
    }
}

SurfaceFigures surface_figures(const Surface& surface, const Board& board)
{
    SurfaceFigures figures;
    double squares = 0.0;
    for (const BoardPoint& point : board.points) {
        const double um = 1000.0
                          * bspline_value(surface.grid, surface.control.data(), point.at_mm.head<2>(),
                                          nullptr);
        squares += um * um;
        figures.lowest_um = std::min(figures.lowest_um, um);
        figures.highest_um = std::max(figures.highest_um, um);
    }
    figures.rms_um = std::sqrt(squares / static_cast<double>(board.points.size()));
    return figures;
}

}  // namespace rig
