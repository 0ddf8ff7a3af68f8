// A picture of one camera's residuals over its image: where there were points, and how far off.
#pragma once

#include <string>

#include "host/report/statistics.h"

namespace rig {

// PNG bytes: a dot at each observed point, coloured by the residual's length from blue (0) over green
// to red (three times the camera's RMSE and more); rejected points are black crosses.
std::string residual_png(const Scene& scene, const Solution& solution, const Statistics& statistics,
                         std::size_t place);

}  // namespace rig
