/* Keys in order: against counting. */
#include <unity.h>

#include "firmware/detect/keysort.h"
#include "tests/unit/synth.h"

#define COUNT_MAX 300u

void setUp(void) {}
void tearDown(void) {}

static void keys_rise_and_are_the_same_ones(void)
{
    uint64_t seed = 3;
    for (uint32_t count = 0; count <= COUNT_MAX; count++) {
        uint32_t keys[COUNT_MAX + 1];
        uint32_t had[16] = {0};
        for (uint32_t i = 0; i < count; i++) {
            keys[i] = (uint32_t)(synth_u64(&seed) % 16) << 28;
            had[keys[i] >> 28]++;
        }
        keys[count] = 77;
        keysort(keys, count);
        for (uint32_t i = 0; i < count; i++) {
            TEST_ASSERT_TRUE(i == 0 || keys[i] >= keys[i - 1]);
            had[keys[i] >> 28]--;
        }
        for (unsigned k = 0; k < 16; k++) {
            TEST_ASSERT_EQUAL_UINT32(0, had[k]);
        }
        TEST_ASSERT_EQUAL_UINT32(77, keys[count]);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(keys_rise_and_are_the_same_ones);
    return UNITY_END();
}
