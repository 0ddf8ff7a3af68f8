/* The kernels take no context, so what runs beside plain C is kept here. */
#include "firmware/app/dsp_verify.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware/limits.h"

static const struct dsp_kernels *checked = &dsp_scalar;
static dsp_verify_listener *told;

/* What plain C makes of the same input. */
static struct {
    uint16_t            grey_q4[LIMIT_SIDE_PX];
    int16_t             rows[5][LIMIT_SIDE_PX];
    uint8_t             strong[DSP_BITS_BYTES(LIMIT_SIDE_PX)];
    uint8_t             bright[DSP_BITS_BYTES(LIMIT_SIDE_PX)];
    uint32_t            square_q6[LIMIT_SIDE_PX];
    int32_t             steered_qm6[LIMIT_SIDE_PX];
    int64_t             sums[DSP_PRODUCTS];
    struct rimrow_batch batch;
    uint32_t            squares[8];
    uint32_t            counts[8];
} plain;

void dsp_verify_tell(dsp_verify_listener *listener)
{
    told = listener;
}

static void demand(bool same, const char *kernel, unsigned count)
{
    if (same) {
        return;
    }
    if (told != NULL) {
        told(kernel, checked->name, count);
    } else {
        (void)fprintf(stderr, "dsp: kernel %s of %s differs from plain C (%u values); run with "
                      "--dsp scalar and report it\n", kernel, checked->name, count);
        abort();
    }
}

static bool is_same(const void *a, const void *b, size_t count, size_t size)
{
    return memcmp(a, b, count * size) == 0;
}

static void widen(const uint8_t *bytes, unsigned width, uint16_t *out_grey_q4)
{
    checked->widen(bytes, width, out_grey_q4);
    dsp_scalar.widen(bytes, width, plain.grey_q4);
    demand(is_same(out_grey_q4, plain.grey_q4, width, sizeof(uint16_t)), "widen", width);
}

static void halve(const uint8_t *above, const uint8_t *below, unsigned width, uint16_t *out_grey_q4)
{
    checked->halve(above, below, width, out_grey_q4);
    dsp_scalar.halve(above, below, width, plain.grey_q4);
    demand(is_same(out_grey_q4, plain.grey_q4, width, sizeof(uint16_t)), "halve", width);
}

static void along_x(const struct taps *taps, const uint16_t *luma_grey_q4, unsigned width,
                    const struct dsp_row *out)
{
    const struct dsp_row expected = {plain.rows[0], plain.rows[1], plain.rows[2]};
    checked->along_x(taps, luma_grey_q4, width, out);
    dsp_scalar.along_x(taps, luma_grey_q4, width, &expected);
    demand(is_same(out->smooth_q3, expected.smooth_q3, width, sizeof(int16_t)) &&
           is_same(out->first_q3, expected.first_q3, width, sizeof(int16_t)) &&
           is_same(out->second_q2, expected.second_q2, width, sizeof(int16_t)), "along_x", width);
}

static void along_y(const struct taps *taps, const struct dsp_row rows[], unsigned width,
                    const struct dsp_gradient *out)
{
    const struct dsp_gradient expected = {.x_q3 = plain.rows[0], .y_q3 = plain.rows[1],
                                          .xx_q2 = plain.rows[2], .xy_q2 = plain.rows[3],
                                          .yy_q2 = plain.rows[4]};
    checked->along_y(taps, rows, width, out);
    dsp_scalar.along_y(taps, rows, width, &expected);
    demand(is_same(out->x_q3, expected.x_q3, width, sizeof(int16_t)) &&
           is_same(out->y_q3, expected.y_q3, width, sizeof(int16_t)) &&
           is_same(out->xx_q2, expected.xx_q2, width, sizeof(int16_t)) &&
           is_same(out->xy_q2, expected.xy_q2, width, sizeof(int16_t)) &&
           is_same(out->yy_q2, expected.yy_q2, width, sizeof(int16_t)), "along_y", width);
}

static void sides(uint32_t threshold_q6, unsigned width, const struct dsp_gradient *out)
{
    struct dsp_gradient expected = *out;
    expected.strong = plain.strong;
    expected.bright = plain.bright;
    expected.square_q6 = plain.square_q6;
    expected.steered_qm6 = plain.steered_qm6;
    checked->sides(threshold_q6, width, out);
    dsp_scalar.sides(threshold_q6, width, &expected);
    bool same = is_same(out->strong, plain.strong, DSP_BITS_BYTES(width), 1) &&
                is_same(out->bright, plain.bright, DSP_BITS_BYTES(width), 1);
    for (unsigned x = 0; x < width; x++) {
        same = same && (dsp_side(out, x) == 0 || (out->square_q6[x] == plain.square_q6[x] &&
                                                  out->steered_qm6[x] == plain.steered_qm6[x]));
    }
    demand(same, "sides", width);
}

static void products(const int16_t *columns, unsigned count, int64_t sums[DSP_PRODUCTS])
{
    memcpy(plain.sums, sums, sizeof plain.sums); /* they are added to */
    checked->products(columns, count, sums);
    dsp_scalar.products(columns, count, plain.sums);
    demand(is_same(sums, plain.sums, DSP_PRODUCTS, sizeof(int64_t)), "products", count);
}

static void rim_rows(const struct rimrow_view *view, unsigned count, struct rimrow_batch *batch)
{
    plain.batch = *batch;
    checked->rim_rows(view, count, batch);
    dsp_scalar.rim_rows(view, count, &plain.batch);
    bool same = is_same(batch->octant, plain.batch.octant, count, sizeof(int16_t));
    for (unsigned column = 0; column < RIMROW_COLUMNS; column++) {
        const unsigned at = column * RIMROW_PIXELS;
        same = same && is_same(batch->columns + at, plain.batch.columns + at, count, sizeof(int16_t));
    }
    demand(same, "rim_rows", count);
}

static void rim_span(const struct rimrow_steps *steps, int32_t p_q24, int32_t q_q24,
                     const uint8_t *bytes, unsigned count, int32_t *p_q14, int32_t *q_q14,
                     uint16_t *grey_q4)
{
    checked->rim_span(steps, p_q24, q_q24, bytes, count, p_q14, q_q14, grey_q4);
    dsp_scalar.rim_span(steps, p_q24, q_q24, bytes, count, plain.batch.p_q14, plain.batch.q_q14,
                        plain.batch.grey_q4);
    demand(is_same(p_q14, plain.batch.p_q14, count, sizeof(int32_t)) &&
           is_same(q_q14, plain.batch.q_q14, count, sizeof(int32_t)) &&
           (bytes == NULL || is_same(grey_q4, plain.batch.grey_q4, count, sizeof(uint16_t))),
           "rim_span", count);
}

static void rim_octants(const struct rimrow_batch *batch, unsigned count, uint32_t squares[8],
                        uint32_t counts[8])
{
    checked->rim_octants(batch, count, squares, counts);
    dsp_scalar.rim_octants(batch, count, plain.squares, plain.counts);
    demand(is_same(squares, plain.squares, 8, sizeof(uint32_t)) &&
           is_same(counts, plain.counts, 8, sizeof(uint32_t)), "rim_octants", count);
}

const struct dsp_kernels *dsp_verify(const struct dsp_kernels *variant)
{
    static struct dsp_kernels kernels;
    checked = variant;
    kernels = (struct dsp_kernels){variant->name, widen, halve, along_x, along_y, sides, products,
                                   rim_rows, rim_span, rim_octants};
    return &kernels;
}
