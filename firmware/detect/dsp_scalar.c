/* The row kernels in plain C: always built, the reference for every variant. */
#include "common/fx/fx.h"
#include "firmware/detect/dsp.h"
#include "firmware/detect/halve_loops.h"
#include "firmware/detect/rimrow_loops.h"

static void widen(const uint8_t *bytes, unsigned width, uint16_t *out_grey_q4)
{
    for (unsigned x = 0; x < width; x++) {
        out_grey_q4[x] = (uint16_t)(bytes[x] << 4);
    }
}

static void along_x(const struct taps *taps, const uint16_t *luma_grey_q4, unsigned width,
                    const struct dsp_row *out)
{
    const unsigned radius = taps->radius;
    for (unsigned x = 0; x < width; x++) {
        const uint16_t *at = luma_grey_q4 + x;
        int32_t smooth = taps->smooth_q15[0] * at[0];
        int32_t first = 0;
        int32_t second = taps->second_q14[0] * at[0];
        for (unsigned k = 1; k <= radius; k++) {
            const int32_t after = at[k];
            const int32_t before = *(at - k);
            smooth += taps->smooth_q15[k] * (after + before);
            first += taps->first_q15[k] * (after - before);
            second += taps->second_q14[k] * (after + before);
        }
        out->smooth_q3[x] = fx_narrow_i16(fx_round_shift_i32(smooth, 12));
        out->first_q3[x] = fx_narrow_i16(fx_round_shift_i32(first, 12));
        out->second_q2[x] = fx_narrow_i16(fx_round_shift_i32(second, 12));
    }
}

static void along_y(const struct taps *taps, const struct dsp_row rows[], unsigned width,
                    const struct dsp_gradient *out)
{
    const unsigned radius = taps->radius;
    const struct dsp_row *centre = &rows[radius];
    for (unsigned x = 0; x < width; x++) {
        int32_t gx = taps->smooth_q15[0] * centre->first_q3[x];
        int32_t gy = 0;
        int32_t gxx = taps->smooth_q15[0] * centre->second_q2[x];
        int32_t gxy = 0;
        int32_t gyy = taps->second_q14[0] * centre->smooth_q3[x];
        for (unsigned k = 1; k <= radius; k++) {
            const struct dsp_row *below = &rows[radius + k];
            const struct dsp_row *above = &rows[radius - k];
            gx += taps->smooth_q15[k] * (below->first_q3[x] + above->first_q3[x]);
            gy += taps->first_q15[k] * (below->smooth_q3[x] - above->smooth_q3[x]);
            gxx += taps->smooth_q15[k] * (below->second_q2[x] + above->second_q2[x]);
            gxy += taps->first_q15[k] * (below->first_q3[x] - above->first_q3[x]);
            gyy += taps->second_q14[k] * (below->smooth_q3[x] + above->smooth_q3[x]);
        }
        out->x_q3[x] = fx_narrow_i16(fx_round_shift_i32(gx, 15));
        out->y_q3[x] = fx_narrow_i16(fx_round_shift_i32(gy, 15));
        out->xx_q2[x] = fx_narrow_i16(fx_round_shift_i32(gxx, 15));
        out->xy_q2[x] = fx_narrow_i16(fx_round_shift_i32(gxy, 16));
        out->yy_q2[x] = fx_narrow_i16(fx_round_shift_i32(gyy, 15));
    }
}

static void sides(uint32_t threshold_q6, unsigned width, const struct dsp_gradient *out)
{
    unsigned strong = 0;
    unsigned bright = 0;
    for (unsigned x = 0; x < width; x++) {
        const int32_t gx = out->x_q3[x];
        const int32_t gy = out->y_q3[x];
        const uint32_t square_q6 = (uint32_t)(gx * gx) + (uint32_t)(gy * gy);
        if (square_q6 >= threshold_q6) {
            const int64_t steered_q8 = dsp_steered_q8(out, x);
            strong |= 1u << (x % 8);
            bright |= (steered_q8 < 0 ? 1u : 0u) << (x % 8);
            out->square_q6[x] = square_q6;
            out->steered_qm6[x] = (int32_t)(steered_q8 >> 14);
        }
        if (x % 8 == 7 || x + 1 == width) {
            out->strong[x / 8] = (uint8_t)strong;
            out->bright[x / 8] = (uint8_t)bright;
            strong = 0;
            bright = 0;
        }
    }
    dsp_end_bits(out, width);
}

static void products(const int16_t *columns, unsigned count, int64_t sums[DSP_PRODUCTS])
{
    unsigned at = 0;
    for (unsigned row = 0; row < DSP_COLUMNS; row++) {
        for (unsigned col = 0; col <= row; col++) {
            const int16_t *a = columns + row * DSP_BATCH;
            const int16_t *b = columns + col * DSP_BATCH;
            int32_t sum = 0;
            for (unsigned k = 0; k < count; k++) {
                sum += a[k] * b[k];
            }
            sums[at++] += sum;
        }
    }
}

const struct dsp_kernels dsp_scalar = {
    .name = "scalar",
    .widen = widen,
    .halve = halve_bytes,
    .along_x = along_x,
    .along_y = along_y,
    .sides = sides,
    .products = products,
    .rim_rows = rimrow_rows,
    .rim_span = rimrow_span,
    .rim_octants = rimrow_octants,
};
