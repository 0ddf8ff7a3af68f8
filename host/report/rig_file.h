// Reads rig.json back.
#pragma once

#include <nlohmann/json.hpp>

#include <Eigen/Geometry>
#include <optional>

#include "host/base/pose.h"
#include "host/base/status.h"
#include "host/model/camera.h"
#include "host/solve/covariance.h"
#include "host/solve/field_errors.h"

namespace rig {

struct RigCamera {
    std::string name;
    int width_px = 0;
    int height_px = 0;
    Camera lens;
    Pose cam_from_rig;
    int part = 0;  // cameras of another part have a rig frame of their own
    std::vector<double> distances_mm;  // of the points that it was calibrated from: least, median, most
    FieldErrors field_errors = {};     // what a field adds to a pixel's variance beyond the covariance
};

struct RigFile {
    std::vector<RigCamera> cameras;
    std::optional<RigCovariance> covariance;  // by `cameras`
    std::optional<Eigen::AlignedBox3d> volume_mm;  // around the points that part 0 was calibrated from
    nlohmann::ordered_json json;  // all of it
};

// Fails with a sentence that names the file and the key at fault.
Result<RigFile> read_rig_file(const std::string& path);

// Whether it consists of parts that nothing connects.
bool in_parts(const RigFile& rig);

// Grid of per_axis^3 points over the volume, faces included; empty when the file does not tell it.
std::vector<Eigen::Vector3d> volume_grid(const RigFile& rig, int per_axis);

// The camera of this name, or fails with a sentence that lists those there are.
Result<RigCamera> find_camera(const RigFile& rig, const std::string& name);

}  // namespace rig
