/* Each pixel of the image and of a border round it is mapped back to the board. Where it crosses no edge
 * it is one number, else fine x fine sub-cells, each with its exact average (mosaic.h). The sub-cells are
 * then weighted by pixel square * Gaussian, along rows and along columns.
 *
 * A cell's average stands for all of the cell, which blurs by a square of the cell's side h on top, once
 * more through the taps' own integration over the cell: together a variance of h^2 / 6 along each axis,
 * which the Gaussian gives back. */
#include "tools/render/raster.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace render {

namespace {

constexpr double blur_sigmas = 4.5; // what lies beyond weighs 7e-6
constexpr double back_level = 0.4;  // the board's plain back

// Integral over z of the normal distribution's integral.
double ramp(double z, double sigma)
{
    if (sigma <= 0) {
        return std::max(z, 0.0);
    }
    const double t = z / sigma;
    return z * 0.5 * std::erfc(-t / std::sqrt(2.0)) +
           sigma * std::exp(-0.5 * t * t) / std::sqrt(2 * 3.14159265358979323846);
}

// Share of the light of a pixel at 0 that comes from below x.
double below(double x, double sigma)
{
    return ramp(x + 0.5, sigma) - ramp(x - 0.5, sigma);
}

std::vector<float> make_taps(double sigma_px, int fine, int reach)
{
    const double h = 1.0 / fine;
    const double sigma = std::sqrt(std::max(0.0, sigma_px * sigma_px - h * h / 6));
    std::vector<double> taps;
    double sum = 0;
    for (int k = 0; k < fine * (2 * reach + 1); k++) {
        const double low = k * h - reach - 0.5;
        taps.push_back(below(low + h, sigma) - below(low, sigma));
        sum += taps.back();
    }
    std::vector<float> out;
    for (double tap : taps) {
        out.push_back(static_cast<float>(tap / sum));
    }
    return out;
}

// Nodes and weights of Gauss and Legendre's rule on [-1/2, 1/2].
std::vector<std::pair<double, double>> quadrature(int n)
{
    std::vector<std::pair<double, double>> out;
    for (int i = 0; i < n; i++) {
        double x = std::cos(3.14159265358979323846 * (i + 0.75) / (n + 0.5));
        double slope = 1;
        for (int step = 0; step < 50; step++) {
            double p0 = 1;
            double p1 = x;
            for (int k = 2; k <= n; k++) {
                const double p2 = ((2 * k - 1) * x * p1 - (k - 1) * p0) / k;
                p0 = p1;
                p1 = p2;
            }
            slope = n * (x * p1 - p0) / (x * x - 1);
            x -= p1 / slope;
        }
        out.emplace_back(0.5 * x, 1 / ((1 - x * x) * slope * slope));
    }
    return out;
}

} // namespace

// One time of the exposure, with the board coordinates of three rows in turn.
struct Stage::Pass {
    double after_ns = 0; // from the middle of the row's exposure
    float weight = 1;
    std::vector<Eigen::Vector2d> above, here, below;
    bool back = false;
};

int Stage::border_for(const Camera& camera)
{
    return static_cast<int>(std::ceil(blur_sigmas * camera.psf_sigma_px)) + 2;
}

Stage::Stage(const Camera& camera, const Mosaic& mosaic, const Plane& backdrop, int border_px, int fine)
    : camera_(camera), mosaic_(mosaic), backdrop_(backdrop), border_(border_px), fine_(fine),
      reach_(border_px - 1), rays_(make_ray_map(camera.lens, border_px)),
      taps_(make_taps(camera.psf_sigma_px, fine, reach_))
{
}

std::vector<Stage::Pass> Stage::make_passes(const Instant& instant) const
{
    // How far the board's image moves during the exposure says how many times are needed.
    const double half_ns = 0.5e3 * camera_.exposure_us;
    const double middle_ns = 0.5e3 * camera_.row_time_us * camera_.lens.height_px;
    double moved_px = 0;
    for (int k = 0; half_ns > 0 && k < 49; k++) {
        const Eigen::Vector2d share(k % 7 / 6.0, k / 7 / 6.0);
        const Eigen::Vector2d at = mosaic_.low() + share.cwiseProduct(mosaic_.high() - mosaic_.low());
        Eigen::Vector3d mm(at.x() * mosaic_.mm_per_unit().x(), at.y() * mosaic_.mm_per_unit().y(), 0);
        Eigen::Vector2d pixel[2];
        bool seen = true;
        for (int end = 0; end < 2; end++) {
            const Pose pose = instant.pose(middle_ns + (end == 0 ? -half_ns : half_ns));
            const Eigen::Vector3d in_rig = pose.rotation * mm + pose.translation_mm;
            seen = seen && camera_.lens.project(camera_.cam_from_rig.rotation * in_rig +
                                                    camera_.cam_from_rig.translation_mm,
                                                pixel[end]);
        }
        if (seen) {
            moved_px = std::max(moved_px, (pixel[1] - pixel[0]).norm());
        }
    }
    int count = 1;
    if (moved_px > 3) {
        count = std::min(64, static_cast<int>(1.2 * moved_px) + 2);
    } else if (moved_px > 0.02) {
        count = moved_px > 1.6 ? 4 : moved_px > 0.6 ? 3 : 2;
    }
    std::vector<Pass> passes;
    for (const auto& [node, weight] : quadrature(count)) {
        Pass pass;
        pass.after_ns = node * 2 * half_ns;
        pass.weight = static_cast<float>(weight);
        passes.push_back(pass);
    }
    return passes;
}

void Stage::map_row(const Instant& instant, int y, const Pass& pass, std::vector<Eigen::Vector2d>& out,
                    bool& from_behind) const
{
    const Pose board = instant.pose(pass.after_ns + 1e3 * camera_.row_time_us * y);
    const Eigen::Matrix3d rotation = camera_.cam_from_rig.rotation * board.rotation;
    const Eigen::Vector3d translation =
        camera_.cam_from_rig.rotation * board.translation_mm + camera_.cam_from_rig.translation_mm;
    Eigen::Matrix3d cam_from_lattice;
    cam_from_lattice << rotation.col(0) * mosaic_.mm_per_unit().x(),
        rotation.col(1) * mosaic_.mm_per_unit().y(), translation;
    from_behind = rotation.col(2).dot(translation) <= 0;
    const Eigen::Matrix3d lattice_from_cam = cam_from_lattice.inverse();
    const Eigen::Vector2d* ray = rays_.row(y);
    out.resize(static_cast<std::size_t>(rays_.stride));
    for (Eigen::Vector2d& at : out) {
        const Eigen::Vector3d q = lattice_from_cam * Eigen::Vector3d(ray->x(), ray->y(), 1);
        ray++;
        // q.z is one over the depth: what lies behind the camera is not seen.
        at = q.z() > 0 ? Eigen::Vector2d(q.head<2>() / q.z())
                       : Eigen::Vector2d::Constant(std::nan(""));
    }
}

void Stage::add_row(const Pass& pass, int y, std::vector<float>& cells) const
{
    const int stride = rays_.stride - 2; // pixels of a row of cells: without the outermost ring
    const float* behind = backdrop_.data() + static_cast<std::ptrdiff_t>(y + border_) * rays_.stride;
    const auto fine = static_cast<std::size_t>(fine_);
    const auto put = [&](int x, std::size_t sub, double value) {
        cells[sub * static_cast<std::size_t>(stride) + static_cast<std::size_t>(x - 1)] +=
            pass.weight * static_cast<float>(value);
    };
    for (int x = 1; x <= stride; x++) {
        const auto at = static_cast<std::size_t>(x);
        const Eigen::Vector2d& centre = pass.here[at];
        const Eigen::Vector2d& left = pass.here[at - 1];
        const Eigen::Vector2d& right = pass.here[at + 1];
        const Eigen::Vector2d& top = pass.above[at];
        const Eigen::Vector2d& bottom = pass.below[at];
        Cell cell;
        cell.centre = centre;
        cell.per_px << 0.5 * (right - left), 0.5 * (bottom - top);
        cell.side_px = 1;
        cell.behind = static_cast<double>(behind[x]);
        double value = cell.behind;
        const bool mapped = std::isfinite(cell.per_px.sum()) && std::isfinite(centre.x());
        if (!mapped || (!pass.back && mosaic_.flat(cell, value))) {
            for (std::size_t sub = 0; sub < fine * fine; sub++) {
                put(x, sub, value);
            }
            continue;
        }
        const Eigen::Vector2d xx = right + left - 2 * centre;
        const Eigen::Vector2d yy = bottom + top - 2 * centre;
        Eigen::Vector2d xy = 0.25 * (pass.below[at + 1] + pass.above[at - 1] - pass.below[at - 1] -
                                     pass.above[at + 1]);
        if (!std::isfinite(xy.sum())) {
            xy.setZero();
        }
        const Eigen::Matrix2d jacobian = cell.per_px;
        cell.side_px = 1.0 / fine_;
        for (std::size_t sub = 0; sub < fine * fine; sub++) {
            const double dx = (static_cast<double>(sub % fine) + 0.5) / fine_ - 0.5;
            const double dy = (static_cast<double>(sub / fine) + 0.5) / fine_ - 0.5;
            cell.centre = centre + jacobian * Eigen::Vector2d(dx, dy) +
                          0.5 * (dx * dx * xx + dy * dy * yy) + dx * dy * xy;
            cell.per_px << jacobian.col(0) + dx * xx + dy * xy, jacobian.col(1) + dx * xy + dy * yy;
            if (pass.back) {
                const bool on = (cell.centre.array() > mosaic_.low().array()).all() &&
                                (cell.centre.array() < mosaic_.high().array()).all();
                put(x, sub, on ? back_level : cell.behind);
            } else {
                put(x, sub, mosaic_.average(cell));
            }
        }
    }
}

// Lays the occluders over one row of cells: exact along x, four lines a sub-cell along y.
void Stage::cover(int y, std::vector<float>& cells) const
{
    constexpr int lines = 4;
    const int columns = rays_.stride - 2;
    std::vector<float> hidden;
    for (const Occluder& occluder : camera_.occluders) {
        for (int sub = 0; sub < fine_; sub++) {
            hidden.assign(static_cast<std::size_t>(columns * fine_), 0);
            for (int line = 0; line < lines; line++) {
                const double at_y = y - 0.5 + (sub + (line + 0.5) / lines) / fine_;
                std::vector<double> cuts;
                for (std::size_t i = 0; i < occluder.polygon.size(); i++) {
                    const Eigen::Vector2d& a = occluder.polygon[i];
                    const Eigen::Vector2d& b = occluder.polygon[(i + 1) % occluder.polygon.size()];
                    if ((a.y() <= at_y) != (b.y() <= at_y)) {
                        cuts.push_back(a.x() + (at_y - a.y()) / (b.y() - a.y()) * (b.x() - a.x()));
                    }
                }
                std::sort(cuts.begin(), cuts.end());
                for (std::size_t i = 0; i + 1 < cuts.size(); i += 2) {
                    const double origin = -reach_ - 0.5;
                    const double low = std::clamp((cuts[i] - origin) * fine_, 0.0,
                                                  static_cast<double>(hidden.size()));
                    const double high = std::clamp((cuts[i + 1] - origin) * fine_, 0.0,
                                                   static_cast<double>(hidden.size()));
                    for (double cell = std::floor(low); cell < high; cell++) {
                        const double share = std::min(cell + 1, high) - std::max(cell, low);
                        hidden[static_cast<std::size_t>(cell)] += static_cast<float>(share / lines);
                    }
                }
            }
            for (std::size_t i = 0; i < hidden.size(); i++) {
                const auto phase = i % static_cast<std::size_t>(fine_);
                const auto column = i / static_cast<std::size_t>(fine_);
                float& value = cells[(static_cast<std::size_t>(sub * fine_) + phase) *
                                         static_cast<std::size_t>(columns) +
                                     column];
                value += hidden[i] * (static_cast<float>(occluder.level) - value);
            }
        }
    }
}

// One sub-row (fine planes of `columns` cells, one a phase) to a row of the image.
void Stage::blur_along(const float* cells, float* out) const
{
    const int columns = rays_.stride - 2;
    const int width = camera_.lens.width_px;
    std::fill(out, out + width, 0.0F);
    for (int step = 0; step <= 2 * reach_; step++) {
        for (int phase = 0; phase < fine_; phase++) {
            const float tap = taps_[static_cast<std::size_t>(step * fine_ + phase)];
            const float* from = cells + static_cast<std::ptrdiff_t>(phase) * columns + step;
            for (int x = 0; x < width; x++) {
                out[x] += tap * from[x];
            }
        }
    }
}

Plane Stage::render(const Instant& instant) const
{
    const int width = camera_.lens.width_px;
    const int height = camera_.lens.height_px;
    const int columns = rays_.stride - 2;
    Plane image(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    std::vector<Pass> passes = make_passes(instant);
    for (Pass& pass : passes) {
        map_row(instant, -reach_ - 1, pass, pass.here, pass.back);
        map_row(instant, -reach_, pass, pass.below, pass.back);
    }
    // Blurred sub-rows, newest overwriting oldest: as many as the blur reaches.
    const int kept = fine_ * (2 * reach_ + 1);
    std::vector<float> ring(static_cast<std::size_t>(kept) * static_cast<std::size_t>(width));
    std::vector<float> cells;
    for (int y = -reach_; y < height + reach_; y++) {
        cells.assign(static_cast<std::size_t>(fine_ * fine_) * static_cast<std::size_t>(columns), 0);
        for (Pass& pass : passes) {
            std::swap(pass.above, pass.here);
            std::swap(pass.here, pass.below);
            map_row(instant, y + 1, pass, pass.below, pass.back);
            add_row(pass, y, cells);
        }
        cover(y, cells);
        for (int sub = 0; sub < fine_; sub++) {
            const int slot = ((y + reach_) * fine_ + sub) % kept;
            blur_along(cells.data() + static_cast<std::ptrdiff_t>(sub) * fine_ * columns,
                       ring.data() + static_cast<std::ptrdiff_t>(slot) * width);
        }
        const int done = y - reach_;
        if (done < 0) {
            continue;
        }
        float* out = image.data() + static_cast<std::ptrdiff_t>(done) * width;
        for (int k = 0; k < kept; k++) {
            const int slot = (done * fine_ + k) % kept;
            const float tap = taps_[static_cast<std::size_t>(k)];
            const float* from = ring.data() + static_cast<std::ptrdiff_t>(slot) * width;
            for (int x = 0; x < width; x++) {
                out[x] += tap * from[x];
            }
        }
    }
    return image;
}

} // namespace render
