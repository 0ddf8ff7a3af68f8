// What the residuals of a solution say: their lengths as in the paper's table, and where in the image
// there were points.
#pragma once

#include "host/report/reach.h"
#include "host/solve/rig.h"

namespace rig {

// Of residual lengths, px. mean and deviation are of the length, so rmse^2 = mean^2 + deviation^2.
struct LengthStatistics {
    std::size_t used = 0;
    std::size_t rejected = 0;   // by the solver, having a residual
    double rmse_px = 0.0;       // used points
    double mean_px = 0.0;
    double deviation_px = 0.0;
    double rmse_all_px = 0.0;   // used and rejected points
    double whitened_rms = 0.0;  // of used points' residuals over sigma, per axis; 1: sigmas are honest
};

struct Coverage {
    int columns = 0;
    int rows = 0;
    double part = 0.0;               // of the cells that hold a used point
    std::vector<std::string> weak;   // names of image ninths with fewer than half their cells filled
};

struct CameraStatistics {
    LengthStatistics lengths;
    std::size_t views = 0;          // with used points
    double points_per_view = 0.0;   // used
    Coverage coverage;
};

struct Statistics {
    LengthStatistics rig;
    std::vector<CameraStatistics> cameras;        // in the order of Solution::cameras
    Reach reach;
    std::map<std::string, std::size_t> rejected;  // observations by reason, all of them
};

Statistics make_statistics(const Scene& scene, const Solution& solution);

}  // namespace rig
