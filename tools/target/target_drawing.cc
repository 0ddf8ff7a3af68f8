#include "tools/target/target_drawing.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

namespace target_maker {

namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kQ30 = 1073741824.0;

// Where the patch frame of a place lies on the sheet: (u, v) -> millimetres.
struct PatchPlace {
    double left_mm;
    double top_mm;
    double side_mm;
    bool turned;

    double x(double u) const { return left_mm + side_mm * (turned ? 1 - u : u); }
    double y(double v) const { return top_mm + side_mm * (turned ? 1 - v : v); }
};

PatchPlace place_of(const targetfile& target, const Sheet& sheet, unsigned place)
{
    const unsigned row = place / target.target.cols;
    const unsigned col = place % target.target.cols;
    return {sheet.grid_left_mm + col * target.patch_mm, sheet.grid_top_mm + row * target.patch_mm,
            target.patch_mm, target.target.turns[place] != 0};
}

// Calls draw(place on the sheet, feature, whether its circle is white) for every feature.
template <typename Draw>
void for_each_feature(const targetfile& target, const Sheet& sheet, Draw draw)
{
    const struct target& t = target.target;
    const unsigned patches = static_cast<unsigned>(t.rows) * t.cols;
    for (unsigned place = 0; place < patches; place++) {
        const PatchPlace patch = place_of(target, sheet, place);
        for (unsigned index = 0; index < layout_feature_count(t.levels); index++) {
            draw(patch, *layout_feature(t.levels, index),
                 layout_circle_is_white(t.levels, t.ids[place], index));
        }
    }
}

// Grey along a white circle's radius, as stops of a linear interpolation. Its error is at most
// step^2/8 times the largest second derivative, (1 - edge_level)/gauss_sigma^2 at the centre; the
// number of steps keeps that below a tenth of an 8-bit level.
std::vector<double> gradient_levels(const targetfile& target)
{
    const double bend = (1 - target.edge_level) / (target.gauss_sigma * target.gauss_sigma);
    const double steps = std::ceil(std::sqrt(bend / (8 * 0.1 / 255)));
    const std::size_t count = static_cast<std::size_t>(std::max(steps, 1.0)) + 1;
    std::vector<double> levels;
    for (std::size_t i = 0; i < count; i++) {
        const double t = static_cast<double>(i) / static_cast<double>(count - 1);
        const double peak = std::exp(-t * t / (2 * target.gauss_sigma * target.gauss_sigma));
        levels.push_back(target.edge_level + (1 - target.edge_level) * peak);
    }
    return levels;
}

void draw_circle(cairo_t* on, double x_mm, double y_mm, double radius_mm,
                 const std::vector<double>& levels, bool white)
{
    cairo_pattern_t* grey = cairo_pattern_create_radial(x_mm, y_mm, 0, x_mm, y_mm, radius_mm);
    for (std::size_t i = 0; i < levels.size(); i++) {
        const double level = white ? levels[i] : 1 - levels[i];
        const double t = static_cast<double>(i) / static_cast<double>(levels.size() - 1);
        cairo_pattern_add_color_stop_rgb(grey, t, level, level, level);
    }
    cairo_set_source(on, grey);
    cairo_arc(on, x_mm, y_mm, radius_mm, 0, 2 * kPi);
    cairo_fill(on);
    cairo_pattern_destroy(grey);
}

// The largest of 1, 2, 5, 10, ... (and 0.5, 0.2, ...) that is at most `limit`.
double round_length(double limit)
{
    const double power = std::pow(10, std::floor(std::log10(limit)));
    for (const double digit : {5.0, 2.0}) {
        if (digit * power <= limit) {
            return digit * power;
        }
    }
    return power;
}

// Text with its baseline at y_mm, made smaller where it would be wider than the sheet allows.
void draw_text(cairo_t* on, const Sheet& sheet, double x_mm, double y_mm, double size_mm,
               const std::string& text)
{
    cairo_text_extents_t extents;
    cairo_set_font_size(on, size_mm);
    cairo_text_extents(on, text.c_str(), &extents);
    const double room_mm = sheet.width_mm - x_mm - sheet.caption_left_mm;
    if (extents.x_advance > room_mm) {
        cairo_set_font_size(on, size_mm * room_mm / extents.x_advance);
    }
    cairo_move_to(on, x_mm, y_mm);
    cairo_show_text(on, text.c_str());
}

void set_font(cairo_t* on, cairo_font_weight_t weight)
{
    cairo_select_font_face(on, "sans-serif", CAIRO_FONT_SLANT_NORMAL, weight);
}

// Ten equal parts; each tick's middle is the mark. Thin rectangles, so that no line-end rule of any
// viewer moves them.
void draw_ruler(cairo_t* on, const Sheet& sheet, double left_mm, double top_mm)
{
    const double thick_mm = 0.08 * sheet.text_mm;
    for (int tick = 0; tick <= 10; tick++) {
        const double tall_mm = (tick % 10 == 0 ? 1.2 : tick == 5 ? 0.9 : 0.6) * sheet.text_mm;
        cairo_rectangle(on, left_mm + sheet.ruler_mm * tick / 10 - thick_mm / 2, top_mm, thick_mm,
                        tall_mm);
    }
    cairo_rectangle(on, left_mm - thick_mm / 2, top_mm, sheet.ruler_mm + thick_mm, thick_mm);
    cairo_fill(on);
}

}  // namespace

Sheet sheet_of(const targetfile& target)
{
    Sheet sheet{};
    sheet.grid_left_mm = target.margin * target.patch_mm;
    sheet.grid_top_mm = sheet.grid_left_mm;
    sheet.width_mm = 2 * sheet.grid_left_mm + target.target.cols * target.patch_mm;
    sheet.caption_top_mm = 2 * sheet.grid_top_mm + target.target.rows * target.patch_mm;
    // 5 mm is read at arm's length; a narrow sheet gets smaller text.
    sheet.caption_left_mm = sheet.width_mm / 20;
    sheet.text_mm = std::min(5.0, sheet.width_mm / 28);
    sheet.height_mm = sheet.caption_top_mm + 9.5 * sheet.text_mm;
    sheet.ruler_mm = round_length(0.75 * sheet.width_mm);
    return sheet;
}

void draw_grid(cairo_t* on, const targetfile& target, const Sheet& sheet)
{
    cairo_rectangle(on, 0, 0, sheet.width_mm, sheet.caption_top_mm);
    cairo_set_source_rgb(on, 1, 1, 1);
    cairo_fill(on);

    // All black triangles are one path: filled one by one, neighbours would show a pale seam
    // where both cover a part of the same pixel.
    for_each_feature(target, sheet, [on](const PatchPlace& patch,
                                         const struct layout_feature& feature, bool white_circle) {
        if (white_circle) {
            for (int corner = 0; corner < 3; corner++) {
                cairo_line_to(on, patch.x(feature.corner_u_8th[corner] / 8.0),
                              patch.y(feature.corner_v_8th[corner] / 8.0));
            }
            cairo_close_path(on);
            cairo_new_sub_path(on);
        }
    });
    cairo_set_source_rgb(on, 0, 0, 0);
    cairo_fill(on);

    const std::vector<double> levels = gradient_levels(target);
    for_each_feature(target, sheet, [&](const PatchPlace& patch,
                                        const struct layout_feature& feature, bool white_circle) {
        draw_circle(on, patch.x(feature.u_q30 / kQ30), patch.y(feature.v_q30 / kQ30),
                    target.circle_ratio * (feature.inradius_q30 / kQ30) * patch.side_mm, levels,
                    white_circle);
    });
}

void draw_caption(cairo_t* on, const targetfile& target, const Sheet& sheet)
{
    const double em = sheet.text_mm;
    const double left_mm = sheet.caption_left_mm;
    cairo_rectangle(on, 0, sheet.caption_top_mm, sheet.width_mm,
                    sheet.height_mm - sheet.caption_top_mm);
    cairo_set_source_rgb(on, 1, 1, 1);
    cairo_fill(on);
    cairo_set_source_rgb(on, 0, 0, 0);

    const struct target& t = target.target;
    set_font(on, CAIRO_FONT_WEIGHT_BOLD);
    draw_text(on, sheet, left_mm, sheet.caption_top_mm + 1.6 * em, 1.3 * em, t.name);
    set_font(on, CAIRO_FONT_WEIGHT_NORMAL);
    draw_text(on, sheet, left_mm, sheet.caption_top_mm + 3.2 * em, em,
              fmt::format("{} x {} patches of {} mm, levels {}", t.rows, t.cols, target.patch_mm,
                          static_cast<unsigned>(t.levels)));
    draw_text(on, sheet, left_mm, sheet.caption_top_mm + 4.6 * em, em,
              fmt::format("digest {:016x}", target_digest(&t)));
    const double ruler_top_mm = sheet.caption_top_mm + 5.6 * em;
    draw_ruler(on, sheet, left_mm, ruler_top_mm);
    draw_text(on, sheet, left_mm, ruler_top_mm + 2.4 * em, 0.9 * em,
              fmt::format("The ruler is {0} mm long. measured_scale = its measured length / {0} mm",
                          sheet.ruler_mm));
}

}  // namespace target_maker
