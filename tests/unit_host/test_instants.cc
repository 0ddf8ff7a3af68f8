// Which captures make one instant.
#include "host/assoc/instants.h"
#include "unity.h"

using namespace rig;

void setUp() {}
void tearDown() {}

namespace {

void captures_within_the_tolerance_share_an_instant()
{
    const std::vector<Capture> captures{{0, 1000}, {1, 1010}, {2, 1011}, {0, 2000}, {1, 1995}};
    const std::vector<std::int64_t> instants = find_instants(captures, 10);
    TEST_ASSERT_EQUAL_INT64(0, instants[0]);
    TEST_ASSERT_EQUAL_INT64(0, instants[1]);  // exactly at the tolerance
    TEST_ASSERT_EQUAL_INT64(1, instants[2]);  // one beyond it
    TEST_ASSERT_EQUAL_INT64(2, instants[3]);
    TEST_ASSERT_EQUAL_INT64(2, instants[4]);
}

void a_camera_stands_once_in_an_instant()
{
    const std::vector<std::int64_t> instants = find_instants({{0, 0}, {0, 1}, {1, 1}}, 100);
    TEST_ASSERT_EQUAL_INT64(0, instants[0]);
    TEST_ASSERT_EQUAL_INT64(1, instants[1]);
    TEST_ASSERT_EQUAL_INT64(1, instants[2]);
}

void the_order_of_captures_does_not_matter()
{
    const std::vector<std::int64_t> instants = find_instants({{1, 500}, {0, 100}, {0, 501}, {1, 99}}, 5);
    TEST_ASSERT_EQUAL_INT64(1, instants[0]);
    TEST_ASSERT_EQUAL_INT64(0, instants[1]);
    TEST_ASSERT_EQUAL_INT64(1, instants[2]);
    TEST_ASSERT_EQUAL_INT64(0, instants[3]);
}

void the_tolerance_is_a_tenth_of_the_shortest_interval()
{
    TEST_ASSERT_EQUAL_INT64(10, default_tolerance_ns({{0, 0}, {0, 100}, {0, 200}, {1, 0}, {1, 5000}}));
    TEST_ASSERT_EQUAL_INT64(1000000, default_tolerance_ns({{0, 7}, {1, 9}}));
    TEST_ASSERT_EQUAL_INT64(1000000, default_tolerance_ns({}));
}

}  // namespace

int main()
{
    UNITY_BEGIN();
    RUN_TEST(captures_within_the_tolerance_share_an_instant);
    RUN_TEST(a_camera_stands_once_in_an_instant);
    RUN_TEST(the_order_of_captures_does_not_matter);
    RUN_TEST(the_tolerance_is_a_tenth_of_the_shortest_interval);
    return UNITY_END();
}
