/* Zero crossings between neighbouring pixels on opposite sides of an edge. */
#include "firmware/detect/edges.h"

#include <string.h>

#include "firmware/detect/profile.h"

void edges_init(struct edge_row *out, struct arena *arena, unsigned width)
{
    out->across = arena_take(arena, width, sizeof(struct edge));
    out->down = arena_take(arena, width + 1, sizeof(struct edge));
    out->across_count = 0;
    out->down_count = 0;
}

/* One of the two pixels beside a crossing. */
struct beside {
    uint32_t square_q6;
    int32_t  steered_qm6;
};

/* part / whole, Q16, to 2^-15 of itself, 65537 at most. part <= whole, whole > 0. The whole is brought to 16 bits:
 * 32-bit division is the one that small processors do fast. */
static inline uint32_t share32_q16(uint32_t part, uint32_t whole)
{
    const unsigned up = (unsigned)__builtin_clz(whole);
    return (part << up) / (whole << up >> 16);
}

/* Likewise, 65536 at most. */
static inline uint32_t share64_q16(uint64_t part, uint64_t whole)
{
    const unsigned up = (unsigned)__builtin_clzll(whole);
    return ((uint32_t)(part << up >> 32) & 0xffff0000u) / (uint32_t)(whole << up >> 48);
}

/* Where q = L_nn / |L_n| is zero between pixel a and pixel b, as a fraction of the way, 0..65536. L_nn is the steered
 * value S over m^2, with m = |L_n|, so that t = A / (A + B) with A = |S_a| m_b^3, B = |S_b| m_a^3. Only ratios count:
 * the third powers' share of their sum is looked up by the squares'. That and the shares' 16 bits move the crossing by
 * at most 6e-5 px. `sign` is 0 where S_a is positive or zero and S_b negative, -1 where it is the other way. */
static inline uint32_t crossing_q16(struct beside a, struct beside b, int32_t sign)
{
    /* Squares are not 0 of strong pixels. */
    const uint32_t a_cube_q16 =
        profile_cube_share_q16(share32_q16(a.square_q6, a.square_q6 + b.square_q6));
    const int64_t a_weight = (int64_t)((a.steered_qm6 ^ sign) - sign) * (65536 - a_cube_q16);
    const int64_t b_weight = (int64_t)(sign - (b.steered_qm6 ^ sign)) * a_cube_q16;
    return share64_q16((uint64_t)a_weight, (uint64_t)(a_weight + b_weight + 1));
}

/* Between two edges of one polarity lies a minimum of the gradient, where the second derivative also
 * changes sign, but the other way: bright side to dark side along the gradient. `along` is the
 * gradient's part from the first pixel to the second, summed over both. Where the edge runs nearly
 * along the line between them that part says nothing, and the crossing counts. `sign`: as above. */
static inline bool is_real(int32_t along_q3, int32_t sideways_q3, int32_t sign)
{
    const int32_t towards_bright = (along_q3 ^ sign) - sign;
    return 4 * towards_bright + (sideways_q3 < 0 ? -sideways_q3 : sideways_q3) > 0;
}

/* The point between columns x and x + 1, if there is one, at *to; returns what is behind it. */
static inline struct edge *scan_across(const struct dsp_gradient *row, unsigned x, int32_t y_px_q16,
                                       struct edge *to)
{
    const int32_t sign = row->steered_qm6[x] >> 31;
    if (!is_real(row->x_q3[x] + row->x_q3[x + 1], row->y_q3[x] + row->y_q3[x + 1], sign)) {
        return to;
    }
    const struct beside a = {row->square_q6[x], row->steered_qm6[x]};
    const struct beside b = {row->square_q6[x + 1], row->steered_qm6[x + 1]};
    to->x_px_q16 = (int32_t)(x * 65536u + crossing_q16(a, b, sign));
    to->y_px_q16 = y_px_q16;
    to->squares_q6 = a.square_q6 + b.square_q6;
    to->column = (uint16_t)x;
    to->forward = sign != 0; /* facing down, the left hand points to larger x */
    return to + 1;
}

/* Likewise between rows y - 1 and y. */
static inline struct edge *scan_down(const struct dsp_gradient *above,
                                     const struct dsp_gradient *row, unsigned x, int32_t y_px_q16,
                                     struct edge *to)
{
    const int32_t sign = above->steered_qm6[x] >> 31;
    if (!is_real(above->y_q3[x] + row->y_q3[x], above->x_q3[x] + row->x_q3[x], sign)) {
        return to;
    }
    const struct beside a = {above->square_q6[x], above->steered_qm6[x]};
    const struct beside b = {row->square_q6[x], row->steered_qm6[x]};
    to->x_px_q16 = (int32_t)(x * 65536u);
    to->y_px_q16 = y_px_q16 - 65536 + (int32_t)crossing_q16(a, b, sign);
    to->squares_q6 = a.square_q6 + b.square_q6;
    to->column = (uint16_t)x;
    to->forward = sign == 0; /* facing right, the left hand points up */
    return to + 1;
}

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "64 bits are read as one number");

/* The bits of 64 pixels, the first in the lowest. */
static inline uint64_t bits_at(const uint8_t *bits, unsigned x)
{
    uint64_t word;
    memcpy(&word, bits + x / 8, sizeof word);
    return word;
}

/* Likewise, of their right-hand neighbours. */
static inline uint64_t bits_beside(const uint8_t *bits, unsigned x)
{
    return bits_at(bits, x) >> 1 | bits_at(bits, x + 64) << 63;
}

void edges_scan_row(const struct dsp_gradient *above, const struct dsp_gradient *row, uint16_t y,
                    unsigned width, struct edge_row *out)
{
    const int32_t y_px_q16 = y * 65536;
    struct edge *across = out->across;
    struct edge *down = out->down;
    for (unsigned first = 0; first < width; first += 64) {
        const uint64_t strong = bits_at(row->strong, first);
        const uint64_t bright = bits_at(row->bright, first);
        uint64_t opposite =
            strong & bits_beside(row->strong, first) & (bright ^ bits_beside(row->bright, first));
        for (; opposite != 0; opposite &= opposite - 1) {
            const unsigned x = first + (unsigned)__builtin_ctzll(opposite);
            across = scan_across(row, x, y_px_q16, across);
        }
        if (above != NULL) {
            opposite = strong & bits_at(above->strong, first) & (bright ^ bits_at(above->bright, first));
        }
        for (; opposite != 0; opposite &= opposite - 1) {
            const unsigned x = first + (unsigned)__builtin_ctzll(opposite);
            down = scan_down(above, row, x, y_px_q16, down);
        }
    }
    out->across_count = (uint32_t)(across - out->across);
    out->down_count = (uint32_t)(down - out->down);
    edges_end_lists(out);
}
