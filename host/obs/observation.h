// What the solver is given: cameras, boards and where in which image a board's point was seen.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace rig {

struct SceneCamera {
    std::string name;
    int width_px = 0;
    int height_px = 0;
    double row_time_ns = 0.0;         // from row to row, downwards; 0: global shutter
    bool estimate_row_time = false;  // it is not known, and is to be found
};

// A point feature, or a circle in a plane z = constant whose observed quantity is the centre of the
// ellipse that its edge makes in the image.
struct BoardPoint {
    std::int64_t id = 0;                             // Tessera: patch id * 128 + feature index
    Eigen::Vector3d at_mm = Eigen::Vector3d::Zero();  // board frame
    double radius_mm = 0.0;                          // 0: a point
};

// One rigid piece with one pose a frame.
struct Board {
    std::string name;
    std::vector<BoardPoint> points;
    std::unordered_map<std::int64_t, std::size_t> index_of_id;
    std::string scale;          // what its lengths are from: "the patch side of 100 mm in target.json"
    bool is_static = false;     // one pose for all frames
    int group = 0;              // boards of one group are fixed to each other: index of the first of them
    bool faces_minus_z = false;  // can only be seen from its -z side (every Tessera target)
};

// 48 bytes: there are millions of them.
struct Observation {
    int camera = 0;           // index into Scene::cameras
    int board = 0;            // index into Scene::boards
    std::int64_t frame = 0;   // equal frames are simultaneous
    Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // (0, 0): centre of the top-left pixel
    std::uint32_t point = 0;  // index into Board::points
    float sigma_px = 0.0f;    // standard deviation per axis; 0: unknown
};

struct InputFile {
    std::string path;
    std::string digest;  // FNV-1a of its bytes, 16 hex digits
};

// The distance of two cameras' centres of projection, measured otherwise: compared with the result, not used in it.
struct Baseline {
    int camera_a = 0;  // indices into Scene::cameras
    int camera_b = 0;
    double mm = 0.0;
    double sigma_mm = 0.0;
};

struct Scene {
    std::vector<SceneCamera> cameras;
    std::vector<Board> boards;
    std::vector<Baseline> baselines;
    std::vector<Observation> observations;      // sorted: camera, frame, board, point
    // First row's exposure after the earliest camera's of this frame, by camera and frame; absent: none.
    std::map<std::pair<int, std::int64_t>, std::int64_t> stamps_ns;
    std::map<std::string, std::size_t> rejected;  // counts by reason, before solving
    std::vector<InputFile> inputs;
};

}  // namespace rig
