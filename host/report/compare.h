// How far two calibrations of one rig differ, and whether their uncertainty allows it.
//
// Points of the world are laid on a grid over each camera's image at several distances, through lens and
// pose of A. B sees them after the implied motion, one motion of the whole rig frame, which is the one
// that makes the differences in pixels least: weighted by what both calibrations know about each pixel,
// and with a camera's weight falling as it disagrees (as in a median), so that one camera that moved
// does not move the others. What is left is the difference of the rig; after a motion for each camera of
// its own what is left is that of its lens alone.
//
// Parts that nothing connects have a rig frame each: cameras that are in one part of A and in one of B are
// compared among themselves, after a motion of their own. How parts stand to each other is in neither.
//
// Test: the differences y of a camera have, where both calibrations saw the same rig, the covariance V
// that both files' covariances give, the fitted motion accounted for. y' (V + w w' + e)^-1 y is then a weighted
// sum of squares of unit Gaussians: e is a hundredth of the mean deviation squared, and w half of what the
// slopes' change from A to B makes of the parameters' change, for finer differences are those of
// linearisation; both are allowed, and not expected. Of lenses with fields V has their part only roughly:
// there y' y is asked, a weighted sum too. A p-value below kCompareChance over the number of tests is a
// difference.
#pragma once

#include "host/report/rig_file.h"

namespace rig {

constexpr double kCompareChance = 1e-3;  // of calling two calibrations of one rig different

struct Difference {
    double rms_px = 0.0;
    double most_px = 0.0;
    double allowed_px = 0.0;  // RMS that the uncertainties predict
    double chance = 1.0;      // p-value; 1 where it was not tested
    bool differs = false;     // significantly
};

struct CameraComparison {
    std::string name;
    Difference rig;         // lens and pose, after the implied motion
    Difference lens;        // after a motion of its own
    double shift_mm = 0.0;  // of the camera's centre, after the implied motion
    double turn_deg = 0.0;  // of the camera, what the lens makes up for taken out
};

// Cameras that one rig frame joins in both.
struct PartComparison {
    int part_a = 0;
    int part_b = 0;
    std::vector<CameraComparison> cameras;  // in A's order
    Pose b_from_a;                // the implied motion of rig frames
    double rms_mm = 0.0;          // of points in A's volume, triangulated with B from A's pixels
    double most_mm = 0.0;
    double allowed_mm = 0.0;
    std::size_t places = 0;       // how many points; A tells the volume of its part 0 only
};

struct Comparison {
    std::vector<PartComparison> parts;  // by A's cameras; one for whole rigs
    std::vector<std::string> only_a;
    std::vector<std::string> only_b;
    bool tested = false;          // both files hold a covariance
    bool differs = false;         // some camera does, or is missing in one
};

struct CompareOptions {
    std::vector<double> distances_mm;  // empty: those that A was calibrated at
    std::string name_a = "A";          // what sentences call the files
    std::string name_b = "B";
};

// Fails with a sentence when no camera's name is in both, when images differ in size, or when A tells no
// distances and none are given.
Result<Comparison> compare_rigs(const RigFile& a, const RigFile& b, const CompareOptions& options);

// Table, and a sentence that says what it amounts to.
std::string comparison_text(const Comparison& comparison, const CompareOptions& options);

}  // namespace rig
