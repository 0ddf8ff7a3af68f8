/* The map from an anchor's frame to its patch: what it fits, what it refuses. */
#include <math.h>
#include <unity.h>

#include "firmware/detect/patchmap.h"

static struct patchmap_pair pairs[PATCHMAP_PAIRS_MAX];

void setUp(void) {}
void tearDown(void) {}

/* In sides, for p and q within 4. */
static void view(double p, double q, double bend, double *u, double *v)
{
    *u = 0.11 * p - 0.04 * q + bend * (p * p - 0.5 * p * q + 0.3 * q * q);
    *v = 0.05 * p + 0.12 * q + bend * (0.2 * p * p + 0.4 * p * q - q * q);
}

static struct patchmap_pair pair_at(double p, double q, double bend)
{
    double u;
    double v;
    view(p, q, bend, &u, &v);
    return (struct patchmap_pair){(int32_t)lround(p * 1048576),
                                  (int32_t)lround(q * 1048576),
                                  {(int32_t)lround(u * 1048576), (int32_t)lround(v * 1048576)}};
}

static unsigned make_pairs(double bend)
{
    unsigned count = 0;
    for (int i = -1; i <= 2; i++) {
        for (int j = -2; j <= 0; j++) {
            pairs[count++] = pair_at(1.7 * i, 1.9 * j, bend);
        }
    }
    return count;
}

static void expect_followed(const struct patchmap *map, double bend)
{
    for (double p = -4; p <= 4; p += 0.5) {
        for (double q = -4; q <= 4; q += 0.5) {
            const struct patchmap_pair pair = pair_at(p, q, bend);
            const struct patchmap_place at = patchmap_place_of(map, pair.p_q20, pair.q_q20);
            /* Places are good to 2^-21 of a side, and pivots above 0.01: a hundredth of the nearest features' distance
             * would do. */
            TEST_ASSERT_INT_WITHIN(100, pair.place.u_q20, at.u_q20);
            TEST_ASSERT_INT_WITHIN(100, pair.place.v_q20, at.v_q20);
        }
    }
}

static void maps_of_either_order_are_followed(void)
{
    struct patchmap map;
    TEST_ASSERT_TRUE(patchmap_fit(pairs, make_pairs(0), PATCHMAP_LINEAR, &map));
    expect_followed(&map, 0);
    TEST_ASSERT_TRUE(patchmap_fit(pairs, make_pairs(0), PATCHMAP_TERMS_MAX, &map));
    expect_followed(&map, 0);
    TEST_ASSERT_TRUE(patchmap_fit(pairs, make_pairs(0.004), PATCHMAP_TERMS_MAX, &map));
    expect_followed(&map, 0.004);
}

static void turned_map_turns_back(void)
{
    const uint32_t unit_q20 = 1 << 17; /* an eighth of a side */
    for (unsigned turn = 0; turn < 65536; turn += 1999) {
        const double angle = turn / 65536.0 * 2 * acos(-1);
        const struct patchmap map = patchmap_turned((uint16_t)turn, unit_q20);
        const struct patchmap_place at =
            patchmap_place_of(&map, (int32_t)lround(3 * cos(angle) * 1048576),
                              (int32_t)lround(3 * sin(angle) * 1048576));
        TEST_ASSERT_INT_WITHIN(4, 3 << 17, at.u_q20);
        TEST_ASSERT_INT_WITHIN(4, 0, at.v_q20);
    }
}

static void pairs_on_one_line_are_refused(void)
{
    struct patchmap map;
    for (int i = 0; i < 12; i++) {
        pairs[i] = pair_at(0.3 * i, 0.6 * i, 0);
    }
    TEST_ASSERT_FALSE(patchmap_fit(pairs, 12, PATCHMAP_LINEAR, &map));
    TEST_ASSERT_FALSE(patchmap_fit(pairs, 12, PATCHMAP_TERMS_MAX, &map));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(maps_of_either_order_are_followed);
    RUN_TEST(turned_map_turns_back);
    RUN_TEST(pairs_on_one_line_are_refused);
    return UNITY_END();
}
