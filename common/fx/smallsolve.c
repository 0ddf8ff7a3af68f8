/* Cholesky's factorisation, row by row:
 *   g_ij = (a_ij - sum_k<j g_ik g_jk) / g_jj,   g_ii^2 = a_ii - sum_k<i g_ik^2.
 * The squares of a row of G add up to a_ii, so no entry is above the root of 2 and no sum of products above 2: sums
 * are kept whole, in Q60, and rounded once. A row for which that is not so belongs to no positive definite matrix,
 * and is told by the first entry that leaves less than nothing of a_ii. */
#include "common/fx/smallsolve.h"

#include "common/fx/fx.h"
#include "common/fx/root.h"

/* Solutions stay below this, and so what G' makes of them below eight times the root of two of it. */
#define VALUE_LIMIT_Q30   ((int64_t)1 << 38)
#define FORWARD_LIMIT_Q30 ((int64_t)1 << 42)
/* Of the inverse. */
#define INVERSE_ROOT_LIMIT_Q30 ((int64_t)1 << 40)
#define DIAGONAL_MAX_Q30  ((int64_t)2 << 30)
/* Above the root of 2; squared and added to what a row may have so far it stays below 2^63. */
#define ENTRY_LIMIT_Q30   ((int64_t)3 << 29)
/* The largest systems, which are the frequent ones, get code without loops. */
#define SPECIALISED static inline __attribute__((always_inline))
#define UNROLLED    _Pragma("GCC unroll 8")

SPECIALISED bool factor(struct smallsolve *a, const unsigned size, int64_t floor_q30)
{
    UNROLLED
    for (unsigned i = 0; i < size; i++) {
        int64_t *row_q30 = a->at_q30[i];
        if (row_q30[i] > DIAGONAL_MAX_Q30) {
            return false;
        }
        int64_t left_q60 = row_q30[i] * ((int64_t)1 << 30);
        UNROLLED
        for (unsigned j = 0; j < i; j++) {
            int64_t sum_q60 = row_q30[j] * ((int64_t)1 << 30);
            UNROLLED
            for (unsigned k = 0; k < j; k++) {
                sum_q60 -= row_q30[k] * a->at_q30[j][k];
            }
            /* Both below 2^62, and 1 / g_jj below 2^41. */
            const int64_t entry_q30 = fx_round_shift_i64(fx_mul_wide_q30(sum_q60 >> 14, a->over_q30[j]), 16);
            if (fx_abs_i64(entry_q30) > ENTRY_LIMIT_Q30) {
                return false;
            }
            row_q30[j] = entry_q30;
            left_q60 -= entry_q30 * entry_q30;
            if (left_q60 < floor_q30 << 30) {
                return false;
            }
        }
        if (left_q60 < floor_q30 << 30) {
            return false;
        }
        row_q30[i] = root_u64((uint64_t)left_q60);
        a->over_q30[i] = fx_div_round((int64_t)1 << 60, row_q30[i]);
    }
    return true;
}

bool smallsolve_factor(struct smallsolve *a, int64_t floor_q30)
{
    assert(a->size >= 1 && a->size <= SMALLSOLVE_MAX);
    assert(floor_q30 >= SMALLSOLVE_FLOOR_MIN_Q30);
    return a->size == SMALLSOLVE_MAX ? factor(a, SMALLSOLVE_MAX, floor_q30) : factor(a, a->size, floor_q30);
}

SPECIALISED bool solve(const struct smallsolve *factored, const unsigned size, int64_t x_q30[])
{
    UNROLLED
    for (unsigned i = 0; i < size; i++) {
        fx_wide sum_q60 = fx_wide_product(x_q30[i], (int64_t)1 << 30);
        UNROLLED
        for (unsigned k = 0; k < i; k++) {
            sum_q60 = fx_wide_difference(sum_q60, fx_wide_product(factored->at_q30[i][k], x_q30[k]));
        }
        /* Below 2^76, and 1 / g_ii below 2^41. */
        x_q30[i] = fx_mul_wide_q30(fx_wide_shift_30(sum_q60), factored->over_q30[i]);
        if (fx_abs_i64(x_q30[i]) > FORWARD_LIMIT_Q30) {
            return false;
        }
    }
    UNROLLED
    for (unsigned i = size; i-- > 0;) {
        fx_wide sum_q60 = fx_wide_product(x_q30[i], (int64_t)1 << 30);
        UNROLLED
        for (unsigned k = i + 1; k < size; k++) {
            sum_q60 = fx_wide_difference(sum_q60, fx_wide_product(factored->at_q30[k][i], x_q30[k]));
        }
        x_q30[i] = fx_mul_wide_q30(fx_wide_shift_30(sum_q60), factored->over_q30[i]);
        if (fx_abs_i64(x_q30[i]) > VALUE_LIMIT_Q30) {
            return false;
        }
    }
    return true;
}

bool smallsolve_solve(const struct smallsolve *factored, int64_t x_q30[])
{
    return factored->size == SMALLSOLVE_MAX ? solve(factored, SMALLSOLVE_MAX, x_q30)
                                            : solve(factored, factored->size, x_q30);
}

bool smallsolve_invert_last(const struct smallsolve *factored, int64_t *xx_q30, int64_t *xy_q30, int64_t *yy_q30)
{
    assert(factored->size >= 2);
    const unsigned last = factored->size - 1;
    const int64_t over_x_q30 = factored->over_q30[last - 1];
    const int64_t over_y_q30 = factored->over_q30[last];
    /* (g_xx 0; g_yx g_yy)^-1, below the diagonal. */
    const int64_t lean_q30 =
        -fx_mul_wide_q30(fx_mul_wide_q30(factored->at_q30[last][last - 1], over_x_q30), over_y_q30);
    if (over_x_q30 > INVERSE_ROOT_LIMIT_Q30 || over_y_q30 > INVERSE_ROOT_LIMIT_Q30 ||
        fx_abs_i64(lean_q30) > INVERSE_ROOT_LIMIT_Q30) {
        return false;
    }
    *xx_q30 = fx_mul_wide_q30(over_x_q30, over_x_q30) + fx_mul_wide_q30(lean_q30, lean_q30);
    *xy_q30 = fx_mul_wide_q30(lean_q30, over_y_q30);
    *yy_q30 = fx_mul_wide_q30(over_y_q30, over_y_q30);
    return true;
}
