/* A scene file: which target moves how before which cameras. README.md describes the file. */
#ifndef RENDER_SCENE_H
#define RENDER_SCENE_H

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/targetfile/targetfile.h"
#include "tools/render/lens.h"
#include "tools/render/motion.h"

namespace render {

// What a user can put right; the text is one sentence.
class UserError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

struct Background {
    double level = 0.5;     // reflectance, [0, 1]
    double amplitude = 0;   // of a soft texture, reflectance
    double scale_px = 60;   // size of its largest waves
    int clutter = 0;        // number of sharp-edged shapes
};

struct Occluder {
    std::vector<Eigen::Vector2d> polygon; // pixels
    double level = 0;                     // reflectance
};

struct Camera {
    std::string name;
    Lens lens;
    Pose cam_from_rig;
    double psf_sigma_px = 0.8;
    double noise = 0;      // standard deviation, grey levels of 255
    double shot_noise = 0; // variance a grey level of signal, grey levels of 255
    int bits = 8;
    double black = 25;     // grey levels of 255
    double white = 215;
    double gamma = 1;
    double vignetting = 0; // share of the light lost in the farthest corner
    double shading_to = 1; // light falls evenly from 1 to this across the frame
    double shading_direction_deg = 0;
    double exposure_us = 0;
    double row_time_us = 0;
    Background background;
    std::vector<Occluder> occluders;
};

struct Scene {
    std::string target_path;
    targetfile target;
    std::string board = "board";
    std::uint64_t seed = 1;
    std::vector<Camera> cameras;
    std::vector<Instant> instants;
};

// Reads a scene. `target_path`, unless empty, stands in for the scene's own target (which lies beside
// the scene unless absolute). Throws UserError.
Scene read_scene(const std::string& path, const std::string& target_path);

} // namespace render

#endif
