// B-splines over the plane and the lens that carries a field of them.
#include <cmath>
#include <random>

#include "host/model/camera.h"
#include "unity.h"

using namespace rig;

void setUp() {}
void tearDown() {}

namespace {

const Camera kBase{CameraModel::kBrown, {1400, 1410, 950, 540, -0.28, 0.09, 4e-4, -3e-4, -0.012}};

// A field of up to some 3 px, its control points drawn at random: rougher than any lens.
Camera bent_lens()
{
    Camera lens = kBase;
    lens.field = make_spline_field(1920, 1080, 8);
    std::mt19937 random(7);
    for (double& control : lens.field.control) {
        control = std::uniform_real_distribution<double>(-3.0, 3.0)(random);
    }
    return lens;
}

const Eigen::Vector3d kPoints[] = {
    {0, 0, 1000}, {300, -200, 900}, {-500, 260, 1100}, {5, 400, 1500}, {-640, -330, 1000}};

Eigen::Vector2d at(const Camera& lens, const std::vector<double>& intrinsics, const Eigen::Vector3d& p)
{
    Eigen::Vector2d pixel;
    TEST_ASSERT_TRUE(project_lens(lens, intrinsics.data(), p, &pixel, nullptr));
    return pixel;
}

void a_spline_reproduces_a_plane_whose_control_points_lie_on_it()
{
    const BsplineGrid grid = make_bspline_grid({-3.0, 2.0}, {9.0, 8.0}, 6);
    TEST_ASSERT_EQUAL_INT(9, grid.columns);
    TEST_ASSERT_EQUAL_INT(6, grid.rows);
    // The control point of index i along an axis stands at origin + (i - 1) step.
    std::vector<double> control;
    for (int row = 0; row < grid.rows; ++row) {
        for (int column = 0; column < grid.columns; ++column) {
            control.push_back(1.0 + 0.5 * (-3.0 + 2.0 * (column - 1)) - 0.25 * (2.0 + 2.0 * (row - 1)));
        }
    }
    for (const Eigen::Vector2d& p : {Eigen::Vector2d(-3, 2), {9, 8}, {0.3, 7.1}, {5.0, 4.0}}) {
        Eigen::Vector2d slope;
        const double value = bspline_value(grid, control.data(), p, &slope);
        // Sums of sixteen terms of size 1: a few units of the last place.
        TEST_ASSERT_TRUE(std::abs(value - (1.0 + 0.5 * p.x() - 0.25 * p.y())) < 1e-14);
        TEST_ASSERT_TRUE((slope - Eigen::Vector2d(0.5, -0.25)).norm() < 1e-14);
    }
    const Eigen::Map<const Eigen::VectorXd> c(control.data(), grid.count());
    TEST_ASSERT_TRUE(std::abs(c.dot(bspline_roughness(grid) * c)) < 1e-12);
}

void beyond_its_border_a_spline_stays_as_it_is_there()
{
    const Camera lens = bent_lens();
    const Eigen::Vector2d corner = lens.field.grid.origin;
    Eigen::Matrix2d slope;
    TEST_ASSERT_TRUE(lens.field.at(corner - Eigen::Vector2d(1e4, 50.0), &slope)
                     == lens.field.at(corner, nullptr));
    TEST_ASSERT_TRUE(slope.norm() == 0.0);
}

void the_roughness_is_the_sum_of_squared_second_differences()
{
    const BsplineGrid grid = make_bspline_grid({0, 0}, {4, 3}, 4);
    std::mt19937 random(3);
    Eigen::VectorXd c(grid.count());
    for (double& value : c) {
        value = std::uniform_real_distribution<double>(-1.0, 1.0)(random);
    }
    double sum = 0.0;
    const auto of = [&](int x, int y) { return c[y * grid.columns + x]; };
    for (int y = 0; y < grid.rows; ++y) {
        for (int x = 0; x < grid.columns; ++x) {
            if (x > 0 && x + 1 < grid.columns) {
                sum += std::pow(of(x - 1, y) - 2 * of(x, y) + of(x + 1, y), 2);
            }
            if (y > 0 && y + 1 < grid.rows) {
                sum += std::pow(of(x, y - 1) - 2 * of(x, y) + of(x, y + 1), 2);
            }
            if (x > 0 && y > 0) {
                sum += 2 * std::pow(of(x, y) - of(x - 1, y) - of(x, y - 1) + of(x - 1, y - 1), 2);
            }
        }
    }
    TEST_ASSERT_TRUE(std::abs(sum - c.dot(bspline_roughness(grid) * c)) < 1e-12 * sum);
}

void derivatives_agree_with_differences()
{
    const Camera lens = bent_lens();
    for (const Eigen::Vector3d& point : kPoints) {
        Eigen::Vector2d pixel;
        ProjectionJacobian jacobian;
        TEST_ASSERT_TRUE(project_lens(lens, lens.intrinsics.data(), point, &pixel, &jacobian));
        // Cells are 250 px wide: a third derivative of 3 px / 250^3, over steps of 0.02 px, leaves
        // 1e-11; rounding of pixels of 1e3 over such steps leaves 1e-11 as well. In millimetres: times 1.4.
        for (int i = 0; i < 3; ++i) {
            const Eigen::Vector3d d = 0.01 * Eigen::Vector3d::Unit(i);
            const Eigen::Vector2d slope =
                (at(lens, lens.intrinsics, point + d) - at(lens, lens.intrinsics, point - d)) / 0.02;
            TEST_ASSERT_TRUE((slope - jacobian.by_point.col(i)).norm() < 1e-8);
        }
        for (std::size_t i = 0; i < lens.intrinsics.size(); ++i) {
            const double step = i < 4 ? 1e-2 : 1e-5;
            std::vector<double> more = lens.intrinsics;
            std::vector<double> less = lens.intrinsics;
            more[i] += step;
            less[i] -= step;
            const Eigen::Vector2d slope = (at(lens, more, point) - at(lens, less, point)) / (2 * step);
            // Pixels of 1e3 round to 1e-13: over a step of 1e-5 that is 1e-8 of slopes up to 1e3.
            TEST_ASSERT_TRUE((slope - jacobian.by_intrinsics.col(static_cast<int>(i))).norm()
                             < 1e-6 * (1.0 + slope.norm()));
        }
        // By a control point: linear, so a step of any size is exact but for rounding.
        const Eigen::Vector2d base = at(kBase, kBase.intrinsics, point);
        const BsplineSupport s = bspline_support(lens.field.grid, base);
        Camera moved = lens;
        const Eigen::Index index = (s.row + 1) * lens.field.grid.columns + s.column + 2;
        moved.field.control[static_cast<std::size_t>(lens.field.grid.count() + index)] += 1.0;
        const Eigen::Vector2d change = at(moved, moved.intrinsics, point) - pixel;
        TEST_ASSERT_TRUE((change - Eigen::Vector2d(0.0, s.x[2] * s.y[1])).norm() < 1e-11);
    }
}

void unproject_undoes_project_over_the_image_and_its_rim()
{
    const Camera lens = bent_lens();
    for (int x = -40; x <= 1960; x += 125) {
        for (int y = -40; y <= 1120; y += 116) {
            const Eigen::Vector3d ray = lens.unproject({double(x), double(y)});
            TEST_ASSERT_TRUE(ray.allFinite());
            // The iteration's own limit is 1e-6 px.
            const Eigen::Vector2d back = lens.project(500.0 * ray);
            TEST_ASSERT_TRUE(std::hypot(back.x() - x, back.y() - y) < 2e-6);
        }
    }
}

void a_field_of_zeros_changes_nothing()
{
    Camera lens = kBase;
    lens.field = make_spline_field(1920, 1080, 12);
    TEST_ASSERT_TRUE(lens.name() == "spline");
    TEST_ASSERT_TRUE(kBase.name() == "brown");
    for (const Eigen::Vector3d& point : kPoints) {
        TEST_ASSERT_TRUE(lens.project(point) == kBase.project(point));
        const Eigen::Vector2d pixel = kBase.project(point);
        TEST_ASSERT_TRUE(lens.unproject(pixel) == kBase.unproject(pixel));
    }
}

}  // namespace

int main()
{
    UNITY_BEGIN();
    RUN_TEST(a_spline_reproduces_a_plane_whose_control_points_lie_on_it);
    RUN_TEST(beyond_its_border_a_spline_stays_as_it_is_there);
    RUN_TEST(the_roughness_is_the_sum_of_squared_second_differences);
    RUN_TEST(derivatives_agree_with_differences);
    RUN_TEST(unproject_undoes_project_over_the_image_and_its_rim);
    RUN_TEST(a_field_of_zeros_changes_nothing);
    return UNITY_END();
}
