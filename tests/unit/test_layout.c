/* The generated positions against the geometry of common/target/TARGET.md, worked out here in
 * double from its own words. */
#include "common/target/layout.h"

#include <math.h>
#include <stdbool.h>
#include <unity.h>

/* A Q30 value is the exact one rounded to nearest: half a step of 2^-30, plus double's rounding,
 * which is 2^-22 of that. */
static const double q30_tolerance = 0.5001 / 1073741824.0;

static const double root2 = 1.41421356237309504880;

void setUp(void) {}
void tearDown(void) {}

static double from_q30(int32_t value)
{
    return value / 1073741824.0;
}

static void corner(const struct layout_feature *feature, unsigned i, double uv[2])
{
    uv[0] = feature->corner_u_8th[i] / 8.0;
    uv[1] = feature->corner_v_8th[i] / 8.0;
}

/* Twice the area, positive when the corners run clockwise as seen (v points down). */
static double doubled_area(const struct layout_feature *feature)
{
    double a[2];
    double b[2];
    double c[2];
    corner(feature, 0, a);
    corner(feature, 1, b);
    corner(feature, 2, c);
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static void counts_are_13_and_85_and_nothing_else_is_known(void)
{
    TEST_ASSERT_EQUAL_UINT(13, layout_feature_count(2));
    TEST_ASSERT_EQUAL_UINT(85, layout_feature_count(3));
    TEST_ASSERT_EQUAL_UINT(0, layout_feature_count(0));
    TEST_ASSERT_EQUAL_UINT(0, layout_feature_count(1));
    TEST_ASSERT_EQUAL_UINT(0, layout_feature_count(4));
    TEST_ASSERT_NULL(layout_feature(2, 13));
    TEST_ASSERT_NULL(layout_feature(3, 85));
    TEST_ASSERT_NULL(layout_feature(1, 0));
    TEST_ASSERT_NOT_NULL(layout_feature(2, 12));
    TEST_ASSERT_NOT_NULL(layout_feature(3, 84));
}

static void every_circle_sits_in_the_incircle_of_its_triangle(void)
{
    for (unsigned levels = 2; levels <= 3; levels++) {
        for (unsigned i = 0; i < layout_feature_count(levels); i++) {
            const struct layout_feature *feature = layout_feature(levels, i);
            const double u = from_q30(feature->u_q30);
            const double v = from_q30(feature->v_q30);
            for (unsigned side = 0; side < 3; side++) {
                double a[2];
                double b[2];
                corner(feature, side, a);
                corner(feature, (side + 1) % 3, b);
                const double length = hypot(b[0] - a[0], b[1] - a[1]);
                const double distance =
                    ((b[0] - a[0]) * (v - a[1]) - (b[1] - a[1]) * (u - a[0])) / length;
                /* Rounding of the centre moves the distance by up to sqrt(2) half steps, that of
                 * the radius by one more: 2.5 tolerances hold all. */
                TEST_ASSERT_TRUE(fabs(distance - from_q30(feature->inradius_q30)) <
                                 2.5 * q30_tolerance);
            }
        }
    }
}

static bool holds(const struct layout_feature *feature, double u, double v)
{
    for (unsigned side = 0; side < 3; side++) {
        double a[2];
        double b[2];
        corner(feature, side, a);
        corner(feature, (side + 1) % 3, b);
        if ((b[0] - a[0]) * (v - a[1]) - (b[1] - a[1]) * (u - a[0]) < 0) {
            return false;
        }
    }
    return true;
}

static void triangles_run_clockwise_and_tile_the_patch(void)
{
    for (unsigned levels = 2; levels <= 3; levels++) {
        double area = 0;
        for (unsigned i = 0; i < layout_feature_count(levels); i++) {
            TEST_ASSERT_TRUE(doubled_area(layout_feature(levels, i)) > 0);
            area += doubled_area(layout_feature(levels, i)) / 2;
        }
        TEST_ASSERT_TRUE(area == 1.0); /* sums of multiples of 1/128: exact */
        /* Sample points off all the lines, which lie at multiples of 1/8 of u, v, u+v and u-v. */
        for (unsigned n = 0; n < 64 * 64; n++) {
            const double u = (n % 64 + 0.31) / 64;
            const double v = ((double)(n / 64) + 0.47) / 64;
            unsigned holders = 0;
            for (unsigned i = 0; i < layout_feature_count(levels); i++) {
                holders += holds(layout_feature(levels, i), u, v) ? 1u : 0u;
            }
            TEST_ASSERT_EQUAL_UINT(1, holders);
        }
    }
}

static void assert_centre(const struct layout_feature *feature, double u, double v, double inradius)
{
    TEST_ASSERT_TRUE(fabs(from_q30(feature->u_q30) - u) < q30_tolerance);
    TEST_ASSERT_TRUE(fabs(from_q30(feature->v_q30) - v) < q30_tolerance);
    TEST_ASSERT_TRUE(fabs(from_q30(feature->inradius_q30) - inradius) < q30_tolerance);
}

/* Clockwise quarter turns about the patch centre: (u, v) -> (1 - v, u). */
static void turn(unsigned quarters, double *u, double *v)
{
    for (unsigned i = 0; i < quarters; i++) {
        const double old_u = *u;
        *u = 1 - *v;
        *v = old_u;
    }
}

static void level_2_circles_lie_where_the_table_of_the_description_says(void)
{
    const double h = (root2 - 1) / 4;
    const double top[4][2] = {{0.25, h}, {0.5, 0.25 - h}, {0.75, h}, {0.5, 0.25 + h}};
    for (unsigned levels = 2; levels <= 3; levels++) {
        assert_centre(layout_feature(levels, 0), 0.5, 2 * h, 2 * h);
    }
    for (unsigned bit = 0; bit < 12; bit++) {
        double u = top[bit % 4][0];
        double v = top[bit % 4][1];
        turn(1 + bit / 4, &u, &v);
        assert_centre(layout_feature(2, 1 + bit), u, v, h);
        TEST_ASSERT_EQUAL_UINT(bit, layout_feature(2, 1 + bit)->bit);
        TEST_ASSERT_FALSE(layout_feature(2, 1 + bit)->inverted);
    }
}

/* A point of small triangle k of the top quarter, given along its hypotenuse (x) and towards its
 * right angle (y), both in hypotenuses (half a patch side). */
static void from_small(unsigned k, double x, double y, double *u, double *v)
{
    const double start[4][2] = {{0, 0}, {0.75, 0.25}, {0.5, 0}, {0.25, 0.25}};
    const double sign = k == 1 ? -1 : 1;
    *u = start[k][0] + sign * x / 2;
    *v = start[k][1] + sign * y / 2;
}

static void level_3_circles_lie_where_the_description_says(void)
{
    const double h = (root2 - 1) / 4;
    const double p = (2 - root2) / 4;
    const double first[3][2] = {{0, 0}, {0.5, 0}, {0.25, 0.25}};
    for (unsigned bit = 0; bit < 12; bit++) {
        double u = 0;
        double v = 0;
        from_small(bit % 4, 0.5, 0.25 - h, &u, &v);
        turn(1 + bit / 4, &u, &v);
        assert_centre(layout_feature(3, 1 + bit), u, v, h / 2);
        for (unsigned j = 0; j < 6; j++) {
            const double x = j % 2 == 0 ? 0.5 - p : 0.5 + p;
            from_small(bit % 4, first[j / 2][0] + x / 2, first[j / 2][1] + p / 2, &u, &v);
            turn(1 + bit / 4, &u, &v);
            const struct layout_feature *feature = layout_feature(3, 13 + 6 * bit + j);
            assert_centre(feature, u, v, p / 4);
            TEST_ASSERT_EQUAL_UINT(bit, feature->bit);
            TEST_ASSERT_TRUE(feature->inverted == (j % 2 == 1));
        }
    }
}

static void anchor_is_white_when_the_id_has_an_even_number_of_one_bits(void)
{
    for (unsigned id = 0; id < LAYOUT_IDS; id++) {
        unsigned ones = 0;
        for (unsigned bit = 0; bit < 12; bit++) {
            ones += (id >> bit) & 1u;
        }
        TEST_ASSERT_TRUE(layout_circle_is_white(2, (uint16_t)id, 0) == (ones % 2 == 0));
        TEST_ASSERT_TRUE(layout_circle_is_white(3, (uint16_t)id, 0) == (ones % 2 == 0));
    }
}

static void a_one_bit_makes_its_circle_white_and_the_satellites_alternate(void)
{
    for (unsigned bit = 0; bit < 12; bit++) {
        const uint16_t one = (uint16_t)(1u << bit);
        const uint16_t rest = (uint16_t)(4095u & ~(1u << bit));
        for (unsigned levels = 2; levels <= 3; levels++) {
            TEST_ASSERT_TRUE(layout_circle_is_white(levels, one, 1 + bit));
            TEST_ASSERT_FALSE(layout_circle_is_white(levels, rest, 1 + bit));
        }
        for (unsigned j = 0; j < 6; j++) {
            const unsigned index = 13 + 6 * bit + j;
            TEST_ASSERT_TRUE(layout_circle_is_white(3, one, index) == (j % 2 == 0));
            TEST_ASSERT_TRUE(layout_circle_is_white(3, rest, index) == (j % 2 == 1));
        }
    }
}

/* Twice the signed area of (a, b, p), p in 48ths; corners in eighths. */
static int side_of(const struct layout_feature *f, unsigned a, unsigned b, int u, int v)
{
    const int du = f->corner_u_8th[b] - f->corner_u_8th[a];
    const int dv = f->corner_v_8th[b] - f->corner_v_8th[a];
    return du * (v - 6 * f->corner_v_8th[a]) - dv * (u - 6 * f->corner_u_8th[a]);
}

static void feature_at_a_place_has_it_in_its_triangle(void)
{
    for (unsigned levels = 2; levels <= 3; levels++) {
        for (int v = 0; v <= 48; v++) {
            for (int u = 0; u <= 48; u++) {
                const unsigned feature =
                    layout_feature_at(levels, u * (1 << 20) / 3, v * (1 << 20) / 3);
                const struct layout_feature *f = layout_feature(levels, feature);
                TEST_ASSERT_NOT_NULL(f);
                TEST_ASSERT_TRUE(side_of(f, 0, 1, u, v) >= 0 && side_of(f, 1, 2, u, v) >= 0 &&
                                 side_of(f, 2, 0, u, v) >= 0);
            }
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(counts_are_13_and_85_and_nothing_else_is_known);
    RUN_TEST(every_circle_sits_in_the_incircle_of_its_triangle);
    RUN_TEST(triangles_run_clockwise_and_tile_the_patch);
    RUN_TEST(level_2_circles_lie_where_the_table_of_the_description_says);
    RUN_TEST(level_3_circles_lie_where_the_description_says);
    RUN_TEST(anchor_is_white_when_the_id_has_an_even_number_of_one_bits);
    RUN_TEST(a_one_bit_makes_its_circle_white_and_the_satellites_alternate);
    RUN_TEST(feature_at_a_place_has_it_in_its_triangle);
    return UNITY_END();
}
