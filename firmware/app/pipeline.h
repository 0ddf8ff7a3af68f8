/* The one-way street of a frame, and the only file that knows all its stages. No operating system, no heap
 * and no floating point here: the programs around it differ, this does not. */
#ifndef TESSERA_FIRMWARE_APP_PIPELINE_H
#define TESSERA_FIRMWARE_APP_PIPELINE_H

#include "firmware/detect/chains.h"
#include "firmware/detect/ellipses.h"
#include "firmware/detect/lattice.h"
#include "firmware/detect/marks.h"
#include "firmware/detect/packet.h"
#include "firmware/detect/patches.h"
#include "firmware/detect/quota.h"
#include "firmware/detect/refine.h"
#include "firmware/detect/steer.h"
#include "firmware/detect/survey.h"

/* What a user may choose. pipeline_defaults gives a good start. */
struct pipeline_settings {
    uint8_t                 kernel_radius_px; /* 2..5: filter size 2 r + 1, sigma r / 3 px           */
    uint32_t                gradient_min_q3;  /* weakest edge, in 1/128 grey level (of 256) a pixel */
    struct patches_settings patches;
    /* The row kernels; every variant gives the same bits, so the settings' digest leaves it out. */
    const struct dsp_kernels *dsp;
};

/* The stages whose time can be watched. */
enum pipeline_stage {
    PIPELINE_STEER,
    PIPELINE_EDGES,
    PIPELINE_CHAINS,
    PIPELINE_ELLIPSES,
    PIPELINE_MARKS,
    PIPELINE_PATCHES,
    PIPELINE_REFINE,
    PIPELINE_LATTICE,
    PIPELINE_STAGES,
};

struct pipeline {
    struct pipeline_settings settings;
    uint16_t         width_px;
    uint16_t         height_px;
    struct steer     steer;
    struct steer     half;    /* the same memory, for the frame at half its size */
    struct edge_row  edges;
    struct quota     quota;
    struct chains    chains;
    struct contour   contour;
    struct ellipses  ellipses;
    struct marks     marks;
    struct patches   patches;
    struct survey    survey;
    struct refine    refine;
    struct lattice   lattice;
    struct packet    packet;
    bool             seen_in_full; /* the last frame: half its size did not explain it */
    /* Set by a program that wants to know where the time goes: its clock, read between the stages. */
    uint64_t       (*clock)(void);            /* NULL: nothing is timed                     */
    uint64_t         spent[PIPELINE_STAGES];  /* in the last frame, in the clock's units    */
};

struct pipeline_settings pipeline_defaults(void);

/* 64 bits that name settings (FNV-1a over their values, the target left out); for the packet. */
uint64_t pipeline_settings_digest(const struct pipeline_settings *settings);

/* The memory that frames of this size need. Width and height 1..LIMIT_SIDE_PX. */
size_t pipeline_bytes(uint16_t width_px, uint16_t height_px);

/* Deals out `memory`, pipeline_bytes() of it, aligned to 16. It and the target that the settings point
 * to stay in use as long as the pipeline. */
void pipeline_init(struct pipeline *pipeline, void *memory, size_t bytes, uint16_t width_px,
                   uint16_t height_px, const struct pipeline_settings *settings);

/* Finds the marks and patches of one frame of that size. */
void pipeline_run(struct pipeline *pipeline, const struct frame_view *frame);

const char *pipeline_stage_name(enum pipeline_stage stage);

/* The lists that were full in the last frame: WIRE_TRUNCATED_... bits. */
uint16_t pipeline_truncated(const struct pipeline *pipeline);

/* The packet of the last frame. about: the camera and the frame; target and settings digest, size and truncation
 * flags are filled in here. NULL when it is not fit for a packet. Holds until the next call. */
const struct packet *pipeline_packet(struct pipeline *pipeline, const struct wire_header *about);

#endif
