/* See golden_run.h. The target follows a rule (tests/golden/make_frames.py has the same one), so that no file
 * has to be read where there are none. */
#include "tests/golden/golden_run.h"

#include <stddef.h>

#include "firmware/app/pipeline.h"

#define MEMORY_BYTES (2u << 20)

static const struct target *golden_target(void)
{
    static struct target target = {
        .name = "golden",
        .rows = 16,
        .cols = 16,
        .levels = 2,
        .circle_ratio_q16 = 32768,
        .edge_level_q16 = 52429,
        .gauss_sigma_q16 = 26214,
        .patch_nm = 20000000,
    };
    for (unsigned place = 0; place < 256; place++) {
        target.ids[place] = (uint16_t)((place * 2357u + 5u) % 4096u);
        target.turns[place] = (uint8_t)(place * 7u / 3u % 2u);
    }
    unsigned bad_place;
    return target_prepare(&target, &bad_place) == TARGET_OK ? &target : NULL;
}

bool golden_run(const struct frame_view *frame, const struct dsp_kernels *dsp,
                struct golden_result *result)
{
    static struct pipeline pipeline;
    static uint64_t memory[MEMORY_BYTES / sizeof(uint64_t)] __attribute__((aligned(16)));
    const size_t bytes = pipeline_bytes(frame->width_px, frame->height_px);
    if (frame->width_px > GOLDEN_WIDTH_MAX || frame->height_px > GOLDEN_HEIGHT_MAX ||
        bytes > sizeof memory) {
        return false;
    }
    struct pipeline_settings settings = pipeline_defaults();
    settings.dsp = dsp;
    settings.patches.target = golden_target();
    pipeline_init(&pipeline, memory, bytes, frame->width_px, frame->height_px, &settings);
    pipeline_run(&pipeline, frame);
    const struct wire_header about = {
        .camera_serial = "golden",
        .clock_kind = WIRE_CLOCK_FILE,
        .clock_uncertainty_ns = WIRE_CLOCK_UNCERTAINTY_UNKNOWN,
    };
    const struct packet *packet = pipeline_packet(&pipeline, &about);
    if (packet == NULL) {
        return false;
    }
    result->digest = 0xcbf29ce484222325u;
    for (size_t i = 0; i < packet->used; i++) {
        result->digest = (result->digest ^ packet->bytes[i]) * 0x100000001b3u;
    }
    result->features = 0;
    for (uint32_t i = 0; i < pipeline.patches.count; i++) {
        result->features += pipeline.patches.at[i].feature_count;
    }
    return true;
}

/* The next number of a PGM's head. */
static bool read_number(const uint8_t *bytes, unsigned long size, unsigned long *at,
                        unsigned *number)
{
    while (*at < size && (bytes[*at] == ' ' || bytes[*at] == '\n')) {
        (*at)++;
    }
    *number = 0;
    const unsigned long first = *at;
    while (*at < size && bytes[*at] >= '0' && bytes[*at] <= '9' && *number < 100000) {
        *number = 10 * *number + (unsigned)(bytes[(*at)++] - '0');
    }
    return *at > first;
}

bool golden_parse(uint8_t *bytes, unsigned long size, struct frame_view *frame)
{
    unsigned width;
    unsigned height;
    unsigned largest;
    unsigned long at = 2;
    if (size < 2 || bytes[0] != 'P' || bytes[1] != '5' || !read_number(bytes, size, &at, &width) ||
        !read_number(bytes, size, &at, &height) || !read_number(bytes, size, &at, &largest)) {
        return false;
    }
    at++; /* one blank before the samples */
    const unsigned sample_bytes = largest == 255 ? 1 : 2;
    if ((largest != 255 && largest != 4095) || width < 1 || width > GOLDEN_WIDTH_MAX ||
        height < 1 || height > GOLDEN_HEIGHT_MAX ||
        size - at != (unsigned long)width * height * sample_bytes) {
        return false;
    }
    for (unsigned long i = at; sample_bytes == 2 && i < size; i += 2) {
        const uint8_t high = bytes[i];
        bytes[i] = bytes[i + 1];
        bytes[i + 1] = high;
    }
    *frame = (struct frame_view){
        .pixels = bytes + at,
        .stride_bytes = width * sample_bytes,
        .width_px = (uint16_t)width,
        .height_px = (uint16_t)height,
        .format = sample_bytes == 1 ? FRAME_GREY8 : FRAME_GREY12,
    };
    return true;
}
