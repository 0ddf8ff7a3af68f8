// The residual's derivatives, its compression, and the centre of an imaged circle.
#include <ceres/gradient_checker.h>

#include <cmath>
#include <cstdio>

#include "host/solve/circle_centre.h"
#include "host/solve/residuals.h"
#include "unity.h"

using namespace rig;

void setUp() {}
void tearDown() {}

namespace {

const Camera kLens{CameraModel::kThinPrism,
                   {1400, 1410, 950, 540, 0.35, 0.12, 3e-4, -2e-4, 0.01, 0.65, 0.22, 0.03, 6e-4, -2e-4,
                    -5e-4, 2e-4}};
const Vector6 kCamera = (Vector6() << 0.1, -0.2, 0.05, -300.0, 20.0, 15.0).finished();
const Vector6 kBoard = (Vector6() << 0.4, 0.3, -1.2, -200.0, 150.0, 1300.0).finished();

View make_view()
{
    View view;
    for (int i = 0; i < 90; ++i) {
        ViewPoint point;
        point.at_mm = {40.0 * (i % 10), 35.0 * (i / 10), 0.0};
        point.pixel = {900.0 + 3.0 * (i % 7), 500.0 - 2.0 * (i % 5)};
        point.sigma_px = 0.5 + 0.01 * i;
        point.used = i % 13 != 0;
        view.points.push_back(point);
    }
    return view;
}

// The block as plain residuals, for the checker: what ViewCost compresses.
class PlainCost : public ceres::CostFunction {
public:
    explicit PlainCost(const View* view) : view_(view)
    {
        *mutable_parameter_block_sizes() = {16, 6, 6};
        set_num_residuals(static_cast<int>(2 * view->points.size()));
    }
    bool Evaluate(double const* const* p, double* residuals, double** jacobians) const override
    {
        Eigen::VectorXd r;
        Eigen::MatrixXd j;
        if (!view_residuals(*view_, kLens.model, p[0], p[1], p[2], &r, &j)) {
            return false;
        }
        Eigen::Map<Eigen::VectorXd>(residuals, r.size()) = r;
        Eigen::Index column = 0;
        for (std::size_t block = 0; jacobians != nullptr && block < 3; ++block) {
            const Eigen::Index width = parameter_block_sizes()[block];
            if (jacobians[block] != nullptr) {
                Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
                    jacobians[block], r.size(), width) = j.middleCols(column, width);
            }
            column += width;
        }
        return true;
    }

private:
    const View* view_;
};

void derivatives_pass_the_gradient_checker()
{
    const View view = make_view();
    const PlainCost cost(&view);
    ceres::NumericDiffOptions options;
    const ceres::GradientChecker checker(&cost, static_cast<std::vector<const ceres::Manifold*>*>(nullptr), options);
    const double* parameters[] = {kLens.intrinsics.data(), kCamera.data(), kBoard.data()};
    ceres::GradientChecker::ProbeResults results;
    // Ridders' differences of pixels of 1e3 are good to some 1e-9 of the slope; an error in a formula
    // shows at 1e-3 and more.
    TEST_ASSERT_TRUE_MESSAGE(checker.Probe(parameters, 1e-6, &results), results.error_log.c_str());
}

void compression_keeps_cost_gradient_and_information()
{
    const View view = make_view();
    for (const double cauchy : {0.0, 50.0}) {
        ViewQuadratic full;
        TEST_ASSERT_TRUE(view_quadratic(view, kLens.model, kLens.intrinsics.data(), kCamera.data(),
                                        kBoard.data(), cauchy, true, &full));
        const ViewCost cost(&view, kLens.model, cauchy);
        const int rows = cost.num_residuals();
        std::vector<double> residuals(static_cast<std::size_t>(rows));
        Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> a(rows, 16), b(rows, 6), c(rows, 6);
        double* jacobians[] = {a.data(), b.data(), c.data()};
        const double* parameters[] = {kLens.intrinsics.data(), kCamera.data(), kBoard.data()};
        TEST_ASSERT_TRUE(cost.Evaluate(parameters, residuals.data(), jacobians));
        Eigen::MatrixXd all(rows, 28);
        all << a, b, c;
        const Eigen::Map<Eigen::VectorXd> r(residuals.data(), rows);
        const Eigen::MatrixXd normal = full.normal.topLeftCorner(28, 28);
        const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseInverse();
        // Compared where every parameter has the same weight. The factor drops pivots below 1e-15,
        // whose root is 3e-8.
        TEST_ASSERT_TRUE((scale.asDiagonal() * (all.transpose() * all - normal) * scale.asDiagonal()).norm()
                         < 1e-10);
        TEST_ASSERT_TRUE(scale.cwiseProduct(all.transpose() * r - full.gradient.head(28)).norm()
                         < 1e-6 * r.norm());
        TEST_ASSERT_TRUE(std::abs(r.squaredNorm() / full.squares - 1.0) < 1e-12);
    }
}

// By another road: many samples, a general conic by singular values, Euclidean spacing along the edge.
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
    for (int k = 0; k < kCount; ++k) {
        const Eigen::Vector2d p = (edge.col(k) - mean) / size;
        const double length = (edge.col((k + 1) % kCount) - edge.col((k + kCount - 1) % kCount)).norm();
        const double weight = std::sqrt(length);
        rows.row(k) << p.x() * p.x(), p.x() * p.y(), p.y() * p.y(), p.x(), p.y();
        rows.row(k) *= weight;
        right[k] = weight;
    }
    const Eigen::VectorXd q = rows.colPivHouseholderQr().solve(right);
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
    RUN_TEST(derivatives_pass_the_gradient_checker);
    RUN_TEST(compression_keeps_cost_gradient_and_information);
    RUN_TEST(circle_centres_agree_with_dense_sampling);
    return UNITY_END();
}
