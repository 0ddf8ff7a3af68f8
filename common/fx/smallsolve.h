/* Symmetric positive definite systems of up to SMALLSOLVE_MAX unknowns, in Q30.
 *
 * Range: the caller scales the system so that the diagonal entries lie in (0, 2] and the others and
 * the right-hand side in [-16, 16]; solutions up to 2^8 come out, larger ones are refused. Divisions round to
 * nearest; with pivots above 2^-16 the solution's error stays below 2^-12 of its largest entry
 * (tests/unit/test_smallsolve.c compares with double). */
#ifndef TESSERA_COMMON_FX_SMALLSOLVE_H
#define TESSERA_COMMON_FX_SMALLSOLVE_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SMALLSOLVE_MAX 8

/* A, and after smallsolve_factor the lower triangle of G in its place: A = G G' (Cholesky). over_q30 is 1 / g_ii.
 * What lies above the diagonal is nobody's business. */
struct smallsolve {
    int64_t  at_q30[SMALLSOLVE_MAX][SMALLSOLVE_MAX];
    int64_t  over_q30[SMALLSOLVE_MAX];
    unsigned size;
};

/* Factors the lower triangle in place. False, and nothing useful is in it, where a pivot (what a_ii keeps of itself
 * beside the unknowns before it, g_ii^2) is below floor_q30: the matrix is singular as far as is wanted, or not
 * positive definite; or where a diagonal entry is above 2. floor_q30 is at least SMALLSOLVE_FLOOR_MIN_Q30. */
#define SMALLSOLVE_FLOOR_MIN_Q30 256
bool smallsolve_factor(struct smallsolve *a, int64_t floor_q30);

/* Solves A x = b in place. False when a value leaves the range: nothing useful is in x then. */
bool smallsolve_solve(const struct smallsolve *factored, int64_t x_q30[]);

/* The last two unknowns' block of A^-1: of the one before the last, of both, of the last. At least two unknowns.
 * False, and nothing set, where a value would be 2^21 or more. */
bool smallsolve_invert_last(const struct smallsolve *factored, int64_t *xx_q30, int64_t *xy_q30, int64_t *yy_q30);

#ifdef __cplusplus
}
#endif

#endif
