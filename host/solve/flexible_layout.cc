// See flexible_system.h: which columns there are.
#include <algorithm>

#include "host/solve/flexible_system.h"

namespace rig {

FlexibleLayout make_layout(const RigState& state, const std::vector<View>& views,
                           const std::vector<char>& use,
                           const std::vector<int>& gauge_cameras, bool poses_only)
{
    FlexibleLayout out;
    const std::size_t cameras = state.lenses.size();
    std::size_t boards = state.surfaces.size();
    std::vector<char> seen(cameras, 0);
    for (std::size_t i = 0; i < views.size(); ++i) {
        boards = std::max(boards, static_cast<std::size_t>(views[i].board) + 1);
        seen[static_cast<std::size_t>(views[i].camera)] |= use[i];
    }
    out.lens.assign(cameras, -1);
    out.camera = out.field = out.lens;
    out.member.assign(state.body_from_board.size(), -1);
    out.surface.assign(boards, -1);
    out.row_time.assign(cameras, -1);
    if (poses_only) {
        return out;
    }
    const auto give = [&](Eigen::Index count) {
        out.size += count;
        return out.size - count;
    };
    for (std::size_t c = 0; c < cameras; ++c) {
        if (seen[c] && state.lenses[c].field.empty()) {
            out.lens[c] = give(static_cast<Eigen::Index>(state.lenses[c].intrinsics.size()));
        }
        const auto camera = static_cast<int>(c);
        if (seen[c] && std::count(gauge_cameras.begin(), gauge_cameras.end(), camera) == 0) {
            out.camera[c] = give(6);
        }
    }
    for (std::size_t i = 0; i < views.size(); ++i) {
        if (use[i] && views[i].member != kNoMember
            && out.member[static_cast<std::size_t>(views[i].member)] < 0) {
            out.member[static_cast<std::size_t>(views[i].member)] = give(6);
        }
    }
    for (std::size_t c = 0; c < cameras; ++c) {
        if (seen[c] && !state.lenses[c].field.empty()) {
            out.field[c] = give(2 * state.lenses[c].field.grid.count());
        }
    }
    for (std::size_t b = 0; b < state.surfaces.size(); ++b) {
        if (!state.surfaces[b].empty()) {
            out.surface[b] = give(state.surfaces[b].grid.count());
        }
    }
    for (std::size_t c = 0; c < cameras && !state.shutter.empty(); ++c) {
        if (seen[c] && state.shutter.estimated[c] != 0 && !state.shutter.row_times_held) {
            out.row_time[c] = give(1);
        }
    }
    return out;
}

}  // namespace rig
