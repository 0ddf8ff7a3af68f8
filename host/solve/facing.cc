// See facing.h.
#include "host/solve/facing.h"

#include <fmt/format.h>

#include <cmath>

namespace rig {
namespace {

bool is_flat(const Board& board)
{
    for (const BoardPoint& point : board.points) {
        if (point.at_mm.z() != 0.0) {
            return false;
        }
    }
    return true;
}

struct Sides {
    int front = 0;  // views from -z
    int back = 0;
    std::string_view majority() const { return back > front ? "back" : "front"; }
};

}  // namespace

Status check_facing(const Scene& scene, const ViewSet& set, const std::vector<Pose>& by_view)
{
    std::map<std::pair<int, int>, Sides> sides;  // by board and camera
    for (std::size_t i = 0; i < set.views.size(); ++i) {
        const View& view = set.views[i];
        Sides& count = sides[{view.board, view.camera}];
        ++(inverse(by_view[i]).translation_mm.z() > 0.0 ? count.back : count.front);
    }
    std::map<int, std::pair<int, std::string_view>> first_of_board;
    for (const auto& [key, count] : sides) {
        const Board& board = scene.boards[static_cast<std::size_t>(key.first)];
        const std::string& camera = scene.cameras[static_cast<std::size_t>(key.second)].name;
        if (!is_flat(board)) {
            continue;
        }
        if (board.faces_minus_z && count.back > count.front) {
            return Status::failure(fmt::format(
                "camera '{}' sees board '{}' mirrored in {} of {} views: its images are mirrored, or "
                "the target was printed or measured mirrored; undo that and solve again",
                camera, board.name, count.back, count.back + count.front));
        }
        const auto [found, is_new] =
            first_of_board.emplace(key.first, std::pair(key.second, count.majority()));
        if (!is_new && found->second.second != count.majority()) {
            return Status::failure(fmt::format(
                "cameras '{}' and '{}' see the flat board '{}' from opposite sides: the images of one "
                "of them are mirrored; undo that and solve again",
                scene.cameras[static_cast<std::size_t>(found->second.first)].name, camera, board.name));
        }
    }
    return Status();
}

}  // namespace rig
