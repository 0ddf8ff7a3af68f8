/* The row kernels for x86, written once and compiled for each width of vector: the including file defines
 *
 *   VEC, LANES     the register and how many 16-bit values it holds
 *   V(op)          the intrinsic of that width: V(add_epi16)(a, b)
 *   LOAD, STORE    unaligned, whole registers
 *   LOAD_BYTES     LANES bytes, each widened to 16 bits
 *   SIGNS          an unsigned of the signs of 16-bit values, the first in the lowest bit
 *   STORE_WIDE     a `struct sum` as LANES 32-bit values in order
 *   QUARTERS       a 128-bit register of four sums over a register's 32-bit values
 *   ROUNDED        (a b + 2^14) >> 15 of 16-bit values: rimrow_lanes.h
 *   AND, OR        bitwise
 *   KERNELS        the table's name; NAME its text
 *
 * Unpacking splits a register's values in two halves with 32 bits a value, packing joins them again in the
 * same order, so nothing here depends on the lanes of wide registers.
 *
 * Sums of two samples have to fit 16 bits. Along x samples are below 2^12. Down the columns: first_q3 is at
 * most 4095 x 0.47 x 8 = 15396; second_q2 at most 4095 x 0.42 x 4 = 6880 from radius 3 on, but 21320
 * at radius 2, where each has a product of its own; smooth_q3 is taken from -2^14, which the exactly zero
 * sums of the other two filters' taps cancel. */

#include <stdbool.h>

#include "firmware/detect/dsp_blocks.h"
#include "firmware/detect/halve_loops.h"

/* Lanes for rimrow_lanes.h. */
#define RV              VEC
#define RV_LANES        LANES
#define RV_LOAD(p)      LOAD(p)
#define RV_STORE(p, v)  STORE(p, v)
#define RV_SET(x)       V(set1_epi16)((int16_t)(x))
#define RV_ADD(a, b)    V(add_epi16)(a, b)
#define RV_SUB(a, b)    V(sub_epi16)(a, b)
#define RV_ADDS(a, b)   V(adds_epi16)(a, b)
#define RV_SUBS(a, b)   V(subs_epi16)(a, b)
#define RV_MULR(a, b)   ROUNDED(a, b)
#define RV_MIN(a, b)    V(min_epi16)(a, b)
#define RV_MAX(a, b)    V(max_epi16)(a, b)
#define RV_AND(a, b)    AND(a, b)
#define RV_ANDNOT(a, b) ANDNOT(a, b)
#define RV_OR(a, b)     OR(a, b)
#define RV_SHL(a, n)    V(sll_epi16)(a, _mm_cvtsi32_si128((int)(n)))
#define RV_SHR(a, n)    V(sra_epi16)(a, _mm_cvtsi32_si128((int)(n)))
#define RV_GT(a, b)     V(cmpgt_epi16)(a, b)
#include "firmware/detect/rimrow_loops.h"

/* Two taps side by side, for pairs of samples. */
static inline VEC tap_pair(int even, int odd)
{
    return V(set1_epi32)((int)((unsigned)even & 0xffffu) | (int)((unsigned)odd << 16));
}

/* 32-bit sums of both halves, shared between the filters' steps. */
struct sum {
    VEC low;
    VEC high;
};

static inline struct sum pair_sum(struct sum pairs, VEC taps)
{
    return (struct sum){V(madd_epi16)(pairs.low, taps), V(madd_epi16)(pairs.high, taps)};
}

static inline struct sum add_sum(struct sum a, struct sum b)
{
    return (struct sum){V(add_epi32)(a.low, b.low), V(add_epi32)(a.high, b.high)};
}

static inline struct sum interleave(VEC even, VEC odd)
{
    return (struct sum){V(unpacklo_epi16)(even, odd), V(unpackhi_epi16)(even, odd)};
}

/* sum over k of taps[k] * values[k], rounded and shifted back to 16 bits, which it fits. Values go in pairs: beside
 * the last of an odd count lies what rounds. */
static inline __attribute__((always_inline)) VEC filter(VEC values[], const int16_t taps[],
                                                        unsigned count, int shift)
{
    const bool odd = count % 2 != 0;
    values[count] = odd ? V(set1_epi16)(2) : ZERO;
    const int rounding = 1 << (shift - 2);
    struct sum sum = pair_sum(interleave(values[0], values[1]),
                              tap_pair(taps[0], count > 1 ? taps[1] : rounding));
    for (unsigned k = 2; k < count; k += 2) {
        const VEC pair = tap_pair(taps[k], k + 1 < count ? taps[k + 1] : rounding);
        sum = add_sum(sum, pair_sum(interleave(values[k], values[k + 1]), pair));
    }
    if (!odd) {
        const VEC half = V(set1_epi32)(2 * rounding);
        sum = add_sum(sum, (struct sum){half, half});
    }
    return V(packs_epi32)(V(srai_epi32)(sum.low, shift), V(srai_epi32)(sum.high, shift));
}

static inline __attribute__((always_inline)) void along_x_block(const struct taps *taps,
                                                                unsigned radius,
                                                                const uint16_t *luma_grey_q4,
                                                                const struct dsp_row *out,
                                                                unsigned x)
{
    const uint16_t *at = luma_grey_q4 + x;
    VEC even[TAPS_RADIUS_MAX + 2]; /* centre, then sums of the two at distance k */
    VEC odd[TAPS_RADIUS_MAX + 2];  /* differences, from distance 1               */
    even[0] = LOAD(at);
    for (unsigned k = 1; k <= radius; k++) {
        const VEC after = LOAD(at + k);
        const VEC before = LOAD(at - k);
        even[k] = V(add_epi16)(after, before);
        odd[k - 1] = V(sub_epi16)(after, before);
    }
    STORE(out->smooth_q3 + x, filter(even, taps->smooth_q15, radius + 1, 12));
    STORE(out->first_q3 + x, filter(odd, taps->first_q15 + 1, radius, 12));
    STORE(out->second_q2 + x, filter(even, taps->second_q14, radius + 1, 12));
}

static void widen(const uint8_t *bytes, unsigned width, uint16_t *out_grey_q4)
{
    if (width < LANES) {
        dsp_scalar.widen(bytes, width, out_grey_q4);
        return;
    }
    for (unsigned x = 0; x < width; x = next_block(x, width)) {
        STORE(out_grey_q4 + x, V(slli_epi16)(LOAD_BYTES(bytes + x), 4));
    }
}

static inline __attribute__((always_inline)) void along_y_block(const struct taps *taps,
                                                                unsigned radius,
                                                                const int16_t *const rows[],
                                                                struct places at,
                                                                const struct dsp_gradient *out,
                                                                unsigned x)
{
    /* smooth_q3 is taken from its middle 2^14, and so the sum of two from 2^15. */
    const VEC middle = V(set1_epi16)(1 << 14);
    const VEC twice_middle = V(set1_epi16)(INT16_MIN);
    VEC even[TAPS_RADIUS_MAX + 2];
    VEC odd[TAPS_RADIUS_MAX + 2];
    even[0] = LOAD(rows[radius] + at.first);
    for (unsigned k = 1; k <= radius; k++) {
        const VEC below = LOAD(rows[radius + k] + at.first);
        const VEC above = LOAD(rows[radius - k] + at.first);
        even[k] = V(add_epi16)(below, above);
        odd[k - 1] = V(sub_epi16)(below, above);
    }
    STORE(out->x_q3 + x, filter(even, taps->smooth_q15, radius + 1, 15));
    STORE(out->xy_q2 + x, filter(odd, taps->first_q15 + 1, radius, 16));

    even[0] = V(sub_epi16)(LOAD(rows[radius] + at.smooth), middle);
    for (unsigned k = 1; k <= radius; k++) {
        const VEC below = LOAD(rows[radius + k] + at.smooth);
        const VEC above = LOAD(rows[radius - k] + at.smooth);
        even[k] = V(add_epi16)(V(add_epi16)(below, above), twice_middle);
        odd[k - 1] = V(sub_epi16)(below, above);
    }
    STORE(out->y_q3 + x, filter(odd, taps->first_q15 + 1, radius, 15));
    STORE(out->yy_q2 + x, filter(even, taps->second_q14, radius + 1, 15));

    even[0] = LOAD(rows[radius] + at.second);
    if (radius == 2) {
        const int16_t each_q15[5] = {taps->smooth_q15[0], taps->smooth_q15[1], taps->smooth_q15[1],
                                     taps->smooth_q15[2], taps->smooth_q15[2]};
        for (unsigned k = 1; k <= 2; k++) {
            even[2 * k - 1] = LOAD(rows[2 + k] + at.second);
            even[2 * k] = LOAD(rows[2 - k] + at.second);
        }
        STORE(out->xx_q2 + x, filter(even, each_q15, 5, 15));
        return;
    }
    for (unsigned k = 1; k <= radius; k++) {
        even[k] = V(add_epi16)(LOAD(rows[radius + k] + at.second),
                               LOAD(rows[radius - k] + at.second));
    }
    STORE(out->xx_q2 + x, filter(even, taps->smooth_q15, radius + 1, 15));
}

#include "firmware/detect/dsp_along.h"

/* The steered second derivatives of half a block over 2^14, from pairs (gx, gy), (gxx, gxy), (gxy, gyy).
 *
 * u = (gxx, gxy) . g and v = (gxy, gyy) . g need 32 bits, and u gx + v gy 45. Split u = 2^16 u1 + u0 with
 * -2^15 <= u0 < 2^15, and v alike: then u gx + v gy = 2^16 (u1 gx + v1 gy) + (u0 gx + v0 gy), two more
 * pairwise products. */
static inline VEC half_steered(VEC g, VEC u_row, VEC v_row)
{
    const VEC low_mask = V(set1_epi32)(0xffff);
    const VEC round = V(set1_epi32)(0x8000);
    const VEC u = V(madd_epi16)(g, u_row);
    const VEC v = V(madd_epi16)(g, v_row);
    const VEC upper = OR(V(srli_epi32)(V(add_epi32)(u, round), 16),
                         ANDNOT(low_mask, V(add_epi32)(v, round)));
    const VEC lower = OR(AND(u, low_mask), V(slli_epi32)(v, 16));
    return V(add_epi32)(V(slli_epi32)(V(madd_epi16)(g, upper), 2),
                        V(srai_epi32)(V(madd_epi16)(g, lower), 14));
}

/* The signs of a block's values, the first in the lowest bit. */
static inline unsigned signs(struct sum values)
{
    return SIGNS(V(packs_epi32)(values.low, values.high));
}

/* The bits of the block at x. The last one overlaps the one before it: its upper bits are new. */
static inline void put_bits(uint8_t *to, unsigned x, unsigned bits)
{
    const unsigned overlap = (0u - x) % LANES;
    const unsigned fresh = bits >> overlap;
    memcpy(to + (x + overlap) / 8, &fresh, LANES / 8); /* little-endian, as x86 is */
}

static void sides(uint32_t threshold_q6, unsigned width, const struct dsp_gradient *out)
{
    if (width < LANES) {
        dsp_scalar.sides(threshold_q6, width, out);
        return;
    }
    const struct dsp_gradient own = *out;
    const VEC below = V(set1_epi32)((int)threshold_q6 - 1);
    for (unsigned x = 0; x < width; x = next_block(x, width)) {
        const struct sum g = interleave(LOAD(own.x_q3 + x), LOAD(own.y_q3 + x));
        const struct sum square = {V(madd_epi16)(g.low, g.low), V(madd_epi16)(g.high, g.high)};
        const struct sum strong = {V(cmpgt_epi32)(square.low, below),
                                   V(cmpgt_epi32)(square.high, below)};
        const unsigned strong_bits = signs(strong);
        unsigned bright_bits = 0;
        if (strong_bits != 0) {
            const VEC xy = LOAD(own.xy_q2 + x);
            const struct sum u_row = interleave(LOAD(own.xx_q2 + x), xy);
            const struct sum v_row = interleave(xy, LOAD(own.yy_q2 + x));
            const struct sum steered = {half_steered(g.low, u_row.low, v_row.low),
                                        half_steered(g.high, u_row.high, v_row.high)};
            bright_bits = signs((struct sum){AND(steered.low, strong.low),
                                             AND(steered.high, strong.high)});
            STORE_WIDE(own.square_q6 + x, square);
            STORE_WIDE(own.steered_qm6 + x, steered);
        }
        put_bits(own.strong, x, strong_bits);
        put_bits(own.bright, x, bright_bits);
    }
    dsp_end_bits(&own, width);
}

/* Adds what up to four registers of 32-bit values come to: four sums side by side, by halves of a transposition. */
static inline __attribute__((always_inline)) void add_sums(const VEC partial[], unsigned count,
                                                           int64_t *sums)
{
    const VEC first = partial[0];
    const VEC second = count > 1 ? partial[1] : ZERO;
    const VEC third = count > 2 ? partial[2] : ZERO;
    const VEC fourth = count > 3 ? partial[3] : ZERO;
    const VEC early = V(add_epi32)(V(unpacklo_epi32)(first, second), V(unpackhi_epi32)(first, second));
    const VEC late = V(add_epi32)(V(unpacklo_epi32)(third, fourth), V(unpackhi_epi32)(third, fourth));
    const __m128i four = QUARTERS(
        V(add_epi32)(V(unpacklo_epi64)(early, late), V(unpackhi_epi64)(early, late)));
    const __m128i sign = _mm_srai_epi32(four, 31);
    int64_t wide[4];
    _mm_storeu_si128((__m128i *)(void *)wide, _mm_unpacklo_epi32(four, sign));
    _mm_storeu_si128((__m128i *)(void *)(wide + 2), _mm_unpackhi_epi32(four, sign));
    for (unsigned i = 0; i < count; i++) {
        sums[i] += wide[i];
    }
}

/* The products of one row with all columns before it; `row` is known where this is inlined, so that the sums
 * live in registers. */
static inline __attribute__((always_inline)) void row_products(const int16_t *columns, unsigned row,
                                                               unsigned count, int64_t *sums)
{
    VEC partial[DSP_COLUMNS];
    for (unsigned col = 0; col <= row; col++) {
        partial[col] = ZERO;
    }
    for (unsigned k = 0; k < count; k += LANES) {
        const VEC own = LOAD(columns + row * DSP_BATCH + k);
        for (unsigned col = 0; col <= row; col++) {
            const VEC other = LOAD(columns + col * DSP_BATCH + k);
            partial[col] = V(add_epi32)(partial[col], V(madd_epi16)(own, other));
        }
    }
    for (unsigned col = 0; col <= row; col += 4) {
        add_sums(partial + col, row - col < 4 ? row - col + 1 : 4, sums + col);
    }
}

static void products(const int16_t *columns, unsigned count, int64_t sums[DSP_PRODUCTS])
{
    row_products(columns, 0, count, sums);
    row_products(columns, 1, count, sums + 1);
    row_products(columns, 2, count, sums + 3);
    row_products(columns, 3, count, sums + 6);
    row_products(columns, 4, count, sums + 10);
    row_products(columns, 5, count, sums + 15);
    row_products(columns, 6, count, sums + 21);
    row_products(columns, 7, count, sums + 28);
    row_products(columns, 8, count, sums + 36);
}

const struct dsp_kernels KERNELS = {
    .name = NAME,
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
