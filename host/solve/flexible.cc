// See flexible.h.
#include "host/solve/flexible.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "host/solve/prior.h"
#include "host/solve/surface.h"
#include "host/solve/velocity_elimination.h"

namespace rig {
namespace {

// A gauge row's deviation: a ten-thousandth of a pixel, of a millimetre. The data say nothing about
// what it holds, so any small figure gives the same result; a tiny one costs digits.
constexpr double kGaugeDeviation = 1e-4;
constexpr int kGaugeGrid = 12;  // places along each side of the image at which a field's rotation is read
constexpr double kDampingMin = 1e-12;
constexpr double kDampingMax = 1e6;

// The smoothness of flexible.h for control points with this curvature.
Eigen::MatrixXd smoothness(const BsplineGrid& grid, double bend)
{
    const double cells = std::max(grid.columns, grid.rows) - 3;
    return bspline_roughness(grid) * std::pow(cells, 4) / (bend * bend);
}

// Quadratic form of smoothness and gauge: cost x' Q x for x the control points, in the system's place.
struct Form {
    Eigen::Index at = 0;
    Eigen::MatrixXd form;
};

// Rows: the rotation about each axis that fits a field best, in pixels at the image's middle.
Eigen::MatrixXd field_gauge(const Camera& lens, const SceneCamera& camera)
{
    const BsplineGrid& grid = lens.field.grid;
    Camera base = lens;
    base.field = SplineField();
    const double fold = base.fold_radius();
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(3, 2 * grid.count());
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    for (int v = 0; v < kGaugeGrid; ++v) {
        for (int u = 0; u < kGaugeGrid; ++u) {
            const Eigen::Vector2d p((u + 0.5) / kGaugeGrid * camera.width_px,
                                    (v + 0.5) / kGaugeGrid * camera.height_px);
            const Eigen::Vector3d ray = base.unproject(p, fold);
            Eigen::Vector2d pixel;
            ProjectionJacobian derivative;
            if (!ray.allFinite()
                || !project_formula(base.model, base.intrinsics.data(), ray, &pixel, &derivative)) {
                continue;
            }
            const Eigen::Matrix<double, 2, 3> turn = -derivative.by_point * skew(ray);
            normal += turn.transpose() * turn;
            const BsplineSupport s = bspline_support(grid, p);
            for (int part = 0; part < 2; ++part) {
                for (int j = 0; j < 4; ++j) {
                    rows.middleCols<4>(part * grid.count() + (s.row + j) * grid.columns + s.column) +=
                        turn.row(part).transpose() * (s.y[j] * s.x.transpose());
                }
            }
        }
    }
    return lens.intrinsics[0] * normal.ldlt().solve(rows);
}

std::vector<Form> make_forms(const RigState& state, const FlexibleLayout& layout,
                               const std::vector<Board>& boards,
                               const std::vector<SceneCamera>& cameras)
{
    const double gauge = 1.0 / (kGaugeDeviation * kGaugeDeviation);
    std::vector<Form> forms;
    for (std::size_t c = 0; c < state.lenses.size(); ++c) {
        if (layout.field[c] >= 0) {
            const BsplineGrid& grid = state.lenses[c].field.grid;
            const Eigen::MatrixXd rows = field_gauge(state.lenses[c], cameras[c]);
            Form form{layout.field[c], gauge * rows.transpose() * rows};
            const Eigen::MatrixXd rough = smoothness(grid, kFieldBendPx);
            for (Eigen::Index at : {Eigen::Index(0), grid.count()}) {
                form.form.block(at, at, grid.count(), grid.count()) += rough;
            }
            forms.push_back(std::move(form));
        }
    }
    for (std::size_t b = 0; b < state.surfaces.size(); ++b) {
        if (layout.surface[b] >= 0) {
            const Eigen::MatrixXd rows = surface_gauge(state.surfaces[b], boards[b]);
            forms.push_back({layout.surface[b],
                              gauge * rows.transpose() * rows
                                  + smoothness(state.surfaces[b].grid, kSurfaceBendMm)});
        }
    }
    return forms;
}

// The control points of each form, in the order of make_forms.
std::vector<std::vector<double>*> controls(const FlexibleLayout& layout, RigState* state)
{
    std::vector<std::vector<double>*> out;
    for (std::size_t c = 0; c < state->lenses.size(); ++c) {
        if (layout.field[c] >= 0) {
            out.push_back(&state->lenses[c].field.control);
        }
    }
    for (std::size_t b = 0; b < state->surfaces.size(); ++b) {
        if (layout.surface[b] >= 0) {
            out.push_back(&state->surfaces[b].control);
        }
    }
    return out;
}

// The forms' cost; with `system` also their part in it.
double add_forms(const std::vector<Form>& forms, const FlexibleLayout& layout, RigState* state,
                  FlexibleSystem* system)
{
    double cost = 0.0;
    const auto of = controls(layout, state);
    for (std::size_t i = 0; i < forms.size(); ++i) {
        const Eigen::Map<const Eigen::VectorXd> x(of[i]->data(), static_cast<Eigen::Index>(of[i]->size()));
        const Eigen::VectorXd slope = forms[i].form * x;
        cost += x.dot(slope);
        if (system != nullptr) {
            system->gradient.segment(forms[i].at, x.size()) += slope;
            system->normal.block(forms[i].at, forms[i].at, x.size(), x.size()) += forms[i].form;
        }
    }
    return cost;
}

// The same of what is known beforehand.
double add_known(const PriorTerm& known, const RigState& state, FlexibleSystem* system)
{
    if (system == nullptr) {
        return known.at(state, 0, nullptr).squaredNorm();
    }
    Eigen::MatrixXd slope;
    const Eigen::VectorXd residual = known.at(state, system->gradient.size(), &slope);
    if (residual.size() > 0) {
        system->gradient += slope.transpose() * residual;
        system->normal += slope.transpose() * slope;
    }
    return residual.squaredNorm();
}

struct Step {
    bool good = false;
    Eigen::VectorXd columns;
    Eigen::VectorXd poses;
    Eigen::VectorXd velocities;  // empty where no shutter rolls
    double gain = 0.0;           // predicted fall of the sum of squares
};

// What remains of a system when the body poses are eliminated.
struct Reduced {
    bool good = false;
    Eigen::MatrixXd half;    // across times the inverse of the root of each pose's block
    Eigen::VectorXd lifted;  // that inverse times the poses' gradient
    std::vector<Eigen::Matrix<double, 6, 6>> root;
    Eigen::MatrixXd schur;   // lower triangle
};

Reduced eliminate_poses(const FlexibleSystem& system, double damping)
{
    Reduced out;
    const Eigen::Index poses = system.own.cols();
    out.half.resize(system.normal.rows(), poses);
    out.lifted.resize(poses);
    out.root.resize(static_cast<std::size_t>(poses / 6));
    for (Eigen::Index p = 0; p < poses; p += 6) {
        Eigen::Matrix<double, 6, 6> own = system.own.middleCols<6>(p);
        // A pose without points keeps still.
        own.diagonal() = own.diagonal().unaryExpr([&](double d) { return d > 0.0 ? d * (1.0 + damping) : 1.0; });
        const Eigen::LLT<Eigen::Matrix<double, 6, 6>> llt(own);
        if (llt.info() != Eigen::Success) {
            return out;
        }
        out.root[static_cast<std::size_t>(p / 6)] = llt.matrixL();
        const auto lower = out.root[static_cast<std::size_t>(p / 6)].triangularView<Eigen::Lower>();
        out.half.middleCols<6>(p) = lower.solve(system.across.middleCols<6>(p).transpose()).transpose();
        out.lifted.segment<6>(p) = lower.solve(system.pose_gradient.segment<6>(p));
    }
    out.schur = system.normal;
    out.schur.diagonal() *= 1.0 + damping;
    if (out.schur.size() > 0) {
        out.schur.selfadjointView<Eigen::Lower>().rankUpdate(out.half, -1.0);
    }
    out.good = true;
    return out;
}

// Damped Gauss-Newton step.
Step solve_step(const FlexibleSystem& system, double damping)
{
    Step step;
    Reduced reduced = eliminate_poses(system, damping);
    if (!reduced.good) {
        return step;
    }
    const Eigen::Index poses = system.own.cols();
    step.columns.resize(system.normal.rows());
    if (step.columns.size() > 0) {
        const Eigen::VectorXd right = system.gradient - reduced.half * reduced.lifted;
        // Equilibrated: columns differ by ten orders of magnitude, and one that nothing feels stays put.
        const Eigen::VectorXd scale = system.normal.diagonal().unaryExpr(
            [](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 1.0; });
        reduced.schur = scale.asDiagonal() * reduced.schur * scale.asDiagonal();
        const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> llt(reduced.schur);
        if (llt.info() != Eigen::Success) {
            return step;
        }
        step.columns = -(scale.asDiagonal() * llt.solve(scale.asDiagonal() * right));
        step.gain = -step.columns.dot(right);
    }
    step.poses.resize(poses);
    const Eigen::VectorXd rest = reduced.lifted + reduced.half.transpose() * step.columns;
    for (Eigen::Index p = 0; p < poses; p += 6) {
        step.poses.segment<6>(p) = -reduced.root[static_cast<std::size_t>(p / 6)]
                                        .triangularView<Eigen::Lower>()
                                        .transpose()
                                        .solve(rest.segment<6>(p));
    }
    step.gain += reduced.lifted.squaredNorm();
    step.good = step.columns.allFinite() && step.poses.allFinite();
    return step;
}

void move(const FlexibleLayout& layout, const Step& step, RigState* state)
{
    const auto add = [&](Eigen::Index at, std::vector<double>* numbers) {
        for (std::size_t i = 0; at >= 0 && i < numbers->size(); ++i) {
            (*numbers)[i] += step.columns[at + static_cast<Eigen::Index>(i)];
        }
    };
    for (std::size_t c = 0; c < state->lenses.size(); ++c) {
        add(layout.lens[c], &state->lenses[c].intrinsics);
        add(layout.field[c], &state->lenses[c].field.control);
        if (layout.camera[c] >= 0) {
            state->cam_from_rig[c] += step.columns.segment<6>(layout.camera[c]);
        }
    }
    for (std::size_t m = 0; m < state->body_from_board.size(); ++m) {
        if (layout.member[m] >= 0) {
            state->body_from_board[m] += step.columns.segment<6>(layout.member[m]);
        }
    }
    for (std::size_t b = 0; b < state->surfaces.size(); ++b) {
        add(layout.surface[b], &state->surfaces[b].control);
    }
    for (std::size_t p = 0; p < state->rig_from_body.size(); ++p) {
        state->rig_from_body[p] += step.poses.segment<6>(static_cast<Eigen::Index>(6 * p));
    }
    for (std::size_t p = 0; p < state->shutter.velocity.size(); ++p) {
        state->shutter.velocity[p] += step.velocities.segment<6>(static_cast<Eigen::Index>(6 * p));
    }
    for (std::size_t c = 0; c < state->shutter.row_time_s.size(); ++c) {
        if (layout.row_time[c] >= 0) {
            state->shutter.row_time_s[c] += step.columns[layout.row_time[c]];
        }
    }
}

int gauge_rows(const FlexibleLayout& layout)
{
    int rows = 0;
    for (const auto* part : {&layout.field, &layout.surface}) {
        for (const Eigen::Index at : *part) {
            rows += at >= 0 ? 3 : 0;
        }
    }
    return rows;
}

}  // namespace

FlexibleResult flexible_bundle(const std::vector<View>& views, const std::vector<char>& use,
                               const std::vector<Board>& boards,
                               const std::vector<SceneCamera>& cameras, const FlexibleOptions& options,
                               RigState* state)
{
    const FlexibleLayout layout =
        make_layout(*state, views, use, options.gauge_cameras, options.poses_only);
    const std::vector<Form> forms = make_forms(*state, layout, boards, cameras);
    const PriorTerm known(options.prior, layout.lens, layout.camera);
    // Of all that is not a point.
    const auto add_rest = [&](RigState* at, FlexibleSystem* to) {
        return add_forms(forms, layout, at, to) + add_known(known, *at, to);
    };
    FlexibleResult result;
    result.unknowns = static_cast<int>(layout.size) - gauge_rows(layout);
    FlexibleSystem system;
    FlexibleSystem tried;
    double damping = kDampingMin;
    bool first = true;
    for (int iteration = 0; iteration == 0 || iteration < options.iterations_max; ++iteration) {
        if (!sum_points(views, use, boards, *state, layout, true, &system)) {
            return result;
        }
        const double cost = system.squares + velocity_cost(state->shutter) + add_rest(state, &system);
        const VelocityElimination velocities(state->shutter, &system);
        result.squares = system.squares;
        result.points = system.points;
        result.usable = true;
        bool better = false;
        double fall = 0.0;
        while (!better && damping < kDampingMax) {
            Step step = solve_step(system, damping);
            RigState there = *state;
            if (step.good) {
                step.velocities = velocities.step(system, step.columns, step.poses);
                step.gain += velocities.gain();
                result.first_gain = first ? step.gain : result.first_gain;
                first = false;
                if (options.iterations_max == 0) {
                    return result;
                }
                move(layout, step, &there);
                better = sum_points(views, use, boards, there, layout, false, &tried);
                fall = better ? cost - tried.squares - velocity_cost(there.shutter) - add_rest(&there, nullptr)
                              : 0.0;
                better = better && fall >= 0.0;
            }
            if (better) {
                *state = std::move(there);
                result.squares = tried.squares;
                damping = std::max(kDampingMin, 0.1 * damping);
            } else {
                damping = std::max(1e-6, 10.0 * damping);
                // At the minimum the last digits decide whether a step helps.
                if (step.good && step.gain < options.tolerance * cost) {
                    break;
                }
            }
        }
        ++result.iterations;
        if (!better || fall < options.tolerance * cost) {
            break;
        }
    }
    return result;
}

std::vector<char> views_in_use(const std::vector<View>& views)
{
    std::vector<char> use;
    for (const View& view : views) {
        use.push_back(std::any_of(view.points.begin(), view.points.end(),
                                  [](const ViewPoint& point) { return point.used; }));
    }
    return use;
}

FlexibleInformation flexible_information(const std::vector<View>& views,
                                         const std::vector<Board>& boards,
                                         const std::vector<SceneCamera>& cameras,
                                         const std::vector<int>& gauge_cameras, const Prior* prior,
                                         double noise, const RigState& state)
{
    const std::vector<char> use = views_in_use(views);
    FlexibleInformation out;
    RigState copy = state;
    copy.shutter.row_times_held = false;
    out.layout = make_layout(copy, views, use, gauge_cameras, false);
    FlexibleSystem system;
    if (sum_points(views, use, boards, copy, out.layout, true, &system)) {
        add_forms(make_forms(copy, out.layout, boards, cameras), out.layout, &copy, &system);
        Eigen::MatrixXd slope;
        if (PriorTerm(prior, out.layout.lens, out.layout.camera).at(copy, out.layout.size, &slope).size() > 0) {
            system.normal += noise * noise * slope.transpose() * slope;
        }
        const VelocityElimination velocities(state.shutter, &system);
        Reduced reduced = eliminate_poses(system, 0.0);
        if (reduced.good) {
            out.matrix = std::move(reduced.schur);
            out.across = std::move(system.across);
            out.own = std::move(system.own);
        }
    }
    return out;
}

}  // namespace rig
