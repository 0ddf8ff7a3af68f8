/* Any bytes as a frame and its settings: the detector must neither read beyond the frame nor compute what C
 * leaves undefined, and its packet must be one that a host takes.
 *
 * `make fuzz` leads it by coverage where clang is installed, and runs it over made-up cases elsewhere;
 * tests/unit/test_fuzz_frame.c runs it over some of these and over cases that once broke something.
 *
 * The bytes: FUZZ_FRAME_HEAD of settings (fuzz_frame_head below), then the content. */
#include "tests/fuzz/fuzz_frame.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "firmware/app/dsp_choice.h"
#include "firmware/app/pipeline.h"

#define SHEET_PATCHES 4
#define SHEET_PATCH_PX 64
#define SHEET_PX (SHEET_PATCHES * SHEET_PATCH_PX)

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t count);

static void require(bool holds)
{
    if (!holds) {
        abort();
    }
}

struct content {
    const uint8_t *bytes;
    size_t         count;
    uint64_t       random; /* what the bytes do not say */
    uint8_t        parameter;
};

static unsigned next_random(struct content *content)
{
    uint64_t z = (content->random += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (unsigned)((z ^ (z >> 31)) & 0x7fffffff);
}

/* ---- A sheet of target patches, drawn once for each number of levels ---- */

static uint8_t sheets[2][SHEET_PX * SHEET_PX];

static uint16_t sheet_id(unsigned place)
{
    return (uint16_t)(37 + 251 * place);
}

static bool in_triangle(const struct layout_feature *f, double u, double v)
{
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3;
        const double along_u = (f->corner_u_8th[j] - f->corner_u_8th[i]) / 8.0;
        const double along_v = (f->corner_v_8th[j] - f->corner_v_8th[i]) / 8.0;
        if (along_u * (v - f->corner_v_8th[i] / 8.0) - along_v * (u - f->corner_u_8th[i] / 8.0) < 0) {
            return false;
        }
    }
    return true;
}

static double reflectance(unsigned levels, uint16_t id, double u, double v)
{
    for (unsigned i = 0; i < layout_feature_count(levels); i++) {
        const struct layout_feature *f = layout_feature(levels, i);
        if (in_triangle(f, u, v)) {
            const double rho = hypot(u - ldexp(f->u_q30, -30), v - ldexp(f->v_q30, -30)) /
                               (0.5 * ldexp(f->inradius_q30, -30));
            const double level = rho < 1 ? 0.8 + 0.2 * exp(-rho * rho / 0.32) : 0;
            return layout_circle_is_white(levels, id, i) ? level : 1 - level;
        }
    }
    return 1;
}

/* Three by three points over one and a half pixels: a little blur with it. */
static void draw_sheet(unsigned levels, uint8_t *sheet)
{
    for (int y = 0; y < SHEET_PX; y++) {
        for (int x = 0; x < SHEET_PX; x++) {
            double sum = 0;
            for (int k = 0; k < 9; k++) {
                const double u = (x + 0.5 + (k % 3 - 1) * 0.5) / SHEET_PATCH_PX;
                const double v = (y + 0.5 + (k / 3 - 1) * 0.5) / SHEET_PATCH_PX;
                const int col = (int)fmin(u, SHEET_PATCHES - 1);
                const int row = (int)fmin(v, SHEET_PATCHES - 1);
                sum += reflectance(levels, sheet_id((unsigned)(row * SHEET_PATCHES + col)), u - col,
                                   v - row);
            }
            sheet[y * SHEET_PX + x] = (uint8_t)(30 + 190 * sum / 9);
        }
    }
}

static double sheet_at(const uint8_t *sheet, double x, double y)
{
    if (!(x >= 0 && y >= 0 && x < SHEET_PX - 1 && y < SHEET_PX - 1)) {
        return 220;
    }
    const uint8_t *at = sheet + (int)y * SHEET_PX + (int)x;
    const double fx = x - floor(x);
    const double fy = y - floor(y);
    return (at[0] * (1 - fx) + at[1] * fx) * (1 - fy) +
           (at[SHEET_PX] * (1 - fx) + at[SHEET_PX + 1] * fx) * fy;
}

/* ---- Pictures, in grey levels of 256 ---- */

struct picture {
    unsigned width;
    unsigned height;
    uint8_t *grey;
};

/* Covers, bends and breaks what is there. */
static void mutate(struct picture *p, struct content *content)
{
    for (unsigned left = next_random(content) % 6; left > 0; left--) {
        const unsigned kind = next_random(content) % 5;
        const unsigned x0 = next_random(content) % p->width;
        const unsigned y0 = next_random(content) % p->height;
        const unsigned x1 = x0 + next_random(content) % (p->width - x0) + 1;
        const unsigned y1 = y0 + next_random(content) % (p->height - y0) + 1;
        const uint8_t value = (uint8_t)(next_random(content) % 5 * 255 / 4);
        for (unsigned y = y0; y < y1; y++) {
            for (unsigned x = x0; x < x1; x++) {
                uint8_t *at = &p->grey[y * p->width + x];
                switch (kind) {
                case 0: /* cover */
                    *at = value;
                    break;
                case 1: /* negative */
                    *at = (uint8_t)(255 - *at);
                    break;
                case 2: /* hard threshold */
                    *at = *at > value ? 255 : 0;
                    break;
                case 3: /* noise */
                    *at = (uint8_t)(*at + next_random(content) % (1u + value / 4u));
                    break;
                default: /* low contrast */
                    *at = (uint8_t)(120 + *at / 32);
                    break;
                }
            }
        }
    }
}

/* The sheet under a map of perspective, from 12 to 190 px a patch and now and then absurdly tilted. */
static void draw_target(struct picture *p, unsigned levels, struct content *content)
{
    uint8_t *sheet = sheets[levels - 2];
    if (sheet[0] == 0) {
        draw_sheet(levels, sheet);
    }
    const double turn = next_random(content) % 6283 / 1000.0;
    const double scale = exp2(next_random(content) % 4000 / 1000.0 - 1.6);
    const double squeeze = 1 + (next_random(content) % 4 == 0 ? next_random(content) % 900 / 100.0
                                                              : next_random(content) % 100 / 100.0);
    const double lean = (int)(next_random(content) % 2001 - 1000) * 1e-6;
    const double cx = SHEET_PX / 2.0 + (int)(next_random(content) % 101) - 50;
    const double cy = SHEET_PX / 2.0 + (int)(next_random(content) % 101) - 50;
    for (unsigned y = 0; y < p->height; y++) {
        for (unsigned x = 0; x < p->width; x++) {
            const double dx = x - p->width / 2.0;
            const double dy = y - p->height / 2.0;
            const double w = fmax(0.05, 1 + lean * dx);
            const double u = (cos(turn) * dx - sin(turn) * dy) * scale / w;
            const double v = (sin(turn) * dx + cos(turn) * dy) * scale * squeeze / w;
            p->grey[y * p->width + x] = (uint8_t)sheet_at(sheet, cx + u, cy + v);
        }
    }
    mutate(p, content);
}

/* Circles in a grid of every period, in rings and discs, aligned to the pixels or not. */
static uint8_t grid_of_circles(const struct content *content, unsigned x, unsigned y)
{
    const double period = 3 + content->parameter % 32 * 0.77;
    const double dx = fmod(x, period) - period / 2;
    const double dy = fmod(y, period) - period / 2;
    const double r = hypot(dx, dy);
    return content->parameter & 64 ? (uint8_t)(128 + 127 * cos(r * 2.5))
                                   : (uint8_t)(255 * fmin(1, fmax(0, period * 0.35 - r + 0.5)));
}

/* Ellipses within ellipses, a few pixels from one to the next; by the parameter one nest or a grid of them. */
static uint8_t nested_ellipses(const struct content *content, unsigned x, unsigned y)
{
    const double across = content->parameter & 64 ? 4000 : 24 + content->parameter % 64;
    const double squeeze = 1 + (content->parameter >> 4) % 4 * 0.5;
    const double dx = fmod(x, across) - fmin(across, 300) / 2;
    const double dy = fmod(y, across) - fmin(across, 300) / 2;
    return (uint8_t)(128 + 127 * sin(hypot(dx, squeeze * dy) * (0.5 + content->parameter % 16 * 0.15)));
}

/* Right triangles side by side, both ways up: four to sixteen pixels. */
static uint8_t triangles(const struct content *content, unsigned x, unsigned y)
{
    const unsigned side = 4 + content->parameter % 13;
    const unsigned gap = content->parameter >> 6;
    const unsigned u = x % side;
    const unsigned v = y % side;
    return u < gap || v < gap ? 230 : (u + v < side) != (content->parameter & 32 && x / side % 2) ? 20 : 230;
}

static uint8_t pattern(unsigned kind, struct content *content, unsigned x, unsigned y, size_t index)
{
    const unsigned period = 1 + content->parameter % 16;
    switch (kind) {
    case FUZZ_FRAME_BYTES:
        return content->count > 0 ? content->bytes[index % content->count] : 0;
    case FUZZ_FRAME_CONSTANT:
        return content->parameter;
    case FUZZ_FRAME_NOISE:
        return (uint8_t)next_random(content);
    case FUZZ_FRAME_SALT: /* saturated pixels */
        return next_random(content) % (2u + content->parameter) == 0 ? 255 : 0;
    case FUZZ_FRAME_CHECKER:
        return (x / period + y / period) % 2 ? 255 : 0;
    case FUZZ_FRAME_STRIPES:
        return (content->parameter & 32 ? x : content->parameter & 64 ? y : x + y) / period % 2 ? 255 : 0;
    case FUZZ_FRAME_GRADIENT:
        return (uint8_t)((x * content->parameter + y * (255u - content->parameter)) / 64);
    case FUZZ_FRAME_TEXT: /* strokes in lines */
        return y % 12 < 8 && (next_random(content) % 3 == 0 || (x / 3 * 7 + y / 12) % 5 == 0) ? 20 : 230;
    case FUZZ_FRAME_RINGS:
        return nested_ellipses(content, x, y);
    case FUZZ_FRAME_TRIANGLES:
        return triangles(content, x, y);
    default:
        return grid_of_circles(content, x, y);
    }
}

static void draw(struct picture *p, unsigned kind, unsigned levels, struct content *content)
{
    if (kind == FUZZ_FRAME_TARGET) {
        draw_target(p, levels, content);
        /* Bytes of the input change single pixels, so that a fuzzer can lead. */
        for (size_t i = 0; i + 2 < content->count; i += 3) {
            const size_t at = (size_t)content->bytes[i] << 8 | content->bytes[i + 1];
            p->grey[at % ((size_t)p->width * p->height)] = content->bytes[i + 2];
        }
        return;
    }
    for (unsigned y = 0; y < p->height; y++) {
        for (unsigned x = 0; x < p->width; x++) {
            const size_t index = (size_t)y * p->width + x;
            p->grey[index] = pattern(kind, content, x, y, index);
        }
    }
    if (kind != FUZZ_FRAME_BYTES && content->parameter & 128) {
        mutate(p, content);
    }
}

/* ---- Running ---- */

/* Just as many bytes as the format promises, so that the sanitizers see any read beyond. */
static uint8_t *pack(const struct picture *p, struct frame_view *view, struct content *content)
{
    const size_t row = frame_row_bytes(view->format, view->width_px);
    const size_t size = (size_t)view->stride_bytes * (p->height - 1u) + row;
    uint8_t *bytes = malloc(size);
    require(bytes != NULL);
    memset(bytes, 0xa5, size);
    for (unsigned y = 0; y < p->height; y++) {
        uint8_t *to = bytes + (size_t)y * view->stride_bytes;
        for (unsigned x = 0; x < p->width; x++) {
            const unsigned grey = p->grey[y * p->width + x];
            /* Low bits, and for a quarter of the frames the forbidden high ones. */
            const unsigned junk = content->parameter % 4 == 3 ? next_random(content) : 0;
            switch (view->format) {
            case FRAME_GREY8:
            case FRAME_NV12:
                to[x] = (uint8_t)grey;
                break;
            case FRAME_YUYV:
                to[2 * x] = (uint8_t)grey;
                break;
            case FRAME_UYVY:
                to[2 * x + 1] = (uint8_t)grey;
                break;
            case FRAME_GREY10:
            case FRAME_GREY12:
            case FRAME_GREY16: {
                const unsigned bits = view->format == FRAME_GREY10   ? 2
                                      : view->format == FRAME_GREY12 ? 4
                                                                     : 8;
                const unsigned sample = grey << bits | junk % 65536u;
                to[2 * x] = (uint8_t)sample;
                to[2 * x + 1] = (uint8_t)(sample >> 8);
                break;
            }
            }
        }
    }
    view->pixels = bytes;
    return bytes;
}

static void make_target(struct target *target, const struct patches_settings *settings, bool drawn_ids)
{
    memset(target, 0, sizeof *target);
    target->rows = SHEET_PATCHES;
    target->cols = SHEET_PATCHES;
    target->levels = settings->levels;
    target->circle_ratio_q16 = settings->circle_ratio_q16;
    target->edge_level_q16 = settings->edge_level_q16;
    target->gauss_sigma_q16 = settings->gauss_sigma_q16;
    target->patch_nm = 100000000;
    for (unsigned i = 0; i < SHEET_PATCHES * SHEET_PATCHES; i++) {
        /* Other ids: half of the target fits what is drawn, so that predictions are wrong. */
        target->ids[i] = drawn_ids || i % 2 == 0 ? sheet_id(i) : (uint16_t)(4000 + i);
        target->turns[i] = drawn_ids ? 0 : i % 3 == 0;
    }
    unsigned bad;
    require(target_prepare(target, &bad) == TARGET_OK);
}

/* What every packet must keep, whatever was seen. */
static void check_packet(struct pipeline *pipeline, const struct target *target)
{
    const struct wire_header about = {.camera_serial = "fuzz"};
    const struct packet *packet = pipeline_packet(pipeline, &about);
    struct wire_packet_view view;
    require(packet != NULL);
    require(wire_decode(packet->bytes, packet->used, &view) == WIRE_OK);
    require(view.header.truncated == pipeline_truncated(pipeline));
    struct wire_patch_cursor cursor = wire_patches(&view);
    while (wire_next_patch(&cursor)) {
        uint16_t row;
        uint16_t col;
        uint8_t turn;
        require(target == NULL || target_find(target, cursor.patch_id, &row, &col, &turn));
    }
    for (uint32_t i = 0; i < pipeline->patches.count; i++) {
        const struct patch *patch = &pipeline->patches.at[i];
        unsigned features = 0;
        for (unsigned k = 0; k < LAYOUT_FEATURES_MAX; k++) {
            require(patch->marks[k] == MARKS_NONE || patch->marks[k] < pipeline->marks.count);
            features += patch->marks[k] != MARKS_NONE;
        }
        require(features == patch->feature_count);
    }
}

/* What the last frame gave, for those who ask whether cases are any good. */
static struct fuzz_frame_seen {
    uint32_t patches;
    uint32_t added;
} fuzz_frame_seen;

/* Returns 64 bits that name the packet (FNV-1a). */
static uint64_t run_frame(const struct frame_view *frame, const struct pipeline_settings *settings)
{
    static struct pipeline pipeline;
    const size_t size = pipeline_bytes(frame->width_px, frame->height_px);
    void *memory = malloc(size);
    require(memory != NULL);
    memset(memory, 0x5a, size);
    memset(&pipeline, 0x5a, sizeof pipeline);
    pipeline_init(&pipeline, memory, size, frame->width_px, frame->height_px, settings);
    pipeline_run(&pipeline, frame);
    check_packet(&pipeline, settings->patches.target);
    fuzz_frame_seen = (struct fuzz_frame_seen){pipeline.patches.count, pipeline.lattice.added};
    uint64_t digest = 0xcbf29ce484222325u;
    for (size_t i = 0; i < pipeline.packet.used; i++) {
        digest = (digest ^ pipeline.packet.bytes[i]) * 0x100000001b3u;
    }
    free(memory);
    return digest;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t count)
{
    static struct target target;
    if (count < FUZZ_FRAME_HEAD) {
        return 0;
    }
    const struct fuzz_frame_head head = fuzz_frame_read_head(data);
    struct content content = {data + FUZZ_FRAME_HEAD, count - FUZZ_FRAME_HEAD, head.random,
                              head.parameter};
    struct pipeline_settings settings = pipeline_defaults();
    settings.kernel_radius_px = head.kernel_radius_px;
    settings.gradient_min_q3 = head.gradient_min_q3;
    settings.patches.levels = head.levels;
    if (head.odd_target) { /* anywhere in the range that target_prepare lets pass */
        settings.patches.circle_ratio_q16 = 1 + next_random(&content) % (65536u >> head.parameter % 17);
        settings.patches.edge_level_q16 = 1 + next_random(&content) % (65536u >> head.parameter / 16);
        settings.patches.gauss_sigma_q16 = 1 + (next_random(&content) >> head.parameter % 31);
    }
    if (head.with_target) {
        make_target(&target, &settings.patches, head.drawn_ids);
        settings.patches.target = &target;
    }
    struct picture picture = {head.width_px, head.height_px,
                              malloc((size_t)head.width_px * head.height_px)};
    require(picture.grey != NULL);
    draw(&picture, head.kind, head.levels, &content);
    struct frame_view frame = {
        .stride_bytes = frame_row_bytes(head.format, head.width_px) + head.extra_bytes,
        .width_px = head.width_px,
        .height_px = head.height_px,
        .format = head.format,
    };
    uint8_t *bytes = pack(&picture, &frame, &content);
    const uint64_t digest = run_frame(&frame, &settings);
    /* Every variant of the row kernels gives the same bits; for some frames, for it takes its time. */
    for (unsigned i = 0; head.random % 4 == 0 && dsp_choice_at(i) != NULL; i++) {
        settings.dsp = dsp_choice_at(i);
        require(run_frame(&frame, &settings) == digest);
    }
    free(bytes);
    free(picture.grey);
    return 0;
}
