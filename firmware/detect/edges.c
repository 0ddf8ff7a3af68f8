/* Zero crossings between neighbouring pixels on opposite sides of an edge. */
#include "firmware/detect/edges.h"

#include <string.h>

#include "common/fx/fx.h"
#include "common/fx/root.h"

void edges_init(struct edge_row *out, struct arena *arena, unsigned width)
{
    out->across = arena_take(arena, width, sizeof(struct edge));
    out->down = arena_take(arena, width, sizeof(struct edge));
    out->across_count = 0;
    out->down_count = 0;
}

/* L_nn = steered / |g|^2 at a pixel whose gradient is above the threshold, as Q10 of grey_q4 a
 * square pixel, not negative. steered is below 2^44, so the shifted one below 2^52; the quotient is
 * below 2^26, since |L_nn| is at most the sum of the second derivatives. */
static int64_t curvature_q10(const struct dsp_gradient *row, unsigned x, uint32_t square_q6)
{
    const int64_t steered_q8 = fx_abs_i64(dsp_steered_q8(row, x));
    return (int64_t)((uint64_t)steered_q8 << 8) / square_q6;
}

static uint32_t square_q6(const struct dsp_gradient *row, unsigned x)
{
    const int32_t gx = row->x_q3[x];
    const int32_t gy = row->y_q3[x];
    return (uint32_t)(gx * gx) + (uint32_t)(gy * gy);
}

/* Where q = L_nn / |L_n| is zero between pixel a and pixel b, as a fraction of the way, 0..65536;
 * also the mean gradient. With A = |L_nn|, m = |L_n|: t = A_a m_b / (A_a m_b + A_b m_a). */
static uint32_t crossing_q16(const struct dsp_gradient *a_row, unsigned a,
                             const struct dsp_gradient *b_row, unsigned b, uint16_t *gradient_q3)
{
    const uint32_t a_square_q6 = square_q6(a_row, a);
    const uint32_t b_square_q6 = square_q6(b_row, b);
    const uint32_t a_gradient_q3 = root_u32(a_square_q6);
    const uint32_t b_gradient_q3 = root_u32(b_square_q6);
    *gradient_q3 = fx_saturate_u16((a_gradient_q3 + b_gradient_q3) / 2);

    const int64_t a_weight = curvature_q10(a_row, a, a_square_q6) * b_gradient_q3;
    const int64_t b_weight = curvature_q10(b_row, b, b_square_q6) * a_gradient_q3;
    if (a_weight + b_weight == 0) {
        return 32768;
    }
    return (uint32_t)fx_div_round(a_weight << 16, a_weight + b_weight);
}

/* Between two edges of one polarity lies a minimum of the gradient, where the second derivative also
 * changes sign, but the other way: bright side to dark side along the gradient. `along` is the
 * gradient's part from the first pixel to the second, summed over both. Where the edge runs nearly
 * along the line between them that part says nothing, and the crossing counts. */
static bool is_real(int8_t first_side, int32_t along_q3, int32_t sideways_q3)
{
    const int32_t towards_bright = first_side > 0 ? along_q3 : -along_q3;
    return towards_bright > 0 || 4 * -towards_bright < fx_abs_i64(sideways_q3);
}

static void scan_across(const struct dsp_gradient *row, unsigned x, uint16_t y,
                        struct edge_row *out)
{
    const int32_t along_q3 = row->x_q3[x] + row->x_q3[x + 1];
    const int32_t sideways_q3 = row->y_q3[x] + row->y_q3[x + 1];
    if (is_real(row->side[x], along_q3, sideways_q3)) {
        struct edge *edge = &out->across[out->across_count++];
        edge->x_px_q16 = (int32_t)(x * 65536u +
                                   crossing_q16(row, x, row, x + 1, &edge->gradient_q3));
        edge->y_px_q16 = y * 65536;
        edge->column = (uint16_t)x;
        /* Facing down, the left hand points to larger x. */
        edge->forward = row->side[x + 1] > 0;
    }
}

static void scan_down(const struct dsp_gradient *above, const struct dsp_gradient *row, unsigned x,
                      uint16_t y, struct edge_row *out)
{
    const int32_t along_q3 = above->y_q3[x] + row->y_q3[x];
    const int32_t sideways_q3 = above->x_q3[x] + row->x_q3[x];
    if (is_real(above->side[x], along_q3, sideways_q3)) {
        struct edge *edge = &out->down[out->down_count++];
        edge->x_px_q16 = (int32_t)(x * 65536u);
        edge->y_px_q16 = (y - 1) * 65536 +
                         (int32_t)crossing_q16(above, x, row, x, &edge->gradient_q3);
        edge->column = (uint16_t)x;
        /* Facing right, the left hand points up. */
        edge->forward = above->side[x] > 0;
    }
}

void edges_scan_row(const struct dsp_gradient *above, const struct dsp_gradient *row, uint16_t y,
                    unsigned width, struct edge_row *out)
{
    out->across_count = 0;
    out->down_count = 0;
    for (unsigned x = 0; x < width; x++) {
        /* Most of an image has no edge: pass eight such pixels at a time. */
        uint64_t eight = 0;
        if (x + 8 <= width) {
            memcpy(&eight, row->side + x, 8);
            if (eight == 0) {
                x += 7;
                continue;
            }
        }
        if (x + 1 < width && row->side[x] * row->side[x + 1] < 0) {
            scan_across(row, x, y, out);
        }
        if (above != NULL && above->side[x] * row->side[x] < 0) {
            scan_down(above, row, x, y, out);
        }
    }
}
