// Levenberg-Marquardt over a grid of pixels whose rays the given lens tells; derivatives are those of the
// projection. Coefficients of a rational lens stand in for one another, so the damping never vanishes.
#include "host/report/nearest_lens.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "host/report/sensitivity.h"

namespace rig {
namespace {

enum { kColumns = 32, kRows = 24, kRoundsMax = 60 };

// Unprojecting leaves up to 1e-6 px; a coefficient that matters is far more.
constexpr double kExactPx = 1e-5;

struct Pair {
    Eigen::Vector3d ray;
    Eigen::Vector2d pixel;
};

CameraModel model_for(const Camera& lens, int count)
{
    if (lens.model == CameraModel::kFisheye) {
        return CameraModel::kFisheye;
    }
    return count <= 5 ? CameraModel::kBrown : count <= 8 ? CameraModel::kRational : CameraModel::kThinPrism;
}

// The lens with its first `count` coefficients in a model that has room for them.
Camera cut(const Camera& lens, int count)
{
    Camera out;
    out.model = model_for(lens, count);
    out.intrinsics.assign(static_cast<std::size_t>(kPinholeCount + distortion_count(out.model)), 0.0);
    const auto kept = std::min(lens.intrinsics.size(), static_cast<std::size_t>(kPinholeCount + count));
    std::copy_n(lens.intrinsics.begin(), kept, out.intrinsics.begin());
    return out;
}

double squares_of(const Camera& lens, const std::vector<Pair>& pairs)
{
    double sum = 0.0;
    for (const Pair& pair : pairs) {
        Eigen::Vector2d pixel;
        if (!project_formula(lens.model, lens.intrinsics.data(), pair.ray, &pixel, nullptr)) {
            return HUGE_VAL;
        }
        sum += (pixel - pair.pixel).squaredNorm();
    }
    return std::isfinite(sum) ? sum : HUGE_VAL;
}

void fit(const std::vector<Pair>& pairs, int count, Camera* lens)
{
    const Eigen::Index free = kPinholeCount + count;
    double damping = 1e-6;
    double now = squares_of(*lens, pairs);
    for (int round = 0; round < kRoundsMax; ++round) {
        Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(free, free);
        Eigen::VectorXd gradient = Eigen::VectorXd::Zero(free);
        for (const Pair& pair : pairs) {
            Eigen::Vector2d pixel;
            ProjectionJacobian slope;
            if (project_formula(lens->model, lens->intrinsics.data(), pair.ray, &pixel, &slope)) {
                const Eigen::MatrixXd own = slope.by_intrinsics.leftCols(free);
                normal += own.transpose() * own;
                gradient += own.transpose() * (pixel - pair.pixel);
            }
        }
        normal.diagonal() *= 1.0 + damping;
        const Eigen::VectorXd step = normal.ldlt().solve(gradient);
        Camera tried = *lens;
        for (Eigen::Index i = 0; i < free; ++i) {
            tried.intrinsics[static_cast<std::size_t>(i)] -= step[i];
        }
        const double then = squares_of(tried, pairs);
        if (then < now) {
            const bool settled = then > (1.0 - 1e-12) * now;
            *lens = tried;
            now = then;
            damping = std::max(1e-12, 0.1 * damping);
            if (settled) {
                break;
            }
        } else {
            damping *= 10.0;
        }
    }
}

void measure(const std::vector<Pair>& pairs, NearestLens* out)
{
    const double fold = out->lens.fold_radius();
    double squares = 0.0;
    out->most_px = pairs.empty() ? HUGE_VAL : 0.0;
    for (const Pair& pair : pairs) {
        const double miss = (out->lens.project(pair.ray, fold) - pair.pixel).norm();
        squares += miss * miss;
        out->most_px = std::isfinite(miss) ? std::max(out->most_px, miss) : HUGE_VAL;
    }
    out->rms_px = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, pairs.size())));
}

}  // namespace

NearestLens nearest_lens(const RigCamera& camera, const std::vector<int>& counts)
{
    std::vector<Pair> pairs;
    const double fold = camera.lens.fold_radius();
    for (const Eigen::Vector2d& pixel : image_grid(camera, kColumns, kRows)) {
        const Eigen::Vector3d ray = camera.lens.unproject(pixel, fold);
        if (ray.allFinite()) {
            pairs.push_back({ray, pixel});
        }
    }
    NearestLens out;
    for (const int count : counts) {
        out.count = count;
        out.lens = cut(camera.lens, count);
        measure(pairs, &out);
        if (out.most_px < kExactPx) {
            out.exact = true;
            return out;
        }
    }
    fit(pairs, out.count, &out.lens);
    measure(pairs, &out);
    return out;
}

}  // namespace rig
