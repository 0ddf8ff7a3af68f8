/* One golden frame through the detector, as every processor has to see it. */
#ifndef TESSERA_TESTS_GOLDEN_GOLDEN_RUN_H
#define TESSERA_TESTS_GOLDEN_GOLDEN_RUN_H

#include <stdbool.h>

#include "firmware/detect/dsp.h"
#include "firmware/frame.h"

/* Golden frames are at most this large, so that they fit a microcontroller's memory. */
#define GOLDEN_WIDTH_MAX  640u
#define GOLDEN_HEIGHT_MAX 480u

struct golden_result {
    uint64_t digest;   /* FNV-1a (64 bits) over the packet's bytes */
    unsigned features;
};

/* Finds the golden target's features and digests the packet. False when the frame is too large. */
bool golden_run(const struct frame_view *frame, const struct dsp_kernels *dsp,
                struct golden_result *result);

/* A PGM (P5, maxval 255, or 4095 in two bytes) in memory as a frame that looks into it; 16-bit samples are
 * put into little-endian order in place. False when it is no such file. */
bool golden_parse(uint8_t *bytes, unsigned long size, struct frame_view *frame);

#endif
