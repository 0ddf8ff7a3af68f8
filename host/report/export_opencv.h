// The rig as OpenCV's YAML.
#pragma once

#include <string>

#include "host/report/rig_file.h"

namespace rig {

// One file that cv::FileStorage reads: a list `cameras` with, for each, name, image_width,
// image_height, model, camera_matrix (3x3), distortion_coefficients (1xN, OpenCV's order; for the
// model fisheye those of cv::fisheye), R (3x3) and T (3x1, mm): a point in the rig frame, which is the
// first camera's, goes to the camera's by R x + T.
std::string opencv_yaml(const RigFile& rig);

}  // namespace rig
