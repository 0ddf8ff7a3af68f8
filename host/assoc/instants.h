// Frames of several cameras that were taken at one time make an instant.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace rig {

struct Capture {
    int camera = 0;
    std::int64_t t_ns = 0;  // all of one clock
};

// The instant of each capture, numbered from 0 in order of time. Captures whose times lie within the
// tolerance of the instant's earliest belong to it; a camera stands at most once in an instant.
std::vector<std::int64_t> find_instants(const std::vector<Capture>& captures, std::int64_t tolerance_ns);

// A tenth of the shortest camera's median interval between frames; a millisecond when no camera has
// two frames.
std::int64_t default_tolerance_ns(const std::vector<Capture>& captures);

}  // namespace rig
