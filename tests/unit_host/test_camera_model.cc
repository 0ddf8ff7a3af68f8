// Camera models: derivatives against differences, the fold, and the way back.
#include <Eigen/LU>
#include <cmath>

#include "host/model/camera.h"
#include "unity.h"

using namespace rig;

void setUp() {}
void tearDown() {}

namespace {

const Camera kCameras[] = {
    {CameraModel::kBrown, {1400, 1410, 950, 540, -0.28, 0.09, 4e-4, -3e-4, -0.012}},
    {CameraModel::kRational, {1400, 1410, 950, 540, 0.35, 0.12, 3e-4, -2e-4, 0.01, 0.65, 0.22, 0.03}},
    {CameraModel::kThinPrism,
     {1400, 1410, 950, 540, 0.35, 0.12, 3e-4, -2e-4, 0.01, 0.65, 0.22, 0.03, 6e-4, -2e-4, -5e-4, 2e-4}},
    {CameraModel::kFisheye, {600, 610, 950, 540, -0.03, 0.008, -0.004, 0.0007}},
};

const Eigen::Vector3d kPoints[] = {
    {0, 0, 1000}, {1e-7, -1e-7, 800}, {300, -200, 900}, {-500, 260, 1100}, {5, 700, 1500}};

Eigen::Vector2d at(const Camera& camera, const std::vector<double>& intrinsics, const Eigen::Vector3d& p)
{
    Eigen::Vector2d pixel;
    TEST_ASSERT_TRUE(project_formula(camera.model, intrinsics.data(), p, &pixel, nullptr));
    return pixel;
}

void derivatives_agree_with_differences()
{
    for (const Camera& camera : kCameras) {
        for (const Eigen::Vector3d& point : kPoints) {
            Eigen::Vector2d pixel;
            ProjectionJacobian jacobian;
            TEST_ASSERT_TRUE(project_formula(camera.model, camera.intrinsics.data(), point, &pixel,
                                             &jacobian));
            for (int i = 0; i < 3; ++i) {
                // A step of 0.1 mm at 1 m: third derivatives leave 1e-8 px / mm, rounding 1e-12.
                const Eigen::Vector3d d = 0.1 * Eigen::Vector3d::Unit(i);
                const Eigen::Vector2d slope =
                    (at(camera, camera.intrinsics, point + d) - at(camera, camera.intrinsics, point - d))
                    / 0.2;
                TEST_ASSERT_TRUE((slope - jacobian.by_point.col(i)).norm() < 3e-7);
            }
            for (std::size_t i = 0; i < camera.intrinsics.size(); ++i) {
                const double step = i < 4 ? 1e-2 : 1e-5;
                std::vector<double> more = camera.intrinsics;
                std::vector<double> less = camera.intrinsics;
                more[i] += step;
                less[i] -= step;
                const Eigen::Vector2d slope = (at(camera, more, point) - at(camera, less, point)) / (2 * step);
                // Pixels of 1e3 round to 1e-13: over a step of 1e-5 that is 1e-8 of slopes up to 1e3.
                TEST_ASSERT_TRUE((slope - jacobian.by_intrinsics.col(static_cast<int>(i))).norm()
                                 < 1e-6 * (1.0 + slope.norm()));
            }
        }
    }
}

void unproject_undoes_project_over_the_image()
{
    for (const Camera& camera : kCameras) {
        for (int x = 0; x <= 1900; x += 190) {
            for (int y = 0; y <= 1080; y += 108) {
                const Eigen::Vector3d ray = camera.unproject({double(x), double(y)});
                TEST_ASSERT_TRUE(ray.allFinite());
                TEST_ASSERT_TRUE(std::abs(ray.norm() - 1.0) < 1e-14);
                // The iteration's own limit is 1e-6 px.
                const Eigen::Vector2d back = camera.project(500.0 * ray);
                TEST_ASSERT_TRUE(std::hypot(back.x() - x, back.y() - y) < 2e-6);
            }
        }
    }
}

void beyond_the_fold_there_is_no_image_and_no_ray()
{
    const Camera camera{CameraModel::kBrown, {1000, 1000, 0, 0, -0.3, 0, 0, 0, 0}};
    // d/dr (r - 0.3 r^3) = 0 at r = 1 / sqrt(0.9); bisection finds it to double precision.
    const double fold = 1.0 / std::sqrt(0.9);
    TEST_ASSERT_TRUE(std::abs(camera.fold_radius() - fold) < 1e-12);
    TEST_ASSERT_TRUE(camera.project({fold * 0.999, 0, 1}).allFinite());
    TEST_ASSERT_FALSE(camera.project({fold * 1.001, 0, 1}).allFinite());
    const double edge = 1000.0 * fold * (1.0 - 0.3 * fold * fold);
    TEST_ASSERT_TRUE(camera.unproject({edge - 0.01, 0}).allFinite());
    TEST_ASSERT_FALSE(camera.unproject({edge + 0.01, 0}).allFinite());
}

void nothing_behind_a_pinhole_is_seen()
{
    for (const Eigen::Vector3d& point : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0, 0, -1),
                                         Eigen::Vector3d(1, 1, -1), Eigen::Vector3d(1, 0, 0)}) {
        TEST_ASSERT_FALSE(kCameras[0].project(point).allFinite());
    }
}

void a_fisheye_sees_beyond_a_right_angle()
{
    const Camera camera{CameraModel::kFisheye, {300, 300, 500, 500, 0, 0, 0, 0}};
    const double theta = 1.6;  // 92 degrees
    const Eigen::Vector3d point(std::sin(theta), 0, std::cos(theta));
    TEST_ASSERT_TRUE((camera.project(point) - Eigen::Vector2d(500 + 300 * theta, 500)).norm() < 1e-10);
    TEST_ASSERT_TRUE((camera.unproject(camera.project(point)) - point).norm() < 1e-8);
}

void names_and_counts_belong_together()
{
    for (const Camera& camera : kCameras) {
        TEST_ASSERT_TRUE(camera_model_from_name(camera_model_name(camera.model)) == camera.model);
        TEST_ASSERT_EQUAL_UINT32(camera.intrinsics.size(), intrinsics_names(camera.model).size());
    }
    TEST_ASSERT_FALSE(camera_model_from_name("magic").has_value());
}

}  // namespace

int main()
{
    UNITY_BEGIN();
    RUN_TEST(derivatives_agree_with_differences);
    RUN_TEST(unproject_undoes_project_over_the_image);
    RUN_TEST(beyond_the_fold_there_is_no_image_and_no_ray);
    RUN_TEST(nothing_behind_a_pinhole_is_seen);
    RUN_TEST(a_fisheye_sees_beyond_a_right_angle);
    RUN_TEST(names_and_counts_belong_together);
    return UNITY_END();
}
