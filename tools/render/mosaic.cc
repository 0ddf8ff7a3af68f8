/* Where edges run, and how much of a small cell lies on which side of them.
 *
 * A cell is a small parallelogram on the board. It touches the line n.p = c when the distance of its
 * centre is below half its width along n, (side / 2) * (|g_x| + |g_y|) with g = J^T n, J = lattice per
 * pixel. In pixels the line then has the normal g / |g| and the distance (n.p - c) / |g|, and its share
 * of the square cell is elementary. A circle is f(p) = |p - c| - r; the mean of f over the cell is
 * f + side^2 / 24 * (Laplacian of f in pixels), and the tangent at that distance cuts off the right area
 * to third order. */
#include "tools/render/mosaic.h"

#include <algorithm>
#include <cmath>

namespace render {

namespace {

constexpr double units = 8; // lattice units a patch side
constexpr double root_half = 0.70710678118654752440;
constexpr int east = 0;
constexpr int south = 1;
constexpr int west = 2;
constexpr int north = 3;
// Above this half width (lattice units) lines that meet elsewhere could be touched: cut the cell.
constexpr double reach_max = 0.12;

// Share of the unit square beyond a line at signed distance `d` >= 0 or < 0 from its centre, whose
// normal (unit) points to the far side.
double share_beyond(double d, const Eigen::Vector2d& normal)
{
    const double nx = std::abs(normal.x());
    const double ny = std::abs(normal.y());
    const double big = std::max(nx, ny);
    const double small = std::min(nx, ny);
    const double away = std::abs(d);
    double far_side = 0;
    if (away >= 0.5 * (big + small)) {
        far_side = 0;
    } else if (away <= 0.5 * (big - small)) {
        far_side = 0.5 - away / big;
    } else {
        const double rest = 0.5 * (big + small) - away;
        far_side = rest * rest / (2 * big * small);
    }
    return d >= 0 ? far_side : 1 - far_side;
}

// Half the width of the cell along `normal`, lattice units.
inline double reach_along(const Cell& cell, const Eigen::Vector2d& normal)
{
    const Eigen::Matrix2d& j = cell.per_px;
    return 0.5 * cell.side_px * (std::abs(j(0, 0) * normal.x() + j(1, 0) * normal.y()) +
                                 std::abs(j(0, 1) * normal.x() + j(1, 1) * normal.y()));
}

// Share of the cell beyond the line n.p = c, `distance` (lattice) from the centre towards n.
double share(const Cell& cell, const Eigen::Vector2d& normal, double distance)
{
    const Eigen::Vector2d g = cell.per_px.transpose() * normal;
    const double scale = g.norm();
    return share_beyond(distance / (scale * cell.side_px), g / scale);
}

double side(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& p)
{
    return (b.x() - a.x()) * (p.y() - a.y()) - (b.y() - a.y()) * (p.x() - a.x());
}

} // namespace

Mosaic::Mosaic(const targetfile& file)
    : columns_(static_cast<int>(units) * file.target.cols + 2),
      rows_(static_cast<int>(units) * file.target.rows + 2),
      squares_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)),
      edge_level_(file.edge_level),
      peak_falloff_(1 / (2 * file.gauss_sigma * file.gauss_sigma))
{
    const target& grid = file.target;
    const double unit_mm = file.patch_mm / units;
    mm_per_unit_ = {unit_mm * file.measured_scale[0], unit_mm * file.measured_scale[1]};
    const double border = units * file.margin;
    low_ = {-border, -border};
    high_ = {units * grid.cols + border, units * grid.rows + border};
    gap_ = units;
    const double q30 = 1.0 / (1 << 30);
    const unsigned features = layout_feature_count(grid.levels);
    for (int place = 0; place < grid.rows * grid.cols; place++) {
        const int row = place / grid.cols;
        const int col = place % grid.cols;
        const bool turned = grid.turns[place] != 0;
        for (unsigned index = 0; index < features; index++) {
            const struct layout_feature& shape = *layout_feature(grid.levels, index);
            const double u = shape.u_q30 * q30;
            const double v = shape.v_q30 * q30;
            const double inradius = units * shape.inradius_q30 * q30;
            Disc disc;
            disc.centre = units * Eigen::Vector2d(col + (turned ? 1 - u : u),
                                                  row + (turned ? 1 - v : v));
            disc.radius = inradius * file.circle_ratio;
            disc.white = layout_circle_is_white(grid.levels, grid.ids[place], index);
            disc.patch = grid.ids[place];
            disc.feature = index;
            gap_ = std::min(gap_, inradius - disc.radius);
            const Piece piece{static_cast<std::int32_t>(discs_.size()), !disc.white};
            discs_.push_back(disc);
            paint(shape, turned, 8 * col, 8 * row, piece);
        }
    }
}

void Mosaic::paint(const struct layout_feature& shape, bool turned, int i0, int j0, const Piece& piece)
{
    std::array<Eigen::Vector2d, 3> corner;
    for (std::size_t k = 0; k < 3; k++) {
        const int u = shape.corner_u_8th[k];
        const int v = shape.corner_v_8th[k];
        corner[k] = {turned ? 8 - u : u, turned ? 8 - v : v};
    }
    const std::array<Eigen::Vector2d, 4> middle = {
        Eigen::Vector2d(0.8, 0.5), Eigen::Vector2d(0.5, 0.8), Eigen::Vector2d(0.2, 0.5),
        Eigen::Vector2d(0.5, 0.2)};
    for (int j = 0; j < 8; j++) {
        for (int i = 0; i < 8; i++) {
            for (std::size_t k = 0; k < 4; k++) {
                const Eigen::Vector2d p = middle[k] + Eigen::Vector2d(i, j);
                const double a = side(corner[0], corner[1], p);
                const double b = side(corner[1], corner[2], p);
                const double c = side(corner[2], corner[0], p);
                if ((a > 0 && b > 0 && c > 0) || (a < 0 && b < 0 && c < 0)) {
                    const int at = (j0 + j + 1) * columns_ + i0 + i + 1;
                    squares_[static_cast<std::size_t>(at)][k] = piece;
                }
            }
        }
    }
}

const Mosaic::Square& Mosaic::square(int i, int j) const
{
    const int column = std::clamp(i + 1, 0, columns_ - 1);
    const int row = std::clamp(j + 1, 0, rows_ - 1);
    return squares_[static_cast<std::size_t>(row * columns_ + column)];
}

const Mosaic::Piece* Mosaic::piece_at(const Eigen::Vector2d& at) const
{
    const int i = static_cast<int>(std::floor(at.x()));
    const int j = static_cast<int>(std::floor(at.y()));
    const double fx = at.x() - i;
    const double fy = at.y() - j;
    const int k = fx > fy ? (fx + fy > 1 ? east : north) : (fx + fy > 1 ? south : west);
    return &square(i, j)[static_cast<std::size_t>(k)];
}

double Mosaic::level(const Disc& disc, double t2) const
{
    const double white = edge_level_ + (1 - edge_level_) * std::exp(-t2 * peak_falloff_);
    return disc.white ? white : 1 - white;
}

double Mosaic::sample(const Eigen::Vector2d& at, double behind) const
{
    if ((at.array() < low_.array()).any() || (at.array() > high_.array()).any()) {
        return behind;
    }
    const Piece* piece = piece_at(at);
    if (piece->disc >= 0) {
        const Disc& disc = discs_[static_cast<std::size_t>(piece->disc)];
        const double t2 = (at - disc.centre).squaredNorm() / (disc.radius * disc.radius);
        if (t2 < 1) {
            return level(disc, t2);
        }
    }
    return piece->white ? 1 : 0;
}

Mosaic::Border Mosaic::border(const Cell& cell) const
{
    Border out;
    const Eigen::Vector2d reach(reach_along(cell, Eigen::Vector2d::UnitX()),
                                reach_along(cell, Eigen::Vector2d::UnitY()));
    int touched = 0;
    for (int axis = 0; axis < 2; axis++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            const double room = sign > 0 ? high_[axis] - cell.centre[axis]
                                         : cell.centre[axis] - low_[axis];
            if (room <= -reach[axis]) {
                out.kind = Border::outside;
                return out;
            }
            if (room < reach[axis]) {
                touched++;
                out.normal = Eigen::Vector2d::Zero();
                out.normal[axis] = sign;
                out.distance = room;
            }
        }
    }
    out.kind = touched == 0 ? Border::inside : touched == 1 ? Border::across : Border::corner;
    return out;
}

// The edges at a corner or the centre of a square, whichever `at` is near to.
Mosaic::Crossing Mosaic::cross_meeting(const Eigen::Vector2d& at, const Piece* here,
                                       double reach) const
{
    const int i = static_cast<int>(std::floor(at.x()));
    const int j = static_cast<int>(std::floor(at.y()));
    const double fx = std::abs(at.x() - i - 0.5);
    const double fy = std::abs(at.y() - j - 0.5);
    std::array<const Piece*, 8> around;
    if (fx + fy < 0.5) {
        const Square& own = square(i, j);
        around = {&own[0], &own[1], &own[2], &own[3], &own[0], &own[1], &own[2], &own[3]};
    } else {
        const int vi = static_cast<int>(std::lround(at.x()));
        const int vj = static_cast<int>(std::lround(at.y()));
        const Square& nw = square(vi - 1, vj - 1);
        const Square& ne = square(vi, vj - 1);
        const Square& sw = square(vi - 1, vj);
        const Square& se = square(vi, vj);
        around = {&nw[east], &nw[south], &ne[south], &ne[west],
                  &sw[north], &sw[east], &se[west], &se[north]};
    }
    bool one_triangle = true;
    bool one_colour = true;
    for (const Piece* piece : around) {
        one_triangle = one_triangle && piece->disc == here->disc;
        one_colour = one_colour && piece->white == here->white;
    }
    Crossing out;
    out.here = here;
    const bool clear = one_triangle || (one_colour && gap_ > 4 * reach);
    out.kind = clear ? Crossing::none : Crossing::many;
    return out;
}

Mosaic::Crossing Mosaic::cross(const Cell& cell) const
{
    const Eigen::Vector2d falling(root_half, -root_half);
    const Eigen::Vector2d rising(root_half, root_half);
    const int i = static_cast<int>(std::floor(cell.centre.x()));
    const int j = static_cast<int>(std::floor(cell.centre.y()));
    const double fx = cell.centre.x() - i;
    const double fy = cell.centre.y() - j;
    const double reach_x = reach_along(cell, Eigen::Vector2d::UnitX());
    const double reach_y = reach_along(cell, Eigen::Vector2d::UnitY());
    const double reach = std::max(reach_x, reach_y);
    Crossing out;
    out.here = piece_at(cell.centre);
    if (reach > reach_max) {
        out.kind = Crossing::many;
        return out;
    }
    int touched = 0;
    const auto touch = [&](double distance, double limit, const Eigen::Vector2d& normal,
                           const Piece& beyond) {
        if (distance < limit) {
            touched++;
            out.distance = distance;
            out.normal = normal;
            out.there = &beyond;
        }
    };
    const int dx = fx < 0.5 ? -1 : 1;
    touch(fx < 0.5 ? fx : 1 - fx, reach_x, Eigen::Vector2d(dx, 0),
          square(i + dx, j)[dx < 0 ? east : west]);
    const int dy = fy < 0.5 ? -1 : 1;
    touch(fy < 0.5 ? fy : 1 - fy, reach_y, Eigen::Vector2d(0, dy),
          square(i, j + dy)[dy < 0 ? south : north]);
    const Square& own = square(i, j);
    const double down = root_half * (fx - fy);     // positive east and north of x - y = i - j
    const double up = root_half * (fx + fy - 1);   // positive east and south of x + y = i + j + 1
    touch(std::abs(down), reach_along(cell, falling), down > 0 ? Eigen::Vector2d(-falling) : falling,
          up > 0 ? own[down > 0 ? south : east] : own[down > 0 ? west : north]);
    touch(std::abs(up), reach_along(cell, rising), up > 0 ? Eigen::Vector2d(-rising) : rising,
          down > 0 ? own[up > 0 ? north : east] : own[up > 0 ? west : south]);
    if (touched == 0) {
        return out;
    }
    if (touched > 1) {
        return cross_meeting(cell.centre, out.here, reach);
    }
    if (out.there->disc == out.here->disc) {
        return out;
    }
    // Where a circle may reach into the same cell, the cell is cut further.
    const bool circle_near = gap_ <= 4 * reach;
    const bool seen = out.there->white != out.here->white;
    out.kind = circle_near ? Crossing::many : seen ? Crossing::straight : Crossing::none;
    return out;
}

bool Mosaic::flat(const Cell& cell, double& value) const
{
    const Border frame = border(cell);
    if (frame.kind == Border::outside) {
        value = cell.behind;
        return true;
    }
    if (frame.kind != Border::inside) {
        return false;
    }
    const Crossing edge = cross(cell);
    if (edge.kind != Crossing::none) {
        return false;
    }
    if (edge.here->disc >= 0) {
        const Disc& disc = discs_[static_cast<std::size_t>(edge.here->disc)];
        const Eigen::Vector2d out = cell.centre - disc.centre;
        // Half the cell's diagonal bounds its reach in any direction.
        const double reach = root_half * cell.side_px * cell.per_px.norm();
        const double clear = disc.radius + reach;
        if (out.squaredNorm() < clear * clear) {
            return false;
        }
    }
    value = edge.here->white ? 1 : 0;
    return true;
}

double Mosaic::quarters(const Cell& cell, int depth) const
{
    double sum = 0;
    for (int k = 0; k < 4; k++) {
        const Eigen::Vector2d step((k & 1) != 0 ? 0.25 : -0.25, (k & 2) != 0 ? 0.25 : -0.25);
        Cell part = cell;
        part.side_px = 0.5 * cell.side_px;
        part.centre += cell.per_px * (step * cell.side_px);
        sum += average(part, depth - 1);
    }
    return 0.25 * sum;
}

double Mosaic::average(const Cell& cell, int depth) const
{
    if (depth == 0) {
        return sample(cell.centre, cell.behind);
    }
    const Border frame = border(cell);
    if (frame.kind == Border::outside) {
        return cell.behind;
    }
    if (frame.kind == Border::corner) {
        return quarters(cell, depth);
    }
    if (frame.kind == Border::across) {
        // Nothing but the white border may be near for the simple answer.
        const double near = reach_along(cell, frame.normal);
        if (-low_.x() <= 4 * near) {
            return quarters(cell, depth);
        }
        const double beyond = share(cell, frame.normal, frame.distance);
        return beyond * cell.behind + (1 - beyond);
    }
    const Crossing edge = cross(cell);
    if (edge.kind == Crossing::many) {
        return quarters(cell, depth);
    }
    const double own = edge.here->white ? 1 : 0;
    if (edge.kind == Crossing::straight) {
        const double beyond = share(cell, edge.normal, edge.distance);
        return beyond * (edge.there->white ? 1 : 0) + (1 - beyond) * own;
    }
    if (edge.here->disc < 0) {
        return own;
    }
    const Disc& disc = discs_[static_cast<std::size_t>(edge.here->disc)];
    const Eigen::Vector2d out = cell.centre - disc.centre;
    const double r = out.norm();
    const double t2 = r * r / (disc.radius * disc.radius);
    const double reach = root_half * cell.side_px * cell.per_px.norm();
    if (r > disc.radius + reach) {
        return own;
    }
    if (r < disc.radius - reach) {
        return level(disc, t2);
    }
    if (reach > 0.5 * disc.radius) {
        return quarters(cell, depth);
    }
    const Eigen::Vector2d radial = out / r;
    const Eigen::Vector2d along = cell.per_px.transpose() * Eigen::Vector2d(-radial.y(), radial.x());
    const double bend = cell.side_px * cell.side_px / 24 * along.squaredNorm() / r;
    const double beyond = share(cell, radial, disc.radius - r - bend);
    return beyond * own + (1 - beyond) * level(disc, t2);
}

} // namespace render
