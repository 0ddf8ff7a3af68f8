/* What triangles behind an edge bring to its near side, against the blur's integral over them. */
#include "firmware/detect/junction.h"

#include <math.h>
#include <unity.h>

#include "tests/unit/synth.h"

void setUp(void) {}
void tearDown(void) {}

static double normal(double t)
{
    return erfc(-t / sqrt(2)) / 2;
}

static double bell(double t)
{
    return exp(-t * t / 2) / sqrt(2 * SYNTH_PI);
}

static struct felt_line line_of(double angle, double distance)
{
    return (struct felt_line){llround(distance * 65536), llround(cos(angle) * 65536),
                              llround(sin(angle) * 65536)};
}

/* The edge y = 0, near side y > 0, in blurs; behind it a ray from the origin with its normal at `angle`, its other
 * colour on the normal's side. What the blur brings of that to (x, y). */
static double integral(double angle, double x, double y)
{
    /* Over depth, each line parallel to the edge in closed form: the ray meets it in one place. */
    const double step = 0.002;
    double sum = 0;
    for (double depth = step / 2; depth < 9; depth += step) {
        const double meets = depth * sin(angle) / cos(angle);
        const double share = cos(angle) > 0 ? normal(x - meets) : normal(meets - x);
        sum += bell(y + depth) * share * step;
    }
    return sum;
}

static struct junction make_junction(double angle)
{
    return (struct junction){
        .edge = line_of(SYNTH_PI / 2, 0),
        .first = 0,
        .ray_count = 1,
        .rays = {{.line = line_of(angle, 0),
                  .lean_q15 = (int32_t)lround(sin(angle) * 32768),
                  .step = 1}},
    };
}

static double share_at(const struct junction *junction, double x, double y)
{
    int32_t share_q15 = 0;
    int32_t growth_q15 = 0;
    TEST_ASSERT_TRUE(junction_add(junction, (int32_t)lround(x * 16384), (int32_t)lround(y * 16384),
                                  &share_q15, &growth_q15));
    return share_q15 / 32768.0;
}

/* The approximation's error against the integral, from so far inside the edge on. */
static double worst_from(double lean, double nearest)
{
    double worst = 0;
    for (unsigned side = 0; side < 4; side++) {
        const double up = asin(lean);
        const double angle = side == 0 ? up : side == 1 ? -up : side == 2 ? SYNTH_PI - up : SYNTH_PI + up;
        const struct junction junction = make_junction(angle);
        for (double y = nearest; y < 3.9; y += 0.25) {
            for (double x = -6; x <= 6; x += 0.25) {
                worst = fmax(worst, fabs(share_at(&junction, x, y) - integral(angle, x, y)));
            }
        }
    }
    return worst;
}

/* What junction.h says of its formula, and 6e-5 for the tables. */
static void ray_parts_what_comes_from_behind(void)
{
    TEST_ASSERT_TRUE(worst_from(0.1, 1.2) < 0.0001 + 6e-5);
    TEST_ASSERT_TRUE(worst_from(0.71, 1.2) < 0.0007 + 6e-5);
    TEST_ASSERT_TRUE(worst_from(0.86, 1.2) < 0.0020 + 6e-5);
    TEST_ASSERT_TRUE(worst_from(0.95, 1.2) < 0.0055 + 6e-5);
    TEST_ASSERT_TRUE(worst_from(0.95, 2.0) < 0.0009 + 6e-5);
}

static void without_rays_an_edge_is_the_tail_of_the_blur(void)
{
    struct junction junction = make_junction(0);
    junction.first = 1;
    junction.ray_count = 0;
    for (double y = 0; y < 3.9; y += 0.1) {
        TEST_ASSERT_TRUE(fabs(share_at(&junction, 1, y) - normal(-y)) < 6e-5);
    }
}

static void two_rays_hold_a_wedge(void)
{
    /* Of the other colour between the normals of 40 and 100 degrees: what lies beyond the one and not beyond the
     * other. */
    struct junction junction = make_junction(0.7);
    junction.ray_count = 2;
    junction.rays[1] = make_junction(-0.6).rays[0];
    junction.rays[1].step = -1;
    for (double x = -3; x <= 3; x += 0.5) {
        const double wedge = fmax(0, integral(0.7, x, 1.5) - integral(-0.6, x, 1.5));
        TEST_ASSERT_TRUE(fabs(share_at(&junction, x, 1.5) - wedge) < 2 * 0.001);
    }
}

static void beyond_the_edge_is_refused_and_far_from_it_nothing_is_added(void)
{
    const struct junction junction = make_junction(0);
    int32_t share_q15 = 7;
    int32_t growth_q15 = 8;
    TEST_ASSERT_FALSE(junction_add(&junction, 0, -2, &share_q15, &growth_q15));
    TEST_ASSERT_TRUE(junction_add(&junction, 0, 4 << 14, &share_q15, &growth_q15));
    TEST_ASSERT_EQUAL_INT32(7, share_q15);
    TEST_ASSERT_EQUAL_INT32(8, growth_q15);
}

static void growth_is_the_share_s_derivative_by_the_blur(void)
{
    /* Distances shrink as the blur grows; half an edge, so that only the edge's own distance counts. */
    const struct junction junction = make_junction(0);
    for (double y = 1; y < 3.5; y += 0.25) {
        int32_t share_q15 = 0;
        int32_t growth_q15 = 0;
        TEST_ASSERT_TRUE(junction_add(&junction, 0, (int32_t)lround(y * 16384), &share_q15, &growth_q15));
        const double slope = (normal(-y / 1.01) - normal(-y / 0.99)) / 2 / (log(1.01) - log(0.99));
        TEST_ASSERT_TRUE(fabs(growth_q15 / 32768.0 - slope) < 2e-4);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(ray_parts_what_comes_from_behind);
    RUN_TEST(without_rays_an_edge_is_the_tail_of_the_blur);
    RUN_TEST(two_rays_hold_a_wedge);
    RUN_TEST(beyond_the_edge_is_refused_and_far_from_it_nothing_is_added);
    RUN_TEST(growth_is_the_share_s_derivative_by_the_blur);
    return UNITY_END();
}
