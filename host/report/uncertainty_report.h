// The error bars of a rig as a table for people and as CSV.
#pragma once

#include "host/report/error_bars.h"
#include "host/report/named_text.h"

namespace rig {

struct UncertaintyOptions {
    std::vector<double> distances_mm;  // from each camera; empty: those it was calibrated at
    double noise_px = 0.0;             // of later observations, in what is triangulated
};

struct UncertaintyReport {
    std::string table;
    std::vector<NamedText> files;  // CSV, and a PNG a camera
};

// Fails with a sentence when the rig has no covariance, or tells no distances and none are given.
// `source` is what sentences call the file.
Result<UncertaintyReport> uncertainty_report(const RigFile& rig, const UncertaintyOptions& options,
                                             const std::string& source);

// Distances at which to look at a camera: `asked`, or else those it was calibrated at; fails likewise.
Result<std::vector<double>> distances_for(const RigCamera& camera, const std::vector<double>& asked,
                                          const std::string& source);

}  // namespace rig
