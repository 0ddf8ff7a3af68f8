// Error bars in pixels and millimetres against the errors of repeated solves with known truth.
// TESSERA_DRAWS: how many; 60 where not given.
#include "host/report/error_bars.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <cstdio>

#include "host/solve/flexible.h"
#include "host/solve/flexible_covariance.h"
#include "tests/unit_host/small_rig.h"

using namespace rig;

void setUp() {}
void tearDown() {}

namespace {

// Mean of a draw's normalised squared errors over draws. Errors of one draw go together, so the width
// comes from the scatter between draws: four standard errors.
struct Tally {
    double sum = 0.0;
    double squares = 0.0;
    int count = 0;
    void add(double value)
    {
        sum += value;
        squares += value * value;
        ++count;
    }
    void check(const char* what) const
    {
        const double mean = sum / count;
        const double width = 4.0 * std::sqrt((squares / count - mean * mean) / (count - 1));
        std::printf("%s: squared error over variance %.4f, expected 1 +- %.4f\n", what, mean, width);
        TEST_ASSERT_TRUE_MESSAGE(std::abs(mean - 1.0) < width, what);
        TEST_ASSERT_TRUE_MESSAGE(width < 0.5, "too few draws to say anything");
    }
};

enum class Where { kWholeImage, kInside };

Eigen::Vector3d moved(const Vector6& motion, const Eigen::Vector3d& point)
{
    const Eigen::Vector3d turn = motion.head<3>();
    return point + turn.cross(point) + motion.tail<3>();
}

// Of all cameras, over the image at two distances, but for pixels that have no ray: one draw in a thousand gives a
// lens that folds before the corner.
double projection_error(const RigFile& found, const RigFile& truth, const Vector6& motion,
                        Where where = Where::kWholeImage)
{
    double sum = 0.0;
    double count = 0.0;
    for (std::size_t c = 0; c < found.cameras.size(); ++c) {
        for (const double distance : {800.0, 1400.0}) {
            for (const PixelError& error : projection_errors(found, c, distance, 6, 5)) {
                const RigCamera& known = truth.cameras[c];
                const Eigen::Vector2d from_middle = error.pixel - Eigen::Vector2d(319.5, 239.5);
                if ((where == Where::kInside && from_middle.norm() > 200.0) ||
                    !error.covariance_px2.allFinite()) {
                    continue;
                }
                const Eigen::Vector3d at =
                    inverse(known.cam_from_rig) * (distance * known.lens.unproject(error.pixel));
                const RigCamera& own = found.cameras[c];
                const Eigen::Vector2d miss =
                    own.lens.project(own.cam_from_rig * moved(motion, at)) - error.pixel;
                sum += miss.dot(error.covariance_px2.inverse() * miss);
                count += 2.0;
            }
        }
    }
    const double all = 2.0 * 2.0 * 6.0 * 5.0 * static_cast<double>(found.cameras.size());
    TEST_ASSERT_TRUE_MESSAGE(where == Where::kInside || count > 0.9 * all, "most pixels have a ray");
    return sum / count;
}

// Least squares over pixels by Gauss-Newton from `start`, derivatives by differences.
Eigen::Vector3d triangulate(const RigFile& rig, const std::vector<Eigen::Vector2d>& pixels,
                            const Eigen::Vector3d& start)
{
    Eigen::Vector3d at = start;
    for (int step = 0; step < 5; ++step) {
        Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
        Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
        for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
            const RigCamera& own = rig.cameras[c];
            const Eigen::Vector2d here = own.lens.project(own.cam_from_rig * at);
            Eigen::Matrix<double, 2, 3> slope;
            for (int k = 0; k < 3; ++k) {
                slope.col(k) = (own.lens.project(own.cam_from_rig * (at + 0.01 * Eigen::Vector3d::Unit(k)))
                                - here) / 0.01;
            }
            normal += slope.transpose() * slope;
            gradient += slope.transpose() * (here - pixels[c]);
        }
        at -= normal.ldlt().solve(gradient);
    }
    return at;
}

double triangulation_miss(const RigFile& found, const RigFile& truth, const Vector6& motion)
{
    double sum = 0.0;
    double count = 0.0;
    for (const Eigen::Vector3d& at : {Eigen::Vector3d(50, 20, 900), Eigen::Vector3d(250, -60, 1100),
                                      Eigen::Vector3d(180, 90, 1400)}) {
        std::vector<Eigen::Vector2d> pixels;
        for (const RigCamera& known : truth.cameras) {
            pixels.push_back(known.lens.project(known.cam_from_rig * at));
        }
        const PointError error = triangulation_error(found, at, 0.0);
        TEST_ASSERT_EQUAL_INT(3, error.cameras);
        const Eigen::Vector3d miss = triangulate(found, pixels, at) - moved(motion, at);
        sum += miss.dot(error.covariance_mm2.ldlt().solve(miss));
        count += 3.0;
    }
    return sum / count;
}

void errors_of_repeated_solves_are_as_large_as_the_error_bars_in_pixels_and_millimetres()
{
    std::mt19937 random(21);
    const RigState state = small_rig::truth(&random);
    const RigFile truth = small_rig::file_of(state);
    const ViewSet clean = small_rig::views(state);
    Tally pixels;
    Tally points;
    for (int draw = 0; draw < small_rig::draws(); ++draw) {
        ViewSet set = clean;
        small_rig::add_noise(&random, &set.views);
        const Solution solution = small_rig::solve(set, state);
        RigFile found = small_rig::file_of(solution.state);
        found.covariance = rig_covariance(solution);
        const Vector6 motion = small_rig::boards_motion(solution, state);
        pixels.add(projection_error(found, truth, motion));
        points.add(triangulation_miss(found, truth, motion));
    }
    pixels.check("projection");
    points.check("triangulation");
}

// Where there are data: what is known of a field beyond them is how smooth it is, and this one is none of those
// that would be drawn.
void error_bars_of_lenses_with_fields_are_honest_where_there_are_data_and_too_small_without_the_map()
{
    std::mt19937 random(24);
    RigState state = small_rig::truth(&random);
    // As many views again, so that fields have data.
    for (int more = 0; more < 3; ++more) {
        const RigState other = small_rig::truth(&random);
        state.rig_from_body.insert(state.rig_from_body.end(), other.rig_from_body.begin(),
                                   other.rig_from_body.end());
    }
    const Scene scene = small_rig::scene();
    for (std::size_t c = 0; c < small_rig::kCameras; ++c) {
        state.lenses[c].field = make_spline_field(640, 480, 4);
    }
    RigFile truth = small_rig::file_of(state);
    const ViewSet clean = small_rig::views(state);
    Tally pixels;
    Tally points;
    double without = 0.0;
    const int draws = small_rig::draws() / 2;
    for (int draw = 0; draw < draws; ++draw) {
        ViewSet set = clean;
        small_rig::add_noise(&random, &set.views);
        Solution solution;
        solution.cameras = {0, 1, 2};
        solution.gauge_cameras = {0};
        solution.part_of_camera.assign(small_rig::kCameras, 0);
        solution.noise_factor.assign(small_rig::kCameras, 1.0);
        solution.set = set;
        solution.state = state;
        TEST_ASSERT_TRUE(flexible_bundle(set.views, views_in_use(set.views), scene.boards, scene.cameras,
                                         FlexibleOptions(), &solution.state).usable);
        solution.flexible = flexible_covariance(scene, solution, nullptr, 1.0);
        RigFile found = small_rig::file_of(solution.state);
        found.covariance = rig_covariance(solution);
        const Vector6 motion = small_rig::boards_motion(solution, state);
        without += projection_error(found, truth, motion, Where::kInside) / draws;
        for (std::size_t c = 0; c < small_rig::kCameras; ++c) {
            found.cameras[c].field_errors = solution.flexible.fields[c];
        }
        pixels.add(projection_error(found, truth, motion, Where::kInside));
        points.add(triangulation_miss(found, truth, motion));
    }
    pixels.check("projection through fields");
    std::printf("without the map of the field: %.2f; triangulation %.2f\n", without, points.sum / draws);
    // Beyond what 1 would scatter by, as above.
    TEST_ASSERT_TRUE(without > 1.26);
}

void noise_of_later_observations_adds_to_what_is_triangulated()
{
    std::mt19937 random(22);
    const RigState state = small_rig::truth(&random);
    RigFile rig = small_rig::file_of(state);
    rig.covariance = rig_covariance(small_rig::solve(small_rig::views(state), state));
    const Eigen::Vector3d at(180, 20, 1000);
    const double alone = triangulation_error(rig, at, 0.0).covariance_mm2.trace();
    rig.covariance->matrix.setZero();
    const double noise = triangulation_error(rig, at, 0.1).covariance_mm2.trace();
    // Depth from a base of 520 mm at 1 m and 500 px: 0.1 px is 0.5 mm, less by three cameras.
    TEST_ASSERT_TRUE(noise > 0.1 * 0.1 && noise < 1.0);
    rig.covariance = rig_covariance(small_rig::solve(small_rig::views(state), state));
    TEST_ASSERT_TRUE(std::abs(triangulation_error(rig, at, 0.1).covariance_mm2.trace() / (alone + noise) - 1.0)
                     < 1e-9);
}

void a_point_behind_or_outside_is_seen_by_no_camera()
{
    std::mt19937 random(23);
    const RigState state = small_rig::truth(&random);
    RigFile rig = small_rig::file_of(state);
    rig.covariance = rig_covariance(small_rig::solve(small_rig::views(state), state));
    TEST_ASSERT_EQUAL_INT(0, triangulation_error(rig, {0, 0, -1000}, 0.0).cameras);
    TEST_ASSERT_EQUAL_INT(0, triangulation_error(rig, {3000, 0, 1000}, 0.0).cameras);
}

}  // namespace

int main()
{
    UNITY_BEGIN();
    RUN_TEST(errors_of_repeated_solves_are_as_large_as_the_error_bars_in_pixels_and_millimetres);
    RUN_TEST(error_bars_of_lenses_with_fields_are_honest_where_there_are_data_and_too_small_without_the_map);
    RUN_TEST(noise_of_later_observations_adds_to_what_is_triangulated);
    RUN_TEST(a_point_behind_or_outside_is_seen_by_no_camera);
    return UNITY_END();
}
