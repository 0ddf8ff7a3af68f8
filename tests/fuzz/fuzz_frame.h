/* The bytes that the fuzz target of frames takes, and cases at random for those without a fuzzer. */
#ifndef TESSERA_TESTS_FUZZ_FUZZ_FRAME_H
#define TESSERA_TESTS_FUZZ_FUZZ_FRAME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "firmware/frame.h"
#include "firmware/limits.h"

#define FUZZ_FRAME_HEAD     20u
#define FUZZ_FRAME_SIDE_MAX 300u
/* One kind byte in sixteen asks for a frame as long or wide as there can be, of no more pixels than others. */
#define FUZZ_FRAME_LONG_FROM 240u

/* What the picture shows. */
enum fuzz_frame_kind {
    FUZZ_FRAME_BYTES, /* the content's own bytes, again and again */
    FUZZ_FRAME_CONSTANT,
    FUZZ_FRAME_NOISE,
    FUZZ_FRAME_SALT,
    FUZZ_FRAME_CHECKER,
    FUZZ_FRAME_STRIPES,
    FUZZ_FRAME_GRADIENT,
    FUZZ_FRAME_TEXT,
    FUZZ_FRAME_CIRCLES,
    FUZZ_FRAME_TARGET,   /* patches in perspective, then broken; four in fifteen frames */
    FUZZ_FRAME_RINGS = 13, /* ellipses within ellipses */
    FUZZ_FRAME_TRIANGLES,
    FUZZ_FRAME_KINDS
};

struct fuzz_frame_head {
    uint16_t             width_px;
    uint16_t             height_px;
    uint16_t             extra_bytes; /* of the stride */
    enum frame_format    format;
    uint8_t              kernel_radius_px;
    uint16_t             gradient_min_q3;
    uint8_t              levels;
    bool                 with_target;
    bool                 drawn_ids;   /* the target is the one drawn, not one half like it */
    bool                 odd_target;  /* circles of any ratio and peak */
    enum fuzz_frame_kind kind;
    uint8_t              parameter;
    uint64_t             random;
};

static inline struct fuzz_frame_head fuzz_frame_read_head(const uint8_t *data)
{
    struct fuzz_frame_head head = {
        .width_px = (uint16_t)(1 + (data[0] | (unsigned)data[1] << 8) % FUZZ_FRAME_SIDE_MAX),
        .height_px = (uint16_t)(1 + (data[2] | (unsigned)data[3] << 8) % FUZZ_FRAME_SIDE_MAX),
        .extra_bytes = data[4],
        .format = (enum frame_format)(data[5] % (FRAME_NV12 + 1)),
        .kernel_radius_px = (uint8_t)(2 + data[6] % 4),
        .gradient_min_q3 = (uint16_t)(64 + (data[7] | (unsigned)data[8] << 8) % 12737),
        .levels = (uint8_t)(2 + (data[9] & 1)),
        .with_target = (data[9] & 2) != 0,
        .drawn_ids = (data[9] & 4) != 0,
        .odd_target = (data[9] & 56) == 56,
        .kind = (enum fuzz_frame_kind)(data[10] % FUZZ_FRAME_KINDS),
        .parameter = data[11],
    };
    if (head.kind > FUZZ_FRAME_TARGET && head.kind < FUZZ_FRAME_RINGS) {
        head.kind = FUZZ_FRAME_TARGET;
    }
    if (data[10] >= FUZZ_FRAME_LONG_FROM) {
        const unsigned width = 1 + (data[0] | (unsigned)data[1] << 8) % LIMIT_SIDE_PX;
        const unsigned most = FUZZ_FRAME_SIDE_MAX * FUZZ_FRAME_SIDE_MAX / width;
        const unsigned rows = most < 1 ? 1 : most < LIMIT_SIDE_PX ? most : LIMIT_SIDE_PX;
        head.width_px = (uint16_t)width;
        head.height_px = (uint16_t)(1 + (data[2] | (unsigned)data[3] << 8) % rows);
        head.extra_bytes = (uint16_t)(8 * data[4]);
    }
    for (unsigned i = 0; i < 8; i++) {
        head.random |= (uint64_t)data[12 + i] << (8 * i);
    }
    return head;
}

/* Case `number`: FUZZ_FRAME_HEAD bytes and up to 64 of content. Half of the frames are at most 100 px
 * a side; half have the default gradient threshold or less, where most is found. Returns the count. */
#define FUZZ_FRAME_CASE_BYTES (FUZZ_FRAME_HEAD + 64u)
static inline size_t fuzz_frame_case(uint64_t number, uint8_t out[FUZZ_FRAME_CASE_BYTES])
{
    uint64_t state = number * 0xd1342543de82ef95u + 1;
    for (unsigned i = 0; i < FUZZ_FRAME_CASE_BYTES; i++) {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        out[i] = (uint8_t)(state >> 24);
    }
    if (out[20] & 1) {
        out[0] %= 100;
        out[2] %= 100;
        out[1] = 0;
        out[3] = 0;
    }
    if (out[21] & 1) {
        out[8] = 0;
    }
    return FUZZ_FRAME_HEAD + (out[22] & 1 ? out[23] % 64u : 0);
}

#endif
