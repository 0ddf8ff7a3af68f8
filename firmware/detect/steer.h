/* Rows of the image -> rows of Gaussian derivatives and of the second derivative's sign along the
 * gradient (Freeman and Adelson's steerable filters), over a ring of rows: memory grows with the
 * width alone.
 *
 * Range: see dsp.h. At the image's border the outermost pixels are repeated. */
#ifndef TESSERA_FIRMWARE_DETECT_STEER_H
#define TESSERA_FIRMWARE_DETECT_STEER_H

#include <stdbool.h>

#include "firmware/detect/arena.h"
#include "firmware/detect/dsp.h"
#include "firmware/detect/luma.h"

#define STEER_RING_ROWS (2 * TAPS_RADIUS_MAX + 1)

struct steer {
    const struct dsp_kernels *dsp;
    const struct taps        *taps;
    uint32_t                  threshold_q6; /* on the squared gradient, Q3 squared */
    unsigned                  width;
    unsigned                  height;
    unsigned                  filtered;     /* rows filtered along x so far */
    bool                      halved;       /* of the frame at half its size */
    uint16_t                 *luma_grey_q4; /* one row; the padding lies before it and after it */
    struct dsp_row            ring[STEER_RING_ROWS];
    struct dsp_gradient       rows[2];      /* the last two rows out: y is in rows[y & 1] */
};

/* kernel_radius_px 2..5 picks the filter (size 2 r + 1, sigma r / 3 px). gradient_min_q3 is the
 * weakest gradient that counts as an edge: grey_q4 a pixel, Q3. */
void steer_init(struct steer *steer, struct arena *arena, const struct dsp_kernels *dsp,
                unsigned kernel_radius_px, uint32_t gradient_min_q3, unsigned width,
                unsigned height);

/* The same for the frame at half its size, in the same memory: one of the two at a time. Frames of 2x2 px or
 * more. */
void steer_halve(const struct steer *full, struct steer *half);

/* How wide the filters are in pixels of the frame. */
uint32_t steer_sigma_px_q16(const struct steer *steer);

/* Starts a frame. */
void steer_begin(struct steer *steer);

/* The derivatives of row y; rows are asked for from 0 on, each once. The frame has the size given to
 * steer_init, also when it is seen at half that. The result holds until row y + 2 is asked for. */
const struct dsp_gradient *steer_row(struct steer *steer, const struct frame_view *frame,
                                     uint16_t y);

#endif
