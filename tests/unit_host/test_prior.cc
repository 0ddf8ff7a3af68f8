// An earlier result as a prior: errors of what follows are as large as the covariance says.
// TESSERA_DRAWS: how many; 60 where not given.
#include "host/solve/prior.h"

#include "host/solve/flexible.h"
#include "host/solve/flexible_covariance.h"
#include "host/solve/surface.h"
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

// A bow of 1 mm about the board's middle less its mean, which is the board's place: of u, places -1 to 1 in
// steps of 2 / 7, the mean square is 3 / 7; of v, in steps of 2 / 5, 7 / 15.
double bow_mm(const Eigen::Vector3d& at)
{
    const double u = at.x() / 175.0 - 1.0;
    const double v = at.y() / 125.0 - 1.0;
    return 0.5 * (3.0 / 7.0 + 7.0 / 15.0 - u * u - v * v);
}

// As small_rig::views of a board that is bowed, which the points do not say.
ViewSet bowed_views(const RigState& state)
{
    ViewSet set = small_rig::views(state);
    for (View& view : set.views) {
        const auto c = static_cast<std::size_t>(view.camera);
        for (ViewPoint& point : view.points) {
            const Eigen::Vector3d at(point.at_mm.x(), point.at_mm.y(), bow_mm(point.at_mm));
            point.pixel = state.lenses[c].project(cam_from_board(state, view) * at);
        }
    }
    return set;
}

// A solution with the board's surface free; the prior may be null.
Solution solve_bent(const Scene& scene, const ViewSet& set, const RigState& start, const Prior* prior)
{
    Solution out = small_rig::solve(set, start, prior);
    out.state = start;
    out.state.surfaces = {make_surface(scene.boards[0], 2)};
    FlexibleOptions options;
    options.prior = prior;
    TEST_ASSERT_TRUE(flexible_bundle(out.set.views, views_in_use(out.set.views), scene.boards, scene.cameras,
                                     options, &out.state).usable);
    lift_points(out.state, scene.boards, &out.set.views);
    out.flexible = flexible_covariance(scene, out, prior, 1.0);
    out.covariance = rig_covariance(out, 1.0, prior);
    return out;
}

void a_bent_board_solved_with_a_prior_leaves_honest_errors_that_are_smaller_than_without()
{
    constexpr std::size_t kBentPoses = 6;
    const Scene scene = small_rig::scene();
    std::mt19937 random(46);
    const RigState state = small_rig::truth(&random);
    const RigState site = small_rig::shortened(small_rig::truth(&random), kBentPoses);
    const ViewSet clean = bowed_views(site);
    small_rig::Honesty all;
    double with = 0.0;
    double without = 0.0;
    double squares = 0.0;
    const int draws = small_rig::draws() / 2;  // each solves twice
    for (int draw = 0; draw < draws; ++draw) {
        const Prior prior = prior_of(small_rig::calibrated(state, &random), {0, 1, 2}, draw % 2 == 0);
        ViewSet set = clean;
        small_rig::add_noise(&random, &set.views);
        const Solution found = solve_bent(scene, set, site, &prior);
        all.add(small_rig::errors_of(found, site), found.covariance.matrix);
        with += found.flexible.matrix.trace();
        without += solve_bent(scene, set, site, nullptr).flexible.matrix.trace();
        for (const BoardPoint& point : scene.boards[0].points) {
            const Surface& surface = found.state.surfaces[0];
            const double z =
                bspline_value(surface.grid, surface.control.data(), point.at_mm.head<2>(), nullptr);
            squares += (z - bow_mm(point.at_mm)) * (z - bow_mm(point.at_mm)) / 48.0;
        }
    }
    all.check("bent board, lenses of all, poses in every other");
    TEST_ASSERT_TRUE(with < 0.5 * without);
    // 0.05 px at 2 mm a pixel seen under tangents of some 0.3 are 0.33 mm a view; 18 views of 48 points
    // share 17 unknowns: 0.33 / sqrt(18 * 48 / 17) = 0.05 mm.
    TEST_ASSERT_TRUE(std::sqrt(squares / draws) < 0.1);
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
    RUN_TEST(a_bent_board_solved_with_a_prior_leaves_honest_errors_that_are_smaller_than_without);
    RUN_TEST(a_prior_of_another_size_or_model_or_of_no_camera_is_refused);
    RUN_TEST(a_lens_left_open_is_the_priors_and_that_of_a_camera_the_prior_does_not_have_stays_open);
    return UNITY_END();
}
