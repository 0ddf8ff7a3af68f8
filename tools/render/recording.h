/* Writes a recording: a folder a camera with frames, times and truth. README.md describes it. */
#ifndef RENDER_RECORDING_H
#define RENDER_RECORDING_H

#include <string>
#include <vector>

#include "tools/render/render_scene.h"
#include "tools/render/rim_truth.h"

namespace render {

// frame_00012.pgm, or .pfm
std::string frame_name(int frame, bool as_float);

// Each file is written beside its place and then moved there. All throw UserError.
void write_pgm(const std::string& path, const Camera& camera, const std::vector<std::uint16_t>& digits);
void write_pfm(const std::string& path, const Camera& camera, const std::vector<double>& grey);
void write_text(const std::string& path, const std::string& text);

std::string truth_header();
std::string truth_lines(const std::string& file, int frame, const std::vector<RimTruth>& rims);
// Cameras with the keys of rig.json, and the board's pose at each frame's time.
std::string truth_json(const Scene& scene, int first, int end);

} // namespace render

#endif
