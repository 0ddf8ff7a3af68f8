// See spline_json.h.
#include "host/report/spline_json.h"

#include <cmath>

#include "host/solve/surface.h"

namespace rig {
namespace {

using nlohmann::ordered_json;

constexpr int kPointsMax = 4096;  // control points along a side that a file may ask for

// A whole number in [4, kPointsMax]; 0 when it is anything else.
int points_along(const ordered_json& value)
{
    return value.is_number_integer() && value >= 4 && value <= kPointsMax ? value.get<int>() : 0;
}

// Finite numbers of a list of known length; false when it is anything else.
bool append(const ordered_json& list, std::size_t count, std::vector<double>* out)
{
    if (!list.is_array() || list.size() != count) {
        return false;
    }
    for (const ordered_json& item : list) {
        if (!item.is_number() || !std::isfinite(item.get<double>())) {
            return false;
        }
        out->push_back(item);
    }
    return true;
}

ordered_json grid_json(const BsplineGrid& grid, const char* unit)
{
    return {{std::string("origin_") + unit, {grid.origin.x(), grid.origin.y()}},
            {std::string("step_") + unit, {grid.step.x(), grid.step.y()}},
            {"columns", grid.columns},
            {"rows", grid.rows}};
}

}  // namespace

ordered_json field_json(const SplineField& field)
{
    ordered_json out = grid_json(field.grid, "px");
    const auto middle = field.control.begin() + field.grid.count();
    out["x_px"] = std::vector<double>(field.control.begin(), middle);
    out["y_px"] = std::vector<double>(middle, field.control.end());
    return out;
}

ordered_json field_errors_json(const FieldErrors& errors)
{
    std::vector<double> xx, xy, yy;
    for (const Eigen::Matrix2d& px2 : errors.px2) {
        xx.push_back(px2(0, 0));
        xy.push_back(px2(0, 1));
        yy.push_back(px2(1, 1));
    }
    return {{"columns", errors.columns}, {"rows", errors.rows}, {"xx", xx}, {"xy", xy}, {"yy", yy}};
}

Result<FieldErrors> read_field_errors(const ordered_json& entry, const std::string& where)
{
    FieldErrors out;
    if (entry.is_null()) {
        return out;
    }
    const auto side = [&](const char* key) {
        const ordered_json value = entry.is_object() ? entry.value(key, ordered_json()) : ordered_json();
        return value.is_number_integer() && value >= 2 && value <= kPointsMax ? value.get<int>() : 0;
    };
    out.columns = side("columns");
    out.rows = side("rows");
    const auto count = static_cast<std::size_t>(out.columns * out.rows);
    std::vector<double> xx, xy, yy;
    if (count == 0 || !append(entry.value("xx", ordered_json()), count, &xx)
        || !append(entry.value("xy", ordered_json()), count, &xy)
        || !append(entry.value("yy", ordered_json()), count, &yy)) {
        return Status::failure(where + ": 'variance_px2' of 'spline' needs 'columns' and 'rows', and as many "
                                       "numbers in 'xx', 'xy' and 'yy'");
    }
    for (std::size_t i = 0; i < count; ++i) {
        out.px2.push_back((Eigen::Matrix2d() << xx[i], xy[i], xy[i], yy[i]).finished());
    }
    return out;
}

ordered_json surface_json(const Surface& surface, const Board& board)
{
    if (surface.empty()) {
        return nullptr;
    }
    const SurfaceFigures figures = surface_figures(surface, board);
    ordered_json out{{"rms_um", figures.rms_um},
                     {"lowest_um", figures.lowest_um},
                     {"highest_um", figures.highest_um}};
    out.update(grid_json(surface.grid, "mm"));
    out["z_mm"] = surface.control;
    return out;
}

Result<SplineField> read_field(const ordered_json& entry, const std::string& where)
{
    const auto fault = [&](const std::string& what) { return Status::failure(where + ": " + what); };
    if (!entry.is_object()) {
        return fault("a spline lens needs 'spline', an object");
    }
    SplineField field;
    std::vector<double> origin;
    std::vector<double> step;
    if (!append(entry.value("origin_px", ordered_json()), 2, &origin)
        || !append(entry.value("step_px", ordered_json()), 2, &step) || !(step[0] > 0.0)
        || !(step[1] > 0.0)) {
        return fault("'spline' needs 'origin_px' and 'step_px', two numbers each, steps above 0");
    }
    field.grid.origin = {origin[0], origin[1]};
    field.grid.step = {step[0], step[1]};
    field.grid.columns = points_along(entry.value("columns", ordered_json()));
    field.grid.rows = points_along(entry.value("rows", ordered_json()));
    if (field.grid.columns == 0 || field.grid.rows == 0) {
        return fault("'columns' and 'rows' of 'spline' must be integers from 4 to "
                     + std::to_string(kPointsMax));
    }
    const auto count = static_cast<std::size_t>(field.grid.count());
    for (const char* key : {"x_px", "y_px"}) {
        if (!append(entry.value(key, ordered_json()), count, &field.control)) {
            return fault("'" + std::string(key) + "' of 'spline' must be a list of "
                         + std::to_string(count) + " numbers");
        }
    }
    return field;
}

}  // namespace rig
