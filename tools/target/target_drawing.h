// The drawing itself, in millimetres on any cairo context.
//
// The sheet from the top: white margin, grid, white margin, caption. Its origin is its upper left
// corner, x to the right and y down, so the grid stands on it exactly as the board frame says.
#ifndef TOOLS_TARGET_TARGET_DRAWING_H
#define TOOLS_TARGET_TARGET_DRAWING_H

#include <cairo.h>

#include "common/targetfile/targetfile.h"

namespace target_maker {

struct Sheet {
    double width_mm;
    double height_mm;
    double grid_left_mm;    // where the board frame's origin lies
    double grid_top_mm;
    double caption_top_mm;  // below it lies the caption
    double caption_left_mm;
    double text_mm;         // size of the caption's text
    double ruler_mm;        // length of its ruler: 1, 2 or 5 times a power of ten
};

// The nominal sheet: measured_scale belongs to a print, not to the drawing.
Sheet sheet_of(const targetfile& target);

// Paints the sheet white and the grid on it; nothing outside [0, width] x [0, caption_top].
// Drawn values are the target's reflectances, 0 to 1, as grey values 0 to 1.
void draw_grid(cairo_t* on, const targetfile& target, const Sheet& sheet);

// Name, patch side, size, digest and ruler.
void draw_caption(cairo_t* on, const targetfile& target, const Sheet& sheet);

}  // namespace target_maker

#endif
