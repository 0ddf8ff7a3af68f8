/* The patterns are those of the fuzz target of frames and some of this file's own: patches too many, ellipses too
 * many, edges that nothing explains. */
#include "tests/cost/hard_frames.h"

#include "tests/fuzz/fuzz_frame.c"

enum kind { PATCHES, PATTERN, ANCHORS, BLOBS, DOTS };

/* Bits of `with`. */
enum { NO_TARGET = 1, OTHER_TARGET = 2, WORDS = 4, SALTED = 8, KERNEL_2 = 16, KERNEL_5 = 32, LEVELS_3 = 64,
       WEAK_EDGES = 128 };

enum { NORMAL, NORMAL_KERNEL_2, NORMAL_KERNEL_5, NORMAL_LEVELS_3, NORMAL_LEVELS_3_KERNEL_2 };

static const struct hard_frame {
    const char *name;
    enum kind   kind;
    double      side;      /* PATCHES: px; BLOBS: blur, px; DOTS: radius, px */
    double      apart;     /* DOTS: px from one to the next                  */
    unsigned    pattern;   /* PATTERN: fuzz_frame_kind; ANCHORS: which       */
    uint8_t     parameter; /* of the pattern                                 */
    unsigned    with;
} frames[] = {
    [NORMAL] = {"full target, 130 px patches", PATCHES, 130, 0, 0, 0, 0},
    [NORMAL_KERNEL_2] = {"the same, filter 5x5", PATCHES, 130, 0, 0, 0, KERNEL_2},
    [NORMAL_KERNEL_5] = {"the same, filter 11x11", PATCHES, 130, 0, 0, 0, KERNEL_5},
    [NORMAL_LEVELS_3] = {"the same, level 3", PATCHES, 130, 0, 0, 0, LEVELS_3},
    [NORMAL_LEVELS_3_KERNEL_2] = {"the same, level 3, filter 5x5", PATCHES, 130, 0, 0, 0, LEVELS_3 | KERNEL_2},
    {"full target, 64 px patches", PATCHES, 64, 0, 0, 0, 0},
    {"full target, 130 px, words beside", PATCHES, 130, 0, 0, 0, WORDS},
    {"full target, 130 px, salted", PATCHES, 130, 0, 0, 0, SALTED},
    {"full target, 130 px, no file", PATCHES, 130, 0, 0, 0, NO_TARGET},
    {"full target, 64 px, no file", PATCHES, 64, 0, 0, 0, NO_TARGET},
    {"full target, 64 px, another's file", PATCHES, 64, 0, 0, 0, OTHER_TARGET},
    {"full target, 64 px, salted", PATCHES, 64, 0, 0, 0, SALTED},
    {"boards of 40 px patches", PATCHES, 40, 0, 0, 0, 0},
    {"boards of 30 px patches", PATCHES, 30, 0, 0, 0, KERNEL_2},
    {"level 3, 80 px patches", PATCHES, 80, 0, 0, 0, LEVELS_3 | KERNEL_2},
    {"noise", PATTERN, 0, 0, FUZZ_FRAME_NOISE, 0, 0},
    {"noise, weakest edges", PATTERN, 0, 0, FUZZ_FRAME_NOISE, 0, WEAK_EDGES | KERNEL_2},
    {"salt", PATTERN, 0, 0, FUZZ_FRAME_SALT, 0, 0},
    {"sparse salt", PATTERN, 0, 0, FUZZ_FRAME_SALT, 8, 0},
    {"sparser salt", PATTERN, 0, 0, FUZZ_FRAME_SALT, 28, KERNEL_2},
    {"checks of 1 px", PATTERN, 0, 0, FUZZ_FRAME_CHECKER, 0, 0},
    {"checks of 2 px", PATTERN, 0, 0, FUZZ_FRAME_CHECKER, 1, 0},
    {"checks of 3 px", PATTERN, 0, 0, FUZZ_FRAME_CHECKER, 2, 0},
    {"checks of 4 px", PATTERN, 0, 0, FUZZ_FRAME_CHECKER, 3, 0},
    {"columns of 2 px", PATTERN, 0, 0, FUZZ_FRAME_STRIPES, 33, 0},
    {"rows of 2 px", PATTERN, 0, 0, FUZZ_FRAME_STRIPES, 65, 0},
    {"slanting stripes", PATTERN, 0, 0, FUZZ_FRAME_STRIPES, 2, 0},
    {"discs, 5 px apart", PATTERN, 0, 0, FUZZ_FRAME_CIRCLES, 3, 0},
    {"discs, 7 px apart", PATTERN, 0, 0, FUZZ_FRAME_CIRCLES, 5, 0},
    {"rings, 8 px apart", PATTERN, 0, 0, FUZZ_FRAME_CIRCLES, 70, 0},
    {"rings, 10 px apart", PATTERN, 0, 0, FUZZ_FRAME_CIRCLES, 73, 0},
    {"rings, 24 px apart", PATTERN, 0, 0, FUZZ_FRAME_CIRCLES, 92, 0},
    {"dots of 2 px in a checkerboard", DOTS, 1, 4, 0, 0, KERNEL_2},
    {"dots of 3 px", DOTS, 1.5, 4.5, 0, 0, KERNEL_2},
    {"dots of 4 px", DOTS, 2, 5.5, 0, 0, 0},
    {"dots of 8 px", DOTS, 4, 11, 0, 0, 0},
    {"text", PATTERN, 0, 0, FUZZ_FRAME_TEXT, 0, 0},
    {"triangles of 5 px", PATTERN, 0, 0, FUZZ_FRAME_TRIANGLES, 1, KERNEL_2},
    {"triangles of 8 px", PATTERN, 0, 0, FUZZ_FRAME_TRIANGLES, 4 + 64, 0},
    {"triangles of 12 px, both ways", PATTERN, 0, 0, FUZZ_FRAME_TRIANGLES, 8 + 32 + 64, 0},
    {"ellipses within ellipses, 6 px", PATTERN, 0, 0, FUZZ_FRAME_RINGS, 64 + 4, 0},
    {"ellipses within ellipses, 4 px", PATTERN, 0, 0, FUZZ_FRAME_RINGS, 64 + 8 + 16, KERNEL_2},
    {"nests of ellipses, 40 px apart", PATTERN, 0, 0, FUZZ_FRAME_RINGS, 16 + 6, 0},
    {"nests of ellipses, 70 px apart", PATTERN, 0, 0, FUZZ_FRAME_RINGS, 32 + 12, KERNEL_2},
    {"blobs, blur 1 px", BLOBS, 1, 0, 0, 0, KERNEL_2},
    {"blobs, blur 1.5 px", BLOBS, 1.5, 0, 0, 0, 0},
    {"blobs, blur 2.5 px", BLOBS, 2.5, 0, 0, 0, 0},
    {"blobs, blur 4 px", BLOBS, 4, 0, 0, 0, KERNEL_5},
    {"false anchors, 15 x 31 px", ANCHORS, 0, 0, 0, 0, KERNEL_2},
    {"false anchors, 36 x 15 px", ANCHORS, 0, 0, 1, 0, LEVELS_3 | NO_TARGET},
    {"false anchors, 39 x 18 px", ANCHORS, 0, 0, 2, 0, KERNEL_2},
    {"false anchors, 37 x 34 px", ANCHORS, 0, 0, 3, 0, 0},
};

static struct target target;

const char *hard_frames_name(unsigned index)
{
    return index < sizeof frames / sizeof frames[0] ? frames[index].name : NULL;
}

/* ---- A target over the whole frame, each patch with an id of its own while there are any ---- */

static void prepare_target(unsigned rows, unsigned cols, unsigned levels, unsigned first)
{
    memset(&target, 0, sizeof target);
    target.rows = (uint16_t)rows;
    target.cols = (uint16_t)cols;
    target.levels = (uint8_t)levels;
    target.circle_ratio_q16 = 32768;
    target.edge_level_q16 = 52429;
    target.gauss_sigma_q16 = 26214;
    target.patch_nm = 100000000;
    for (unsigned i = 0; i < rows * cols; i++) {
        target.ids[i] = (uint16_t)((first + 51 * i) % 4096);
    }
    unsigned bad;
    require(target_prepare(&target, &bad) == TARGET_OK);
}

/* Across each row, then down each column; beyond the border is as at it. */
static void blur(float *at, unsigned width, unsigned height, double sigma)
{
    const int radius = (int)ceil(3 * sigma);
    const size_t count = (size_t)width * height;
    double weights[32];
    double sum_of_weights = 0;
    require(radius < 16);
    for (int k = -radius; k <= radius; k++) {
        weights[radius + k] = exp(-0.5 * k * k / (sigma * sigma));
        sum_of_weights += weights[radius + k];
    }
    float *from = malloc(count * sizeof *from);
    require(from != NULL);
    for (unsigned pass = 0; pass < 2; pass++) {
        memcpy(from, at, count * sizeof *from);
        const long step = pass == 0 ? 1 : (long)width;
        const long last = (pass == 0 ? (long)width : (long)height) - 1;
        for (size_t i = 0; i < count; i++) {
            const long place = pass == 0 ? (long)(i % width) : (long)(i / width);
            double sum = 0;
            for (int k = -radius; k <= radius; k++) {
                const long to = place + k < 0 ? 0 : place + k > last ? last : place + k;
                sum += weights[radius + k] * (double)from[(long)i + (to - place) * step];
            }
            at[i] = (float)(sum / sum_of_weights);
        }
    }
    free(from);
}

/* One patch, four points a pixel: a blur follows. */
static void draw_patch(float *grey, unsigned width, unsigned height, const struct hard_frame *frame,
                       unsigned col, unsigned row)
{
    const double side = frame->side;
    const uint16_t id = target.ids[row * target.cols + col];
    const unsigned x1 = (unsigned)fmin(width, ceil((col + 1) * side));
    const unsigned y1 = (unsigned)fmin(height, ceil((row + 1) * side));
    for (unsigned y = (unsigned)ceil(row * side); y < y1; y++) {
        for (unsigned x = (unsigned)ceil(col * side); x < x1; x++) {
            double sum = 0;
            for (unsigned k = 0; k < 4; k++) {
                const double u = (x + (k % 2) / 2.0) / side - col;
                const double v = (y + (k / 2) / 2.0) / side - row;
                sum += reflectance(target.levels, id, fmin(u, 0.999), fmin(v, 0.999));
            }
            grey[y * width + x] = (float)(30 + 190 * sum / 4);
        }
    }
}

static void draw_patches(struct picture *p, const struct hard_frame *frame, struct content *content)
{
    const size_t count = (size_t)p->width * p->height;
    float *grey = malloc(count * sizeof *grey);
    require(grey != NULL);
    for (unsigned row = 0; row < target.rows; row++) {
        for (unsigned col = 0; col < target.cols; col++) {
            draw_patch(grey, p->width, p->height, frame, col, row);
        }
    }
    blur(grey, p->width, p->height, 0.8);
    for (size_t i = 0; i < count; i++) { /* and a camera's noise: 1.4 grey levels */
        p->grey[i] = (uint8_t)(lrintf(grey[i]) + (int)(next_random(content) % 5) - 2);
    }
    free(grey);
    if (frame->with & WORDS) { /* in a corner, what no target explains */
        for (unsigned y = 0; y < 24; y++) {
            for (unsigned x = 0; x < 200; x++) {
                p->grey[y * p->width + x] = pattern(FUZZ_FRAME_TEXT, content, x, y, 0);
            }
        }
    }
    for (size_t i = 0; frame->with & SALTED && i < count; i++) {
        if (next_random(content) % 400 == 0) {
            p->grey[i] = (uint8_t)(255 - p->grey[i]);
        }
    }
}

/* ---- Ellipses ---- */

static void darken(struct picture *p, double x0, double y0, double major, double minor)
{
    for (int y = (int)(y0 - major - 2); y <= y0 + major + 2; y++) {
        for (int x = (int)(x0 - major - 2); x <= x0 + major + 2; x++) {
            if (x < 0 || y < 0 || x >= (int)p->width || y >= (int)p->height) {
                continue;
            }
            const double in = fmin(1, (1 - hypot((x - x0) / major, (y - y0) / minor)) * minor + 0.5);
            uint8_t *at = &p->grey[(unsigned)y * p->width + (unsigned)x];
            *at = in > 0 && 200 - 180 * in < *at ? (uint8_t)(200 - 180 * in) : *at;
        }
    }
}

/* Long ellipses that pass for anchors among dots that pass for their patches' circles: every anchor looks far, at
 * many, in vain. The worst of some hundred such frames drawn at random. */
static void draw_anchors(struct picture *p, unsigned which)
{
    static const struct {
        double dots, dot, major, minor, across, down;
    } shapes[] = {{5.6, 1.6, 5.2, 2.7, 14.7, 30.9},
                  {5.5, 1.9, 9.7, 3.6, 36.3, 14.6},
                  {6.6, 2.8, 10.3, 4.6, 39.0, 18.2},
                  {7.2, 2.6, 11.2, 3.3, 36.7, 33.9}};
    memset(p->grey, 200, (size_t)p->width * p->height);
    for (double y = shapes[which].dots / 2; y < p->height; y += shapes[which].dots) {
        for (double x = shapes[which].dots / 2; x < p->width; x += shapes[which].dots) {
            const double dx = fmod(x, shapes[which].across) - shapes[which].across / 2;
            const double dy = fmod(y, shapes[which].down) - shapes[which].down / 2;
            if (hypot(dx / shapes[which].major, dy / shapes[which].minor) > 1.6) {
                darken(p, x, y, shapes[which].dot, shapes[which].dot);
            }
        }
    }
    for (double y = shapes[which].down / 2; y < p->height; y += shapes[which].down) {
        for (double x = shapes[which].across / 2; x < p->width; x += shapes[which].across) {
            darken(p, x, y, shapes[which].major, shapes[which].minor);
        }
    }
}

/* Every second place of a square grid. */
static void draw_dots(struct picture *p, double radius, double apart)
{
    memset(p->grey, 200, (size_t)p->width * p->height);
    unsigned row = 0;
    for (double y = apart / 2; y < p->height; y += apart / 2, row++) {
        for (double x = row % 2 ? apart : apart / 2; x < p->width; x += apart) {
            darken(p, x, y, radius, radius);
        }
    }
}

/* Noise, blurred and cut above its middle: round shapes of all sizes, each an outline of its own. */
static void draw_blobs(struct picture *p, double sigma, struct content *content)
{
    const size_t count = (size_t)p->width * p->height;
    float *grey = malloc(count * sizeof *grey);
    require(grey != NULL);
    for (size_t i = 0; i < count; i++) {
        grey[i] = (float)(next_random(content) % 1000) - 499.5f;
    }
    blur(grey, p->width, p->height, sigma);
    /* What is left of 289 is 289 / (2 sqrt(pi) sigma). */
    const double level = 289 / (3.545 * sigma) * 0.8;
    for (size_t i = 0; i < count; i++) {
        p->grey[i] = (uint8_t)(128 + 100 * tanh(((double)grey[i] - level) / (0.3 * level)));
    }
    free(grey);
}

void hard_frames_set(unsigned index, unsigned width_px, unsigned height_px,
                     struct pipeline_settings *settings)
{
    const struct hard_frame *frame = &frames[index];
    const double side = frame->kind == PATCHES ? frame->side : 130;
    const unsigned first = frame->with & OTHER_TARGET ? 12 : 11;
    prepare_target((unsigned)ceil(height_px / side), (unsigned)ceil(width_px / side),
                   frame->with & LEVELS_3 ? 3 : 2, first);
    *settings = pipeline_defaults();
    settings->kernel_radius_px = frame->with & KERNEL_2 ? 2 : frame->with & KERNEL_5 ? 5 : 3;
    settings->gradient_min_q3 = frame->with & WEAK_EDGES ? 64 : settings->gradient_min_q3;
    settings->patches.levels = target.levels;
    settings->patches.target = frame->with & NO_TARGET ? NULL : &target;
}

void hard_frames_draw(unsigned index, unsigned width_px, unsigned height_px, uint8_t *grey)
{
    const struct hard_frame *frame = &frames[index];
    struct picture picture = {width_px, height_px, grey};
    struct content content = {NULL, 0, 9, frame->parameter};
    switch (frame->kind) {
    case PATCHES:
        prepare_target((unsigned)ceil(height_px / frame->side), (unsigned)ceil(width_px / frame->side),
                       frame->with & LEVELS_3 ? 3 : 2, 11);
        draw_patches(&picture, frame, &content);
        break;
    case PATTERN:
        draw(&picture, frame->pattern, 2, &content);
        break;
    case ANCHORS:
        draw_anchors(&picture, frame->pattern);
        break;
    case BLOBS:
        draw_blobs(&picture, frame->side, &content);
        break;
    case DOTS:
        draw_dots(&picture, frame->side, frame->apart);
        break;
    }
}

unsigned hard_frames_normal(unsigned index)
{
    const unsigned with = frames[index].with;
    return with & LEVELS_3 ? with & KERNEL_2 ? NORMAL_LEVELS_3_KERNEL_2 : NORMAL_LEVELS_3
           : with & KERNEL_2 ? NORMAL_KERNEL_2
           : with & KERNEL_5 ? NORMAL_KERNEL_5
                             : NORMAL;
}
