/* Zero crossings between neighbouring pixels on opposite sides of an edge. */
#include "firmware/detect/edges.h"

#include <string.h>

#include "common/fx/fx.h"
#include "firmware/detect/profile.h"

void edges_init(struct edge_row *out, struct arena *arena, unsigned width)
{
    out->across = arena_take(arena, width, sizeof(struct edge));
    out->down = arena_take(arena, width + 1, sizeof(struct edge));
    out->across_count = 0;
    out->down_count = 0;
}

static uint32_t square_q6(const struct dsp_gradient *row, unsigned x)
{
    const int32_t gx = row->x_q3[x];
    const int32_t gy = row->y_q3[x];
    return (uint32_t)(gx * gx) + (uint32_t)(gy * gy);
}

/* part / whole, Q16, to 2^-15 of itself. part <= whole, whole > 0. Both are brought to 16 bits: 32-bit
 * division is the one that small processors do fast. */
static uint32_t share_q16(uint64_t part, uint64_t whole)
{
    const unsigned bits = fx_bits_u64(whole);
    const unsigned up = bits < 16 ? 16 - bits : 0;
    const unsigned down = bits > 16 ? bits - 16 : 0;
    return ((uint32_t)(part << up >> down) << 16) / (uint32_t)(whole << up >> down);
}

/* Where q = L_nn / |L_n| is zero between pixel a and pixel b, as a fraction of the way, 0..65536; also the root
 * mean square of both gradients. L_nn is the steered value S over m^2, with m = |L_n|, so that t = A / (A + B) with
 * A = |S_a| m_b^3, B = |S_b| m_a^3. Only ratios count: with w the square of m over the mean of both squares, the third
 * power is looked up by w. That and the shares' 16 bits move the crossing by at most 6e-5 px. */
static uint32_t crossing_q16(const struct dsp_gradient *a_row, unsigned a,
                             const struct dsp_gradient *b_row, unsigned b, uint16_t *gradient_q3)
{
    const uint32_t a_square_q6 = square_q6(a_row, a); /* below 2^30, the sum below 2^31 */
    const uint32_t sum_q6 = a_square_q6 + square_q6(b_row, b);
    *gradient_q3 = fx_saturate_u16(profile_root_q24(sum_q6 / 2) >> 12);
    if (sum_q6 == 0) {
        return 32768;
    }
    const uint32_t a_over_mean_q22 = share_q16(a_square_q6, sum_q6) << 7;
    const uint64_t a_cube_q14 = profile_cube(a_over_mean_q22);
    const uint64_t b_cube_q14 = profile_cube((2u << 22) - a_over_mean_q22);
    /* |S| is below 2^44. */
    const uint64_t a_weight = (uint64_t)fx_abs_i64(dsp_steered_q8(a_row, a)) * b_cube_q14;
    const uint64_t b_weight = (uint64_t)fx_abs_i64(dsp_steered_q8(b_row, b)) * a_cube_q14;
    const uint64_t sum = a_weight + b_weight;
    return sum > 0 ? share_q16(a_weight, sum) : 32768;
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

static uint64_t eight_sides(const int8_t *side)
{
    uint64_t eight;
    memcpy(&eight, side, sizeof eight);
    return eight;
}

/* The lowest bit of each byte where two rows of sides are opposite: of the differences between 0, 1 and
 * 255 only 1 ^ 255 = 254 has its highest bit set and its lowest not. */
static uint64_t opposite_bytes(uint64_t a, uint64_t b)
{
    const uint64_t differ = a ^ b;
    return (differ >> 7) & ~differ & 0x0101010101010101u;
}

/* The column of the lowest byte that is set; the first of eight sides is in the lowest byte. */
static unsigned first_byte(uint64_t bytes)
{
    return (unsigned)__builtin_ctzll(bytes) / 8;
}

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "eight sides are read as one number");

void edges_scan_row(const struct dsp_gradient *above, const struct dsp_gradient *row, uint16_t y,
                    unsigned width, struct edge_row *out)
{
    out->across_count = 0;
    out->down_count = 0;
    const unsigned pairs = width - 1;
    unsigned x = 0;
    for (; x + 8 <= pairs; x += 8) {
        const uint64_t here = eight_sides(row->side + x);
        if (here == 0) { /* most of an image has no edge */
            continue;
        }
        uint64_t bytes = opposite_bytes(here, eight_sides(row->side + x + 1));
        for (; bytes != 0; bytes &= bytes - 1) {
            scan_across(row, x + first_byte(bytes), y, out);
        }
        bytes = above != NULL ? opposite_bytes(here, eight_sides(above->side + x)) : 0;
        for (; bytes != 0; bytes &= bytes - 1) {
            scan_down(above, row, x + first_byte(bytes), y, out);
        }
    }
    for (; x < width; x++) {
        if (x < pairs && row->side[x] * row->side[x + 1] < 0) {
            scan_across(row, x, y, out);
        }
        if (above != NULL && above->side[x] * row->side[x] < 0) {
            scan_down(above, row, x, y, out);
        }
    }
    edges_end_lists(out);
}
