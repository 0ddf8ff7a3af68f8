// Residuals and their derivatives, their compression, and the centre of an imaged circle.
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "host/solve/circle_centre.h"
#include "host/solve/view_cost.h"
#include "unity.h"

using namespace rig;

void setUp() {}
void tearDown() {}

namespace {

// One lens of every model.
const std::vector<Camera> kLenses{
    {CameraModel::kBrown, {1400, 1410, 950, 540, -0.28, 0.09, 4e-4, -3e-4, -0.012}},
    {CameraModel::kRational,
     {1400, 1410, 950, 540, 0.35, 0.12, 3e-4, -2e-4, 0.01, 0.65, 0.22, 0.03}},
    {CameraModel::kThinPrism,
     {1400, 1410, 950, 540, 0.35, 0.12, 3e-4, -2e-4, 0.01, 0.65, 0.22, 0.03, 6e-4, -2e-4, -5e-4, 2e-4}},
    {CameraModel::kFisheye, {700, 710, 950, 540, -0.03, 0.008, -0.004, 7e-4}}};
const Camera& kLens = kLenses[2];

// A member of a body, so that all three links are there.
RigState make_state(const Camera& lens)
{
    RigState state;
    state.lenses = {lens};
    state.cam_from_rig = {(Vector6() << 0.1, -0.2, 0.05, -300.0, 20.0, 15.0).finished()};
    state.rig_from_body = {(Vector6() << 0.4, 0.3, -1.2, -100.0, 250.0, 1200.0).finished()};
    state.body_from_board = {(Vector6() << -0.1, 0.2, 0.3, 50.0, -80.0, 30.0).finished()};
    return state;
}

View make_view()
{
    View view;
    view.member = 0;
    for (int i = 0; i < 91; ++i) {
        ViewPoint point;
        point.at_mm = {40.0 * (i % 10), 35.0 * (i / 10), 3.0 * (i % 4)};
        point.pixel = {900.0 + 3.0 * (i % 7), 500.0 - 2.0 * (i % 5)};
        point.centre_offset_px = {0.25f * static_cast<float>(i % 3), -0.5f};
        point.sigma_px = 0.5f + 0.01f * static_cast<float>(i);
        point.used = i % 13 != 0 && i != 90;
        view.points.push_back(point);
    }
    return view;
}

// Every number of the state that a view depends on, in the order of chain_normal.
std::vector<double*> parameters_of(RigState* state)
{
    std::vector<double*> out;
    for (double& number : state->lenses[0].intrinsics) {
        out.push_back(&number);
    }
    for (Vector6* pose : {&state->cam_from_rig[0], &state->rig_from_body[0], &state->body_from_board[0]}) {
        for (int i = 0; i < 6; ++i) {
            out.push_back(pose->data() + i);
        }
    }
    return out;
}

// Residuals of the points in use, one under the other.
Eigen::VectorXd used_residuals(const View& view, const RigState& state)
{
    Eigen::Matrix2Xd all;
    view_residuals(view, state, &all);
    std::vector<double> used;
    for (std::size_t i = 0; i < view.points.size(); ++i) {
        if (view.points[i].used) {
            used.push_back(all(0, static_cast<Eigen::Index>(i)));
            used.push_back(all(1, static_cast<Eigen::Index>(i)));
        }
    }
    return Eigen::Map<Eigen::VectorXd>(used.data(), static_cast<Eigen::Index>(used.size()));
}

// By central differences of used_residuals, each step a millionth of what moves points by their
// distance: good to 1e-8 of a column's length.
Eigen::MatrixXd differences(const View& view, RigState state)
{
    const std::vector<double*> parameters = parameters_of(&state);
    Eigen::MatrixXd jacobian(used_residuals(view, state).size(),
                             static_cast<Eigen::Index>(parameters.size()));
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        const double value = *parameters[i];
        const double step = 1e-6 * std::max(1.0, std::abs(value));
        *parameters[i] = value + step;
        const Eigen::VectorXd ahead = used_residuals(view, state);
        *parameters[i] = value - step;
        jacobian.col(static_cast<Eigen::Index>(i)) =
            (ahead - used_residuals(view, state)) / (2.0 * step);
        *parameters[i] = value;
    }
    return jacobian;
}

void residuals_are_those_of_the_lens_formula()
{
    const View view = make_view();
    for (const Camera& lens : kLenses) {
        const RigState state = make_state(lens);
        Eigen::Matrix2Xd residuals;
        view_residuals(view, state, &residuals);
        for (std::size_t i = 0; i < view.points.size(); ++i) {
            const ViewPoint& point = view.points[i];
            Eigen::Vector2d pixel;
            TEST_ASSERT_TRUE(project_formula(lens.model, lens.intrinsics.data(),
                                             cam_from_board(state, view) * point.at_mm, &pixel, nullptr));
            const Eigen::Vector2d expected =
                (pixel + point.centre_offset_px.cast<double>() - point.pixel)
                / static_cast<double>(point.sigma_px);
            // Double arithmetic on pixels of 1e3 over sigmas of 0.5: 1e-12 and a few roundings.
            TEST_ASSERT_TRUE((residuals.col(static_cast<Eigen::Index>(i)) - expected).norm() < 1e-10);
        }
    }
}

void normal_matrix_is_that_of_difference_quotients()
{
    const View view = make_view();
    for (const Camera& lens : kLenses) {
        const RigState state = make_state(lens);
        LocalQuadratic quadratic;
        TEST_ASSERT_TRUE(
            local_quadratic(view, lens, cam_from_board(state, view), 0.0, true, &quadratic));
        const Eigen::MatrixXd normal = chain_normal(quadratic, chain_of(state, view));
        const Eigen::MatrixXd jacobian = differences(view, state);
        const Eigen::VectorXd scale = jacobian.colwise().norm().cwiseInverse();
        const Eigen::MatrixXd difference = normal - jacobian.transpose() * jacobian;
        // Of unit columns; an error in a formula shows at 1e-3 and more.
        TEST_ASSERT_TRUE((scale.asDiagonal() * difference * scale.asDiagonal()).cwiseAbs().maxCoeff() < 1e-6);
        const Eigen::VectorXd residuals = used_residuals(view, state);
        TEST_ASSERT_TRUE(std::abs(quadratic.squares / residuals.squaredNorm() - 1.0) < 1e-12);
    }
}

void gradient_is_that_of_the_robust_sum()
{
    const View view = make_view();
    for (const Camera& lens : kLenses) {
        const Pose pose = cam_from_board(make_state(lens), view);
        for (const double cauchy : {0.0, 50.0}) {
            LocalQuadratic quadratic;
            TEST_ASSERT_TRUE(local_quadratic(view, lens, pose, cauchy, true, &quadratic));
            const Eigen::Index lens_count = quadratic.gradient.size() - kMotionCount;
            for (Eigen::Index i = 0; i < quadratic.gradient.size(); ++i) {
                double sums[2];
                double step = 1e-6;
                for (int side = 0; side < 2; ++side) {
                    const double way = side == 0 ? -step : step;
                    Camera moved = lens;
                    Pose turned = pose;
                    if (i < lens_count) {
                        moved.intrinsics[static_cast<std::size_t>(i)] += way;
                    } else if (i < lens_count + 3) {
                        turned.rotation =
                            rotation_exp(way * Eigen::Vector3d::Unit(i - lens_count)) * pose.rotation;
                    } else {
                        turned.translation_mm[i - lens_count - 3] += way;
                    }
                    LocalQuadratic there;
                    TEST_ASSERT_TRUE(local_quadratic(view, moved, turned, cauchy, false, &there));
                    sums[side] = there.squares;
                }
                // Sums of some 1e7 lose 1e-9 to rounding, over steps of 1e-6 1e-3 of slope; slopes
                // that matter are the geometric mean of the sum and the curvature.
                const double slope = (sums[1] - sums[0]) / (4.0 * step);
                const double size = std::sqrt(quadratic.normal(i, i) * quadratic.squares);
                TEST_ASSERT_TRUE(std::abs(slope - quadratic.gradient[i])
                                 < 1e-5 * size + 1e-15 * quadratic.squares / step);
            }
        }
    }
}

void a_point_in_use_without_image_makes_the_step_impossible()
{
    View view = make_view();
    RigState state = make_state(kLens);
    view.points[5].at_mm.z() = -5000.0;
    LocalQuadratic quadratic;
    TEST_ASSERT_FALSE(local_quadratic(view, kLens, cam_from_board(state, view), 0.0, true, &quadratic));
    Eigen::Matrix2Xd residuals;
    view_residuals(view, state, &residuals);
    TEST_ASSERT_TRUE(!residuals.col(5).allFinite() && residuals.col(4).allFinite());
    view.points[5].used = false;
    TEST_ASSERT_TRUE(local_quadratic(view, kLens, cam_from_board(state, view), 0.0, true, &quadratic));
}

void compression_keeps_cost_gradient_and_information()
{
    const View view = make_view();
    const RigState state = make_state(kLens);
    for (const double cauchy : {0.0, 50.0}) {
        LocalQuadratic full;
        TEST_ASSERT_TRUE(local_quadratic(view, kLens, cam_from_board(state, view), cauchy, true, &full));
        CompressedView compressed;
        compress(view, state, cauchy, &compressed);
        const ViewCost cost(&compressed, 16, true);
        const int rows = cost.num_residuals();
        std::vector<double> residuals(static_cast<std::size_t>(rows));
        using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
        Rows a(rows, 16);
        Rows b(rows, 6);
        Rows c(rows, 6);
        Rows d(rows, 6);
        double* jacobians[] = {a.data(), b.data(), c.data(), d.data()};
        TEST_ASSERT_TRUE(cost.Evaluate(nullptr, residuals.data(), jacobians));
        Eigen::MatrixXd all(rows, 34);
        all << a, b, c, d;
        const Eigen::Map<Eigen::VectorXd> r(residuals.data(), rows);
        const Eigen::MatrixXd normal = chain_normal(full, chain_of(state, view));
        const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseInverse();
        // Compared where every parameter has the same weight. The factor drops pivots below 1e-14
        // of 34 columns.
        TEST_ASSERT_TRUE((scale.asDiagonal() * (all.transpose() * all - normal) * scale.asDiagonal()).norm()
                         < 1e-11);
        TEST_ASSERT_TRUE((all.leftCols(16).transpose() * r - full.gradient.head(16))
                             .cwiseProduct(scale.head(16))
                             .norm()
                         < 1e-9 * r.norm());
        TEST_ASSERT_TRUE(std::abs(r.squaredNorm() / full.squares - 1.0) < 1e-12);
    }
}

// By another road: many samples, a general conic by orthogonal factors, Euclidean spacing along the
// edge, and distances: those of a conic over its slope there, which each round takes from the last.
Eigen::Vector2d dense_centre(const Camera& lens, const Pose& pose, const Eigen::Vector3d& centre, double radius)
{
    constexpr int kCount = 2000;
    Eigen::Matrix<double, 2, Eigen::Dynamic> edge(2, kCount);
    for (int k = 0; k < kCount; ++k) {
        const double phi = 2.0 * std::acos(-1.0) * k / kCount;
        Eigen::Vector2d pixel;
        const Eigen::Vector3d at = centre + radius * Eigen::Vector3d(std::cos(phi), std::sin(phi), 0.0);
        TEST_ASSERT_TRUE(project_formula(lens.model, lens.intrinsics.data(), pose * at, &pixel, nullptr));
        edge.col(k) = pixel;
    }
    const Eigen::Vector2d mean = edge.rowwise().mean();
    const double size = (edge.colwise() - mean).norm() / std::sqrt(2.0 * kCount);
    Eigen::MatrixXd rows(kCount, 5);
    Eigen::VectorXd right(kCount);
    Eigen::VectorXd q;
    for (int round = 0; round < 5; ++round) {
        for (int k = 0; k < kCount; ++k) {
            const Eigen::Vector2d p = (edge.col(k) - mean) / size;
            const double length = (edge.col((k + 1) % kCount) - edge.col((k + kCount - 1) % kCount)).norm();
            double slope = 1.0;
            if (round > 0) {
                slope = std::hypot(2.0 * q[0] * p.x() + q[1] * p.y() + q[3],
                                   q[1] * p.x() + 2.0 * q[2] * p.y() + q[4]);
            }
            const double weight = std::sqrt(length) / slope;
            rows.row(k) << p.x() * p.x(), p.x() * p.y(), p.y() * p.y(), p.x(), p.y();
            rows.row(k) *= weight;
            right[k] = weight;
        }
        q = rows.colPivHouseholderQr().solve(right);
    }
    const double det = 4.0 * q[0] * q[2] - q[1] * q[1];
    return mean + size * Eigen::Vector2d((q[1] * q[4] - 2.0 * q[2] * q[3]) / det,
                                         (q[1] * q[3] - 2.0 * q[0] * q[4]) / det);
}

void circle_centres_agree_with_dense_sampling()
{
    double worst_px = 0.0;
    double largest_px = 0.0;
    for (const double k1 : {0.0, -0.33, 0.33}) {
        const Camera lens{CameraModel::kBrown, {1400, 1400, 960, 540, k1, 0, 0, 0, 0}};
        for (const double tilt : {0.0, 0.5, 1.047}) {
            for (const double across : {0.0, 0.3}) {
                for (const double radius_px : {3.0, 12.0, 40.0}) {
                    const Pose pose{rotation_exp({tilt * 0.6, tilt * 0.8, 0.0}), {1000 * across, 150, 1000}};
                    const double radius = radius_px / 1.4;
                    const Eigen::Vector3d at(2.0, -3.0, 0.0);
                    Eigen::Vector2d point;
                    TEST_ASSERT_TRUE(project_formula(lens.model, lens.intrinsics.data(), pose * at, &point,
                                                     nullptr));
                    const Eigen::Vector2d offset = circle_centre_offset(lens, pose, at, radius);
                    const Eigen::Vector2d dense = dense_centre(lens, pose, at, radius) - point;
                    worst_px = std::max(worst_px, (offset - dense).norm());
                    largest_px = std::max(largest_px, offset.norm());
                }
            }
        }
    }
    std::printf("circle centre: worst error %.2e px, largest offset %.3f px\n", worst_px, largest_px);
    // What the solver promises.
    TEST_ASSERT_TRUE(worst_px < 0.001);
    TEST_ASSERT_TRUE(largest_px > 0.5);
}

}  // namespace

int main()
{
    UNITY_BEGIN();
    RUN_TEST(residuals_are_those_of_the_lens_formula);
    RUN_TEST(normal_matrix_is_that_of_difference_quotients);
    RUN_TEST(gradient_is_that_of_the_robust_sum);
    RUN_TEST(a_point_in_use_without_image_makes_the_step_impossible);
    RUN_TEST(compression_keeps_cost_gradient_and_information);
    RUN_TEST(circle_centres_agree_with_dense_sampling);
    return UNITY_END();
}
