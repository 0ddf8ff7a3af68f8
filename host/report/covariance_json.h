// The joint covariance of a rig as it stands in rig.json under `covariance`:
//     "parameters": ["cam0.fx", ..., "cam1.rotation_x", ..., "boards.translation_z"]
//     "lower":      the lower triangle row by row, n (n + 1) / 2 numbers
// in the order and with the meaning of solve/covariance.h; rad and mm for motions. `boards` is the
// implied motion, `boards 1` that of the next part.
#pragma once

#include <nlohmann/json.hpp>

#include "host/base/status.h"
#include "host/model/camera.h"
#include "host/solve/covariance.h"

namespace rig {

struct NamedLens {
    std::string name;
    const Camera* lens;
    int part;  // of the rig; cameras stand part by part
};

// `order`: index into covariance.lens of each camera of `cameras`. Cameras and their rows have one order.
nlohmann::ordered_json covariance_json(const RigCovariance& covariance, const std::vector<NamedLens>& cameras,
                                       const std::vector<std::size_t>& order);

// The same back, indexed as `cameras`. Fails with a sentence, which begins with `where`, when names or
// numbers are not those that these cameras must have.
Result<RigCovariance> read_covariance_json(const nlohmann::ordered_json& json,
                                           const std::vector<NamedLens>& cameras,
                                           const std::string& where);

}  // namespace rig
