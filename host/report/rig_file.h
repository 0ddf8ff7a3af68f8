// Reads rig.json back.
#pragma once

#include <nlohmann/json.hpp>

#include <optional>

#include "host/base/pose.h"
#include "host/base/status.h"
#include "host/model/camera.h"
#include "host/solve/covariance.h"

namespace rig {

struct RigCamera {
    std::string name;
    int width_px = 0;
    int height_px = 0;
    Camera lens;
    Pose cam_from_rig;
};

struct RigFile {
    std::vector<RigCamera> cameras;
    std::optional<RigCovariance> covariance;  // by `cameras`
    nlohmann::ordered_json json;  // all of it
};

// Fails with a sentence that names the file and the key at fault.
Result<RigFile> read_rig_file(const std::string& path);

// The camera of this name, or fails with a sentence that lists those there are.
Result<RigCamera> find_camera(const RigFile& rig, const std::string& name);

}  // namespace rig
