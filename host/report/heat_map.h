// A picture of one camera's projection uncertainty over its image.
#pragma once

#include "host/report/error_bars.h"

namespace rig {

enum { kHeatColumns = 49, kHeatRows = 37 };

// PNG bytes from a grid of kHeatColumns x kHeatRows: colour from blue (0) over green to red (three times
// the median and more), with the number, px, written at places. Grey: no ray.
std::string heat_png(const RigCamera& camera, double distance_mm, const std::vector<PixelError>& grid);

}  // namespace rig
