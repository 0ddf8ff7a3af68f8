// See richer.h.
#include "host/solve/richer.h"

#include <fmt/format.h>

#include <algorithm>

namespace rig {
namespace {

constexpr int kFieldCells[] = {4, 6, 9, 13, 19, 27};

std::string field_name(int cells)
{
    return fmt::format("spline, {} cells", cells);
}

}  // namespace

void resample(const BsplineGrid& from, const double* control, const BsplineGrid& to, double* out)
{
    for (int row = 0; row < to.rows; ++row) {
        for (int column = 0; column < to.columns; ++column) {
            const Eigen::Vector2d at =
                to.origin + to.step.cwiseProduct(Eigen::Vector2d(column - 1, row - 1));
            out[row * to.columns + column] = bspline_value(from, control, at, nullptr);
        }
    }
}

std::vector<std::string> lens_ladder(const Camera& lens)
{
    std::vector<std::string> ladder;
    const int own_cells = std::max(lens.field.grid.columns, lens.field.grid.rows) - 3;
    if (lens.field.empty() && lens.model == CameraModel::kFisheye) {
        ladder.emplace_back(camera_model_name(lens.model));
    } else if (lens.field.empty()) {
        for (const CameraModel model :
             {CameraModel::kBrown, CameraModel::kRational, CameraModel::kThinPrism}) {
            if (model >= lens.model) {
                ladder.emplace_back(camera_model_name(model));
            }
        }
    }
    for (const int cells : kFieldCells) {
        if (lens.field.empty() || cells >= own_cells) {
            ladder.push_back(field_name(cells));
        }
    }
    return ladder;
}

std::string first_field()
{
    return field_name(kFieldCells[0]);
}

void enrich_lens(const SceneCamera& camera, const std::string& name, Camera* lens)
{
    const auto model = camera_model_from_name(name);
    if (model) {
        lens->model = *model;
        lens->intrinsics.resize(static_cast<std::size_t>(kPinholeCount + distortion_count(*model)), 0.0);
        return;
    }
    for (const int cells : kFieldCells) {
        if (name == field_name(cells)) {
            SplineField field = make_spline_field(camera.width_px, camera.height_px, cells);
            for (int part = 0; part < 2 && !lens->field.empty(); ++part) {
                resample(lens->field.grid, lens->field.control.data() + part * lens->field.grid.count(),
                         field.grid, field.control.data() + part * field.grid.count());
            }
            lens->field = std::move(field);
        }
    }
}

}  // namespace rig
