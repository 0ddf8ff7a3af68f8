// Two cameras that never see the same board, but boards that are fixed to each other.
#pragma once

#include <optional>
#include <vector>

#include "host/base/pose.h"

namespace rig {

// Camera a sees board p while camera b sees board q, at one place of the body that carries both.
struct Sighted {
    Pose a_from_p;
    Pose b_from_q;
};

struct HandEye {
    Pose b_from_a;
    Pose p_from_q;
};

enum { kHandEyeMin = 3 };

// b_from_q = b_from_a * a_from_p * p_from_q for all of the list, in the least-squares sense, places
// that contradict the others left aside. None where there are fewer than kHandEyeMin places, or
// where they do not differ enough by rotations about two axes.
std::optional<HandEye> solve_hand_eye(const std::vector<Sighted>& places);

}  // namespace rig
