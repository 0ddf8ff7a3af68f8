/* The row kernels: the few loops that touch every pixel, and so the only code that may have vector
 * variants. dsp_scalar.c is the truth; a variant gives the same bits.
 *
 * Scaling. Luma is grey_q4 (0..4095). With the kernels of taps_table.c:
 *   smooth rows  g * L      Q3 of grey_q4, 0..32760      (27-bit sums, shifted by 12)
 *   first        g' * L     Q3, |.| <= 4095 * 0.55 * 8 < 2^15
 *   second       g'' * L    Q2, |.| <= 4095 * 1.5 * 4  < 2^15
 * and likewise down the columns; the bounds hold because the positive taps of g' sum to less than
 * 0.55 and those of g'' to less than 1.5 (tests/unit/test_steer.c checks the table). */
#ifndef TESSERA_FIRMWARE_DETECT_DSP_H
#define TESSERA_FIRMWARE_DETECT_DSP_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "firmware/detect/rimrow.h"
#include "firmware/detect/taps.h"

/* One image row filtered along x; padded rows are not needed here, `width` values each. The three lie in one array. */
struct dsp_row {
    int16_t *smooth_q3; /* g   along x */
    int16_t *first_q3;  /* g'  along x */
    int16_t *second_q2; /* g'' along x */
};

/* The derivatives of the smoothed image along one row. */
struct dsp_gradient {
    int16_t *x_q3;
    int16_t *y_q3;
    int16_t *xx_q2;
    int16_t *xy_q2;
    int16_t *yy_q2;
    /* One bit a pixel, pixel 0 in the lowest of the first byte; DSP_BITS_BYTES of them, 0 behind the last pixel.
     * strong: the gradient is not below the threshold. bright: the second derivative along the gradient is negative
     * as well, else (positive or zero) the pixel is on the dark side of its edge. */
    uint8_t *strong;
    uint8_t *bright;
    /* Of strong pixels: x_q3^2 + y_q3^2, below 2^30; the steered second derivative (dsp_steered_q8) over 2^14. */
    uint32_t *square_q6;
    int32_t  *steered_qm6;
};

/* Whole numbers of 64 bits, and one more. */
#define DSP_BITS_BYTES(width) (((width) / 64u + 2u) * 8u)

/* Columns of samples whose pairwise sums of products are wanted: the normal equations of rim.h. */
#define DSP_COLUMNS    RIMROW_COLUMNS
#define DSP_PRODUCTS   (DSP_COLUMNS * (DSP_COLUMNS + 1) / 2)
#define DSP_BATCH      RIMROW_PIXELS /* samples a column has room for */
#define DSP_BATCH_STEP RIMROW_STEP

struct dsp_kernels {
    const char *name;
    /* Bytes, grey levels of 256, as luma: times 16. */
    void (*widen)(const uint8_t *bytes, unsigned width, uint16_t *out_grey_q4);
    /* Two rows of 2 * width bytes as one of half their size: sums of four, times 4. */
    void (*halve)(const uint8_t *above, const uint8_t *below, unsigned width,
                  uint16_t *out_grey_q4);
    /* luma_grey_q4 points at the first pixel of a row padded by taps->radius on both sides. */
    void (*along_x)(const struct taps *taps, const uint16_t *luma_grey_q4, unsigned width,
                    const struct dsp_row *out);
    /* rows[0..2 radius] are the filtered rows around the output row, from above to below: in all of them the three
     * lie equally far apart. */
    void (*along_y)(const struct taps *taps, const struct dsp_row rows[], unsigned width,
                    const struct dsp_gradient *out);
    /* Fills out->strong, bright, square_q6 and steered_qm6 from the derivatives; the threshold is on x_q3^2 +
     * y_q3^2. */
    void (*sides)(uint32_t threshold_q6, unsigned width, const struct dsp_gradient *out);
    /* Adds to sums, for each row i and column j <= i, the sum over k < count of c[i][k] c[j][k], where column
     * c[i] starts at columns + i * DSP_BATCH. count: a multiple of DSP_BATCH_STEP, at most DSP_BATCH.
     * |c| at most 4095: 128 products stay below 2^31. */
    void (*products)(const int16_t *columns, unsigned count, int64_t sums[DSP_PRODUCTS]);
    /* The rim's pixels: rimrow.h. count: as for products. Octants' sums are overwritten. */
    void (*rim_rows)(const struct rimrow_view *view, unsigned count, struct rimrow_batch *batch);
    /* `count` pixels of a row, and up to RIMROW_RAMP - 1 more, the first at (p, q): p, q and, where `bytes` is not NULL,
     * brightness. All places, and one step more, are within the range of rimrow.h. */
    void (*rim_span)(const struct rimrow_steps *steps, int32_t p_q24, int32_t q_q24,
                     const uint8_t *bytes, unsigned count, int32_t *p_q14, int32_t *q_q14,
                     uint16_t *grey_q4);
    void (*rim_octants)(const struct rimrow_batch *batch, unsigned count, uint32_t squares[8],
                        uint32_t counts[8]);
};

extern const struct dsp_kernels dsp_scalar;
#if defined(__x86_64__)
extern const struct dsp_kernels dsp_sse2;
extern const struct dsp_kernels dsp_avx2;
#endif
/* ARMv7-A may lack NEON: there the processor is asked, too. */
#if defined(__aarch64__) || (defined(__arm__) && __ARM_ARCH_PROFILE == 'A')
#define DSP_HAS_NEON
extern const struct dsp_kernels dsp_neon;
#endif

/* Clears what is behind the last pixel's byte. */
static inline void dsp_end_bits(const struct dsp_gradient *g, unsigned width)
{
    const size_t filled = (width + 7u) / 8u;
    memset(g->strong + filled, 0, DSP_BITS_BYTES(width) - filled);
    memset(g->bright + filled, 0, DSP_BITS_BYTES(width) - filled);
}

/* 0 for a pixel that is not strong, 1 on the dark side, -1 on the bright one. */
static inline int dsp_side(const struct dsp_gradient *g, unsigned x)
{
    const unsigned bit = 1u << (x % 8u);
    return (g->strong[x / 8u] & bit) == 0 ? 0 : (g->bright[x / 8u] & bit) == 0 ? 1 : -1;
}

/* gx^2 gxx + 2 gx gy gxy + gy^2 gyy, the second derivative along the gradient times the gradient's
 * square (Freeman and Adelson 1991: the second-derivative filter steered to the dominant
 * orientation). Q8; below 2^45. */
static inline int64_t dsp_steered_q8(const struct dsp_gradient *g, unsigned x)
{
    const int32_t gx = g->x_q3[x];
    const int32_t gy = g->y_q3[x];
    const int32_t along_x = gx * g->xx_q2[x] + gy * g->xy_q2[x];
    const int32_t along_y = gx * g->xy_q2[x] + gy * g->yy_q2[x];
    return (int64_t)gx * along_x + (int64_t)gy * along_y;
}

#endif
