/* See areafit.h. Points are taken from an origin among them, so that with fewer than 2^b points a coordinate is below
 * 2^(b - 1) px; it is held with 20 - b fractional bits, below 2^19. A step's cross product has then
 * 40 - 2 b fractional bits and is below 2^(40 - b). */
#include "firmware/detect/areafit.h"

#include "common/fx/fx.h"

#define COORDINATE_BITS 20u
/* Dropped from products before a sum over all points is made of them. */
#define FIRST_DROP      18u
#define CUBE_DROP       17u
/* 2 A of the smallest area: n^2 / 64 for n = 2^(b - 1), with 40 - 2 b fractional bits. */
#define AREA2_MIN       ((int64_t)1 << 32)
#define OFFSET_MAX_Q16  ((int64_t)512 << 16)

struct sums {
    int64_t area2;   /* sum c: twice the area                          */
    int64_t cubes;   /* sum (c >> CUBE_DROP)^3                         */
    int64_t x;       /* sum (w x >> FIRST_DROP), w = c before + c after */
    int64_t y;
    int64_t xx;      /* sum (w x >> FIRST_DROP) x                      */
    int64_t xy;
    int64_t yy;
};

/* Where coordinates count from, and how many bits of theirs are dropped. */
struct origin {
    int64_t  x_px_q16;
    int64_t  y_px_q16;
    unsigned drop;
};

static struct origin choose_origin(const int32_t x_px_q16[], const int32_t y_px_q16[], uint32_t count)
{
    struct origin origin = {.drop = fx_bits_u64(count) + 16 - COORDINATE_BITS};
    for (uint32_t quarter = 0; quarter < 4; quarter++) {
        origin.x_px_q16 += x_px_q16[quarter * count / 4];
        origin.y_px_q16 += y_px_q16[quarter * count / 4];
    }
    origin.x_px_q16 >>= 2;
    origin.y_px_q16 >>= 2;
    return origin;
}

static void gather_sums(const int32_t x_px_q16[], const int32_t y_px_q16[], uint32_t count,
                        const struct origin *origin, struct sums *out)
{
    const unsigned drop = origin->drop;
    const int64_t half = ((int64_t)1 << drop) >> 1;
    const int64_t from_x = origin->x_px_q16 - half;
    const int64_t from_y = origin->y_px_q16 - half;
    int64_t before_x = (x_px_q16[count - 2] - from_x) >> drop;
    int64_t before_y = (y_px_q16[count - 2] - from_y) >> drop;
    int64_t x = (x_px_q16[count - 1] - from_x) >> drop;
    int64_t y = (y_px_q16[count - 1] - from_y) >> drop;
    int64_t before = before_x * y - x * before_y;
    struct sums sums = {0};
    for (uint32_t i = 0; i < count; i++) {
        const int64_t next_x = (x_px_q16[i] - from_x) >> drop;
        const int64_t next_y = (y_px_q16[i] - from_y) >> drop;
        const int64_t after = x * next_y - next_x * y;
        const int64_t share = after >> CUBE_DROP;
        const int64_t weight = before + after;
        /* Below 2^(41 - b + 19); once cut, times 2^19 and 2^b points below 2^61. */
        const int64_t weighted_x = (weight * x) >> FIRST_DROP;
        const int64_t weighted_y = (weight * y) >> FIRST_DROP;
        sums.area2 += after;
        sums.cubes += share * share * share;
        sums.x += weighted_x;
        sums.y += weighted_y;
        sums.xx += weighted_x * x;
        sums.xy += weighted_x * y;
        sums.yy += weighted_y * y;
        before = after;
        x = next_x;
        y = next_y;
    }
    *out = sums;
}

/* The area over pi, Q12 px^2; negative for what is no ellipse. The contour's own area is a polygon's: where a step
 * subtends the angle a in the unit frame, c = sin a stands for a = c + c^3 / 6, with c in units of A / pi. */
static int64_t area_over_pi_q12(const struct sums *sums, unsigned fraction_bits)
{
    /* 2^15 to 2^23, so that cubes / unit is below 2^46. */
    const int64_t unit = sums->area2 >> CUBE_DROP;
    const int64_t share = sums->cubes / unit;
    if (fx_abs_i64(share) > unit * unit / 32) {
        return -1; /* a fifth of the area */
    }
    /* (2 pi)^2 / 6 = 421 / 64. */
    const int64_t missing = share * 421 * ((int64_t)1 << (CUBE_DROP - 6)) / unit;
    /* 1 / (2 pi) in Q24; the area is below 2^41. */
    return fx_round_shift_i64(fx_abs_i64(sums->area2 + missing) * FX_Q(0.15915494309, 24),
                              24 + fraction_bits - 12);
}

/* 4 (moment / area - offset x offset), Q12 px^2, of which `quotient` is the first part with fraction_bits. */
static int64_t shape_q12(int64_t quotient, unsigned fraction_bits, int64_t offset_product_q32)
{
    return fx_round_shift_i64(quotient, fraction_bits - 12) - fx_round_shift_i64(offset_product_q32, 18);
}

bool areafit_ellipse(const int32_t x_px_q16[], const int32_t y_px_q16[], uint32_t count,
                     struct areafit *out)
{
    assert(count >= AREAFIT_POINTS_MIN && count <= AREAFIT_POINTS_MAX);
    const struct origin origin = choose_origin(x_px_q16, y_px_q16, count);
    const unsigned fraction_bits = 2 * (16 - origin.drop);
    struct sums sums;
    gather_sums(x_px_q16, y_px_q16, count, &origin, &sums);
    if (fx_abs_i64(sums.area2) < AREA2_MIN) {
        return false;
    }
    /* sum w x = 2 sum c x = 6 A m_x. */
    const int64_t area6 = 3 * fx_round_shift_i64(sums.area2, FIRST_DROP);
    const int64_t dx_q16 = sums.x * ((int64_t)1 << origin.drop) / area6;
    const int64_t dy_q16 = sums.y * ((int64_t)1 << origin.drop) / area6;
    const int64_t area_q12 = area_over_pi_q12(&sums, fraction_bits);
    if (fx_abs_i64(dx_q16) > OFFSET_MAX_Q16 || fx_abs_i64(dy_q16) > OFFSET_MAX_Q16 ||
        area_q12 < 0 || area_q12 > ELLIPSE_SHAPE_MAX_PX2_Q12) {
        return false;
    }
    /* sum w x^2 = 8 A m_xx, which over 2 A is 4 m_xx. Both are lifted as far as there is room: large ellipses want
     * every bit. */
    const unsigned bits = fx_bits_u64((uint64_t)fx_abs_i64(sums.xx) | (uint64_t)fx_abs_i64(sums.xy) |
                                      (uint64_t)fx_abs_i64(sums.yy));
    const unsigned lift = bits + FIRST_DROP < 62 ? FIRST_DROP : 62 - bits;
    const int64_t unit = (int64_t)1 << lift;
    const int64_t area2 = fx_scale_i64(sums.area2, (int)lift - (int)FIRST_DROP);
    const int64_t sxx = shape_q12(sums.xx * unit / area2, fraction_bits, dx_q16 * dx_q16);
    const int64_t sxy = shape_q12(sums.xy * unit / area2, fraction_bits, dx_q16 * dy_q16);
    const int64_t syy = shape_q12(sums.yy * unit / area2, fraction_bits, dy_q16 * dy_q16);
    if (sxx < ELLIPSE_SHAPE_MIN_PX2_Q12 || syy < ELLIPSE_SHAPE_MIN_PX2_Q12 ||
        sxx > ELLIPSE_SHAPE_MAX_PX2_Q12 || syy > ELLIPSE_SHAPE_MAX_PX2_Q12 ||
        fx_abs_i64(sxy) > ELLIPSE_SHAPE_MAX_PX2_Q12) {
        return false;
    }
    /* mean u^2 = 1 - A / (pi a b), nearly half of 1 - (A / pi)^2 / det S; a distance is u / 2 over the root of the
     * mean of 1 / a^2 and 1 / b^2, which is tr S / (2 det S). */
    const int64_t lack_q24 = sxx * syy - sxy * sxy - area_q12 * area_q12;
    out->residual_px2_q12 = lack_q24 > 0 ? fx_saturate_i32(lack_q24 / (4 * (sxx + syy))) : 0;
    out->clockwise = sums.area2 > 0;
    out->ellipse = (struct ellipse){
        .x_px_q16 = fx_saturate_i32(origin.x_px_q16 + dx_q16),
        .y_px_q16 = fx_saturate_i32(origin.y_px_q16 + dy_q16),
        .shape_xx_px2_q12 = (int32_t)sxx,
        .shape_xy_px2_q12 = (int32_t)sxy,
        .shape_yy_px2_q12 = (int32_t)syy,
    };
    return true;
}
