// cairo keeps coordinates in 1/256 of its surface's unit, which would be 1.4 um on a page counted
// in points. The vector drawings are therefore made in finer units and scaled back, to below what
// printers and plate writers resolve.
#include "tools/target/target_sheets.h"

#include <algorithm>
#include <cmath>
#include <csetjmp>
#include <memory>
#include <vector>

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <fmt/format.h>
#include <png.h>

#include "tools/target/target_drawing.h"

namespace target_maker {

namespace {

constexpr double kMmPerInch = 25.4;
constexpr double kPointsPerMm = 72 / kMmPerInch;
constexpr double kPdfPointsMax = 14400;
constexpr double kSvgMmMax = 10000;
constexpr double kSvgUnitsPerMm = 100;  // cairo's coordinates end at 2^23 units, 80 m
constexpr double kPngSideMax = 32767;   // cairo's limit
constexpr double kPngPixelsMax = 300e6; // 1.2 GB while it is drawn

struct SurfaceDestroyer {
    void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
struct ContextDestroyer {
    void operator()(cairo_t* context) const { cairo_destroy(context); }
};
using Surface = std::unique_ptr<cairo_surface_t, SurfaceDestroyer>;
using Context = std::unique_ptr<cairo_t, ContextDestroyer>;

cairo_status_t append(void* to, const unsigned char* data, unsigned int bytes)
{
    static_cast<std::string*>(to)->append(reinterpret_cast<const char*>(data), bytes);
    return CAIRO_STATUS_SUCCESS;
}

// A context in millimetres. Round shapes become curves to within a thousandth of the surface's
// unit, and text keeps its size and spacing at every resolution.
Context context_mm(const Surface& surface, double units_per_mm)
{
    Context on(cairo_create(surface.get()));
    cairo_scale(on.get(), units_per_mm, units_per_mm);
    cairo_set_tolerance(on.get(), 0.001);
    cairo_font_options_t* font = cairo_font_options_create();
    cairo_font_options_set_hint_style(font, CAIRO_HINT_STYLE_NONE);
    cairo_font_options_set_hint_metrics(font, CAIRO_HINT_METRICS_OFF);
    cairo_font_options_set_antialias(font, CAIRO_ANTIALIAS_GRAY);
    cairo_set_font_options(on.get(), font);
    cairo_font_options_destroy(font);
    return on;
}

rig::Status finished(const Surface& surface, const Context& on, const char* kind)
{
    cairo_surface_flush(surface.get());
    cairo_status_t status = cairo_status(on.get());
    if (status == CAIRO_STATUS_SUCCESS) {
        status = cairo_surface_status(surface.get());
    }
    return status == CAIRO_STATUS_SUCCESS
               ? rig::Status()
               : rig::Status::failure(fmt::format("the {} cannot be drawn: {}", kind,
                                                  cairo_status_to_string(status)));
}

rig::Status finish_stream(const Surface& surface, const Context& on, const char* kind)
{
    const rig::Status drawn = finished(surface, on, kind);
    cairo_surface_finish(surface.get());
    return drawn.ok() ? finished(surface, on, kind) : drawn;
}


void png_append(png_structp png, png_bytep data, size_t bytes)
{
    static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<char*>(data), bytes);
}

void png_nothing_to_flush(png_structp) {}

// One channel of cairo's 32-bit pixels as a grey PNG; empty when libpng gives up.
std::string grey_png(const unsigned char* pixels, unsigned width, unsigned height, int stride,
                     double dpi)
{
    std::string bytes;
    std::vector<unsigned char> row(width);
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
    if (info == nullptr || setjmp(png_jmpbuf(png)) != 0) {
        png_destroy_write_struct(&png, &info);
        return {};
    }
    png_set_write_fn(png, &bytes, png_append, png_nothing_to_flush);
    png_set_compression_level(png, 3); // flat areas shrink at any level; higher ones only cost time
    png_set_IHDR(png, info, width, height, 8, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    const png_uint_32 per_metre = static_cast<png_uint_32>(std::lround(dpi * 1000 / kMmPerInch));
    png_set_pHYs(png, info, per_metre, per_metre, PNG_RESOLUTION_METER);
    png_write_info(png, info);
    for (unsigned y = 0; y < height; y++) {
        const unsigned char* from = pixels + static_cast<std::ptrdiff_t>(y) * stride;
        for (unsigned x = 0; x < width; x++) {
            row[x] = from[4 * x + 1];
        }
        png_write_row(png, row.data());
    }
    png_write_end(png, info);
    png_destroy_write_struct(&png, &info);
    return bytes;
}

// cairo writes the document's size in its own units; the viewBox keeps those.
rig::Status set_svg_size(std::string& svg, const Sheet& sheet)
{
    const std::size_t from = svg.find("width=\"");
    const std::size_t end = svg.find("viewBox=");
    if (from == std::string::npos || end == std::string::npos || from > end) {
        return rig::Status::failure("the SVG cannot be drawn: this cairo writes another header");
    }
    svg.replace(from, end - from, fmt::format("width=\"{:.6f}mm\" height=\"{:.6f}mm\" ",
                                              sheet.width_mm, sheet.height_mm));
    return {};
}

}  // namespace

rig::Result<std::string> pdf_of(const targetfile& target)
{
    const Sheet sheet = sheet_of(target);
    const double width_pt = sheet.width_mm * kPointsPerMm;
    const double height_pt = sheet.height_mm * kPointsPerMm;
    const double longest_pt = std::max(width_pt, height_pt);
    if (longest_pt > kPdfPointsMax) {
        return rig::Status::failure(fmt::format(
            "the sheet of {:.0f} x {:.0f} mm is larger than a PDF page can be (5080 mm a side); "
            "use --svg or a smaller target",
            sheet.width_mm, sheet.height_mm));
    }
    // Units of 2^-n points: the factor back is exact in the few decimals that cairo writes, and the
    // longest side stays below 2^15, which even old viewers take.
    const double units_per_point =
        std::exp2(std::min(6.0, std::floor(std::log2(32767 / longest_pt))));
    std::string bytes;
    const Surface page(cairo_pdf_surface_create_for_stream(append, &bytes, width_pt, height_pt));
    cairo_pdf_surface_set_metadata(page.get(), CAIRO_PDF_METADATA_TITLE, target.target.name);
    const cairo_rectangle_t extents{0, 0, width_pt * units_per_point, height_pt * units_per_point};
    const Surface fine(cairo_recording_surface_create(CAIRO_CONTENT_COLOR_ALPHA, &extents));
    {
        const Context on = context_mm(fine, kPointsPerMm * units_per_point);
        draw_grid(on.get(), target, sheet);
        const rig::Status drawn = finished(fine, on, "PDF");
        if (!drawn.ok()) {
            return drawn;
        }
    }
    const Context on = context_mm(page, kPointsPerMm);
    cairo_save(on.get());
    cairo_identity_matrix(on.get());
    cairo_scale(on.get(), 1 / units_per_point, 1 / units_per_point);
    cairo_set_source_surface(on.get(), fine.get(), 0, 0);
    cairo_paint(on.get());
    cairo_restore(on.get());
    draw_caption(on.get(), target, sheet);
    cairo_show_page(on.get());
    const rig::Status written = finish_stream(page, on, "PDF");
    if (!written.ok()) {
        return written;
    }
    return bytes;
}

rig::Result<std::string> svg_of(const targetfile& target)
{
    const Sheet sheet = sheet_of(target);
    if (std::max(sheet.width_mm, sheet.height_mm) > kSvgMmMax) {
        return rig::Status::failure(fmt::format(
            "the sheet of {:.0f} x {:.0f} mm is larger than an SVG of {:.0f} mm a side; make the "
            "target smaller",
            sheet.width_mm, sheet.height_mm, kSvgMmMax));
    }
    std::string bytes;
    const Surface page(cairo_svg_surface_create_for_stream(append, &bytes,
                                                           sheet.width_mm * kSvgUnitsPerMm,
                                                           sheet.height_mm * kSvgUnitsPerMm));
    const Context on = context_mm(page, kSvgUnitsPerMm);
    draw_grid(on.get(), target, sheet);
    draw_caption(on.get(), target, sheet);
    rig::Status written = finish_stream(page, on, "SVG");
    if (written.ok()) {
        written = set_svg_size(bytes, sheet);
    }
    if (!written.ok()) {
        return written;
    }
    return bytes;
}

rig::Result<std::string> png_of(const targetfile& target, double dpi)
{
    const Sheet sheet = sheet_of(target);
    const double width = std::ceil(sheet.width_mm * dpi / kMmPerInch - 1e-6);
    const double height = std::ceil(sheet.height_mm * dpi / kMmPerInch - 1e-6);
    if (width > kPngSideMax || height > kPngSideMax || width * height > kPngPixelsMax) {
        return rig::Status::failure(fmt::format(
            "the PNG would have {:.0f} x {:.0f} pixels, more than {:.0f} a side or {:.0f} million "
            "in all; lower --dpi",
            width, height, kPngSideMax, kPngPixelsMax / 1e6));
    }
    const Surface image(cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(width),
                                                   static_cast<int>(height)));
    const Context on = context_mm(image, dpi / kMmPerInch);
    cairo_set_source_rgb(on.get(), 1, 1, 1);
    cairo_paint(on.get());
    draw_grid(on.get(), target, sheet);
    draw_caption(on.get(), target, sheet);
    const rig::Status drawn = finished(image, on, "PNG");
    if (!drawn.ok()) {
        return drawn;
    }
    const std::string bytes = grey_png(cairo_image_surface_get_data(image.get()),
                                       static_cast<unsigned>(width), static_cast<unsigned>(height),
                                       cairo_image_surface_get_stride(image.get()), dpi);
    if (bytes.empty()) {
        return rig::Status::failure("the PNG cannot be made: libpng gives up, out of memory?");
    }
    return bytes;
}

}  // namespace target_maker
