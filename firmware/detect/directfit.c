/* See directfit.h for the method. Notation: w = (x, y) are whitened coordinates; the monomials are
 * split as q = (x^2, x y, y^2) and l = (x, y, 1). */
#include "firmware/detect/directfit.h"

#include "common/fx/fx.h"
#include "common/fx/root.h"
#include "common/fx/smallsolve.h"

#define WHITE_LIMIT_Q22  ((int64_t)2 << 22)
#define ITERATIONS       6
#define PIVOT_MIN_Q30    ((int64_t)1 << 16)
#define PIVOT_FLOOR_Q30  4

/* px = mean + 2 L w, with L the lower triangular root of the points' covariance. */
struct whitening {
    int64_t mean_x_px_q16;
    int64_t mean_y_px_q16;
    int64_t xx_px_q16; /* L */
    int64_t yx_px_q16;
    int64_t yy_px_q16;
    int64_t over_xx_q50;  /* 2^50 / xx_px_q16 */
    int64_t over_yy_q50;
    int64_t slope_q24;    /* yx / xx */
};

/* Means of the products of monomials, Q30. */
struct moments {
    int64_t quadratic_q30[3][3]; /* S1 / n */
    int64_t mixed_q30[3][3];     /* S2 / n: rows q, columns l */
    int64_t linear_q30[3][3];    /* S3 / n */
};

static bool make_whitening(const int32_t x_px_q16[], const int32_t y_px_q16[], uint32_t count,
                           struct whitening *w)
{
    int64_t sum_x = 0;
    int64_t sum_y = 0;
    for (uint32_t i = 0; i < count; i++) {
        sum_x += x_px_q16[i];
        sum_y += y_px_q16[i];
    }
    w->mean_x_px_q16 = fx_div_round(sum_x, count);
    w->mean_y_px_q16 = fx_div_round(sum_y, count);

    /* Offsets in Q8 are below 2^22, so 4096 squares stay below 2^56. */
    int64_t sum_xx = 0;
    int64_t sum_xy = 0;
    int64_t sum_yy = 0;
    for (uint32_t i = 0; i < count; i++) {
        const int64_t dx_q8 = fx_round_shift_i64(x_px_q16[i] - w->mean_x_px_q16, 8);
        const int64_t dy_q8 = fx_round_shift_i64(y_px_q16[i] - w->mean_y_px_q16, 8);
        sum_xx += dx_q8 * dx_q8;
        sum_xy += dx_q8 * dy_q8;
        sum_yy += dy_q8 * dy_q8;
    }
    const int64_t xx_px2_q16 = sum_xx / count;
    const int64_t xy_px2_q16 = sum_xy / count;
    const int64_t yy_px2_q16 = sum_yy / count;
    if (xx_px2_q16 <= 0 || yy_px2_q16 <= 0) {
        return false;
    }
    w->xx_px_q16 = root_u64((uint64_t)xx_px2_q16 << 16);
    if (w->xx_px_q16 < 21845) {
        return false;
    }
    w->yx_px_q16 = (xy_px2_q16 * 65536) / w->xx_px_q16;
    const int64_t rest_px2_q32 = (yy_px2_q16 << 16) - w->yx_px_q16 * w->yx_px_q16;
    if (rest_px2_q32 <= 0) {
        return false;
    }
    w->yy_px_q16 = root_u64((uint64_t)rest_px2_q32);
    /* L's determinant is the product of the spreads along and across; the larger is at most the root
     * of the trace. */
    const int64_t along_px_q16 = root_u64((uint64_t)(xx_px2_q16 + yy_px2_q16) << 16);
    const int64_t across_px_q16 = w->xx_px_q16 * w->yy_px_q16 / along_px_q16;
    if (w->yy_px_q16 < 21845 || across_px_q16 < 21845 || across_px_q16 * 8 < along_px_q16) {
        return false;
    }
    w->over_xx_q50 = ((int64_t)1 << 50) / w->xx_px_q16;
    w->over_yy_q50 = ((int64_t)1 << 50) / w->yy_px_q16;
    w->slope_q24 = (w->yx_px_q16 * ((int64_t)1 << 24)) / w->xx_px_q16;
    return true;
}

/* Sums over the points of all monomials up to the fourth power. False when a point lies outside the
 * range: further than four standard deviations from the mean, where no ellipse's points lie. */
static bool gather_moments(const int32_t x_px_q16[], const int32_t y_px_q16[], uint32_t count,
                           const struct whitening *w, struct moments *m)
{
    int64_t s40 = 0, s31 = 0, s22 = 0, s13 = 0, s04 = 0;
    int64_t s30 = 0, s21 = 0, s12 = 0, s03 = 0;
    int64_t s20 = 0, s11 = 0, s02 = 0, s10 = 0, s01 = 0;
    for (uint32_t i = 0; i < count; i++) {
        const int64_t dx_q16 = x_px_q16[i] - w->mean_x_px_q16;
        const int64_t dy_q16 = y_px_q16[i] - w->mean_y_px_q16 -
                               fx_round_shift_i64(dx_q16 * w->slope_q24, 24);
        /* d / (2 L) in Q22: d * 2^50 / L = Q50, to Q22 and halved. |d| is below 64 L for 4096 points,
         * so the products stay below 2^57. */
        const int64_t x = fx_round_shift_i64(dx_q16 * w->over_xx_q50, 29);
        const int64_t y = fx_round_shift_i64(dy_q16 * w->over_yy_q50, 29);
        if (fx_abs_i64(x) > WHITE_LIMIT_Q22 || fx_abs_i64(y) > WHITE_LIMIT_Q22) {
            return false;
        }
        const int64_t xx = fx_round_shift_i64(x * x, 22);
        const int64_t xy = fx_round_shift_i64(x * y, 22);
        const int64_t yy = fx_round_shift_i64(y * y, 22);
        s40 += xx * xx;
        s31 += xx * xy;
        s22 += xx * yy;
        s13 += xy * yy;
        s04 += yy * yy;
        s30 += xx * x;
        s21 += xx * y;
        s12 += xy * y;
        s03 += yy * y;
        s20 += xx;
        s11 += xy;
        s02 += yy;
        s10 += x;
        s01 += y;
    }
    const int64_t n = count;
    /* Q44 / n -> Q30; the low-order sums are Q22. */
    const int64_t m40 = fx_round_shift_i64(s40 / n, 14), m31 = fx_round_shift_i64(s31 / n, 14);
    const int64_t m22 = fx_round_shift_i64(s22 / n, 14), m13 = fx_round_shift_i64(s13 / n, 14);
    const int64_t m04 = fx_round_shift_i64(s04 / n, 14);
    const int64_t m30 = fx_round_shift_i64(s30 / n, 14), m21 = fx_round_shift_i64(s21 / n, 14);
    const int64_t m12 = fx_round_shift_i64(s12 / n, 14), m03 = fx_round_shift_i64(s03 / n, 14);
    const int64_t m20 = s20 * 256 / n, m11 = s11 * 256 / n, m02 = s02 * 256 / n;
    const int64_t m10 = s10 * 256 / n, m01 = s01 * 256 / n;
    *m = (struct moments){
        .quadratic_q30 = {{m40, m31, m22}, {m31, m22, m13}, {m22, m13, m04}},
        .mixed_q30 = {{m30, m21, m20}, {m21, m12, m11}, {m12, m03, m02}},
        .linear_q30 = {{m20, m11, m10}, {m11, m02, m01}, {m10, m01, (int64_t)1 << 30}},
    };
    return true;
}

/* The lower triangle of M = S1 - S2 S3^-1 S2' in schur_q30 and the rows of S2 S3^-1 in eliminated_q30. */
static bool eliminate_linear(const struct moments *m, int64_t schur_q30[3][3],
                             int64_t eliminated_q30[3][3])
{
    struct smallsolve linear = {.size = 3};
    for (unsigned i = 0; i < 3; i++) {
        for (unsigned j = 0; j < 3; j++) {
            linear.at_q30[i][j] = m->linear_q30[i][j];
            eliminated_q30[i][j] = m->mixed_q30[i][j];
        }
    }
    if (!smallsolve_factor(&linear, (int64_t)1 << 18)) {
        return false;
    }
    for (unsigned i = 0; i < 3; i++) {
        if (!smallsolve_solve(&linear, eliminated_q30[i])) {
            return false;
        }
        for (unsigned j = 0; j < 3; j++) {
            if (fx_abs_i64(eliminated_q30[i][j]) > ((int64_t)16 << 30)) {
                return false;
            }
        }
    }
    for (unsigned i = 0; i < 3; i++) {
        for (unsigned j = 0; j <= i; j++) {
            int64_t sum_q30 = m->quadratic_q30[i][j];
            for (unsigned k = 0; k < 3; k++) {
                sum_q30 -= fx_round_shift_i64(m->mixed_q30[j][k] * (eliminated_q30[i][k] >> 4), 26);
            }
            schur_q30[i][j] = sum_q30;
        }
    }
    return true;
}

/* Scales v so that its largest entry is 1. False for the zero vector. */
static bool normalise(int64_t v_q30[3])
{
    int64_t largest = 0;
    for (unsigned i = 0; i < 3; i++) {
        const int64_t size = fx_abs_i64(v_q30[i]);
        largest = size > largest ? size : largest;
    }
    if (largest == 0) {
        return false;
    }
    const int drop = (int)fx_bits_i64(largest) - 32;
    largest = fx_scale_i64(largest, -drop);
    for (unsigned i = 0; i < 3; i++) {
        v_q30[i] = (fx_scale_i64(v_q30[i], -drop) * ((int64_t)1 << 30)) / largest;
    }
    return true;
}

/* A symmetric matrix of 3 as L D L', L with a unit diagonal. The last pivot, which vanishes for points on an ellipse,
 * is raised to PIVOT_FLOOR_Q30. */
struct factors {
    int64_t l10_q30; /* at most 4, like the others */
    int64_t l20_q30;
    int64_t l21_q30;
    int64_t d0_q30;  /* at least 2^-14, like the next */
    int64_t d1_q30;
    int64_t d2_q30;
};

/* part / pivot, cut beyond 4. False there. */
static bool take_factor(int64_t part_q30, int64_t pivot_q30, int64_t *l_q30)
{
    if (pivot_q30 < PIVOT_MIN_Q30 || fx_abs_i64(part_q30) > 4 * pivot_q30) {
        return false;
    }
    *l_q30 = fx_div_round(part_q30 * ((int64_t)1 << 30), pivot_q30);
    return true;
}

static bool factor_schur(int64_t m_q30[3][3], struct factors *f)
{
    f->d0_q30 = m_q30[0][0];
    if (!take_factor(m_q30[1][0], f->d0_q30, &f->l10_q30) || !take_factor(m_q30[2][0], f->d0_q30, &f->l20_q30)) {
        return false;
    }
    f->d1_q30 = m_q30[1][1] - fx_mul_q30(f->l10_q30, m_q30[1][0]);
    const int64_t part21_q30 = m_q30[2][1] - fx_mul_q30(f->l20_q30, m_q30[1][0]);
    if (!take_factor(part21_q30, f->d1_q30, &f->l21_q30)) {
        return false;
    }
    f->d2_q30 = m_q30[2][2] - fx_mul_q30(f->l20_q30, m_q30[2][0]) - fx_mul_q30(f->l21_q30, part21_q30);
    f->d2_q30 = f->d2_q30 < PIVOT_FLOOR_Q30 ? PIVOT_FLOOR_Q30 : f->d2_q30;
    return true;
}

/* The eigenvector of M v = lambda C v for the positive lambda, by v <- M^-1 C v. Each step is scaled by
 * the last pivot of M, the one that vanishes for points on an ellipse: it cancels in the direction. */
static bool find_conic(int64_t schur_q30[3][3], int64_t v_q30[3])
{
    struct factors f;
    if (!factor_schur(schur_q30, &f)) {
        return false;
    }
    const int64_t l10 = f.l10_q30;
    const int64_t l20 = f.l20_q30;
    const int64_t l21 = f.l21_q30;
    const int64_t ratio0_q30 = fx_div_round(f.d2_q30 * ((int64_t)1 << 30), f.d0_q30);
    const int64_t ratio1_q30 = fx_div_round(f.d2_q30 * ((int64_t)1 << 30), f.d1_q30);
    if (ratio0_q30 > ((int64_t)1 << 30) || ratio1_q30 > ((int64_t)1 << 30)) {
        return false; /* nothing like an ellipse: the residual is as large as the spread */
    }
    v_q30[0] = (int64_t)1 << 30;
    v_q30[1] = 0;
    v_q30[2] = (int64_t)1 << 30;
    for (unsigned i = 0; i < ITERATIONS; i++) {
        /* C v = (2 c, -b, 2 a); halved here, so that every value stays below 2^37. */
        const int64_t z0 = v_q30[2];
        const int64_t z1 = -v_q30[1] / 2 - fx_mul_q30(l10 / 4, z0) * 4;
        const int64_t z2 = v_q30[0] - fx_mul_q30(l20 / 4, z0) * 4 - fx_mul_q30(l21 / 64, z1) * 64;
        const int64_t x2 = z2 / 16;
        const int64_t x1 = fx_mul_q30(z1 / 16, ratio1_q30) - fx_mul_q30(l21 / 16, x2) * 16;
        const int64_t x0 = fx_mul_q30(z0 / 16, ratio0_q30) - fx_mul_q30(l10 / 64, x1) * 64 -
                           fx_mul_q30(l20 / 16, x2) * 16;
        v_q30[0] = x0;
        v_q30[1] = x1;
        v_q30[2] = x2;
        if (!normalise(v_q30)) {
            return false;
        }
    }
    return true;
}

/* From the conic in whitened coordinates to the ellipse in pixels. */
static bool make_ellipse(const int64_t v_q30[3], int64_t eliminated_q30[3][3],
                         const struct whitening *w, struct ellipse *out)
{
    int64_t linear_q30[3]; /* d, e, f = -(S2 S3^-1)' v */
    for (unsigned k = 0; k < 3; k++) {
        int64_t sum_q30 = 0;
        for (unsigned i = 0; i < 3; i++) {
            sum_q30 -= fx_round_shift_i64(v_q30[i] * (eliminated_q30[i][k] >> 4), 26);
        }
        linear_q30[k] = sum_q30;
        if (fx_abs_i64(sum_q30) > ((int64_t)1 << 34)) {
            return false;
        }
    }
    const int64_t a = v_q30[0];
    const int64_t b = v_q30[1];
    const int64_t c = v_q30[2];
    const int64_t det_q30 = fx_round_shift_i64(4 * (a * c) - b * b, 30);
    if (det_q30 < ((int64_t)1 << 20)) {
        return false;
    }
    /* Centre: the gradient of the conic vanishes. Products below 2^65 / 4: halved first. */
    const int64_t d = linear_q30[0] / 8;
    const int64_t e = linear_q30[1] / 8;
    const int64_t x_q30 = (b * e - 2 * c * d) / det_q30 * 8;
    const int64_t y_q30 = (b * d - 2 * a * e) / det_q30 * 8;
    if (fx_abs_i64(x_q30) > ((int64_t)4 << 30) || fx_abs_i64(y_q30) > ((int64_t)4 << 30)) {
        return false;
    }
    int64_t level_q30 = -(linear_q30[2] + 4 * fx_mul_q30(d, x_q30) + 4 * fx_mul_q30(e, y_q30));
    int64_t sign = 1;
    if (a < 0) {
        sign = -1;
    }
    level_q30 *= sign;
    if (level_q30 <= 0 || level_q30 > ((int64_t)8 << 30)) {
        return false;
    }
    /* Shape in whitened coordinates: level * 4 / det * (c, -b/2, a). */
    const int64_t factor_q28 = fx_div_round(level_q30 * ((int64_t)1 << 28), det_q30) * 4;
    if (factor_q28 > ((int64_t)64 << 28)) {
        return false;
    }
    const int64_t wxx_q24 = fx_round_shift_i64(factor_q28 / 4 * (sign * c / 4), 30);
    const int64_t wxy_q24 = fx_round_shift_i64(factor_q28 / 4 * (-sign * b / 8), 30);
    const int64_t wyy_q24 = fx_round_shift_i64(factor_q28 / 4 * (sign * a / 4), 30);

    /* To pixels by B = 2 L: S = B W B'. L in Q16 below 2^27, W below 2^29. */
    const int64_t kx = w->xx_px_q16;
    const int64_t ky = w->yx_px_q16;
    const int64_t kz = w->yy_px_q16;
    const int64_t row0_x = fx_round_shift_i64(kx * wxx_q24, 16);
    const int64_t row0_y = fx_round_shift_i64(kx * wxy_q24, 16);
    const int64_t row1_x = fx_round_shift_i64(ky * wxx_q24 + kz * wxy_q24, 16);
    const int64_t row1_y = fx_round_shift_i64(ky * wxy_q24 + kz * wyy_q24, 16);
    /* (Q24 px) * (Q16 px) = Q40; times 4; to Q12. */
    const int64_t sxx = fx_round_shift_i64(row0_x / 16 * kx, 22);
    const int64_t sxy = fx_round_shift_i64(row0_x / 16 * ky + row0_y / 16 * kz, 22);
    const int64_t syy = fx_round_shift_i64(row1_x / 16 * ky + row1_y / 16 * kz, 22);
    if (sxx < ELLIPSE_SHAPE_MIN_PX2_Q12 || syy < ELLIPSE_SHAPE_MIN_PX2_Q12 ||
        sxx > ELLIPSE_SHAPE_MAX_PX2_Q12 || syy > ELLIPSE_SHAPE_MAX_PX2_Q12) {
        return false;
    }
    const int64_t px = w->mean_x_px_q16 + fx_round_shift_i64(2 * kx * x_q30, 30);
    const int64_t py = w->mean_y_px_q16 + fx_round_shift_i64(2 * (ky * x_q30 + kz * y_q30), 30);
    if (fx_abs_i64(px) > ((int64_t)16384 << 16) || fx_abs_i64(py) > ((int64_t)16384 << 16)) {
        return false;
    }
    *out = (struct ellipse){
        .x_px_q16 = (int32_t)px,
        .y_px_q16 = (int32_t)py,
        .shape_xx_px2_q12 = (int32_t)sxx,
        .shape_xy_px2_q12 = fx_saturate_i32(sxy),
        .shape_yy_px2_q12 = (int32_t)syy,
    };
    return true;
}

bool directfit_ellipse(const int32_t x_px_q16[], const int32_t y_px_q16[], uint32_t count,
                       struct ellipse *out)
{
    if (count < DIRECTFIT_POINTS_MIN || count > DIRECTFIT_POINTS_MAX) {
        return false;
    }
    struct whitening whitening;
    struct moments moments;
    int64_t schur_q30[3][3];
    int64_t eliminated_q30[3][3];
    int64_t conic_q30[3];
    return make_whitening(x_px_q16, y_px_q16, count, &whitening) &&
           gather_moments(x_px_q16, y_px_q16, count, &whitening, &moments) &&
           eliminate_linear(&moments, schur_q30, eliminated_q30) &&
           find_conic(schur_q30, conic_q30) &&
           make_ellipse(conic_q30, eliminated_q30, &whitening, out);
}
