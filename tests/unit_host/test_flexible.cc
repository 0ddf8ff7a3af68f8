// Surfaces, and the joint solve of rigs with fields and surfaces.
#include <cmath>
#include <random>

#include "host/solve/flexible.h"
#include "host/solve/heldout.h"
#include "host/solve/surface.h"
#include "unity.h"

using namespace rig;

void setUp() {}
void tearDown() {}

namespace {

Board make_board()
{
    Board board;
    for (int i = 0; i < 12; ++i) {
        for (int j = 0; j < 8; ++j) {
            BoardPoint point;
            point.at_mm = {50.0 * i, 50.0 * j, 0.0};
            board.points.push_back(point);
        }
    }
    return board;
}

// A bow of 1 mm, less its piston; the tilts are zero by symmetry.
double bow_mm(const Eigen::Vector3d& at)
{
    const double u = (at.x() - 275.0) / 275.0;
    const double v = (at.y() - 175.0) / 175.0;
    return 1.0 - 0.5 * (u * u + v * v);
}

// Two cameras, two boards of which the second is fixed to the first, six instants.
struct Rig {
    std::vector<SceneCamera> cameras{{"a", 1920, 1080}, {"b", 1920, 1080}};
    std::vector<Board> boards{make_board(), make_board()};
    std::vector<View> views;
    std::vector<char> use;
    RigState state;
};

// Pixels that the state itself predicts, with points of the first board at `height`.
template <typename Height>
void observe(const Height& height, Rig* rig)
{
    for (View& view : rig->views) {
        const Camera& lens = rig->state.lenses[static_cast<std::size_t>(view.camera)];
        const Pose pose = cam_from_board(rig->state, view);
        for (ViewPoint& point : view.points) {
            Eigen::Vector3d at = rig->boards[0].points[point.point].at_mm;
            at.z() = view.board == 0 ? height(at) : 0.0;
            TEST_ASSERT_TRUE(project_lens(lens, lens.intrinsics.data(), pose * at, &point.pixel, nullptr));
        }
    }
}

Rig make_rig()
{
    Rig rig;
    rig.state.lenses = {{CameraModel::kBrown, {1400, 1410, 950, 540, -0.28, 0.09, 4e-4, -3e-4, -0.012}},
                        {CameraModel::kRational, {1400, 1410, 960, 530, 0.35, 0.12, 3e-4, -2e-4, 0.01, 0.65,
                                                  0.22, 0.03}}};
    rig.state.cam_from_rig = {Vector6::Zero(), Vector6::Zero()};
    rig.state.cam_from_rig[1] << 0.01, 0.15, -0.02, -300.0, 5.0, 20.0;
    rig.state.body_from_board = {Vector6::Zero()};
    rig.state.body_from_board[0] << 0.1, -0.2, 0.05, 100.0, 300.0, -40.0;
    std::mt19937 random(5);
    const auto draw = [&](double size) { return std::uniform_real_distribution<double>(-size, size)(random); };
    for (std::size_t frame = 0; frame < 6; ++frame) {
        Vector6 pose;
        pose << draw(0.5), draw(0.5), draw(0.3), -200.0 + draw(200.0), -150.0 + draw(100.0), 1200.0 + draw(300.0);
        rig.state.rig_from_body.push_back(pose);
        for (int camera = 0; camera < 2; ++camera) {
            for (int board = 0; board < 2; ++board) {
                View view;
                view.camera = camera;
                view.board = board;
                view.frame = static_cast<std::int64_t>(frame);
                view.pose = frame;
                view.member = board == 0 ? kNoMember : 0;
                for (std::size_t i = 0; i < rig.boards[0].points.size(); ++i) {
                    ViewPoint point;
                    point.at_mm = rig.boards[0].points[i].at_mm;
                    point.point = static_cast<std::uint32_t>(i);
                    point.sigma_px = 0.5f;
                    view.points.push_back(point);
                }
                rig.views.push_back(view);
            }
        }
    }
    rig.use.assign(rig.views.size(), 1);
    return rig;
}

// Gives the first camera a field and the first board a surface, drawn at random.
void bend(Rig* rig)
{
    std::mt19937 random(9);
    SplineField& field = rig->state.lenses[0].field;
    field = make_spline_field(1920, 1080, 5);
    for (double& control : field.control) {
        control = std::uniform_real_distribution<double>(-1.0, 1.0)(random);
    }
    rig->state.surfaces.resize(2);
    rig->state.surfaces[0] = make_surface(rig->boards[0], 3);
    for (double& control : rig->state.surfaces[0].control) {
        control = std::uniform_real_distribution<double>(-1.0, 1.0)(random);
    }
}

// Pointers to every unknown, in the order of the system's columns and then the poses.
std::vector<double*> unknowns(const FlexibleLayout& layout, RigState* state)
{
    std::vector<double*> out(static_cast<std::size_t>(layout.size), nullptr);
    const auto put = [&](Eigen::Index at, double* first, std::size_t count) {
        for (std::size_t i = 0; at >= 0 && i < count; ++i) {
            out[static_cast<std::size_t>(at) + i] = first + i;
        }
    };
    for (std::size_t c = 0; c < 2; ++c) {
        put(layout.lens[c], state->lenses[c].intrinsics.data(), state->lenses[c].intrinsics.size());
        put(layout.camera[c], state->cam_from_rig[c].data(), 6);
        put(layout.field[c], state->lenses[c].field.control.data(), state->lenses[c].field.control.size());
    }
    put(layout.member[0], state->body_from_board[0].data(), 6);
    put(layout.surface[0], state->surfaces[0].control.data(), state->surfaces[0].control.size());
    for (Vector6& pose : state->rig_from_body) {
        for (int i = 0; i < 6; ++i) {
            out.push_back(pose.data() + i);
        }
    }
    return out;
}

double squares(const Rig& rig, const FlexibleLayout& layout)
{
    FlexibleSystem system;
    TEST_ASSERT_TRUE(sum_points(rig.views, rig.use, rig.boards, rig.state, layout, false, &system));
    return system.squares;
}

void the_gradient_agrees_with_differences()
{
    Rig rig = make_rig();
    observe(bow_mm, &rig);
    bend(&rig);
    const FlexibleLayout layout = make_layout(rig.state, rig.views, rig.use, {0}, false);
    TEST_ASSERT_EQUAL_INT(12 + 6 + 6 + 2 * 8 * 6 + 6 * 5, layout.size);
    FlexibleSystem system;
    TEST_ASSERT_TRUE(sum_points(rig.views, rig.use, rig.boards, rig.state, layout, true, &system));
    Eigen::VectorXd gradient(layout.size + 36);
    gradient << system.gradient, system.pose_gradient;
    const std::vector<double*> all = unknowns(layout, &rig.state);
    for (std::size_t i = 0; i < all.size(); ++i) {
        TEST_ASSERT_NOT_NULL(all[i]);
        const double size = *all[i];
        // Small against what bends the function: a thousandth of the image, a thousandth of a radian.
        const double step = std::abs(size) > 50.0 ? 1e-3 : 1e-6;
        *all[i] = size + step;
        const double more = squares(rig, layout);
        *all[i] = size - step;
        const double less = squares(rig, layout);
        *all[i] = size;
        const double slope = (more - less) / (4.0 * step);
        // The sum, 1e4, rounds to 1e-12 or so: over a step of 1e-6 that is 1e-5 at the worst, and
        // third derivatives leave less than a millionth of the slope.
        TEST_ASSERT_TRUE(std::abs(slope - gradient[static_cast<Eigen::Index>(i)])
                         < 1e-4 + 1e-5 * std::abs(slope));
    }
}

void the_normal_matrix_is_the_curvature_where_residuals_vanish()
{
    Rig rig = make_rig();
    bend(&rig);
    const Surface bent = rig.state.surfaces[0];
    observe([&](const Eigen::Vector3d& at) {
        return bspline_value(bent.grid, bent.control.data(), at.head<2>(), nullptr);
    }, &rig);
    const FlexibleLayout layout = make_layout(rig.state, rig.views, rig.use, {0}, false);
    FlexibleSystem system;
    TEST_ASSERT_TRUE(sum_points(rig.views, rig.use, rig.boards, rig.state, layout, true, &system));
    Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(layout.size + 36, layout.size + 36);
    whole.topLeftCorner(layout.size, layout.size) = system.normal.selfadjointView<Eigen::Lower>();
    whole.topRightCorner(layout.size, 36) = system.across;
    whole.bottomLeftCorner(36, layout.size) = system.across.transpose();
    for (int p = 0; p < 36; p += 6) {
        whole.block<6, 6>(layout.size + p, layout.size + p) = system.own.middleCols<6>(p);
    }
    const std::vector<double*> all = unknowns(layout, &rig.state);
    std::mt19937 random(2);
    for (int draw = 0; draw < 20; ++draw) {
        // Each unknown by what moves the image by some 1e-4 px.
        Eigen::VectorXd step(whole.rows());
        for (Eigen::Index i = 0; i < step.size(); ++i) {
            // A control point that no view feels stays.
            const double size = whole(i, i) > 1e-6 ? 1e-2 / std::sqrt(whole(i, i)) : 0.0;
            step[i] = std::uniform_real_distribution<double>(-size, size)(random);
            *all[static_cast<std::size_t>(i)] += step[i];
        }
        const double found = squares(rig, layout);
        const double expected = step.dot(whole * step);
        for (Eigen::Index i = 0; i < step.size(); ++i) {
            *all[static_cast<std::size_t>(i)] -= step[i];
        }
        // Steps of 1e-4 px beside a bend of the functions over 1e3 px: a few parts in a million.
        TEST_ASSERT_TRUE(std::abs(found - expected) < 1e-4 * expected);
    }
}

void a_bowed_board_is_found_with_the_lens_and_without_piston_and_tilt()
{
    Rig rig = make_rig();
    observe(bow_mm, &rig);
    const RigState truth = rig.state;
    rig.state.surfaces.resize(2);
    rig.state.surfaces[0] = make_surface(rig.boards[0], 2);
    rig.state.lenses[0].intrinsics[0] += 3.0;
    rig.state.rig_from_body[2][3] += 2.0;
    FlexibleOptions options;
    options.tolerance = 1e-14;
    const FlexibleResult result =
        flexible_bundle(rig.views, rig.use, rig.boards, rig.cameras, options, &rig.state);
    TEST_ASSERT_TRUE(result.usable);
    TEST_ASSERT_EQUAL_INT(9 + 12 + 6 + 6 + 20 - 3, result.unknowns);
    // Points without noise: what is left is smoothness. The bow's second differences, 1 and 4 mm, cost
    // (4 / 25)^2 each at the most, 20 of them: less than 1, over 2304 points.
    TEST_ASSERT_TRUE(std::sqrt(result.squares / static_cast<double>(result.points)) < 0.02);
    double mean = 0.0;
    for (const BoardPoint& point : rig.boards[0].points) {
        mean += bow_mm(point.at_mm) / 96.0;
    }
    for (const BoardPoint& point : rig.boards[0].points) {
        const Surface& surface = rig.state.surfaces[0];
        const double z = bspline_value(surface.grid, surface.control.data(), point.at_mm.head<2>(), nullptr);
        // 0.01 sigmas of 0.5 px at 1 mm a pixel, tilts of half a radian: some 0.01 mm.
        TEST_ASSERT_TRUE(std::abs(z - (bow_mm(point.at_mm) - mean)) < 0.02);
    }
    const Eigen::Map<const Eigen::VectorXd> control(rig.state.surfaces[0].control.data(), 20);
    // Held with a deviation of 1e-4 mm against nothing else.
    TEST_ASSERT_TRUE((surface_gauge(rig.state.surfaces[0], rig.boards[0]) * control).norm() < 1e-4);
    TEST_ASSERT_TRUE((rig.state.cam_from_rig[1] - truth.cam_from_rig[1]).tail<3>().norm() < 0.1);
}

void gauge_rows_read_piston_and_tilt_of_a_plane()
{
    const Board board = make_board();
    Surface surface = make_surface(board, 4);
    for (int row = 0; row < surface.grid.rows; ++row) {
        for (int column = 0; column < surface.grid.columns; ++column) {
            const double x = surface.grid.origin.x() + (column - 1) * surface.grid.step.x();
            surface.control[static_cast<std::size_t>(row * surface.grid.columns + column)] =
                2.0 + 0.01 * (x - 275.0);
        }
    }
    const Eigen::Map<const Eigen::VectorXd> control(surface.control.data(), surface.grid.count());
    const Eigen::Vector3d read = surface_gauge(surface, board) * control;
    // The points' root mean square distance: of 12 and 8 places 50 mm apart.
    const double size = 50.0 * std::sqrt((12.0 * 12.0 - 1.0) / 12.0 + (8.0 * 8.0 - 1.0) / 12.0);
    TEST_ASSERT_TRUE((read - Eigen::Vector3d(2.0, 0.01 * size, 0.0)).norm() < 1e-10);
}

void lifting_points_twice_is_lifting_them_once()
{
    Rig rig = make_rig();
    bend(&rig);
    lift_points(rig.state, rig.boards, &rig.views);
    const double once = rig.views[0].points[17].at_mm.z();
    lift_points(rig.state, rig.boards, &rig.views);
    TEST_ASSERT_TRUE(once != 0.0);
    TEST_ASSERT_TRUE(rig.views[0].points[17].at_mm.z() == once);
    TEST_ASSERT_TRUE(rig.views[1].points[17].at_mm.z() == 0.0);
}

void only_boards_in_one_plane_can_bend()
{
    Board board = make_board();
    TEST_ASSERT_TRUE(can_bend(board));
    board.points[5].at_mm.z() = 1.0;
    TEST_ASSERT_FALSE(can_bend(board));
    TEST_ASSERT_FALSE(can_bend(Board()));
}

void the_quantile_agrees_with_tables_of_students_distribution()
{
    // One-sided, 0.001. The expansion is good to 3 % at 7 degrees of freedom, and better above.
    const double table[][2] = {{7, 4.785}, {10, 4.144}, {20, 3.552}, {60, 3.232}, {1000, 3.098}};
    for (const auto& [freedom, quantile] : table) {
        TEST_ASSERT_TRUE(std::abs(student_quantile(freedom) / quantile - 1.0) < 0.03);
    }
}

}  // namespace

int main()
{
    UNITY_BEGIN();
    RUN_TEST(the_gradient_agrees_with_differences);
    RUN_TEST(the_normal_matrix_is_the_curvature_where_residuals_vanish);
    RUN_TEST(a_bowed_board_is_found_with_the_lens_and_without_piston_and_tilt);
    RUN_TEST(gauge_rows_read_piston_and_tilt_of_a_plane);
    RUN_TEST(lifting_points_twice_is_lifting_them_once);
    RUN_TEST(only_boards_in_one_plane_can_bend);
    RUN_TEST(the_quantile_agrees_with_tables_of_students_distribution);
    return UNITY_END();
}
