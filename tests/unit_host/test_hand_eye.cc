// Two cameras, each with a board of its own, fixed to each other: the common motion tells how they
// stand.
#include <cmath>

#include "host/solve/hand_eye.h"
#include "unity.h"

using namespace rig;

void setUp() {}
void tearDown() {}

namespace {

Pose pose(double a, double b, double c, double x, double y, double z)
{
    return pose_exp((Vector6() << a, b, c, x, y, z).finished());
}

const Pose kBFromA = pose(0.1, -0.7, 0.2, -400, 30, 90);
const Pose kPFromQ = pose(0.4, 2.9, -0.3, 50, 20, -300);

// Turns about both axes of the image, unless the second is held.
std::vector<Sighted> places(int count, bool two_axes)
{
    std::vector<Sighted> list;
    for (int i = 0; i < count; ++i) {
        const double t = i;
        const Pose a_from_p = pose(0.5 * std::sin(t), two_axes ? 0.4 * std::cos(1.7 * t) : 0.0, 0.0,
                                   100 * std::cos(t), 80 * std::sin(2 * t), 1500 + 40 * t);
        list.push_back({a_from_p, kBFromA * a_from_p * kPFromQ});
    }
    return list;
}

void assert_found(const std::vector<Sighted>& list, double turn, double shift_mm)
{
    const std::optional<HandEye> found = solve_hand_eye(list);
    TEST_ASSERT_TRUE(found.has_value());
    TEST_ASSERT_TRUE(rotation_distance(found->b_from_a.rotation, kBFromA.rotation) < turn);
    TEST_ASSERT_TRUE(rotation_distance(found->p_from_q.rotation, kPFromQ.rotation) < turn);
    TEST_ASSERT_TRUE((found->b_from_a.translation_mm - kBFromA.translation_mm).norm() < shift_mm);
    TEST_ASSERT_TRUE((found->p_from_q.translation_mm - kPFromQ.translation_mm).norm() < shift_mm);
}

void exact_poses_give_the_exact_answer()
{
    // An eigenvector from squares keeps half the digits: 1e-8, on lengths of 1,500 mm.
    for (const int count : {3, 4, 30}) {
        assert_found(places(count, true), 1e-6, 1e-2);
    }
}

void a_place_that_contradicts_is_left_aside()
{
    std::vector<Sighted> list = places(20, true);
    list[4].b_from_q = pose(1.0, 0.2, 0.1, 300, -200, 900);
    // It keeps a weight of (0.01 / its error)^2, some 1e-4, over 19 good places.
    assert_found(list, 1e-4, 0.5);
}

void turning_about_one_axis_is_not_enough()
{
    TEST_ASSERT_FALSE(solve_hand_eye(places(20, false)).has_value());
}

void two_places_are_not_enough()
{
    TEST_ASSERT_FALSE(solve_hand_eye(places(2, true)).has_value());
}

}  // namespace

int main()
{
    UNITY_BEGIN();
    RUN_TEST(exact_poses_give_the_exact_answer);
    RUN_TEST(a_place_that_contradicts_is_left_aside);
    RUN_TEST(turning_about_one_axis_is_not_enough);
    RUN_TEST(two_places_are_not_enough);
    return UNITY_END();
}
