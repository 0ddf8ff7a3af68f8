/* The map from board to image: what it fits, what it refuses. */
#include <math.h>
#include <unity.h>

#include "firmware/detect/boardmap.h"

static struct boardmap_pair pairs[64];

void setUp(void) {}
void tearDown(void) {}

/* A view of second order about the board place (6, 3): 130 px a side, turned, bent by some pixels. */
static void view(double u, double v, double *x, double *y)
{
    const double a = u - 6;
    const double b = v - 3;
    *x = 950 + 110 * a - 60 * b + 1.5 * a * a - 0.8 * a * b + 0.4 * b * b;
    *y = 540 + 62 * a + 104 * b - 0.7 * a * a + 1.1 * a * b + 0.9 * b * b;
}

static struct boardmap_pair pair_at(double u, double v)
{
    double x;
    double y;
    view(u, v, &x, &y);
    return (struct boardmap_pair){
        .u_q24 = (int64_t)lround(u * 16777216),
        .v_q24 = (int64_t)lround(v * 16777216),
        .x_px_q16 = (int32_t)lround(x * 65536),
        .y_px_q16 = (int32_t)lround(y * 65536),
    };
}

static uint32_t make_pairs(void)
{
    uint32_t count = 0;
    for (int i = 0; i < 5; i++) {
        for (int j = 0; j < 5; j++) {
            pairs[count++] = pair_at(5.2 + 0.37 * i, 2.3 + 0.31 * j);
        }
    }
    return count;
}

static void second_order_view_is_followed_one_patch_beyond_its_points(void)
{
    struct boardmap map;
    TEST_ASSERT_TRUE(boardmap_fit(pairs, make_pairs(), &map));
    for (double u = 4.4; u < 7.6; u += 0.4) {
        for (double v = 1.4; v < 4.6; v += 0.4) {
            double x;
            double y;
            view(u, v, &x, &y);
            const struct boardmap_point at =
                boardmap_point_at(&map, lround(u * 16777216), lround(v * 16777216));
            /* In the fit's coordinates (a quarter of a side) the points span 0.4, so the pivots of the
             * second-order terms are about 2e-4, and Q30 leaves 2^-30 / 2e-4 = 5e-6 of 4096 px in their
             * coefficients; at the corners, 0.4 from the middle, three such terms make 0.01 px. */
            TEST_ASSERT_TRUE(fabs((double)at.x_q16 / 65536 - x) < 0.01);
            TEST_ASSERT_TRUE(fabs((double)at.y_q16 / 65536 - y) < 0.01);
        }
    }
}

static void derivatives_are_pixels_a_side(void)
{
    struct boardmap map;
    TEST_ASSERT_TRUE(boardmap_fit(pairs, make_pairs(), &map));
    struct boardmap_slopes at;
    boardmap_slopes_at(&map, (int64_t)6 << 24, (int64_t)3 << 24, &at);
    /* At (6, 3) the derivatives are the linear coefficients; good to the second order's 0.01 px a side. */
    TEST_ASSERT_TRUE(fabs((double)at.x_by_u_q16 / 65536 - 110) < 0.01);
    TEST_ASSERT_TRUE(fabs((double)at.x_by_v_q16 / 65536 + 60) < 0.01);
    TEST_ASSERT_TRUE(fabs((double)at.y_by_u_q16 / 65536 - 62) < 0.01);
    TEST_ASSERT_TRUE(fabs((double)at.y_by_v_q16 / 65536 - 104) < 0.01);
}

static void too_few_pairs_are_refused(void)
{
    struct boardmap map;
    (void)make_pairs();
    TEST_ASSERT_FALSE(boardmap_fit(pairs, BOARDMAP_PAIRS_MIN - 1, &map));
}

static void pairs_on_one_line_are_refused(void)
{
    struct boardmap map;
    for (int i = 0; i < 20; i++) {
        pairs[i] = pair_at(5 + 0.1 * i, 3);
    }
    TEST_ASSERT_FALSE(boardmap_fit(pairs, 20, &map));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(second_order_view_is_followed_one_patch_beyond_its_points);
    RUN_TEST(derivatives_are_pixels_a_side);
    RUN_TEST(too_few_pairs_are_refused);
    RUN_TEST(pairs_on_one_line_are_refused);
    return UNITY_END();
}
