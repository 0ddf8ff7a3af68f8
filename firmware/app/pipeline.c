/* Calls the stages in order. */
#include "firmware/app/pipeline.h"

#include "firmware/detect/areafit.h"
#include "firmware/limits.h"

/* Frames smaller than this are seen in full at once. */
#define HALVED_MIN_PX 128u
/* Half the size is gone on with where it names the patches of so much of what has edges: one in so many. */
#define HALVED_SHARE  4u

static_assert(AREAFIT_POINTS_MAX >= LIMIT_CONTOUR_POINTS, "the fit takes whole contours");

struct pipeline_settings pipeline_defaults(void)
{
    return (struct pipeline_settings){
        .kernel_radius_px = 3,
        .gradient_min_q3 = 320, /* 2.5 grey levels a pixel: three times the noise of a bad camera */
        .patches = {.levels = 2, .circle_ratio_q16 = 32768, .edge_level_q16 = 52429,
                    .gauss_sigma_q16 = 26214, .target = NULL},
        .dsp = &dsp_scalar,
    };
}

uint64_t pipeline_settings_digest(const struct pipeline_settings *settings)
{
    const uint32_t values[] = {settings->kernel_radius_px, settings->gradient_min_q3,
                               settings->patches.levels, settings->patches.circle_ratio_q16,
                               settings->patches.edge_level_q16, settings->patches.gauss_sigma_q16};
    uint64_t digest = 0xcbf29ce484222325u;
    for (unsigned i = 0; i < sizeof values / sizeof values[0]; i++) {
        for (unsigned byte = 0; byte < 4; byte++) {
            digest = (digest ^ (values[i] >> (8 * byte) & 0xffu)) * 0x100000001b3u;
        }
    }
    return digest;
}

static void deal_memory(struct pipeline *pipeline, struct arena *arena, uint16_t width_px,
                        uint16_t height_px, const struct pipeline_settings *settings)
{
    steer_init(&pipeline->steer, arena, settings->dsp, settings->kernel_radius_px,
               settings->gradient_min_q3, width_px, height_px);
    if (width_px >= 2 && height_px >= 2) {
        steer_halve(&pipeline->steer, &pipeline->half);
    }
    edges_init(&pipeline->edges, arena, width_px);
    chains_init(&pipeline->chains, arena, width_px, height_px);
    pipeline->contour.x_px_q16 = arena_take(arena, LIMIT_CONTOUR_POINTS, sizeof(int32_t));
    pipeline->contour.y_px_q16 = arena_take(arena, LIMIT_CONTOUR_POINTS, sizeof(int32_t));
    ellipses_init(&pipeline->ellipses, arena, width_px, height_px);
    marks_init(&pipeline->marks, arena, width_px, height_px);
    patches_init(&pipeline->patches, arena, &settings->patches, width_px, height_px);
    survey_init(&pipeline->survey, arena, width_px, height_px);
    refine_init(&pipeline->refine, arena, settings->dsp, &settings->patches,
                pipeline->steer.taps->sigma_px_q16);
    lattice_init(&pipeline->lattice, arena);
    packet_init(&pipeline->packet, arena, width_px, height_px);
}

size_t pipeline_bytes(uint16_t width_px, uint16_t height_px)
{
    static struct pipeline counted; /* only its sizes are set: too large for a small stack */
    struct arena arena = {0};
    const struct pipeline_settings settings = pipeline_defaults();
    deal_memory(&counted, &arena, width_px, height_px, &settings);
    return arena.used;
}

void pipeline_init(struct pipeline *pipeline, void *memory, size_t bytes, uint16_t width_px,
                   uint16_t height_px, const struct pipeline_settings *settings)
{
    assert(width_px >= 1 && width_px <= LIMIT_SIDE_PX);
    assert(height_px >= 1 && height_px <= LIMIT_SIDE_PX);
    struct arena arena = {.base = memory, .size = bytes};
    pipeline->settings = *settings;
    pipeline->width_px = width_px;
    pipeline->height_px = height_px;
    pipeline->clock = NULL;
    deal_memory(pipeline, &arena, width_px, height_px, settings);
}

/* Books the time since *since on a stage. */
static void book(struct pipeline *pipeline, enum pipeline_stage stage, uint64_t *since)
{
    if (pipeline->clock != NULL) {
        const uint64_t now = pipeline->clock();
        pipeline->spent[stage] += now - *since;
        *since = now;
    }
}

/* Rows to ellipses, in pixels of what `steer` sees: the frame, or the frame at half its size. */
static void scan(struct pipeline *pipeline, struct steer *steer, const struct frame_view *frame,
                 uint64_t *since)
{
    steer_begin(steer);
    quota_begin(&pipeline->quota, steer->width, steer->height);
    chains_begin(&pipeline->chains);
    ellipses_begin(&pipeline->ellipses);
    survey_begin(&pipeline->survey);

    const uint32_t threshold_q6 = steer->threshold_q6;
    const struct dsp_gradient *above = NULL;
    for (uint16_t y = 0; y < steer->height; y++) {
        const struct dsp_gradient *row = steer_row(steer, frame, y);
        book(pipeline, PIPELINE_STEER, since);
        edges_scan_row(above, row, y, steer->width, &pipeline->edges);
        quota_count(&pipeline->quota, &pipeline->edges);
        steer->threshold_q6 = quota_threshold_q6(&pipeline->quota, threshold_q6);
        if (steer->halved) {
            survey_count(&pipeline->survey, &pipeline->edges, y);
        }
        book(pipeline, PIPELINE_EDGES, since);
        chains_link_row(&pipeline->chains, &pipeline->edges, y == 0);
        book(pipeline, PIPELINE_CHAINS, since);
        while (chains_take(&pipeline->chains, ELLIPSES_POINTS_MIN, &pipeline->contour)) {
            ellipses_add(&pipeline->ellipses, &pipeline->contour);
        }
        book(pipeline, PIPELINE_ELLIPSES, since);
        above = row;
    }
    steer->threshold_q6 = threshold_q6;
    chains_end(&pipeline->chains);
    while (chains_take(&pipeline->chains, ELLIPSES_POINTS_MIN, &pipeline->contour)) {
        ellipses_add(&pipeline->ellipses, &pipeline->contour);
    }
    ellipses_end(&pipeline->ellipses);
    if (steer->halved) {
        ellipses_double(&pipeline->ellipses);
    }
    book(pipeline, PIPELINE_ELLIPSES, since);
}

/* Ellipses to named patches. */
static void name(struct pipeline *pipeline, uint64_t *since)
{
    marks_classify(&pipeline->ellipses, patches_size_ratio_q8(pipeline->settings.patches.levels),
                   &pipeline->marks);
    book(pipeline, PIPELINE_MARKS, since);
    patches_decode(&pipeline->marks, &pipeline->patches);
    book(pipeline, PIPELINE_PATCHES, since);
}

/* Named patches to all that can be seen of them, as exactly as can be. */
static void complete(struct pipeline *pipeline, const struct steer *steer,
                     const struct frame_view *frame, uint64_t *since)
{
    refine_set_kernel(&pipeline->refine, steer_sigma_px_q16(steer));
    refine_marks(&pipeline->refine, frame, &pipeline->patches, &pipeline->marks);
    book(pipeline, PIPELINE_REFINE, since);
    lattice_extend(&pipeline->lattice, &pipeline->refine, frame, &pipeline->patches,
                   &pipeline->marks);
    book(pipeline, PIPELINE_LATTICE, since);
}

uint16_t pipeline_truncated(const struct pipeline *pipeline)
{
    unsigned bits = 0;
    bits |= pipeline->quota.reached || pipeline->chains.truncated ? (unsigned)WIRE_TRUNCATED_EDGES : 0u;
    bits |= pipeline->ellipses.arcs.truncated ? (unsigned)WIRE_TRUNCATED_CHAINS : 0u;
    bits |= pipeline->ellipses.truncated ? (unsigned)WIRE_TRUNCATED_ELLIPSES : 0u;
    bits |= pipeline->lattice.truncated ? (unsigned)WIRE_TRUNCATED_MARKS : 0u;
    bits |= pipeline->patches.truncated ? (unsigned)WIRE_TRUNCATED_PATCHES : 0u;
    return (uint16_t)bits;
}

/* Tries with half the frame's size, at a quarter of the cost. False where that leaves something to be
 * explained. Only the target's file tells where circles are that half the size does not show; at three levels
 * too many would have to be told so. */
static bool run_halved(struct pipeline *pipeline, const struct frame_view *frame, uint64_t *since)
{
    if (pipeline->settings.patches.target == NULL || pipeline->settings.patches.levels > 2 ||
        frame->width_px < HALVED_MIN_PX ||
        frame->height_px < HALVED_MIN_PX) {
        return false;
    }
    scan(pipeline, &pipeline->half, frame, since);
    name(pipeline, since);
    const uint32_t cells = survey_left(&pipeline->survey);
    survey_explain(&pipeline->survey, &pipeline->patches, &pipeline->marks);
    if (pipeline_truncated(pipeline) != 0 ||
        HALVED_SHARE * (cells - survey_left(&pipeline->survey)) < cells) {
        return false;
    }
    const uint32_t classified = pipeline->marks.count;
    complete(pipeline, &pipeline->half, frame, since);
    survey_explain(&pipeline->survey, &pipeline->patches, &pipeline->marks);
    return pipeline_truncated(pipeline) == 0 && survey_left(&pipeline->survey) == 0 &&
           !survey_misses_anchors(&pipeline->marks, classified);
}

void pipeline_run(struct pipeline *pipeline, const struct frame_view *frame)
{
    assert(frame->width_px == pipeline->width_px && frame->height_px == pipeline->height_px);
    for (unsigned stage = 0; stage < PIPELINE_STAGES; stage++) {
        pipeline->spent[stage] = 0;
    }
    uint64_t since = pipeline->clock != NULL ? pipeline->clock() : 0;
    pipeline->lattice.truncated = false; /* the last frame's: it is asked before the lattice has run */
    pipeline->seen_in_full = !run_halved(pipeline, frame, &since);
    if (pipeline->seen_in_full) {
        scan(pipeline, &pipeline->steer, frame, &since);
        name(pipeline, &since);
        complete(pipeline, &pipeline->steer, frame, &since);
    }
}

const char *pipeline_stage_name(enum pipeline_stage stage)
{
    static const char *const names[PIPELINE_STAGES] = {"steer", "edges", "chains", "ellipses",
                                                       "marks", "patches", "refine", "lattice"};
    return names[stage];
}

const struct packet *pipeline_packet(struct pipeline *pipeline, const struct wire_header *about)
{
    struct wire_header header = *about;
    const struct target *target = pipeline->settings.patches.target;
    header.width_px = pipeline->width_px;
    header.height_px = pipeline->height_px;
    header.target_digest = target != NULL ? target_digest(target) : 0;
    header.settings_digest = pipeline_settings_digest(&pipeline->settings);
    header.truncated = pipeline_truncated(pipeline);
    if (!packet_build(&pipeline->packet, &header, &pipeline->marks, &pipeline->patches)) {
        return NULL;
    }
    return &pipeline->packet;
}
