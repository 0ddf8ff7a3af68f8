// See compare.h.
#include "host/report/compare.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "host/base/chi_square.h"
#include "host/report/compare_rows.h"
#include "host/report/error_bars.h"
#include "host/report/uncertainty_report.h"

namespace rig {
namespace {

constexpr double kDegreesPerRadian = 180.0 / 3.14159265358979323846;
enum { kColumns = 7, kRows = 5, kVolumePerAxis = 5 };

// Of a difference whose deviation is not known, or said to be less.
constexpr double kSigmaMinPx = 1e-3;

// Variance that is added to every direction, as a part of the mean variance of as many as a camera has
// parameters: a hundredth of the deviation.
constexpr double kRidgePart = 1e-4;

Result<SharedCamera> look(const RigFile& a, const RigFile& b, std::size_t in_a, std::size_t in_b,
                          const CompareOptions& options)
{
    SharedCamera out;
    out.in_a = in_a;
    out.in_b = in_b;
    const RigCamera& one = a.cameras[in_a];
    const RigCamera& other = b.cameras[in_b];
    if (one.width_px != other.width_px || one.height_px != other.height_px) {
        return Status::failure("camera '" + one.name + "' has images of " + std::to_string(one.width_px) + " x "
                               + std::to_string(one.height_px) + " in " + options.name_a + " and of "
                               + std::to_string(other.width_px) + " x " + std::to_string(other.height_px)
                               + " in " + options.name_b + "; they cannot be compared");
    }
    out.fold_a = one.lens.fold_radius();
    out.fold_b = other.lens.fold_radius();
    const Result<std::vector<double>> distances = distances_for(one, options.distances_mm, options.name_a);
    if (!distances.ok()) {
        return distances.status();
    }
    const std::vector<Eigen::Vector2d> pixels = image_grid(one, kColumns, kRows);
    for (const double distance : distances.value()) {
        std::vector<PixelError> known_a;
        std::vector<PixelError> known_b;
        if (a.covariance && b.covariance) {
            known_a = projection_errors(a, in_a, distance, kColumns, kRows);
            known_b = projection_errors(b, in_b, distance, kColumns, kRows);
        }
        for (std::size_t i = 0; i < pixels.size(); ++i) {
            const Eigen::Vector3d ray = one.lens.unproject(pixels[i], out.fold_a);
            double variance = 0.0;
            for (const std::vector<PixelError>* known : {&known_a, &known_b}) {
                const double own = known->empty() ? 0.0 : 0.5 * (*known)[i].covariance_px2.trace();
                variance += std::isfinite(own) ? own : 0.0;
            }
            if (ray.allFinite()) {
                out.points_mm.push_back(inverse(one.cam_from_rig) * (distance * ray));
                out.sigma_px.push_back(std::sqrt(variance + kSigmaMinPx * kSigmaMinPx));
            }
        }
    }
    return out;
}

// Chance that a weighted sum of squared unit Gaussians is `sum` or more: as a chi-square of the same mean
// and variance (Satterthwaite).
double chance_of(double sum, const Eigen::VectorXd& weights)
{
    const double mean = weights.sum();
    const double half_variance = weights.squaredNorm();
    if (!(half_variance > 0.0)) {
        return 1.0;
    }
    const double degrees = mean * mean / half_variance;
    return chance_above(chi_square_normal(sum * degrees / mean, degrees));
}

Eigen::MatrixXd covariance_of(const RigFile& a, const RigFile& b, const Eigen::MatrixXd& by_a,
                              const Eigen::MatrixXd& by_b)
{
    return by_a * a.covariance->matrix * by_a.transpose() + by_b * b.covariance->matrix * by_b.transpose();
}

// What only a field can do, which the covariance does not have: places are alike as far as a step of its
// grid reaches, exp(-d^2 / 2) of places d steps apart, and wholly so along one ray.
void add_field(const RigCamera& camera, const std::vector<Eigen::Vector2d>& pixels, Eigen::MatrixXd* variance)
{
    std::vector<Eigen::Matrix2d> root;
    for (std::size_t i = 0; i < pixels.size() && !camera.field_errors.empty(); ++i) {
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(field_covariance(camera, pixels[i]));
        root.push_back(eigen.operatorSqrt());
        for (std::size_t j = 0; j <= i; ++j) {
            const double apart =
                (pixels[i] - pixels[j]).cwiseQuotient(camera.lens.field.grid.step).squaredNorm();
            const Eigen::Matrix2d block = std::exp(-0.5 * apart) * root[i] * root[j];
            const auto row = static_cast<Eigen::Index>(2 * i);
            const auto column = static_cast<Eigen::Index>(2 * j);
            variance->block<2, 2>(row, column) += block;
            if (i != j) {
                variance->block<2, 2>(column, row) += block.transpose();
            }
        }
    }
}

Difference difference_of(const RigFile& a, const RigFile& b, const SharedCamera& camera,
                         const ImpliedMotion& motion)
{
    const bool tested = a.covariance && b.covariance;
    const DifferenceRows rows = difference_rows(a, b, camera, camera.points_mm, motion.b_from_a, tested);
    Difference out;
    const auto points = static_cast<double>(std::max<Eigen::Index>(2, rows.difference.size())) / 2.0;
    out.rms_px = std::sqrt(rows.difference.squaredNorm() / points);
    for (Eigen::Index i = 0; i < rows.difference.size(); i += 2) {
        out.most_px = std::max(out.most_px, rows.difference.segment<2>(i).norm());
    }
    if (tested && rows.difference.size() > 0) {
        Eigen::MatrixXd variance = covariance_of(a, b, rows.by_a + rows.by_motion * motion.follow_a,
                                                 rows.by_b + rows.by_motion * motion.follow_b);
        add_field(a.cameras[camera.in_a], rows.pixels, &variance);
        add_field(b.cameras[camera.in_b], rows.pixels, &variance);
        out.allowed_px = std::sqrt(variance.trace() / points);
        // Parameters that are hardly known err by so much that slopes change on the way. In directions that are
        // known well that may count, so it is allowed there, but not expected.
        const Eigen::VectorXd bend = 0.5 * rows.weight.cwiseProduct(rows.second_order);
        const Eigen::MatrixXd whitened =
            rows.weight.asDiagonal() * variance * rows.weight.asDiagonal() + bend * bend.transpose();
        const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(whitened);
        const auto directions = static_cast<double>(a.cameras[camera.in_a].lens.intrinsics.size() + 6);
        const double ridge = kRidgePart * whitened.trace() / directions;
        const Eigen::ArrayXd modes =
            (eigen.eigenvectors().transpose() * rows.weight.cwiseProduct(rows.difference)).array();
        const Eigen::ArrayXd own = eigen.eigenvalues().cwiseMax(0.0).array();
        const Eigen::ArrayXd bent = (eigen.eigenvectors().transpose() * bend).array().square();
        const Eigen::ArrayXd expected = (own - bent).cwiseMax(0.0);
        if (a.cameras[camera.in_a].field_errors.empty() && b.cameras[camera.in_b].field_errors.empty()) {
            out.chance = chance_of((modes.square() / (own + ridge)).sum(), (expected / (own + ridge)).matrix());
        } else {
            // How a field's places go together is known too roughly to weigh directions by.
            out.chance = chance_of(modes.square().sum(), expected.matrix());
        }
    }
    return out;
}

void compare_volume(const RigFile& a, const RigFile& b, const std::vector<SharedCamera>& cameras,
                    const ImpliedMotion& motion, PartComparison* out)
{
    const bool tested = a.covariance && b.covariance;
    double squares = 0.0;
    double variance = 0.0;
    for (const Eigen::Vector3d& at : volume_grid(a, kVolumePerAxis)) {
        Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
        Eigen::Vector3d pull = Eigen::Vector3d::Zero();
        Eigen::MatrixXd by_a = Eigen::MatrixXd::Zero(3, tested ? a.covariance->matrix.cols() : 0);
        Eigen::MatrixXd by_b = Eigen::MatrixXd::Zero(3, tested ? b.covariance->matrix.cols() : 0);
        int seen = 0;
        for (const SharedCamera& camera : cameras) {
            const DifferenceRows rows = difference_rows(a, b, camera, {at}, motion.b_from_a, tested);
            const RigCamera& one = a.cameras[camera.in_a];
            if (rows.difference.size() == 0
                || !inside(one, one.lens.project(one.cam_from_rig * at, camera.fold_a))) {
                continue;
            }
            ++seen;
            const Eigen::Matrix<double, 2, 3> slope = rows.by_motion.rightCols<3>();
            normal += slope.transpose() * slope;
            pull += slope.transpose() * rows.difference;
            if (tested) {
                by_a += slope.transpose() * (rows.by_a + rows.by_motion * motion.follow_a);
                by_b += slope.transpose() * (rows.by_b + rows.by_motion * motion.follow_b);
            }
        }
        if (seen < 2) {
            continue;
        }
        ++out->places;
        const Eigen::Matrix3d back = normal.inverse();
        const double miss = (back * pull).norm();
        squares += miss * miss;
        out->most_mm = std::max(out->most_mm, miss);
        variance += tested ? covariance_of(a, b, back * by_a, back * by_b).trace() : 0.0;
    }
    if (out->places > 0) {
        out->rms_mm = std::sqrt(squares / static_cast<double>(out->places));
        out->allowed_mm = std::sqrt(variance / static_cast<double>(out->places));
    }
}

std::string list_names(const RigFile& rig)
{
    std::string out;
    for (const RigCamera& camera : rig.cameras) {
        out += (out.empty() ? "'" : ", '") + camera.name + "'";
    }
    return out;
}

// Pairs by name; what is in one file only goes to the result.
Status match(const RigFile& a, const RigFile& b, const CompareOptions& options,
             std::vector<SharedCamera>* shared, Comparison* out)
{
    const auto place = [](const RigFile& rig, const std::string& name) {
        return std::find_if(rig.cameras.begin(), rig.cameras.end(),
                            [&](const RigCamera& camera) { return camera.name == name; })
               - rig.cameras.begin();
    };
    for (std::size_t i = 0; i < a.cameras.size(); ++i) {
        const auto j = static_cast<std::size_t>(place(b, a.cameras[i].name));
        if (j == b.cameras.size()) {
            out->only_a.push_back(a.cameras[i].name);
            continue;
        }
        const Result<SharedCamera> camera = look(a, b, i, j, options);
        if (!camera.ok()) {
            return camera.status();
        }
        shared->push_back(camera.value());
    }
    for (const RigCamera& camera : b.cameras) {
        if (static_cast<std::size_t>(place(a, camera.name)) == a.cameras.size()) {
            out->only_b.push_back(camera.name);
        }
    }
    if (shared->empty()) {
        return Status::failure("no camera's name is in both: " + options.name_a + " has " + list_names(a) + ", "
                               + options.name_b + " has " + list_names(b));
    }
    return Status();
}

// The shared cameras by the parts that they are in.
std::vector<std::vector<SharedCamera>> group(const RigFile& a, const RigFile& b,
                                             const std::vector<SharedCamera>& shared)
{
    std::vector<std::vector<SharedCamera>> out;
    std::map<std::pair<int, int>, std::size_t> place;
    for (const SharedCamera& camera : shared) {
        const std::pair parts(a.cameras[camera.in_a].part, b.cameras[camera.in_b].part);
        const std::size_t at = place.emplace(parts, out.size()).first->second;
        out.resize(std::max(out.size(), at + 1));
        out[at].push_back(camera);
    }
    return out;
}

// `chance`: below which a difference is one.
PartComparison compare_part(const RigFile& a, const RigFile& b, const std::vector<SharedCamera>& shared,
                            double chance)
{
    const auto own_start = [&](const SharedCamera& camera) {
        return inverse(b.cameras[camera.in_b].cam_from_rig) * a.cameras[camera.in_a].cam_from_rig;
    };
    PartComparison out;
    out.part_a = a.cameras[shared.front().in_a].part;
    out.part_b = b.cameras[shared.front().in_b].part;
    const ImpliedMotion motion = fit_motion(a, b, shared, own_start(shared.front()));
    out.b_from_a = motion.b_from_a;
    for (const SharedCamera& camera : shared) {
        CameraComparison own;
        own.name = a.cameras[camera.in_a].name;
        const ImpliedMotion alone = fit_motion(a, b, {camera}, own_start(camera));
        own.rig = difference_of(a, b, camera, motion);
        own.lens = difference_of(a, b, camera, alone);
        own.rig.differs = own.rig.chance < chance;
        own.lens.differs = own.lens.chance < chance;
        const Eigen::Vector3d centre = inverse(a.cameras[camera.in_a].cam_from_rig).translation_mm;
        const Eigen::Vector3d now = inverse(b.cameras[camera.in_b].cam_from_rig).translation_mm;
        own.shift_mm = (motion.b_from_a * centre - now).norm();
        own.turn_deg = kDegreesPerRadian
                       * rotation_distance(motion.b_from_a.rotation, alone.b_from_a.rotation);
        out.cameras.push_back(own);
    }
    if (out.part_a == 0) {
        compare_volume(a, b, shared, motion, &out);
    }
    return out;
}

}  // namespace

Result<Comparison> compare_rigs(const RigFile& a, const RigFile& b, const CompareOptions& options)
{
    Comparison out;
    std::vector<SharedCamera> shared;
    const Status status = match(a, b, options, &shared, &out);
    if (!status.ok()) {
        return status;
    }
    out.tested = a.covariance && b.covariance;
    out.differs = !out.only_a.empty() || !out.only_b.empty();
    const double chance = kCompareChance / (2.0 * static_cast<double>(shared.size()));
    for (const std::vector<SharedCamera>& cameras : group(a, b, shared)) {
        out.parts.push_back(compare_part(a, b, cameras, chance));
        for (const CameraComparison& camera : out.parts.back().cameras) {
            out.differs = out.differs || camera.rig.differs || camera.lens.differs;
        }
    }
    return out;
}

}  // namespace rig
