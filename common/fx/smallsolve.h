/* Symmetric positive definite systems of up to SMALLSOLVE_MAX unknowns, in Q30.
 *
 * Range: the caller scales the system so that the diagonal entries lie in (0, 2] and the others and
 * the right-hand side in [-2, 2]; solutions up to 2^8 come out, larger ones are refused. Divisions round to
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

/* A = L D L', L with a unit diagonal. The strict lower part holds L, the diagonal D; over_pivot is 1 / D, so
 * that a column costs one division. */
struct smallsolve {
    int64_t at_q30[SMALLSOLVE_MAX][SMALLSOLVE_MAX];
    int64_t over_pivot_q30[SMALLSOLVE_MAX];
    unsigned size;
};

/* Factors the lower triangle of a_q30 in place. A pivot below floor_q30 (> 0) is raised to it and
 * `smallsolve_factor` says false: the matrix was singular as far as this arithmetic sees; what
 * comes out of a solve is then dominated by the null vector, which is what inverse iteration wants. */
bool smallsolve_factor(struct smallsolve *a, int64_t floor_q30);

/* Solves L D L' x = b in place. False when a value leaves the range: nothing useful is in x then. */
bool smallsolve_solve(const struct smallsolve *factored, int64_t x_q30[]);

#ifdef __cplusplus
}
#endif

#endif
