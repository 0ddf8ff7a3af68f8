/* The pixels of a rim, 128 at a time: what each says of the circle, as rows of the Jacobian and what the model
 * leaves over. This is a row kernel (dsp.h); rim.h chooses the pixels and circlefit.h has the model.
 *
 * Radius and direction are computed in 32-bit integers (rimrow_loops.h), all else in 16-bit ones (rimrow_lanes.h): the
 * same operations for every pixel, in vectors of any width with the same results. Ranges: places in the unit frame
 * within rho < 3.5; pixels with rho^2 outside of [1/8, 8) are never kept. */
#ifndef TESSERA_FIRMWARE_DETECT_RIMROW_H
#define TESSERA_FIRMWARE_DETECT_RIMROW_H

#include <stdint.h>

#include "common/fx/fx.h"
#include "firmware/detect/curve.h"

#define RIMROW_PIXELS 128u
#define RIMROW_BAND_MAX_Q14 (INT16_MAX - 16) /* 2 blurs; distances are cut just above */
#define RIMROW_STEP   16u /* whole multiples are computed */
#define RIMROW_RAMP   8
#define RIMROW_EDGES  3u
#define RIMROW_GIVEN   (RIMROW_EDGES + 1)
#define RIMROW_BEYOND_Q14 INT16_MAX
#define RIMROW_COLUMNS 9u

/* Distance from a straight edge in blurs of that edge, positive on the circle's side: t0 + tp p + tq q. */
struct rimrow_edge {
    int32_t t0_q11;
    int32_t tp;     /* Q(edge_shift - 3), so that |tp|, |tq| <= 2^14 */
    int32_t tq;
};

/* A factor of at least 0 that may be larger than 1, for 16-bit lanes: mantissa 2^(up - down). What it is applied to
 * is cut at `limit` between mantissa and shift, where the result would not fit. */
struct rimrow_gain {
    int16_t mantissa_q15;
    int16_t limit;
    int32_t up;
    int32_t down;
};

static inline struct rimrow_gain rimrow_gain_of(int64_t value_q24)
{
    int32_t up = 0;
    int32_t down = 0;
    for (; value_q24 >= 1 << 24 && up < 15; value_q24 /= 2) {
        up++;
    }
    for (; value_q24 > 0 && value_q24 < 1 << 23 && up == 0 && down < 15; value_q24 *= 2) {
        down++;
    }
    const int64_t mantissa_q15 = (value_q24 + (1 << 8)) >> 9;
    const struct rimrow_gain gain = {
        (int16_t)(mantissa_q15 < INT16_MAX ? mantissa_q15 : INT16_MAX), (int16_t)(INT16_MAX >> up), up,
        down};
    return gain;
}

/* What all pixels of one circle share. */
struct rimrow_view {
    /* (R / h)^2 = i0 + i1 cos 2a + i2 sin 2a, in (1/8, 8) all around. With `wide` 0 it is below 4 and |i1|, |i2|
     * below 2; with 1 all of these have a bit less. */
    int16_t  inverse_q13;
    int16_t  inverse_cos_q14;
    int16_t  inverse_sin_q14;
    uint32_t wide;
    /* t = (1 - rho) (R / s) (h / R). In the band 1 - rho in Q(24 - depth_shift) is at most 23000, and cut there. */
    uint32_t depth_shift;
    int32_t  depth_q14;        /* (R / s) 2^(depth_shift - 11), in [2, 4) */
    /* Kept are |t| <= band and -t <= max(gap h / R - clear, near), all in blurs. */
    int16_t  gap_q11;          /* below 16 */
    int16_t  band_q14;         /* at most RIMROW_BAND_MAX_Q14 */
    int16_t  clear_q11;
    int16_t  near_q11;
    struct rimrow_gain over_rim; /* full swing over the swing at the circle's edge, at most 16 */
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
     * t by curve.h, with its coefficients times 2^(j + k): for tau / 2 and y / 2. */
    int16_t  bend_q11[CURVE_TERMS];
    int16_t  bend_share_q15;   /* (s / R) 2^(2 - bend_shift): times h / R below 4, it is below 4 */
    uint32_t bend_shift;       /* 0..2 */
    int16_t  edge_q14;         /* below 2 */
    int16_t  peak_shown_q15;   /* 2^15 - 1: the peak goes on beyond the rim; 0: it ends there */
    struct rimrow_gain peak;   /* A / phi(0) / 2, for Q15 to become Q14 */
    int16_t  peak_n0;          /* below 16, in Q(15 - peak_shift), like the next */
    int16_t  peak_n1;
    uint32_t peak_shift;       /* 0..4 */
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
    /* Only read for RIMROW_GIVEN: the share of the full swing that all edges bring together, RIMROW_BEYOND_Q14 beyond
     * one, else at most 1.5; and its growth with the blur's logarithm, at most 1. */
    int16_t  others_q14[RIMROW_PIXELS];
    int16_t  growth_q14[RIMROW_PIXELS];
    /* Between the kernel's own loops. */
    int16_t  depth_q13[RIMROW_PIXELS];   /* (1 - rho) R / s; Q12 where the view is wide */
    int16_t  square_q12[RIMROW_PIXELS];  /* rho^2 */
    int16_t  cos_q14[RIMROW_PIXELS];     /* directions */
    int16_t  sin_q14[RIMROW_PIXELS];
    int16_t  apart_q13[RIMROW_EDGES][RIMROW_PIXELS]; /* from edges, in blurs, 0 to 4 */
    int16_t  edge_q14[RIMROW_PIXELS];    /* E */
    int16_t  kept[RIMROW_PIXELS];        /* all bits, or none */
    /* Q11: by p, q, size, two elongations, level, contrast, blur; the rest as it is. Zero where a pixel is not
     * kept. */
    int16_t  columns[RIMROW_COLUMNS * RIMROW_PIXELS];
    int16_t  octant[RIMROW_PIXELS];      /* 0..7 around the circle; 8 where a pixel is not kept */
};

/* Fills what tells a pixel's distance: (R / h)^2 from its three numbers, in (1/8, 8) all around, and R / s. */
static inline void rimrow_set_shape(struct rimrow_view *view, const int64_t inverse_q24[3], int64_t most_q24,
                                    int64_t over_blur_q16)
{
    /* Numbers of 16 bits: just below 4 there is room for roundings. */
    view->wide = most_q24 > (4 << 24) - (1 << 16) ? 1 : 0;
    view->inverse_q13 = (int16_t)((inverse_q24[0] >> view->wide) >> 11);
    view->inverse_cos_q14 = (int16_t)((inverse_q24[1] >> view->wide) >> 10);
    view->inverse_sin_q14 = (int16_t)((inverse_q24[2] >> view->wide) >> 10);
    const unsigned bits = fx_bits_i64(over_blur_q16);
    view->depth_shift = 29 - bits;
    view->depth_q14 =
        (int32_t)(bits > 16 ? over_blur_q16 >> (bits - 16) : over_blur_q16 << (16 - bits));
}

/* Fills how fast the peak falls: n0 - n1 y, which is cut below 16, and n1 so that n1 y is below it. n0, n1 >= 0. */
static inline void rimrow_set_fall(struct rimrow_view *view, int64_t n0_q15, int64_t n1_q15)
{
    static const int64_t most_q15 = (int64_t)INT16_MAX << 4;
    static const int64_t most1_q15 = (most_q15 << 14) / (CURVE_Y_MAX_Q14 + 2);
    const int64_t cut0_q15 = n0_q15 < most_q15 ? n0_q15 : most_q15;
    const int64_t cut1_q15 = n1_q15 < most1_q15 ? n1_q15 : most1_q15;
    const int64_t largest_q15 = cut0_q15 + ((cut1_q15 * CURVE_Y_MAX_Q14) >> 14);
    const unsigned bits = fx_bits_i64(largest_q15 < most_q15 ? largest_q15 : most_q15);
    view->peak_shift = bits > 15 ? bits - 15 : 0;
    view->peak_n0 = (int16_t)(cut0_q15 >> view->peak_shift);
    view->peak_n1 = (int16_t)(cut1_q15 >> view->peak_shift);
}

/* Fills what bends the profile from curve_at's terms and eps = s / R, at most 0.99. */
static inline void rimrow_set_bend(struct rimrow_view *view, const int32_t terms_q14[CURVE_TERMS],
                                   int64_t eps_q16)
{
    static const uint8_t powers[CURVE_TERMS] = {0, 1, 2, 3, 1, 2, 3, 4, 2, 3, 4, 5, 3, 4, 4};
    for (unsigned i = 0; i < CURVE_TERMS; i++) {
        const int32_t term_q11 = (terms_q14[i] * (1 << powers[i]) + 4) >> 3;
        view->bend_q11[i] = (int16_t)(term_q11 > INT16_MAX   ? INT16_MAX
                                      : term_q11 < INT16_MIN ? INT16_MIN
                                                             : term_q11);
    }
    /* h / R is below 2.83: (R / h)^2 is above 1/8. */
    view->bend_shift = eps_q16 < 16384 ? 0 : eps_q16 < 32768 ? 1 : 2;
    view->bend_share_q15 = (int16_t)(eps_q16 << 1 >> view->bend_shift);
}

#endif
