/* Small symmetric systems against Gaussian elimination in double. */
#include "common/fx/smallsolve.h"

#include <math.h>
#include <string.h>
#include <unity.h>

#include "tests/unit/synth.h"

static const double one_q30 = 1073741824.0;

void setUp(void) {}
void tearDown(void) {}

/* A = B B' + ridge I, scaled to a unit diagonal: positive definite with entries in [-1, 1]. The lower
 * triangle goes to `fixed` rounded to Q30 and all of it, so rounded, to `exact`. */
static void random_system(uint64_t *seed, unsigned n, double ridge, struct smallsolve *fixed,
                          double exact[SMALLSOLVE_MAX][SMALLSOLVE_MAX])
{
    double b[SMALLSOLVE_MAX][SMALLSOLVE_MAX];
    double a[SMALLSOLVE_MAX][SMALLSOLVE_MAX];
    for (unsigned i = 0; i < n; i++) {
        for (unsigned j = 0; j < n; j++) {
            b[i][j] = synth_normal(seed, 1);
        }
    }
    for (unsigned i = 0; i < n; i++) {
        for (unsigned j = 0; j < n; j++) {
            a[i][j] = i == j ? ridge : 0;
            for (unsigned k = 0; k < n; k++) {
                a[i][j] += b[i][k] * b[j][k];
            }
        }
    }
    memset(fixed, 0x5a, sizeof *fixed); /* what lies above the diagonal is nobody's business */
    fixed->size = n;
    for (unsigned i = 0; i < n; i++) {
        for (unsigned j = 0; j <= i; j++) {
            fixed->at_q30[i][j] = llrint(one_q30 * a[i][j] / sqrt(a[i][i] * a[j][j]));
            exact[i][j] = exact[j][i] = (double)fixed->at_q30[i][j] / one_q30;
        }
    }
}

/* Elimination without pivoting, safe for positive definite matrices; gives the smallest pivot. */
static double solve_exactly(unsigned n, double a[SMALLSOLVE_MAX][SMALLSOLVE_MAX],
                            double x[SMALLSOLVE_MAX])
{
    double smallest = a[0][0];
    for (unsigned k = 0; k < n; k++) {
        smallest = fmin(smallest, a[k][k]);
        for (unsigned i = k + 1; i < n; i++) {
            const double factor = a[i][k] / a[k][k];
            for (unsigned j = k; j < n; j++) {
                a[i][j] -= factor * a[k][j];
            }
            x[i] -= factor * x[k];
        }
    }
    for (unsigned k = n; k-- > 0;) {
        for (unsigned j = k + 1; j < n; j++) {
            x[k] -= a[k][j] * x[j];
        }
        x[k] /= a[k][k];
    }
    return smallest;
}

/* The header's bound: 2^-12 of the largest entry while pivots are above 2^-16 (floor 2^-16) and the solution
 * is at most 2^8. */
static void solutions_agree_with_double_within_the_stated_error(void)
{
    uint64_t seed = 4;
    unsigned tried = 0;
    for (unsigned round = 0; round < 4000; round++) {
        const unsigned n = 1 + round % SMALLSOLVE_MAX;
        struct smallsolve fixed;
        double a[SMALLSOLVE_MAX][SMALLSOLVE_MAX];
        double x[SMALLSOLVE_MAX];
        int64_t x_q30[SMALLSOLVE_MAX];
        random_system(&seed, n, pow(10, -4 * synth_uniform(&seed)), &fixed, a);
        for (unsigned i = 0; i < n; i++) {
            x_q30[i] = llrint(one_q30 * (4 * synth_uniform(&seed) - 2));
            x[i] = (double)x_q30[i] / one_q30;
        }
        const double pivot = solve_exactly(n, a, x);
        double largest = 0;
        for (unsigned i = 0; i < n; i++) {
            largest = fmax(largest, fabs(x[i]));
        }
        if (pivot < 1.1 / 65536 || largest > 250) {
            continue;
        }
        tried++;
        TEST_ASSERT_TRUE(smallsolve_factor(&fixed, 1 << 14));
        TEST_ASSERT_TRUE(smallsolve_solve(&fixed, x_q30));
        for (unsigned i = 0; i < n; i++) {
            SYNTH_NEAR(largest / 4096, x[i], (double)x_q30[i] / one_q30);
        }
    }
    TEST_ASSERT_TRUE(tried > 3000);
}

static void singular_and_indefinite_matrices_are_refused(void)
{
    /* (1 1; 1 1), and (1 2; 2 1), whose eigenvalues are 3 and -1. */
    struct smallsolve a = {.size = 2};
    a.at_q30[0][0] = a.at_q30[1][0] = a.at_q30[1][1] = 1 << 30;
    TEST_ASSERT_FALSE(smallsolve_factor(&a, SMALLSOLVE_FLOOR_MIN_Q30));
    a = (struct smallsolve){.size = 2};
    a.at_q30[0][0] = a.at_q30[1][1] = 1 << 30;
    a.at_q30[1][0] = (int64_t)2 << 30;
    TEST_ASSERT_FALSE(smallsolve_factor(&a, SMALLSOLVE_FLOOR_MIN_Q30));
}

/* A pivot of 1/64: just above the floor, or below it. */
static void the_floor_decides(void)
{
    for (int above = 0; above < 2; above++) {
        struct smallsolve a = {.size = 2};
        a.at_q30[0][0] = a.at_q30[1][0] = 1 << 30;
        a.at_q30[1][1] = (1 << 30) + (1 << 24);
        TEST_ASSERT_EQUAL(above == 0, smallsolve_factor(&a, (1 << 24) + above));
    }
}

static void diagonal_above_two_is_refused(void)
{
    for (int above = 0; above < 2; above++) {
        struct smallsolve a = {.size = 1};
        a.at_q30[0][0] = ((int64_t)2 << 30) + above;
        TEST_ASSERT_EQUAL(above == 0, smallsolve_factor(&a, 1 << 24));
    }
}

/* The last rows of the unit matrix, solved for, are the last columns of the inverse. */
static void last_block_of_the_inverse_is_what_solving_gives(void)
{
    uint64_t seed = 9;
    for (unsigned round = 0; round < 500; round++) {
        const unsigned n = 2 + round % (SMALLSOLVE_MAX - 1);
        struct smallsolve fixed;
        double a[SMALLSOLVE_MAX][SMALLSOLVE_MAX];
        random_system(&seed, n, 0.1, &fixed, a);
        if (!smallsolve_factor(&fixed, 1 << 20)) {
            continue;
        }
        int64_t block_q30[3];
        TEST_ASSERT_TRUE(smallsolve_invert_last(&fixed, &block_q30[0], &block_q30[1], &block_q30[2]));
        for (unsigned i = 0; i < 2; i++) {
            int64_t column_q30[SMALLSOLVE_MAX] = {0};
            column_q30[n - 2 + i] = 1 << 30;
            TEST_ASSERT_TRUE(smallsolve_solve(&fixed, column_q30));
            const double tolerance = 1e-5 * (1 + fabs((double)column_q30[n - 2 + i]) / one_q30) * one_q30;
            SYNTH_NEAR(tolerance, (double)column_q30[n - 2], (double)block_q30[i]);
            SYNTH_NEAR(tolerance, (double)column_q30[n - 1], (double)block_q30[i + 1]);
        }
    }
}

static void solution_beyond_the_range_is_refused(void)
{
    struct smallsolve a = {.size = 1};
    a.at_q30[0][0] = 1 << 14; /* 2^-16 */
    TEST_ASSERT_TRUE(smallsolve_factor(&a, 1 << 13));
    int64_t x_q30[1] = {1 << 30};
    TEST_ASSERT_FALSE(smallsolve_solve(&a, x_q30)); /* 2^16 > 2^8 */
}

static void unit_matrix_gives_the_right_side_back(void)
{
    struct smallsolve a = {.size = SMALLSOLVE_MAX};
    int64_t x_q30[SMALLSOLVE_MAX];
    for (unsigned i = 0; i < SMALLSOLVE_MAX; i++) {
        a.at_q30[i][i] = 1 << 30;
        x_q30[i] = (int64_t)i * 123456789 - ((int64_t)1 << 28);
    }
    TEST_ASSERT_TRUE(smallsolve_factor(&a, SMALLSOLVE_FLOOR_MIN_Q30));
    TEST_ASSERT_TRUE(smallsolve_solve(&a, x_q30));
    for (unsigned i = 0; i < SMALLSOLVE_MAX; i++) {
        TEST_ASSERT_EQUAL_INT64((int64_t)i * 123456789 - ((int64_t)1 << 28), x_q30[i]);
    }
}

/* Matrices that are mostly not positive definite, as far as entries may be. With SAN=1 an overflow ends the program.
 * What a factorisation lets through has pivots from the floor on, and what a solve does is within its range. */
static void no_matrix_overflows(void)
{
    uint64_t seed = 56;
    unsigned refused = 0;
    unsigned solved = 0;
    for (unsigned round = 0; round < 40000; round++) {
        struct smallsolve a = {.size = 1 + round % SMALLSOLVE_MAX};
        int64_t x_q30[SMALLSOLVE_MAX];
        const double spread = round % 5 == 0 ? 0.02 : 1;
        for (unsigned i = 0; i < a.size; i++) {
            for (unsigned j = 0; j <= i; j++) {
                const double at = round % 3 ? 4 * synth_uniform(&seed) - 2
                                            : (synth_u64(&seed) & 1 ? 2 : -2);
                a.at_q30[i][j] = llrint(one_q30 * (i == j ? fabs(at) : spread * at));
            }
            if (synth_u64(&seed) % 4 == 0) {
                a.at_q30[i][i] = 1 + (int64_t)(synth_u64(&seed) % 4096);
            }
            x_q30[i] = synth_u64(&seed) & 1 ? (int64_t)2 << 30 : -((int64_t)2 << 30);
        }
        const int64_t floor_q30 = (int64_t)SMALLSOLVE_FLOOR_MIN_Q30 << round / 8 % 16;
        if (!smallsolve_factor(&a, floor_q30)) {
            refused++;
            continue;
        }
        for (unsigned i = 0; i < a.size; i++) {
            const double root = (double)(a.at_q30[i][i] + 1);
            TEST_ASSERT_TRUE(root * root >= (double)floor_q30 * one_q30);
        }
        if (smallsolve_solve(&a, x_q30)) {
            solved++;
            for (unsigned i = 0; i < a.size; i++) {
                TEST_ASSERT_TRUE(fabs((double)x_q30[i] / one_q30) <= 256);
            }
        }
    }
    TEST_ASSERT_TRUE(refused > 10000);
    TEST_ASSERT_TRUE(solved > 3000);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(solutions_agree_with_double_within_the_stated_error);
    RUN_TEST(singular_and_indefinite_matrices_are_refused);
    RUN_TEST(the_floor_decides);
    RUN_TEST(diagonal_above_two_is_refused);
    RUN_TEST(last_block_of_the_inverse_is_what_solving_gives);
    RUN_TEST(solution_beyond_the_range_is_refused);
    RUN_TEST(unit_matrix_gives_the_right_side_back);
    RUN_TEST(no_matrix_overflows);
    return UNITY_END();
}
