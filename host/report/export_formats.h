// A rig in the formats of other programs. What each can carry, and in which units:
//
//     opencv   every lens; poses in mm; one YAML (export_opencv.h)
//     ros      k1 k2 p1 p2 k3 [k4 k5 k6], fisheye; no poses; a camera_info YAML a camera
//     kalibr   k1 k2 p1 p2, fisheye; poses from camera to camera in metres; one camchain YAML
//     colmap   k1 k2 p1 p2 [k3 k4 k5 k6], fisheye; poses in metres; cameras.txt and rig_config.json (3.12)
//     mrcal    k1 k2 p1 p2 k3 [k4 k5 k6 [s1 s2 s3 s4]]; poses in metres; a .cameramodel a camera
//     json     everything: rig.json
//
// A rig in parts that nothing connects: ros has no poses and json says what stands in which part, so they
// take all; colmap has a rig a part, mrcal a folder part-N a part; opencv and kalibr hold one rig, so that
// one part is chosen.
//
// The centre of the top-left pixel is (0, 0) in all of them but COLMAP, where it is (0.5, 0.5).
#pragma once

#include <optional>

#include "host/report/named_text.h"
#include "host/report/rig_file.h"

namespace rig {

std::vector<std::string> export_format_names();

struct ExportResult {
    std::vector<NamedText> files;    // one without a name, or some for a folder
    std::vector<std::string> notes;  // sentences: what the files do not carry
};

// `approximate`: put a lens that the format cannot carry into the nearest that it can; else that fails,
// with a sentence that names the camera and how far off the nearest would be. A fisheye is never put into
// a format that has none. `part`: the cameras of this part only; fails where there is none, and for json,
// which is the whole file.
Result<ExportResult> export_rig(const RigFile& rig, const std::string& format, bool approximate,
                                std::optional<int> part = std::nullopt);

}  // namespace rig
