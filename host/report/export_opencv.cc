// See export_opencv.h.
#include "host/report/export_opencv.h"

#include <opencv2/core.hpp>

namespace rig {

std::string opencv_yaml(const RigFile& rig)
{
    cv::FileStorage file("rig.yaml", cv::FileStorage::WRITE | cv::FileStorage::MEMORY
                                         | cv::FileStorage::FORMAT_YAML);
    file << "cameras" << "[";
    for (const RigCamera& camera : rig.cameras) {
        const std::vector<double>& numbers = camera.lens.intrinsics;
        const cv::Mat matrix = (cv::Mat_<double>(3, 3) << numbers[0], 0.0, numbers[2], 0.0, numbers[1],
                                numbers[3], 0.0, 0.0, 1.0);
        cv::Mat distortion(1, static_cast<int>(numbers.size()) - kPinholeCount, CV_64F);
        for (int i = 0; i < distortion.cols; ++i) {
            distortion.at<double>(i) = numbers[static_cast<std::size_t>(kPinholeCount + i)];
        }
        cv::Mat rotation(3, 3, CV_64F);
        cv::Mat translation(3, 1, CV_64F);
        for (int row = 0; row < 3; ++row) {
            translation.at<double>(row) = camera.cam_from_rig.translation_mm[row];
            for (int column = 0; column < 3; ++column) {
                rotation.at<double>(row, column) = camera.cam_from_rig.rotation(row, column);
            }
        }
        file << "{" << "name" << camera.name << "image_width" << camera.width_px << "image_height"
             << camera.height_px << "model" << std::string(camera_model_name(camera.lens.model))
             << "camera_matrix" << matrix << "distortion_coefficients" << distortion << "R" << rotation
             << "T" << translation << "}";
    }
    file << "]";
    return file.releaseAndGetString();
}

}  // namespace rig
