/* The pixels around a circle's rim: which they are, and the sums over all of them.
 *
 * Here is the hot loop of circlefit.h, which has the model and its mathematics. Row kernels (dsp.h) do the work: a
 * pixel's row of the Jacobian and what the model leaves of its brightness become nine 16-bit numbers
 * (rimrow.h), and the sums over all pairs of them are the normal equations. */
#ifndef TESSERA_FIRMWARE_DETECT_RIM_H
#define TESSERA_FIRMWARE_DETECT_RIM_H

#include "firmware/detect/dsp.h"
#include "firmware/detect/ellipse.h"
#include "firmware/detect/pattern.h"
#include "firmware/frame.h"

#define RIM_UNKNOWNS   8u
#define RIM_LEVEL      5u /* b */
#define RIM_CONTRAST   6u /* c */
#define RIM_BLUR       7u
/* In the fine pass rests are 32 times larger on the same scale: 16 grey levels of 256 at most. */
#define RIM_FINE_BITS  5

/* One feature as the model has it so far. */
struct rim_view {
    struct ellipse      ellipse;
    struct ellipse_root root;
    int64_t             over_xx_q40;   /* 2^40 / B_xx: steps of p along a row, Q24 */
    int64_t             over_yy_q40;
    int64_t             slope_q24;     /* B_yx / B_xx */
    uint32_t            size_px_q16;   /* R: geometric mean of the semi-axes */
    int64_t             inverse_q24[3]; /* (R / h)^2 = i0 + i1 (pp - qq) + i2 2 p q, on the circle */
    int32_t             blur_px_q16;
    int32_t             edge_blur_px_q16; /* of straight edges: on a small disc blur looks different */
    int64_t             gap_q16;       /* from the circle to the triangle, in circle radii */
    struct pattern_edges edges;        /* of the triangle                                 */
    int64_t             level_q30;     /* b and c so far; 0 in the first pass */
    int64_t             contrast_q30;
    /* How b and c change across the circle, per pixel along x and y: light that falls unevenly. Only the fine
     * pass uses them. */
    int64_t             level_slope_q30[2];
    int64_t             contrast_slope_q30[2];
    bool                fine;
};

/* Working memory and the target's own profile. */
struct rim {
    const struct dsp_kernels *dsp;
    struct rimrow_batch      *pixels;
    int64_t                   over_rim_q15; /* full swing over the swing at the circle's edge */
    int64_t                   edge_q15;     /* of the circles: level(rho) = edge + (1 - edge) */
    int64_t                   gauss_sigma_q16; /* exp(-rho^2 / 2 sigma^2); at most 8         */
};

/* Sums over the rim's pixels: J'J and J' rest in Q40, rest^2 in Q44 (rests in units of 4096 grey_q4, 2^RIM_FINE_BITS
 * times larger when view->fine). */
struct rim_sums {
    int64_t  matrix_q40[RIM_UNKNOWNS][RIM_UNKNOWNS]; /* lower triangle */
    int64_t  right_q40[RIM_UNKNOWNS];
    int64_t  squares_q44;            /* fine pass only, like the next two */
    int64_t  octant_squares_q44[8];
    uint32_t octant_count[8];
    uint32_t count;
};

/* Visits the pixels of the band, row by row. */
void rim_gather(const struct rim *rim, const struct frame_view *frame, const struct rim_view *view,
                struct rim_sums *sums);

#endif
