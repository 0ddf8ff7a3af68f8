/* The row kernels with NEON, of aarch64 and of armv7 where the compiler is told that it is there. Ranges as
 * in dsp_x86_rows.h. */
#include "firmware/detect/dsp.h"

#if defined(__ARM_NEON)
#include <arm_neon.h>

#define RV              int16x8_t
#define RV_LANES        8u
#define RV_LOAD(p)      vld1q_s16(p)
#define RV_STORE(p, v)  vst1q_s16(p, v)
#define RV_SET(x)       vdupq_n_s16((int16_t)(x))
#define RV_ADD(a, b)    vaddq_s16(a, b)
#define RV_SUB(a, b)    vsubq_s16(a, b)
#define RV_ADDS(a, b)   vqaddq_s16(a, b)
#define RV_SUBS(a, b)   vqsubq_s16(a, b)
#define RV_MULR(a, b)   vqrdmulhq_s16(a, b)
#define RV_MIN(a, b)    vminq_s16(a, b)
#define RV_MAX(a, b)    vmaxq_s16(a, b)
#define RV_AND(a, b)    vandq_s16(a, b)
#define RV_ANDNOT(a, b) vbicq_s16(b, a)
#define RV_OR(a, b)     vorrq_s16(a, b)
#define RV_SHL(a, n)    vshlq_s16(a, vdupq_n_s16((int16_t)(n)))
#define RV_SHR(a, n)    vshlq_s16(a, vdupq_n_s16((int16_t)-(int16_t)(n)))
#define RV_GT(a, b)     vreinterpretq_s16_u16(vcgtq_s16(a, b))

#include "firmware/detect/rimrow_loops.h"

#define LANES 8u
#include "firmware/detect/dsp_blocks.h"

/* The upper four values by the instructions that take them from where they are. */
#if defined(__aarch64__)
#define MULL_HIGH(a, b)        vmull_high_s16(a, b)
#define MLAL_HIGH(sum, a, b)   vmlal_high_s16(sum, a, b)
#define MULL_HIGH_N(a, n)      vmull_high_n_s16(a, n)
#define MLAL_HIGH_N(sum, a, n) vmlal_high_n_s16(sum, a, n)
#define LOWER(a, b)            vuzp1q_s16(a, b)
#define UPPER(a, b)            vuzp2q_s16(a, b)
#else
#define MULL_HIGH(a, b)        vmull_s16(vget_high_s16(a), vget_high_s16(b))
#define MLAL_HIGH(sum, a, b)   vmlal_s16(sum, vget_high_s16(a), vget_high_s16(b))
#define MULL_HIGH_N(a, n)      vmull_n_s16(vget_high_s16(a), n)
#define MLAL_HIGH_N(sum, a, n) vmlal_n_s16(sum, vget_high_s16(a), n)
#define LOWER(a, b)            vuzpq_s16(a, b).val[0]
#define UPPER(a, b)            vuzpq_s16(a, b).val[1]
#endif

struct sum {
    int32x4_t low;
    int32x4_t high;
};

/* Of each value the lower 16 bits, or the upper ones. */
static inline int16x8_t lower_halves(struct sum sum)
{
    return LOWER(vreinterpretq_s16_s32(sum.low), vreinterpretq_s16_s32(sum.high));
}

static inline int16x8_t upper_halves(struct sum sum)
{
    return UPPER(vreinterpretq_s16_s32(sum.low), vreinterpretq_s16_s32(sum.high));
}

static inline struct sum weigh_first(int16x8_t value, int16_t tap)
{
    return (struct sum){vmull_n_s16(vget_low_s16(value), tap), MULL_HIGH_N(value, tap)};
}

static inline struct sum weigh(struct sum sum, int16x8_t value, int16_t tap)
{
    return (struct sum){vmlal_n_s16(sum.low, vget_low_s16(value), tap),
                        MLAL_HIGH_N(sum.high, value, tap)};
}

static inline int16x8_t narrow_12(struct sum sum)
{
    return vcombine_s16(vrshrn_n_s32(sum.low, 12), vrshrn_n_s32(sum.high, 12));
}

static inline int16x8_t narrow_15(struct sum sum)
{
    return vcombine_s16(vrshrn_n_s32(sum.low, 15), vrshrn_n_s32(sum.high, 15));
}

static inline int16x8_t narrow_16(struct sum sum)
{
    return vcombine_s16(vrshrn_n_s32(sum.low, 16), vrshrn_n_s32(sum.high, 16));
}

static inline __attribute__((always_inline)) void along_x_block(const struct taps *taps,
                                                                unsigned radius,
                                                                const uint16_t *luma_grey_q4,
                                                                const struct dsp_row *out,
                                                                unsigned x)
{
    const int16_t *at = (const int16_t *)luma_grey_q4 + x;
    const int16x8_t centre = vld1q_s16(at);
    struct sum smooth = weigh_first(centre, taps->smooth_q15[0]);
    struct sum second = weigh_first(centre, taps->second_q14[0]);
    struct sum first = {vdupq_n_s32(0), vdupq_n_s32(0)};
    for (unsigned k = 1; k <= radius; k++) {
        const int16x8_t after = vld1q_s16(at + k);
        const int16x8_t before = vld1q_s16(at - k);
        const int16x8_t both = vaddq_s16(after, before);
        const int16x8_t change = vsubq_s16(after, before);
        smooth = weigh(smooth, both, taps->smooth_q15[k]);
        second = weigh(second, both, taps->second_q14[k]);
        first = k == 1 ? weigh_first(change, taps->first_q15[1])
                       : weigh(first, change, taps->first_q15[k]);
    }
    vst1q_s16(out->smooth_q3 + x, narrow_12(smooth));
    vst1q_s16(out->first_q3 + x, narrow_12(first));
    vst1q_s16(out->second_q2 + x, narrow_12(second));
}

static inline __attribute__((always_inline)) void along_y_block(const struct taps *taps,
                                                                unsigned radius,
                                                                const int16_t *const rows[],
                                                                struct places at,
                                                                const struct dsp_gradient *out,
                                                                unsigned x)
{
    /* smooth_q3 is taken from its middle 2^14, and so the sum of two from 2^15. */
    const int16x8_t middle = vdupq_n_s16(1 << 14);
    const int16x8_t twice_middle = vdupq_n_s16(INT16_MIN);
    const int16_t *here = rows[radius];
    struct sum gx = weigh_first(vld1q_s16(here + at.first), taps->smooth_q15[0]);
    struct sum gxx = weigh_first(vld1q_s16(here + at.second), taps->smooth_q15[0]);
    struct sum gyy = weigh_first(vsubq_s16(vld1q_s16(here + at.smooth), middle),
                                 taps->second_q14[0]);
    struct sum gy = {vdupq_n_s32(0), vdupq_n_s32(0)};
    struct sum gxy = gy;
    for (unsigned k = 1; k <= radius; k++) {
        const int16_t *below = rows[radius + k];
        const int16_t *above = rows[radius - k];
        const int16x8_t first_below = vld1q_s16(below + at.first);
        const int16x8_t first_above = vld1q_s16(above + at.first);
        const int16x8_t smooth_below = vld1q_s16(below + at.smooth);
        const int16x8_t smooth_above = vld1q_s16(above + at.smooth);
        gx = weigh(gx, vaddq_s16(first_below, first_above), taps->smooth_q15[k]);
        gyy = weigh(gyy, veorq_s16(vaddq_s16(smooth_below, smooth_above), twice_middle),
                    taps->second_q14[k]);
        const int16x8_t second_below = vld1q_s16(below + at.second);
        const int16x8_t second_above = vld1q_s16(above + at.second);
        if (radius == 2) { /* whose sums do not fit */
            gxx = weigh(weigh(gxx, second_below, taps->smooth_q15[k]), second_above, taps->smooth_q15[k]);
        } else {
            gxx = weigh(gxx, vaddq_s16(second_below, second_above), taps->smooth_q15[k]);
        }
        const int16x8_t first_change = vsubq_s16(first_below, first_above);
        const int16x8_t smooth_change = vsubq_s16(smooth_below, smooth_above);
        gxy = k == 1 ? weigh_first(first_change, taps->first_q15[1])
                     : weigh(gxy, first_change, taps->first_q15[k]);
        gy = k == 1 ? weigh_first(smooth_change, taps->first_q15[1])
                    : weigh(gy, smooth_change, taps->first_q15[k]);
    }
    vst1q_s16(out->x_q3 + x, narrow_15(gx));
    vst1q_s16(out->y_q3 + x, narrow_15(gy));
    vst1q_s16(out->xx_q2 + x, narrow_15(gxx));
    vst1q_s16(out->xy_q2 + x, narrow_16(gxy));
    vst1q_s16(out->yy_q2 + x, narrow_15(gyy));
}

static void widen(const uint8_t *bytes, unsigned width, uint16_t *out_grey_q4)
{
    if (width < LANES) {
        dsp_scalar.widen(bytes, width, out_grey_q4);
        return;
    }
    for (unsigned x = 0; x < width; x = next_block(x, width)) {
        vst1q_u16(out_grey_q4 + x, vshll_n_u8(vld1_u8(bytes + x), 4));
    }
}

static inline void halve_block(const uint8_t *above, const uint8_t *below, uint16_t *out_grey_q4)
{
    const uint16x8_t sum = vpadalq_u8(vpaddlq_u8(vld1q_u8(above)), vld1q_u8(below));
    vst1q_u16(out_grey_q4, vshlq_n_u16(sum, 2));
}

static void halve(const uint8_t *above, const uint8_t *below, unsigned width, uint16_t *out_grey_q4)
{
    if (width < LANES) {
        dsp_scalar.halve(above, below, width, out_grey_q4);
        return;
    }
    for (unsigned x = 0; x < width - LANES; x += LANES) {
        halve_block(above + 2 * x, below + 2 * x, out_grey_q4 + x);
    }
    const unsigned x = width - LANES;
    halve_block(above + 2 * x, below + 2 * x, out_grey_q4 + x);
}

#include "firmware/detect/dsp_along.h"

/* The steered derivative of four pixels over 2^14, see dsp_x86_rows.h. */
static inline int32x4_t steered(int16x4_t gx, int16x4_t gy, int16x4_t gxx, int16x4_t gxy,
                                int16x4_t gyy)
{
    const int32x4_t u = vmlal_s16(vmull_s16(gx, gxx), gy, gxy);
    const int32x4_t v = vmlal_s16(vmull_s16(gx, gxy), gy, gyy);
    const int32x4_t upper =
        vmlal_s16(vmull_s16(gx, vrshrn_n_s32(u, 16)), gy, vrshrn_n_s32(v, 16));
    const int32x4_t lower = vmlal_s16(vmull_s16(gx, vmovn_s32(u)), gy, vmovn_s32(v));
    return vsraq_n_s32(vshlq_n_s32(upper, 2), lower, 14);
}

static inline int32x4_t square(int16x4_t gx, int16x4_t gy)
{
    return vmlal_s16(vmull_s16(gx, gx), gy, gy);
}

/* The highest bits of eight masks, the first in the lowest bit. */
static inline uint8_t bits_of(uint8x8_t masks)
{
    static const uint8_t places[8] = {1, 2, 4, 8, 16, 32, 64, 128};
    const uint8x8_t bits = vand_u8(masks, vld1_u8(places));
#if defined(__aarch64__)
    return vaddv_u8(bits);
#else
    return (uint8_t)vget_lane_u64(vpaddl_u32(vpaddl_u16(vpaddl_u8(bits))), 0);
#endif
}

static void sides(uint32_t threshold_q6, unsigned width, const struct dsp_gradient *out)
{
    if (width < LANES) {
        dsp_scalar.sides(threshold_q6, width, out);
        return;
    }
    const struct dsp_gradient own = *out;
    const int32x4_t threshold = vdupq_n_s32((int32_t)threshold_q6);
    for (unsigned x = 0; x < width; x = next_block(x, width)) {
        const int16x8_t gx = vld1q_s16(own.x_q3 + x);
        const int16x8_t gy = vld1q_s16(own.y_q3 + x);
        const int32x4_t square_low = square(vget_low_s16(gx), vget_low_s16(gy));
        const int32x4_t square_high = square(vget_high_s16(gx), vget_high_s16(gy));
        const uint16x8_t strong16 = vcombine_u16(vmovn_u32(vcgeq_s32(square_low, threshold)),
                                                 vmovn_u32(vcgeq_s32(square_high, threshold)));
        const uint8x8_t strong = vmovn_u16(strong16);
        uint8_t bright_bits = 0;
        if (vget_lane_u64(vreinterpret_u64_u8(strong), 0) != 0) {
            const int16x8_t gxx = vld1q_s16(own.xx_q2 + x);
            const int16x8_t gxy = vld1q_s16(own.xy_q2 + x);
            const int16x8_t gyy = vld1q_s16(own.yy_q2 + x);
            const int32x4_t low =
                steered(vget_low_s16(gx), vget_low_s16(gy), vget_low_s16(gxx), vget_low_s16(gxy),
                        vget_low_s16(gyy));
            const int32x4_t high =
                steered(vget_high_s16(gx), vget_high_s16(gy), vget_high_s16(gxx),
                        vget_high_s16(gxy), vget_high_s16(gyy));
            const int16x8_t sign = vcombine_s16(vmovn_s32(vshrq_n_s32(low, 31)),
                                                vmovn_s32(vshrq_n_s32(high, 31)));
            bright_bits = bits_of(vand_u8(vreinterpret_u8_s8(vmovn_s16(sign)), strong));
            vst1q_u32(own.square_q6 + x, vreinterpretq_u32_s32(square_low));
            vst1q_u32(own.square_q6 + x + 4, vreinterpretq_u32_s32(square_high));
            vst1q_s32(own.steered_qm6 + x, low);
            vst1q_s32(own.steered_qm6 + x + 4, high);
        }
        /* The last block overlaps the one before it: its upper bits are new. */
        const unsigned overlap = (0u - x) % LANES;
        own.strong[(x + overlap) / 8] = (uint8_t)(bits_of(strong) >> overlap);
        own.bright[(x + overlap) / 8] = (uint8_t)(bright_bits >> overlap);
    }
    dsp_end_bits(&own, width);
}

/* The products of one row with all columns before it; `row` is known where this is inlined, so that the sums
 * live in registers. */
static inline __attribute__((always_inline)) void row_products(const int16_t *columns, unsigned row,
                                                               unsigned count, int64_t *sums)
{
    int32x4_t partial[DSP_COLUMNS];
    for (unsigned col = 0; col <= row; col++) {
        partial[col] = vdupq_n_s32(0);
    }
    for (unsigned k = 0; k < count; k += LANES) {
        const int16x8_t own = vld1q_s16(columns + row * DSP_BATCH + k);
        for (unsigned col = 0; col <= row; col++) {
            const int16x8_t other = vld1q_s16(columns + col * DSP_BATCH + k);
            partial[col] = vmlal_s16(partial[col], vget_low_s16(own), vget_low_s16(other));
            partial[col] = vmlal_s16(partial[col], vget_high_s16(own), vget_high_s16(other));
        }
    }
    for (unsigned col = 0; col <= row; col += 2) {
        const int32x4_t even = partial[col];
        const int32x4_t odd = partial[col < row ? col + 1 : col];
        const int32x2_t two = vpadd_s32(vadd_s32(vget_low_s32(even), vget_high_s32(even)),
                                        vadd_s32(vget_low_s32(odd), vget_high_s32(odd)));
        sums[col] += vget_lane_s32(two, 0);
        if (col < row) {
            sums[col + 1] += vget_lane_s32(two, 1);
        }
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

const struct dsp_kernels dsp_neon = {
    .name = "neon",
    .widen = widen,
    .halve = halve,
    .along_x = along_x,
    .along_y = along_y,
    .sides = sides,
    .products = products,
    .rim_rows = rimrow_rows,
    .rim_span = rimrow_span,
    .rim_octants = rimrow_octants,
};
#endif
