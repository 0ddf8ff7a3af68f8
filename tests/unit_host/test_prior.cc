// An earlier result as a prior: errors of what follows are as large as the covariance says.
// TESSERA_DRAWS: how many; 60 where not given.
#include "host/solve/prior.h"

#include "tests/unit_host/small_rig.h"

using namespace rig;

void setUp() {}
void tearDown() {}

namespace {

constexpr std::size_t kSitePoses = 3;  // too few to calibrate well from

// `known`: the cameras of the earlier result that the prior has.
Prior prior_of(const RigFile& lab, const std::vector<int>& known, bool poses)
{
    Prior out;
    out.source = "lab";
    out.poses = poses;
    out.covariance = *lab.covariance;
    for (const RigCamera& camera : lab.cameras) {
        out.names.push_back(camera.name);
        out.lenses.push_back(camera.lens);
        out.cam_from_rig.push_back(camera.cam_from_rig);
    }
    out.place.assign(small_rig::kCameras, -1);
    for (const int camera : known) {
        out.place[static_cast<std::size_t>(camera)] = camera;
    }
    return out;
}

void check_honest(const std::vector<int>& known, bool poses, unsigned seed, const char* what)
{
    std::mt19937 random(seed);
    const RigState state = small_rig::truth(&random);
    RigState site = small_rig::truth(&random);
    site = small_rig::shortened(site, kSitePoses);
    const ViewSet clean = small_rig::views(site);
    small_rig::Honesty all;
    double with = 0.0;
    double without = 0.0;
    for (int draw = 0; draw < small_rig::draws(); ++draw) {
        const Prior prior = prior_of(small_rig::calibrated(state, &random), known, poses);
        ViewSet set = clean;
        small_rig::add_noise(&random, &set.views);
        Solution found = small_rig::solve(set, site, &prior);
        const double plain = rig_covariance(found).matrix.trace();
        found.covariance = rig_covariance(found, 1.0, &prior);
        all.add(small_rig::errors_of(found, site), found.covariance.matrix);
        with += found.covariance.matrix.trace();
        without += plain;
    }
    all.check(what);
    // Three poses alone say a third of what fifteen do, and the prior is those fifteen.
    TEST_ASSERT_TRUE(with < 0.8 * without);
}

void lenses_known_beforehand_leave_honest_errors()
{
    check_honest({0, 1, 2}, false, 41, "lenses of all");
}

void lenses_and_poses_known_beforehand_leave_honest_errors()
{
    check_honest({0, 1, 2}, true, 42, "lenses and poses of all");
}

// Cameras 1 and 2 of a rig whose frame is that of camera 0, of which the prior says nothing.
void poses_against_a_camera_that_is_not_the_rig_frame_leave_honest_errors()
{
    check_honest({1, 2}, true, 43, "lenses and poses of two");
}

void a_prior_of_another_size_or_model_or_of_no_camera_is_refused()
{
    std::mt19937 random(44);
    const Scene scene = small_rig::scene();
    const std::vector<Eigen::Vector2i> sizes(3, Eigen::Vector2i(640, 480));
    const Prior good = prior_of(small_rig::calibrated(small_rig::truth(&random), &random), {}, false);
    Prior prior = good;
    std::vector<LensChoice> brown(3);
    TEST_ASSERT_TRUE(match_prior(scene, sizes, &brown, &prior).ok());
    TEST_ASSERT_EQUAL_INT(2, prior.place[2]);
    const auto refused = [&](Prior bad, LensChoice told, const std::vector<Eigen::Vector2i>& size,
                             const char* word) {
        std::vector<LensChoice> lenses(3, told);
        const Status status = match_prior(scene, size, &lenses, &bad);
        TEST_ASSERT_FALSE(status.ok());
        TEST_ASSERT_TRUE_MESSAGE(status.sentence().find(word) != std::string::npos, status.sentence().c_str());
    };
    refused(good, {CameraModel::kRational, false, false}, sizes, "--model brown");
    refused(good, {CameraModel::kBrown, false, true}, sizes, "not a spline one");
    refused(good, {}, {3, Eigen::Vector2i(640, 400)}, "640 x 400");
    Prior strange = good;
    strange.names = {"x", "y", "z"};
    refused(strange, {}, sizes, "no camera of the prior");
    Prior bent = good;
    bent.lenses[1].field = make_spline_field(640, 480, 4);
    refused(bent, {}, sizes, "'cam1' has a spline lens in the prior");
}

void a_lens_left_open_is_the_priors_and_that_of_a_camera_the_prior_does_not_have_stays_open()
{
    std::mt19937 random(45);
    Scene scene = small_rig::scene();
    Prior prior = prior_of(small_rig::calibrated(small_rig::truth(&random), &random), {}, false);
    prior.lenses[0].model = CameraModel::kRational;
    prior.names[2] = "another";
    std::vector<LensChoice> open(3, LensChoice{CameraModel::kBrown, true, false});
    TEST_ASSERT_TRUE(match_prior(scene, std::vector<Eigen::Vector2i>(3, Eigen::Vector2i(640, 480)), &open,
                                 &prior).ok());
    TEST_ASSERT_TRUE(open[0].model == CameraModel::kRational && !open[0].richer);
    TEST_ASSERT_TRUE(open[1].model == CameraModel::kBrown && !open[1].richer);
    TEST_ASSERT_TRUE(open[2].model == CameraModel::kBrown && open[2].richer);
}

}  // namespace

int main()
{
    UNITY_BEGIN();
    RUN_TEST(lenses_known_beforehand_leave_honest_errors);
    RUN_TEST(lenses_and_poses_known_beforehand_leave_honest_errors);
    RUN_TEST(poses_against_a_camera_that_is_not_the_rig_frame_leave_honest_errors);
    RUN_TEST(a_prior_of_another_size_or_model_or_of_no_camera_is_refused);
    RUN_TEST(a_lens_left_open_is_the_priors_and_that_of_a_camera_the_prior_does_not_have_stays_open);
    return UNITY_END();
}
