// The covariance against the errors of repeated solves with known truth.
// TESSERA_DRAWS: how many; 60 where not given.
#include "host/solve/uncertainty.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <cstdio>

#include "tests/unit_host/small_rig.h"
#include "unity.h"

using namespace rig;

void setUp() {}
void tearDown() {}

namespace {

void errors_of_repeated_solves_are_as_large_as_the_covariance_says()
{
    std::mt19937 random(7);
    const RigState truth = small_rig::truth(&random);
    const ViewSet clean = small_rig::views(truth);
    small_rig::Honesty all;
    small_rig::Honesty lenses;
    small_rig::Honesty poses;
    small_rig::Honesty motion;
    for (int draw = 0; draw < small_rig::draws(); ++draw) {
        ViewSet set = clean;
        small_rig::add_noise(&random, &set.views);
        Solution found = small_rig::solve(set, truth);
        found.covariance = rig_covariance(found);
        const Eigen::VectorXd error = small_rig::errors_of(found, truth);
        const Eigen::MatrixXd& covariance = found.covariance.matrix;
        all.add(error, covariance);
        for (std::size_t c = 0; c < small_rig::kCameras; ++c) {
            const Eigen::Index lens = found.covariance.lens[c];
            lenses.add(error.segment<9>(lens), covariance.block<9, 9>(lens, lens));
            const Eigen::Index pose = found.covariance.pose[c];
            if (pose >= 0) {
                poses.add(error.segment<6>(pose), covariance.block<6, 6>(pose, pose));
            }
        }
        motion.add(error.tail<6>(), covariance.bottomRightCorner<6, 6>());
    }
    all.check("everything");
    // The cameras' lenses and poses are not independent of one another: the width is a little narrow.
    lenses.check("lenses");
    poses.check("poses");
    motion.check("implied motion");
}

void deviations_are_scaled_by_the_noise_factor_where_it_is_above_one()
{
    std::mt19937 random(8);
    const RigState truth = small_rig::truth(&random);
    Solution found = small_rig::solve(small_rig::views(truth), truth);
    TEST_ASSERT_TRUE(estimate_uncertainty(small_rig::scene(), nullptr, &found).ok());
    const double fx = found.uncertainty[1].intrinsics[0];
    const double turn = found.uncertainty[1].rotation_rad.x();
    found.noise_factor = {0.5, 2.0, 1.0};
    TEST_ASSERT_TRUE(estimate_uncertainty(small_rig::scene(), nullptr, &found).ok());
    TEST_ASSERT_TRUE(std::abs(found.uncertainty[1].intrinsics[0] / (2.0 * fx) - 1.0) < 1e-9);
    TEST_ASSERT_TRUE(std::abs(found.uncertainty[1].rotation_rad.x() / (2.0 * turn) - 1.0) < 1e-9);
    const Eigen::Index lens = found.covariance.lens[1];
    TEST_ASSERT_TRUE(std::abs(std::sqrt(found.covariance.matrix(lens, lens)) / (2.0 * fx) - 1.0) < 1e-9);
}

}  // namespace

int main()
{
    UNITY_BEGIN();
    RUN_TEST(errors_of_repeated_solves_are_as_large_as_the_covariance_says);
    RUN_TEST(deviations_are_scaled_by_the_noise_factor_where_it_is_above_one);
    return UNITY_END();
}
