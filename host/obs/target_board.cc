// A Tessera target as the solver's board: the project's one reader of target files, turned into points.
#include <fmt/format.h>

#include <filesystem>
#include <memory>

// In C a struct and a function may share a name; C++ warns that the function hides the constructor.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
#include "common/targetfile/targetfile.h"
#pragma GCC diagnostic pop
#include "host/obs/scene.h"

namespace rig {

Result<Board> read_target_board(const std::string& path, std::uint64_t* digest)
{
    const auto file = std::make_unique<targetfile>();
    char error[TARGETFILE_ERROR_BYTES];
    if (!targetfile_read(path.c_str(), file.get(), error)) {
        return Status::failure(error);
    }
    const target& pattern = file->target;
    if (digest != nullptr) {
        *digest = target_digest(&file->target);
    }
    Board board;
    board.name = pattern.name[0] != '\0' ? pattern.name : path;
    board.faces_minus_z = true;
    board.scale = fmt::format("the patch side of {} mm in {}", 1e-6 * static_cast<double>(pattern.patch_nm),
                              std::filesystem::path(path).filename().string());
    if (file->measured_scale[0] != 1.0 || file->measured_scale[1] != 1.0) {
        board.scale += fmt::format(", times the measured_scale of {} and {}", file->measured_scale[0],
                                   file->measured_scale[1]);
    }
    const unsigned patches = unsigned{pattern.rows} * pattern.cols;
    for (unsigned place = 0; place < patches; ++place) {
        for (unsigned feature = 0; feature < layout_feature_count(pattern.levels); ++feature) {
            BoardPoint point;
            point.id = std::int64_t{pattern.ids[place]} * LAYOUT_POINT_STRIDE + feature;
            if (targetfile_point_mm(file.get(), pattern.ids[place], feature, point.at_mm.data(),
                                    &point.radius_mm)) {
                board.index_of_id.emplace(point.id, board.points.size());
                board.points.push_back(point);
            }
        }
    }
    return board;
}

}  // namespace rig
