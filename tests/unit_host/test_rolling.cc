// Boards that move while rows are read: derivatives, what is found on simulated rigs with known
// truth, and whether the covariance is as large as the errors. TESSERA_DRAWS: three times how many
// draws; 60 where not given.
#include "host/solve/rolling_kernel.h"

#include "host/solve/flexible.h"
#include "host/solve/row_times.h"
#include "host/solve/velocity_prior.h"
#include "tests/unit_host/small_rig.h"
#include "unity.h"

using namespace rig;

void setUp() {}
void tearDown() {}

namespace {

// 480 rows of these take 14 and 17 ms; the third camera has a global shutter.
constexpr double kRowNs[] = {30000.0, 36000.0, 0.0};

Scene rolling_scene(double second_ns = kRowNs[1])
{
    Scene scene = small_rig::scene();
    for (std::size_t c = 0; c < 3; ++c) {
        scene.cameras[c].row_time_ns = c == 1 ? second_ns : kRowNs[c];
    }
    return scene;
}

// A rig whose boards move at 300 mm/s and 1 rad/s (root mean square), times `speed`; observed
// without noise.
struct Moving {
    Scene scene = rolling_scene();
    RigState truth;
    ViewSet set;
};

// Each point where its row sees it: a row time moves it by a hundredth of what the row was off by.
void observe_moving(const RigState& truth, std::vector<View>* views)
{
    for (View& view : *views) {
        const RowPoses poses(view, truth);
        const Camera& lens = truth.lenses[static_cast<std::size_t>(view.camera)];
        for (int round = 0; round < 12; ++round) {
            for (ViewPoint& point : view.points) {
                point.pixel = lens.project(poses.at(point.pixel.y()) * point.at_mm);
            }
        }
    }
}

Moving moving(std::mt19937* random, double speed, double second_ns = kRowNs[1])
{
    Moving out;
    out.scene = rolling_scene(second_ns);
    out.truth = small_rig::truth(random);
    out.set = small_rig::views(out.truth);
    start_shutter(out.scene, &out.set, &out.truth);
    std::normal_distribution<double> normal(0.0, speed / std::sqrt(3.0));
    for (Vector6& velocity : out.truth.shutter.velocity) {
        for (int i = 0; i < 6; ++i) {
            velocity[i] = (i < 3 ? 1.0 : 300.0) * normal(*random);
        }
    }
    observe_moving(out.truth, &out.set.views);
    return out;
}

// The joint solution from the true lenses and poses, but boards thought to stand still.
Solution solve(const Scene& scene, const ViewSet& set, RigState start)
{
    Solution solution;
    solution.cameras = {0, 1, 2};
    solution.gauge_cameras = {0};
    solution.part_of_camera.assign(3, 0);
    solution.set = set;
    start_shutter(scene, &solution.set, &start);
    solution.state = start;
    const RefineResult refined =
        refine_rolling(BundleOptions(), &solution.set.views, &solution.state);
    TEST_ASSERT_TRUE(refined.converged);
    solution.noise_factor = refined.noise_factor;
    return solution;
}

double squares(const std::vector<View>& views, const RigState& state)
{
    double sum = 0.0;
    for (const View& view : views) {
        LocalQuadratic quadratic;
        TEST_ASSERT_TRUE(rolling_quadratic(view, state, 0.0, false, &quadratic));
        sum += quadratic.squares;
    }
    return sum;
}

// A board of two: the second, a member, 200 mm from its body's origin and turned against it.
void make_member(Moving* rig)
{
    Vector6 place;
    place << 0.1, -0.2, 0.3, 200.0, 30.0, -20.0;
    rig->truth.body_from_board = {place};
    rig->set.views.front().member = 0;
    std::vector<View> one{rig->set.views.front()};
    observe_moving(rig->truth, &one);
    rig->set.views.front() = one.front();
}

void the_gradient_is_the_slope_of_the_sum_of_squares()
{
    std::mt19937 random(3);
    Moving rig = moving(&random, 1.0);
    make_member(&rig);
    small_rig::add_noise(&random, &rig.set.views);
    std::vector<View> views{rig.set.views.front()};
    const std::size_t pose = views.front().pose;
    rig.truth.cam_from_rig[0] << 0.1, -0.05, 0.02, 10.0, -20.0, 5.0;
    LocalQuadratic quadratic;
    TEST_ASSERT_TRUE(rolling_quadratic(views.front(), rig.truth, 0.0, true, &quadratic));
    const RollingMaps maps = rolling_maps(views.front(), rig.truth);
    const Vector12 pull = quadratic.gradient.tail<12>();
    const auto probe = [&](const char* what, double* number, double step, double predicted) {
        const double kept = *number;
        *number = kept + step;
        const double ahead = squares(views, rig.truth);
        *number = kept - step;
        const double behind = squares(views, rig.truth);
        *number = kept;
        const double slope = (ahead - behind) / (2.0 * step);
        std::printf("%s: slope %.6g, gradient %.6g\n", what, slope, 2.0 * predicted);
        // Offsets are held on both sides, so that both are of one function: what differs is the
        // quotient's third order, and rounding.
        TEST_ASSERT_TRUE(std::abs(slope - 2.0 * predicted) < 1e-4 * std::abs(slope) + 1e-3);
    };
    // By velocity and row time all is linear but for products of both: differences are exact to
    // their rounding.
    for (int i = 0; i < 6; ++i) {
        probe("velocity", &rig.truth.shutter.velocity[pose][i], i < 3 ? 1e-3 : 1.0,
              maps.velocity.col(i).dot(pull));
    }
    probe("row time", &rig.truth.shutter.row_time_s[0], 1e-8, maps.row_time.dot(pull));
    // With the offsets made for the true velocity the pose's share is all there is.
    update_centre_offsets(rig.truth, 1, &views);
    TEST_ASSERT_TRUE(rolling_quadratic(views.front(), rig.truth, 0.0, true, &quadratic));
    const Vector12 rest = quadratic.gradient.tail<12>();
    for (int i = 0; i < 6; ++i) {
        const double step = i < 3 ? 1e-6 : 1e-3;
        probe("pose", &rig.truth.rig_from_body[pose][i], step, maps.link[1].col(i).dot(rest));
        probe("member", &rig.truth.body_from_board[0][i], step, maps.link[2].col(i).dot(rest));
    }
}

void offsets_made_for_another_velocity_give_nearly_the_same_residuals()
{
    std::mt19937 random(4);
    const Moving rig = moving(&random, 1.0);
    std::vector<View> views = rig.set.views;
    update_centre_offsets(rig.truth, 1, &views);
    // Exact up to the offsets' own digits: a float holds 10 px to 1e-6, and that is 1e-5 of a
    // sigma.
    const double points = static_cast<double>(views.size()) * 48.0;
    TEST_ASSERT_TRUE(squares(views, rig.truth) < 1e-8 * points);
    // Held at rest, what is left is of second order: (1 rad/s 8 ms)^2 / 2 of a board of 350 mm at 1
    // m and 500 px, 0.006 px, with some boards at three times the speed.
    std::vector<View> still = rig.set.views;
    const double rms_px = small_rig::kNoisePx * std::sqrt(squares(still, rig.truth) / points);
    std::printf("second order: %.4f px\n", rms_px);
    TEST_ASSERT_TRUE(rms_px < 0.05);
}

void without_noise_lenses_velocities_and_a_row_time_are_found()
{
    std::mt19937 random(5);
    Moving rig = moving(&random, 1.0);
    rig.scene.cameras[1].estimate_row_time = true;
    rig.scene.cameras[1].row_time_ns = 0.0;
    // Offsets settle to 2e-5 px, a 50th of this sigma; so does everything. The prior, which counts
    // as an observation, is off by as much as velocities are large: what it holds is off by part of
    // its sigma.
    for (View& view : rig.set.views) {
        for (ViewPoint& point : view.points) {
            point.sigma_px = 1e-3f;
        }
    }
    const Solution found = solve(rig.scene, rig.set, rig.truth);
    Solution judged = found;
    judged.covariance = rig_covariance(found);
    const double own_ns = 1e9 * judged.covariance.row_time_s[1];
    const double miss_ns = 1e9 * found.state.shutter.row_time_s[1] - kRowNs[1];
    std::printf("row time off by %.3f ns, sigma %.3f ns\n", miss_ns, own_ns);
    TEST_ASSERT_TRUE(std::abs(miss_ns) < 0.5 * own_ns);
    for (std::size_t c = 0; c < 3; ++c) {
        const Eigen::Index fx = judged.covariance.lens[c];
        const double sigma = std::sqrt(judged.covariance.matrix(fx, fx));
        TEST_ASSERT_TRUE(std::abs(found.state.lenses[c].intrinsics[0] - rig.truth.lenses[c].intrinsics[0])
                         < 0.5 * sigma);
    }
}

void errors_of_moving_boards_are_as_large_as_the_covariance_says()
{
    std::mt19937 random(6);
    const Moving rig = moving(&random, 1.0);
    Scene scene = rig.scene;
    scene.cameras[1].estimate_row_time = true;
    scene.cameras[1].row_time_ns = 0.0;
    small_rig::Honesty lenses_and_poses;
    small_rig::Honesty row_time;
    for (int draw = 0; draw < small_rig::draws() / 3; ++draw) {
        ViewSet set = rig.set;
        small_rig::add_noise(&random, &set.views);
        Solution found = solve(scene, set, rig.truth);
        found.covariance = rig_covariance(found);
        const Eigen::VectorXd error = small_rig::errors_of(found, rig.truth);
        const Eigen::Index own = error.size() - 6;
        lenses_and_poses.add(error.head(own), found.covariance.matrix.topLeftCorner(own, own));
        const double sigma = found.covariance.row_time_s[1];
        const Eigen::VectorXd miss =
            Eigen::VectorXd::Constant(1, found.state.shutter.row_time_s[1] - 1e-9 * kRowNs[1]);
        row_time.add(miss, Eigen::MatrixXd::Constant(1, 1, sigma * sigma));
    }
    lenses_and_poses.check("lenses and poses");
    row_time.check("row time");
}

void a_row_time_far_from_where_it_starts_is_found()
{
    // The start is 42 us; a detector at its best has sigmas of 0.003 px, and misfits begin at a
    // thousand of them.
    for (const double true_ns : {0.0, 10000.0, 100000.0}) {
        std::mt19937 random(12);
        Moving rig = moving(&random, 1.0, true_ns);
        std::normal_distribution<double> normal(0.0, 0.003);
        for (View& view : rig.set.views) {
            for (ViewPoint& point : view.points) {
                point.sigma_px = 0.003f;
                point.pixel += Eigen::Vector2d(normal(random), normal(random));
            }
        }
        rig.scene.cameras[1].estimate_row_time = true;
        Solution found = solve(rig.scene, rig.set, rig.truth);
        found.covariance = rig_covariance(found);
        const double miss_ns = 1e9 * found.state.shutter.row_time_s[1] - true_ns;
        std::printf("row time of %.0f ns: off by %.2f ns, sigma %.2f ns\n", true_ns, miss_ns,
                    1e9 * found.covariance.row_time_s[1]);
        // Five sigmas: a Gaussian is further off once in two million.
        TEST_ASSERT_TRUE(std::abs(miss_ns) < 5e9 * found.covariance.row_time_s[1]);
        TEST_ASSERT_TRUE(found.covariance.row_time_s[1] < 1e-7);
    }
}

void boards_held_still_cost_nothing()
{
    std::mt19937 random(7);
    const Moving rig = moving(&random, 0.0);
    double rolling = 0.0;
    double global = 0.0;
    for (int draw = 0; draw < 8; ++draw) {
        ViewSet set = rig.set;
        small_rig::add_noise(&random, &set.views);
        const Solution with = solve(rig.scene, set, rig.truth);
        const Solution without = solve(small_rig::scene(), set, rig.truth);
        TEST_ASSERT_TRUE(without.state.shutter.empty());
        for (std::size_t c = 0; c < 3; ++c) {
            const double truth = rig.truth.lenses[c].intrinsics[0];
            rolling += std::pow(with.state.lenses[c].intrinsics[0] - truth, 2);
            global += std::pow(without.state.lenses[c].intrinsics[0] - truth, 2);
        }
    }
    std::printf("focal lengths, boards held still: %.4f px with velocities free, %.4f without\n",
                std::sqrt(rolling / 24.0), std::sqrt(global / 24.0));
    // The likeliest deviations of 15 boards may be above zero by chance; what they then let through
    // is below what the data tell of one number in ten.
    TEST_ASSERT_TRUE(std::sqrt(rolling / global) < 1.05);
}

void deviations_are_those_of_the_boards()
{
    std::mt19937 random(8);
    Moving rig = moving(&random, 1.0);
    small_rig::add_noise(&random, &rig.set.views);
    const VelocityDeviation found = solve(rig.scene, rig.set, rig.truth).state.shutter.deviation;
    double turn = 0.0;
    double shift = 0.0;
    for (const Vector6& velocity : rig.truth.shutter.velocity) {
        turn += velocity.head<3>().squaredNorm() / (3.0 * small_rig::kPoses);
        shift += velocity.tail<3>().squaredNorm() / (3.0 * small_rig::kPoses);
    }
    std::printf("turn %.3f rad/s, true %.3f; shift %.1f mm/s, true %.1f\n", found.turn_rad_s, std::sqrt(turn),
                found.shift_mm_s, std::sqrt(shift));
    // The data tell each velocity far better than it is large, all but a few directions of 45.
    TEST_ASSERT_TRUE(std::abs(found.turn_rad_s / std::sqrt(turn) - 1.0) < 0.15);
    TEST_ASSERT_TRUE(std::abs(found.shift_mm_s / std::sqrt(shift) - 1.0) < 0.15);
}

void the_solver_of_fields_and_surfaces_comes_to_the_same_minimum()
{
    std::mt19937 random(9);
    Moving rig = moving(&random, 1.0);
    small_rig::add_noise(&random, &rig.set.views);
    rig.scene.cameras[1].estimate_row_time = true;
    Solution found = solve(rig.scene, rig.set, rig.truth);
    found.state.shutter.row_times_held = false;
    BundleOptions to_the_end;
    to_the_end.trust = 1e8;
    TEST_ASSERT_TRUE(bundle(found.set.views, to_the_end, &found.state).usable);
    found.covariance = rig_covariance(found);
    rig.scene.boards[0].points.clear();
    for (int k = 0; k < 48; ++k) {
        BoardPoint point;
        point.at_mm = {50.0 * (k % 8), 50.0 * (k / 8), 0.0};
        rig.scene.boards[0].points.push_back(point);
    }
    for (View& view : found.set.views) {
        for (ViewPoint& point : view.points) {
            const Eigen::Vector2i cell = (point.at_mm.head<2>() / 50.0).cast<int>();
            point.point = static_cast<std::uint32_t>(8 * cell.y() + cell.x());
        }
    }
    RigState moved = found.state;
    moved.lenses[1].intrinsics[0] += 0.5;
    moved.shutter.row_time_s[1] += 1e-6;
    moved.shutter.velocity[2] += 0.05 * moved.shutter.velocity[2];
    const FlexibleResult result =
        flexible_bundle(found.set.views, views_in_use(found.set.views), rig.scene.boards,
                        rig.scene.cameras, FlexibleOptions(), &moved);
    TEST_ASSERT_TRUE(result.usable);
    // Both end where a step lowers the sum of squares by a 1e-9th part: a thousandth of a sigma.
    const Eigen::Index lens = found.covariance.lens[1];
    const double sigma = std::sqrt(found.covariance.matrix(lens, lens));
    TEST_ASSERT_TRUE(std::abs(moved.lenses[1].intrinsics[0] - found.state.lenses[1].intrinsics[0])
                     < 0.01 * sigma);
    TEST_ASSERT_TRUE(std::abs(moved.shutter.row_time_s[1] - found.state.shutter.row_time_s[1])
                     < 0.01 * found.covariance.row_time_s[1]);
    const FlexibleInformation information = flexible_information(
        found.set.views, rig.scene.boards, rig.scene.cameras, {0}, nullptr, 1.0, found.state);
    const Eigen::MatrixXd full = information.matrix.selfadjointView<Eigen::Lower>();
    const Eigen::VectorXd scale = full.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd even = scale.asDiagonal() * full * scale.asDiagonal();
    const Eigen::MatrixXd covariance =
        scale.asDiagonal() * even.ldlt().solve(Eigen::MatrixXd::Identity(full.rows(), full.cols()))
        * scale.asDiagonal();
    // Two sums of the same information: they differ by rounding, magnified by its condition.
    const Eigen::Index at = information.layout.row_time[1];
    TEST_ASSERT_TRUE(std::abs(std::sqrt(covariance(at, at)) / found.covariance.row_time_s[1] - 1.0) < 1e-3);
    const Eigen::Index fx = information.layout.lens[1];
    TEST_ASSERT_TRUE(std::abs(std::sqrt(covariance(fx, fx)) / sigma - 1.0) < 1e-3);
}

void stamps_that_differ_within_an_instant_are_times_too()
{
    std::mt19937 random(10);
    Moving rig = moving(&random, 1.0);
    // The camera with the global shutter saw each instant 4 ms later.
    for (int frame = 0; frame < small_rig::kPoses; ++frame) {
        rig.scene.stamps_ns[{2, frame}] = 4000000;
    }
    RigState truth = rig.truth;
    start_shutter(rig.scene, &rig.set, &truth);
    truth.shutter.velocity = rig.truth.shutter.velocity;
    observe_moving(truth, &rig.set.views);
    small_rig::add_noise(&random, &rig.set.views);
    Solution found = solve(rig.scene, rig.set, truth);
    const double factor = found.noise_factor[2];
    std::printf("noise factor of the late camera %.3f\n", factor);
    // 700 residuals tell it to 3 %; taken for simultaneous they would be 1 mm, 0.5 px, off: ten
    // sigmas.
    TEST_ASSERT_TRUE(factor > 0.85 && factor < 1.15);
}

void boards_that_stand_still_for_sure_have_no_velocity()
{
    std::mt19937 random(11);
    Moving rig = moving(&random, 0.0);
    rig.scene.boards[0].is_static = true;
    start_shutter(rig.scene, &rig.set, &rig.truth);
    TEST_ASSERT_TRUE(rig.truth.shutter.empty());
}

void a_row_time_without_one_that_is_known_is_refused()
{
    Scene scene = rolling_scene();
    scene.cameras[0].estimate_row_time = true;
    TEST_ASSERT_TRUE(check_row_time_reference(scene, {0, 0, 0}).ok());
    const Status apart = check_row_time_reference(scene, {0, 1, 0});
    TEST_ASSERT_FALSE(apart.ok());
    TEST_ASSERT_TRUE(apart.sentence().find("camera 'cam0': its row time cannot be estimated") == 0);
}

}  // namespace

int main()
{
    UNITY_BEGIN();
    RUN_TEST(the_gradient_is_the_slope_of_the_sum_of_squares);
    RUN_TEST(offsets_made_for_another_velocity_give_nearly_the_same_residuals);
    RUN_TEST(without_noise_lenses_velocities_and_a_row_time_are_found);
    RUN_TEST(errors_of_moving_boards_are_as_large_as_the_covariance_says);
    RUN_TEST(a_row_time_far_from_where_it_starts_is_found);
    RUN_TEST(boards_held_still_cost_nothing);
    RUN_TEST(deviations_are_those_of_the_boards);
    RUN_TEST(the_solver_of_fields_and_surfaces_comes_to_the_same_minimum);
    RUN_TEST(stamps_that_differ_within_an_instant_are_times_too);
    RUN_TEST(boards_that_stand_still_for_sure_have_no_velocity);
    RUN_TEST(a_row_time_without_one_that_is_known_is_refused);
    return UNITY_END();
}
