/* Few edges are let through as they are; too many are bounded, whatever the frame does, and then let through again. */
#include "firmware/detect/quota.h"

#include <unity.h>

#include "firmware/limits.h"

#define WIDTH  1000u
#define HEIGHT 800u
#define THRESHOLD_Q6 102400u /* the default: 2.5 grey levels a pixel */

static struct quota quota;

void setUp(void)
{
    quota_begin(&quota, WIDTH, HEIGHT);
}
void tearDown(void) {}

static void count(uint32_t across, uint32_t down)
{
    const struct edge_row row = {.across_count = across, .down_count = down};
    quota_count(&quota, &row);
}

static void rows_within_their_share_change_nothing(void)
{
    const uint32_t share = limit_edges_a_row(WIDTH);
    for (unsigned y = 0; y < HEIGHT; y++) {
        count(share / 3, share - share / 3);
        TEST_ASSERT_EQUAL_UINT32(THRESHOLD_Q6, quota_threshold_q6(&quota, THRESHOLD_Q6));
    }
    TEST_ASSERT_FALSE(quota.reached);
}

/* A target that fills some part of the frame, densely. */
static void reserve_lets_an_eighth_of_the_rows_be_twice_as_dense(void)
{
    const uint32_t share = limit_edges_a_row(WIDTH);
    for (unsigned y = 0; y < HEIGHT; y++) {
        count(y >= 300 && y < 300 + HEIGHT / 8 ? 2 * share : share / 2, 0);
    }
    TEST_ASSERT_FALSE(quota.reached);
}

/* Points of a row as many as there can be, less by half for each doubling of the gradient asked for: a frame whose
 * edges are of all strengths. */
static void frame_full_of_edges_is_bounded_and_says_so(void)
{
    for (unsigned y = 0; y < HEIGHT; y++) {
        count((WIDTH - 1) >> quota.doublings, WIDTH >> quota.doublings);
    }
    TEST_ASSERT_TRUE(quota.reached);
    /* A step is a row: less than three are let through on top before it bites (1 + 1/2 + 1/4 ...). */
    TEST_ASSERT_TRUE(quota.points <= quota.allowed + 3 * 2 * WIDTH);
    TEST_ASSERT_TRUE(quota.points >= quota.allowed - quota.reserve / 2);
}

/* Nothing but the strongest edges there can be: then none are let through for a while. */
static void edges_of_full_contrast_are_bounded_too(void)
{
    for (unsigned y = 0; y < HEIGHT; y++) {
        const bool through = quota_threshold_q6(&quota, THRESHOLD_Q6) < (uint32_t)18018 * 18018;
        count(through ? WIDTH - 1 : 0, through ? WIDTH : 0);
    }
    TEST_ASSERT_TRUE(quota.reached);
    /* Six doublings, from 320 beyond 18018 (dsp.h), are six rows at most on top. */
    TEST_ASSERT_TRUE(quota.points <= quota.allowed + 6 * 2 * WIDTH);
}

static void what_comes_after_dense_rows_is_seen_as_before(void)
{
    for (unsigned y = 0; y < HEIGHT / 4; y++) {
        count((WIDTH - 1) >> quota.doublings, WIDTH >> quota.doublings);
    }
    TEST_ASSERT_TRUE(quota_threshold_q6(&quota, THRESHOLD_Q6) > THRESHOLD_Q6);
    /* A quarter of the reserve at a row's whole share, and a row a doubling. */
    for (unsigned y = 0; y < HEIGHT / 32 + QUOTA_DOUBLINGS_MAX + 1; y++) {
        count(0, 0);
    }
    TEST_ASSERT_EQUAL_UINT32(THRESHOLD_Q6, quota_threshold_q6(&quota, THRESHOLD_Q6));
    TEST_ASSERT_TRUE(quota.reached);
}

static void thresholds_stay_within_what_the_kernels_take(void)
{
    for (unsigned y = 0; y < 100; y++) {
        count(WIDTH - 1, WIDTH);
        TEST_ASSERT_TRUE(quota_threshold_q6(&quota, 1) >= 1);
        TEST_ASSERT_TRUE(quota_threshold_q6(&quota, 32767u * 32767u) <= 1u << 30);
        TEST_ASSERT_TRUE(quota.doublings <= QUOTA_DOUBLINGS_MAX);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(rows_within_their_share_change_nothing);
    RUN_TEST(reserve_lets_an_eighth_of_the_rows_be_twice_as_dense);
    RUN_TEST(frame_full_of_edges_is_bounded_and_says_so);
    RUN_TEST(edges_of_full_contrast_are_bounded_too);
    RUN_TEST(what_comes_after_dense_rows_is_seen_as_before);
    RUN_TEST(thresholds_stay_within_what_the_kernels_take);
    return UNITY_END();
}
