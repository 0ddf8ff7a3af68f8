/* The pixels of a rim, 128 at a time: what each says of the circle, as rows of the Jacobian and what the model
 * leaves over. This is a row kernel (dsp.h); rim.h chooses the pixels and refine.h has the model.
 *
 * All arithmetic is of 32-bit integers, the same operations for every pixel, so that compilers turn the loops
 * into vectors of any width with the same results. Ranges: places in the unit frame within rho < 3.5;
 * pixels with rho^2 outside of [1/8, 8) are never kept. */
#ifndef TESSERA_FIRMWARE_DETECT_RIMROW_H
#define TESSERA_FIRMWARE_DETECT_RIMROW_H

#include "firmware/detect/curve.h"

#define RIMROW_PIXELS 128u
#define RIMROW_BAND_MAX_Q13 (2 << 13)
#define RIMROW_STEP   16u /* whole multiples are computed */
#define RIMROW_RAMP   8
#define RIMROW_EDGES  3u
#define RIMROW_GIVEN   (RIMROW_EDGES + 1)
#define RIMROW_BEYOND_Q15 (2 << 15)
#define RIMROW_COLUMNS 9u

/* Distance from a straight edge in blurs of that edge, positive on the circle's side: t0 + tp p + tq q. */
struct rimrow_edge {
    int32_t t0_q11;
    int32_t tp;     /* Q(edge_shift - 3), so that |tp|, |tq| <= 2^14 */
    int32_t tq;
};

/* What all pixels of one circle share. */
struct rimrow_view {
    int32_t  inverse_q28;      /* (R / h)^2 = i0 + i1 cos 2a + i2 sin 2a, in (1/8, 8) all around */
    int32_t  inverse_cos_q15;
    int32_t  inverse_sin_q15;
    /* t = (1 - rho) (h / R) (R / s). In the band (1 - rho) h / R in Q(24 - depth_shift) is below 2^13. */
    uint32_t depth_shift;
    int32_t  depth_q14;        /* (R / s) 2^(depth_shift - 11), in [2, 4) */
    /* Kept are |t| <= band and -t <= max(gap h / R - clear, near), all in blurs. */
    int32_t  gap_q10;          /* below 16 */
    int32_t  band_q13;         /* at most RIMROW_BAND_MAX_Q13 */
    int32_t  clear_q13;
    int32_t  near_q13;
    int32_t  over_rim_q11;     /* full swing over the swing at the circle's edge, at most 16 */
    /* The model of brightness: level + contrast edge; level in 1/32 grey_q4, contrast in 1/4 grey_q4, and how
     * they change with p and q. */
    int32_t  level_q5;
    int32_t  level_p_q5;       /* |.| <= 2^14 */
    int32_t  level_q_q5;
    int32_t  contrast_q2;      /* |.| <= 2^14 */
    int32_t  contrast_p_q2;    /* |.| <= 2^12 */
    int32_t  contrast_q_q2;
    uint32_t rest_shift;       /* rests are 1/32 grey_q4 shifted down by so much */
    /* The profile E = edge Phi(t) + A exp(-rho^2 (n0 - n1 y)) + the neighbours' part, over the swing at the rim.
     * t by curve.h. */
    int32_t  curve_q14[CURVE_TERMS];
    int32_t  eps_q14;          /* s / R, at most 1 */
    int32_t  edge_q14;         /* below 2 */
    int32_t  peak_q8;          /* A / phi(0)^4, below 2^18 */
    int32_t  peak_n0_q11;      /* at most 16, like the next */
    int32_t  peak_n1_q11;
    int32_t  peak_shown_q15;   /* 1: the peak goes on beyond the rim; 0: it ends there */
    uint32_t edge_count;       /* at most RIMROW_EDGES; or RIMROW_GIVEN: as the batch has them */
    uint32_t edge_shift;       /* 2..14: distances stay below 2^18 blurs */
    struct rimrow_edge edges[RIMROW_EDGES];
};

/* How far the 0th to 8th next pixel of a row lies from one, in the unit frame. */
struct rimrow_steps {
    int32_t p_q24[RIMROW_RAMP + 1];
    int32_t q_q24[RIMROW_RAMP + 1];
};

/* Pixels in and rows out. */
struct rimrow_batch {
    int32_t  p_q14[RIMROW_PIXELS + RIMROW_RAMP];
    int32_t  q_q14[RIMROW_PIXELS + RIMROW_RAMP];
    uint16_t grey_q4[RIMROW_PIXELS + RIMROW_RAMP];
    /* Only read for RIMROW_GIVEN: the share of the full swing that all edges bring together, RIMROW_BEYOND_Q15 beyond
     * one, else at most 1.5; and its growth with the blur's logarithm, at most 1. */
    int32_t  others_q15[RIMROW_PIXELS];
    int32_t  growth_q15[RIMROW_PIXELS];
    /* Q11: by p, q, size, two elongations, level, contrast, blur; the rest as it is. Zero where a pixel is not
     * kept. */
    int16_t  columns[RIMROW_COLUMNS * RIMROW_PIXELS];
    int16_t  octant[RIMROW_PIXELS];      /* 0..7 around the circle; 8 where a pixel is not kept */
};

#endif
