// The drawing as PDF, SVG and PNG: bytes, ready to be saved.
#ifndef TOOLS_TARGET_TARGET_SHEETS_H
#define TOOLS_TARGET_TARGET_SHEETS_H

#include <string>

#include "common/targetfile/targetfile.h"
#include "host/base/status.h"

namespace target_maker {

// Vectors at true size: 72 points are 25.4 mm. At most 14400 points a side, what viewers take.
rig::Result<std::string> pdf_of(const targetfile& target);

// Vectors at true size, in millimetres. At most 10 m a side.
rig::Result<std::string> svg_of(const targetfile& target);

// 8-bit grey, anti-aliased, with its resolution noted inside. The sheet's point (x, y) mm lies at
// pixel (x * dpi / 25.4 - 0.5, y * dpi / 25.4 - 0.5), (0, 0) being the centre of the first pixel.
rig::Result<std::string> png_of(const targetfile& target, double dpi);

}  // namespace target_maker

#endif
