// See statistics.h.
#include "host/report/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace rig {
namespace {

constexpr int kCoverageColumns = 16;

class Lengths {
public:
    void add(double length_px, double sigma_px, bool used)
    {
        all_squares_ += length_px * length_px;
        ++(used ? out_.used : out_.rejected);
        if (used) {
            sum_ += length_px;
            squares_ += length_px * length_px;
            white_squares_ += length_px * length_px / (sigma_px * sigma_px);
        }
    }
    LengthStatistics result() const
    {
        LengthStatistics out = out_;
        const double all = static_cast<double>(out.used + out.rejected);
        const double used = static_cast<double>(out.used);
        if (out.used > 0) {
            out.rmse_px = std::sqrt(squares_ / used);
            out.mean_px = sum_ / used;
            out.deviation_px = std::sqrt(std::max(0.0, squares_ / used - out.mean_px * out.mean_px));
            out.whitened_rms = std::sqrt(white_squares_ / (2.0 * used));
        }
        out.rmse_all_px = all > 0.0 ? std::sqrt(all_squares_ / all) : 0.0;
        return out;
    }

private:
    LengthStatistics out_;
    double sum_ = 0.0;
    double squares_ = 0.0;
    double white_squares_ = 0.0;
    double all_squares_ = 0.0;
};

class Grid {
public:
    explicit Grid(const SceneCamera& camera)
        : width_(camera.width_px), height_(camera.height_px), columns_(kCoverageColumns),
          rows_(std::max(3, (kCoverageColumns * camera.height_px + camera.width_px / 2) / camera.width_px)),
          filled_(static_cast<std::size_t>(columns_ * rows_), false)
    {
    }
    void add(const Eigen::Vector2d& pixel)
    {
        const int column = place(pixel.x(), width_, columns_);
        const int row = place(pixel.y(), height_, rows_);
        filled_[static_cast<std::size_t>(row * columns_ + column)] = true;
    }
    Coverage result() const
    {
        static const std::array<std::string, 9> names{
            "top left",  "top",         "top right", "left",        "centre",
            "right",     "bottom left", "bottom",    "bottom right"};
        std::array<int, 9> cells{};
        std::array<int, 9> full{};
        Coverage out{columns_, rows_, 0.0, {}};
        for (int row = 0; row < rows_; ++row) {
            for (int column = 0; column < columns_; ++column) {
                const auto ninth = static_cast<std::size_t>(3 * (3 * row / rows_) + 3 * column / columns_);
                const bool filled = filled_[static_cast<std::size_t>(row * columns_ + column)];
                ++cells[ninth];
                full[ninth] += filled ? 1 : 0;
                out.part += filled ? 1.0 / (columns_ * rows_) : 0.0;
            }
        }
        for (std::size_t i = 0; i < names.size(); ++i) {
            if (2 * full[i] < cells[i]) {
                out.weak.push_back(names[i]);
            }
        }
        return out;
    }

private:
    static int place(double at, int size, int count)
    {
        return std::clamp(static_cast<int>((at + 0.5) / size * count), 0, count - 1);
    }
    int width_;
    int height_;
    int columns_;
    int rows_;
    std::vector<bool> filled_;
};

}  // namespace

Statistics make_statistics(const Scene& scene, const Solution& solution)
{
    Statistics out;
    out.rejected = scene.rejected;
    for (const auto& [reason, count] : solution.set.rejected) {
        out.rejected[reason] += count;
    }
    Lengths all;
    for (const int camera : solution.cameras) {
        CameraStatistics own;
        Lengths lengths;
        Grid grid(scene.cameras[static_cast<std::size_t>(camera)]);
        for (const View& view : solution.set.views) {
            if (view.camera != camera) {
                continue;
            }
            const std::vector<Eigen::Vector2d> residuals = residuals_px(solution, view);
            std::size_t used = 0;
            for (std::size_t i = 0; i < residuals.size(); ++i) {
                const bool good = view.points[i].used;
                if (good || residuals[i].allFinite()) {
                    const auto sigma_px = static_cast<double>(view.points[i].sigma_px);
                    lengths.add(residuals[i].norm(), sigma_px, good);
                    all.add(residuals[i].norm(), sigma_px, good);
                }
                if (good) {
                    grid.add(view.points[i].pixel);
                    ++used;
                }
            }
            own.views += used > 0 ? 1 : 0;
            const std::size_t lost = residuals.size() - used;
            if (lost > 0) {
                out.rejected[used > 0 ? "far from its projection" : "view that disagrees with the rig"] +=
                    lost;
            }
        }
        own.lengths = lengths.result();
        own.points_per_view = own.views > 0 ? static_cast<double>(own.lengths.used)
                                                  / static_cast<double>(own.views)
                                            : 0.0;
        own.coverage = grid.result();
        out.cameras.push_back(own);
    }
    out.rig = all.result();
    out.reach = make_reach(solution);
    return out;
}

}  // namespace rig
