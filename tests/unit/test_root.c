/* Integer square roots: exact, so the definition itself is the test. */
#include "common/fx/root.h"

#include <stdbool.h>
#include <unity.h>

#include "tests/unit/synth.h"

void setUp(void) {}
void tearDown(void) {}

/* r * r <= value < (r + 1)^2. */
static bool is_floor_of_root(uint64_t value, uint64_t r)
{
    /* (r + 1)^2 > value without overflow: value / (r + 1) < r + 1. */
    return r * r <= value && value / (r + 1) < r + 1;
}

static void roots_are_exact_around_every_kind_of_square(void)
{
    for (uint64_t r = 1; r < 65536; r += r < 300 ? 1 : 97) {
        TEST_ASSERT_EQUAL_UINT32(r, root_u64(r * r));
        TEST_ASSERT_EQUAL_UINT32(r - 1, root_u64(r * r - 1));
        TEST_ASSERT_EQUAL_UINT32(r, root_u32((uint32_t)(r * r)));
        TEST_ASSERT_EQUAL_UINT32(r - 1, root_u32((uint32_t)(r * r - 1)));
        const uint64_t big = r << 16 | 0xffff;
        TEST_ASSERT_EQUAL_UINT32(big, root_u64(big * big));
        TEST_ASSERT_EQUAL_UINT32(big - 1, root_u64(big * big - 1));
    }
}

static void roots_are_exact_at_both_ends_of_the_range(void)
{
    TEST_ASSERT_EQUAL_UINT32(0, root_u64(0));
    TEST_ASSERT_EQUAL_UINT32(1, root_u64(1));
    TEST_ASSERT_EQUAL_UINT32(1, root_u64(3));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, root_u64(UINT64_MAX));
    TEST_ASSERT_EQUAL_UINT32(0, root_u32(0));
    TEST_ASSERT_EQUAL_UINT32(65535, root_u32(UINT32_MAX));
}

static void roots_are_exact_for_random_values_of_every_length(void)
{
    uint64_t seed = 3;
    for (int i = 0; i < 200000; i++) {
        const uint64_t value = synth_u64(&seed) >> (i % 64);
        TEST_ASSERT_TRUE(is_floor_of_root(value, root_u64(value)));
        TEST_ASSERT_TRUE(is_floor_of_root((uint32_t)value, root_u32((uint32_t)value)));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(roots_are_exact_around_every_kind_of_square);
    RUN_TEST(roots_are_exact_at_both_ends_of_the_range);
    RUN_TEST(roots_are_exact_for_random_values_of_every_length);
    return UNITY_END();
}
