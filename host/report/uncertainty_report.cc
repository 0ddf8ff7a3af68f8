// See uncertainty_report.h.
#include "host/report/uncertainty_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "host/report/heat_map.h"
#include "host/report/sensitivity.h"

namespace rig {
namespace {

constexpr double kDegreesPerRadian = 180.0 / 3.14159265358979323846;
// Of the table and of projection.csv; odd, so that the middle of the image is on it.
enum { kColumns = 17, kRows = 13, kVolumePerAxis = 9 };

using Out = std::back_insert_iterator<std::string>;

// Values that are no numbers left out; ascending.
std::vector<double> sorted(std::vector<double> values)
{
    values.erase(std::remove_if(values.begin(), values.end(), [](double v) { return !std::isfinite(v); }),
                 values.end());
    std::sort(values.begin(), values.end());
    return values;
}

void projection_rows(const RigCamera& camera, double distance_mm, const std::vector<PixelError>& grid,
                     Out table, Out csv)
{
    std::vector<double> worst;
    for (const PixelError& error : grid) {
        worst.push_back(worst_px(error));
        const Eigen::Matrix2d& c = error.covariance_px2;
        fmt::format_to(csv, "{},{},{},{},{:.6g},{:.6g},{:.6g},{:.6g}\n", camera.name, distance_mm,
                       error.pixel.x(), error.pixel.y(), worst.back(), c(0, 0), c(0, 1), c(1, 1));
    }
    const double centre = worst[worst.size() / 2];
    const std::vector<double> ordered = sorted(worst);
    if (ordered.empty()) {
        fmt::format_to(table, "{:<16} {:>11.0f}  no pixel of this camera has a ray\n", camera.name, distance_mm);
        return;
    }
    fmt::format_to(table, "{:<16} {:>11.0f} {:>10.4f} {:>10.4f} {:>10.4f}\n", camera.name, distance_mm,
                   centre, ordered[ordered.size() / 2], ordered.back());
}

// Covariance of a camera's centre in the rig frame, or with `world` in that of the boards. A motion
// (w, d) on the left of (R, t) moves the centre -R't by -R'(d + t x w).
Eigen::Matrix3d centre_covariance(const RigFile& rig, std::size_t camera, bool world)
{
    const RigCovariance& covariance = *rig.covariance;
    const Pose& pose = rig.cameras[camera].cam_from_rig;
    Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(3, covariance.matrix.cols());
    if (covariance.pose[camera] >= 0) {
        Eigen::Matrix<double, 3, 6> own;
        own << skew(pose.translation_mm), Eigen::Matrix3d::Identity();
        slope.middleCols<6>(covariance.pose[camera]) = -pose.rotation.transpose() * own;
    }
    if (world) {
        slope.middleCols<6>(covariance.motion[camera]) -= point_by_motion(inverse(pose).translation_mm);
    }
    return slope * covariance.matrix * slope.transpose();
}

void pose_rows(const RigFile& rig, Out table, Out csv)
{
    fmt::format_to(table, "\nCamera poses, standard deviations: centre in mm, against the first camera and "
                          "against the\nboards' world; turn about the camera's axes against the first "
                          "camera, degrees\n\n{:<16} {:>11} {:>10} {:>10} {:>10} {:>10}\n",
                   "camera", "centre", "in world", "turn x", "turn y", "turn z");
    for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
        const Eigen::Matrix3d own = centre_covariance(rig, i, false);
        const Eigen::Matrix3d world = centre_covariance(rig, i, true);
        Eigen::Vector3d turn = Eigen::Vector3d::Zero();
        if (rig.covariance->pose[i] >= 0) {
            turn = kDegreesPerRadian
                   * rig.covariance->matrix.diagonal().segment<3>(rig.covariance->pose[i]).cwiseSqrt();
        }
        fmt::format_to(table, "{:<16} {:>11.4f} {:>10.4f} {:>10.5f} {:>10.5f} {:>10.5f}\n",
                       rig.cameras[i].name, std::sqrt(own.trace()), std::sqrt(world.trace()), turn.x(),
                       turn.y(), turn.z());
        fmt::format_to(csv, "{},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}\n",
                       rig.cameras[i].name, std::sqrt(own(0, 0)), std::sqrt(own(1, 1)),
                       std::sqrt(own(2, 2)), std::sqrt(world(0, 0)), std::sqrt(world(1, 1)),
                       std::sqrt(world(2, 2)), turn.x(), turn.y(), turn.z());
    }
}

void volume_rows(const RigFile& rig, double noise_px, Out table, Out csv)
{
    if (rig.cameras.size() < 2 || !rig.volume_mm) {
        return;
    }
    const std::vector<PointError> errors = volume_errors(rig, kVolumePerAxis, noise_px);
    std::vector<double> lengths;
    for (const PointError& error : errors) {
        const Eigen::Vector3d each = error.covariance_mm2.diagonal().cwiseSqrt();
        lengths.push_back(each.norm());
        fmt::format_to(csv, "{:.3f},{:.3f},{:.3f},{},{:.6g},{:.6g},{:.6g}\n", error.at_mm.x(),
                       error.at_mm.y(), error.at_mm.z(), error.cameras, each.x(), each.y(), each.z());
    }
    fmt::format_to(table, "\nTriangulation in the volume, standard deviation of the point in mm (of x, y "
                          "and z together)\n");
    const std::vector<double> ordered = sorted(lengths);
    if (ordered.empty()) {
        fmt::format_to(table, "    no place in the volume is seen by two cameras\n");
        return;
    }
    fmt::format_to(table, "    median {:.4f}, worst {:.4f} over {} places that two cameras or more see{}\n",
                   ordered[ordered.size() / 2], ordered.back(), ordered.size(),
                   noise_px > 0.0 ? fmt::format(", with {} px of noise in each later observation", noise_px)
                                  : ", of the calibration alone (--noise-px adds that of observations)");
}

}  // namespace

Result<std::vector<double>> distances_for(const RigCamera& camera, const std::vector<double>& asked,
                                          const std::string& source)
{
    const std::vector<double>& out = asked.empty() ? camera.distances_mm : asked;
    if (out.empty()) {
        return Status::failure(source + " does not tell at which distances camera '" + camera.name
                               + "' was calibrated; give some with --distances");
    }
    return out;
}

Result<UncertaintyReport> uncertainty_report(const RigFile& rig, const UncertaintyOptions& options,
                                             const std::string& source)
{
    if (!rig.covariance) {
        return Status::failure(source + " holds no 'covariance'; solve again with this version");
    }
    UncertaintyReport out;
    std::string projection = "camera,distance_mm,x,y,worst_px,xx_px2,xy_px2,yy_px2\n";
    std::string poses = "camera,x_mm,y_mm,z_mm,world_x_mm,world_y_mm,world_z_mm,turn_x_deg,turn_y_deg,"
                        "turn_z_deg\n";
    std::string points = "x_mm,y_mm,z_mm,cameras,sigma_x_mm,sigma_y_mm,sigma_z_mm\n";
    const auto table = std::back_inserter(out.table);
    fmt::format_to(table, "Projection uncertainty, standard deviation in px in the worst direction, of points "
                          "fixed to\nthe boards' world\n\n{:<16} {:>11} {:>10} {:>10} {:>10}\n",
                   "camera", "distance mm", "centre", "median", "worst");
    for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
        const RigCamera& camera = rig.cameras[i];
        const Result<std::vector<double>> distances = distances_for(camera, options.distances_mm, source);
        if (!distances.ok()) {
            return distances.status();
        }
        for (const double distance : distances.value()) {
            projection_rows(camera, distance, projection_errors(rig, i, distance, kColumns, kRows), table,
                            std::back_inserter(projection));
        }
        const double middle = distances.value()[distances.value().size() / 2];
        out.files.push_back({"uncertainty-" + camera.name + ".png",
                             heat_png(camera, middle,
                                      projection_errors(rig, i, middle, kHeatColumns, kHeatRows))});
    }
    pose_rows(rig, table, std::back_inserter(poses));
    volume_rows(rig, options.noise_px, table, std::back_inserter(points));
    out.files.push_back({"projection.csv", projection});
    out.files.push_back({"poses.csv", poses});
    out.files.push_back({"triangulation.csv", points});
    return out;
}

}  // namespace rig
