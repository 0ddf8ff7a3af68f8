// Reads observations.csv: camera,frame,board,point,x,y[,sigma].
#pragma once

#include <string>

#include "host/base/status.h"
#include "host/obs/observation.h"

namespace rig {

// Adds the file's observations, in the order of sort_observations, and its digest to the scene,
// whose cameras and boards are known. Millions of rows are meant: some 0.3 microseconds each.
Status read_observations(const std::string& path, Scene* scene);

// Sorts by camera, frame, board and point: the one order in which everything later is summed.
void sort_observations(std::vector<Observation>* observations);

}  // namespace rig
