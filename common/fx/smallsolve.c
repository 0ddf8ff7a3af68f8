/* The LDL' factorisation, column by column:
 *   d_j = a_jj - sum_k<j l_jk^2 d_k,   l_ij = (a_ij - sum_k<j l_ik l_jk d_k) / d_j. */
#include "common/fx/smallsolve.h"

#include "common/fx/fx.h"

/* Values in a solve stay below this. */
#define SMALLSOLVE_VALUE_LIMIT ((int64_t)1 << 38)
/* |l_ij| is at most sqrt(a_ii / d_j); with pivots from 2^-22 that is 2^12 at worst: 2^42 in Q30. Beyond raised
 * pivots it may be anything, and is cut here, so that sums of eight products stay below 2^62. */
#define SMALLSOLVE_L_BITS 44

/* 1 / b in Q30, b > 0: 2^60 over it, rounded. */
static int64_t invert_q30(int64_t b_q30)
{
    return fx_div_round((int64_t)1 << 60, b_q30);
}

/* sum / pivot, cut to SMALLSOLVE_L_BITS. */
static int64_t entry_of_l_q30(int64_t sum_q30, int64_t pivot_q30, int64_t over_pivot_q30)
{
    const int64_t limit_q30 = pivot_q30 << (SMALLSOLVE_L_BITS - 30);
    if (fx_abs_i64(sum_q30) > limit_q30) {
        return sum_q30 < 0 ? -((int64_t)1 << SMALLSOLVE_L_BITS) : (int64_t)1 << SMALLSOLVE_L_BITS;
    }
    return fx_mul_wide_q30(sum_q30, over_pivot_q30);
}

bool smallsolve_factor(struct smallsolve *a, int64_t floor_q30)
{
    assert(a->size >= 1 && a->size <= SMALLSOLVE_MAX);
    assert(floor_q30 > 0);
    bool regular = true;
    for (unsigned j = 0; j < a->size; j++) {
        int64_t scaled_q30[SMALLSOLVE_MAX]; /* l_jk d_k */
        int64_t pivot_q30 = a->at_q30[j][j];
        for (unsigned k = 0; k < j; k++) {
            scaled_q30[k] = fx_mul_wide_q30(a->at_q30[j][k], a->at_q30[k][k]);
            pivot_q30 -= fx_mul_wide_q30(scaled_q30[k], a->at_q30[j][k]);
        }
        if (pivot_q30 < floor_q30) {
            pivot_q30 = floor_q30;
            regular = false;
        }
        a->at_q30[j][j] = pivot_q30;
        a->over_pivot_q30[j] = invert_q30(pivot_q30);
        for (unsigned i = j + 1; i < a->size; i++) {
            int64_t sum_q30 = a->at_q30[i][j];
            for (unsigned k = 0; k < j; k++) {
                sum_q30 -= fx_mul_wide_q30(a->at_q30[i][k], scaled_q30[k]);
            }
            a->at_q30[i][j] = entry_of_l_q30(sum_q30, pivot_q30, a->over_pivot_q30[j]);
        }
    }
    return regular;
}

bool smallsolve_solve(const struct smallsolve *factored, int64_t x_q30[])
{
    const unsigned size = factored->size;
    for (unsigned i = 0; i < size; i++) {
        for (unsigned k = 0; k < i; k++) {
            x_q30[i] -= fx_mul_wide_q30(factored->at_q30[i][k], x_q30[k]);
        }
        if (fx_abs_i64(x_q30[i]) > SMALLSOLVE_VALUE_LIMIT) {
            return false;
        }
    }
    for (unsigned i = size; i-- > 0;) {
        /* Above 2^60 already, which what is taken away, 7 times 2^52, does not bring back. */
        if (fx_abs_i64(x_q30[i]) > factored->at_q30[i][i] << 30) {
            return false;
        }
        x_q30[i] = fx_mul_wide_q30(x_q30[i], factored->over_pivot_q30[i]);
        for (unsigned k = i + 1; k < size; k++) {
            x_q30[i] -= fx_mul_wide_q30(factored->at_q30[k][i], x_q30[k]);
        }
        if (fx_abs_i64(x_q30[i]) > SMALLSOLVE_VALUE_LIMIT) {
            return false;
        }
    }
    return true;
}
