// Poses of a plane from one image of it, against the pose that made the image.
#include <cmath>
#include <random>

#include "host/solve/plane_pose.h"
#include "unity.h"

using namespace rig;

void setUp() {}
void tearDown() {}

namespace {

constexpr double kDistance = 0.03;
constexpr std::size_t kCountMin = 6;

Pose pose(double a, double b, double c, double x, double y, double z)
{
    return pose_exp((Vector6() << a, b, c, x, y, z).finished());
}

// Tilted either way, turned, off the axis, near and far; none seen from behind.
const Pose kPoses[] = {pose(0.5, 0.0, 0.0, 0, 0, 1500), pose(-0.4, 0.6, 0.3, 300, -200, 900),
                       pose(0.1, -0.8, 2.9, -400, 250, 2500), pose(0.7, 0.7, -1.0, 50, 500, 1200),
                       pose(0.0, 0.0, 1.0, 200, 100, 1000)};

// 8 x 6 points 80 mm apart about the origin.
PlanePoints image_of(const Pose& cam_from_plane, double noise = 0.0)
{
    PlanePoints points;
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 48; ++i) {
        const Eigen::Vector2d at(80.0 * (i % 8) - 280.0, 80.0 * std::floor(i / 8) - 200.0);
        const Eigen::Vector3d seen = cam_from_plane * Eigen::Vector3d(at.x(), at.y(), 0.0);
        points.plane.push_back(at);
        points.image.emplace_back(seen.x() / seen.z() + noise * normal(random),
                                  seen.y() / seen.z() + noise * normal(random));
    }
    return points;
}

void assert_found(const PlanePoints& points, double scale, const Pose& truth, double turn,
                  double shift_mm)
{
    const auto homography = find_homography(points, kDistance, kCountMin);
    TEST_ASSERT_TRUE(homography.has_value());
    const auto found = plane_pose(points, *homography, scale);
    TEST_ASSERT_TRUE(found.has_value());
    TEST_ASSERT_TRUE(rotation_distance(found->rotation, truth.rotation) < turn);
    TEST_ASSERT_TRUE((found->translation_mm - truth.translation_mm).norm() < shift_mm);
}

void exact_images_give_the_exact_pose()
{
    // The board's slope comes as a root of what is 0 where it faces the camera: half the digits.
    for (const Pose& truth : kPoses) {
        assert_found(image_of(truth), 1.0, truth, 1e-6, 1e-3);
    }
}

void the_image_of_another_focal_length_is_scaled_back()
{
    for (const Pose& truth : kPoses) {
        PlanePoints points = image_of(truth);
        for (Eigen::Vector2d& seen : points.image) {
            seen *= 0.4;
        }
        assert_found(points, 2.5, truth, 1e-6, 1e-3);
    }
}

void noise_moves_the_pose_as_little_as_it_must()
{
    // 1e-4 is 0.4 px at 4,000 px of focal length. 48 points over a tilted board of 560 mm at 1500 mm tell
    // the tilt to some 1e-4 * 1500 / (560 * 0.3 tilt and perspective) / sqrt(48 / 3): 2e-4; five times that.
    for (const Pose& truth : {kPoses[0], kPoses[1], kPoses[3]}) {
        assert_found(image_of(truth, 1e-4), 1.0, truth, 1e-3, 2.0);
    }
}

void wrong_points_have_no_say()
{
    for (const Pose& truth : kPoses) {
        PlanePoints points = image_of(truth);
        for (std::size_t i = 0; i < points.image.size(); i += 3) {
            points.image[i] += Eigen::Vector2d(0.3 * std::cos(i), 0.3 * std::sin(i));
        }
        assert_found(points, 1.0, truth, 1e-6, 1e-3);
    }
}

void points_on_a_line_have_no_homography()
{
    PlanePoints points = image_of(kPoses[1]);
    points.plane.resize(8);
    points.image.resize(8);
    TEST_ASSERT_FALSE(find_homography(points, kDistance, kCountMin).has_value());
}

void points_of_no_plane_have_no_homography()
{
    PlanePoints points = image_of(kPoses[0]);
    points.plane.resize(12);
    points.image.resize(12);
    std::mt19937 random(3);
    std::uniform_real_distribution<double> anywhere(-1.0, 1.0);
    for (Eigen::Vector2d& seen : points.image) {
        seen = {anywhere(random), anywhere(random)};
    }
    // Four points always agree with one; two of the other eight by chance in 0.003 squared of the samples
    // and pairs: 500 * 28 * (pi 0.03^2 / 4)^2, 0.7 %.
    TEST_ASSERT_FALSE(find_homography(points, kDistance, kCountMin).has_value());
}

}  // namespace

int main()
{
    UNITY_BEGIN();
    RUN_TEST(exact_images_give_the_exact_pose);
    RUN_TEST(the_image_of_another_focal_length_is_scaled_back);
    RUN_TEST(noise_moves_the_pose_as_little_as_it_must);
    RUN_TEST(wrong_points_have_no_say);
    RUN_TEST(points_on_a_line_have_no_homography);
    RUN_TEST(points_of_no_plane_have_no_homography);
    return UNITY_END();
}
