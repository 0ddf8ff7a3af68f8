// Laws of rigid motions.
#include <Eigen/LU>
#include <cmath>

#include "host/base/pose.h"
#include "unity.h"

using namespace rig;

void setUp() {}
void tearDown() {}

namespace {

const Vector6 kOne = (Vector6() << 0.3, -0.7, 0.2, 100.0, -40.0, 900.0).finished();
const Vector6 kOther = (Vector6() << -1.1, 0.4, 2.0, -5.0, 60.0, 20.0).finished();

void a_pose_times_its_inverse_is_the_identity()
{
    const Pose both = pose_exp(kOne) * inverse(pose_exp(kOne));
    // A dozen roundings of numbers of some 1e3.
    TEST_ASSERT_TRUE((both.rotation - Eigen::Matrix3d::Identity()).norm() < 1e-14);
    TEST_ASSERT_TRUE(both.translation_mm.norm() < 1e-11);
}

void composing_is_applying_one_after_the_other()
{
    const Pose a_from_b = pose_exp(kOne);
    const Pose b_from_c = pose_exp(kOther);
    const Eigen::Vector3d point(12.0, -7.0, 3.0);
    TEST_ASSERT_TRUE(((a_from_b * b_from_c) * point - a_from_b * (b_from_c * point)).norm() < 1e-11);
}

void log_undoes_exp_up_to_half_a_turn()
{
    const double pi = std::acos(-1.0);
    for (const double angle : {0.0, 1e-12, 1e-6, 0.9e-4, 1.1e-4, 0.1, 1.0, 3.0, pi - 1e-7}) {
        const Eigen::Vector3d vector = angle * Eigen::Vector3d(2.0, -1.0, 2.0) / 3.0;
        // Near half a turn the matrix's entries still fix the axis to their last bits.
        TEST_ASSERT_TRUE((rotation_log(rotation_exp(vector)) - vector).norm() < 1e-14 + 1e-13 * angle);
    }
}

void exp_gives_a_rotation_at_every_angle()
{
    for (double angle = 1e-9; angle < 7.0; angle *= 1.7) {
        const Eigen::Matrix3d r = rotation_exp(angle * Eigen::Vector3d(0.6, 0.0, 0.8));
        TEST_ASSERT_TRUE((r * r.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-14);
        TEST_ASSERT_TRUE(r.determinant() > 0.0);
    }
}

void right_jacobian_is_the_derivative_of_exp()
{
    for (const double angle : {0.0, 1e-5, 0.05, 0.0999, 0.1001, 1.0, 3.0, 5.0}) {
        const Eigen::Vector3d vector = angle * Eigen::Vector3d(0.36, -0.48, 0.8);
        const Eigen::Matrix3d jacobian = rotation_right_jacobian(vector);
        for (int i = 0; i < 3; ++i) {
            const double step = 1e-5;
            const Eigen::Vector3d delta = step * Eigen::Vector3d::Unit(i);
            const Eigen::Vector3d seen = rotation_log(rotation_exp(vector).transpose()
                                                      * rotation_exp(vector + delta))
                                         - rotation_log(rotation_exp(vector).transpose()
                                                        * rotation_exp(vector - delta));
            // Central difference: the error is step^2 / 6, and rounding 1e-16 / step.
            TEST_ASSERT_TRUE((seen / (2.0 * step) - jacobian.col(i)).norm() < 2e-10);
        }
    }
}

}  // namespace

int main()
{
    UNITY_BEGIN();
    RUN_TEST(a_pose_times_its_inverse_is_the_identity);
    RUN_TEST(composing_is_applying_one_after_the_other);
    RUN_TEST(log_undoes_exp_up_to_half_a_turn);
    RUN_TEST(exp_gives_a_rotation_at_every_angle);
    RUN_TEST(right_jacobian_is_the_derivative_of_exp);
    return UNITY_END();
}
