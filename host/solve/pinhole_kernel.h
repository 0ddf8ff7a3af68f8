// Sums over a view's points for the lenses of the pinhole family (camera.cc has their formula),
// four points at a time. D is the number of distortion coefficients: 5, 8 or 12.
#pragma once

#include <array>
#include <cmath>
#include <limits>

#include "host/solve/lanes.h"
#include "host/solve/view_kernel.h"

namespace rig {

// A point nearer than this to the plane of the lens is no measurement.
constexpr double kDepthMinMm = 1e-3;

struct PointLanes {
    Lanes at[3];      // board frame
    Lanes target[2];  // observed less centre offset
    Lanes weight;     // 1 / sigma; 0 in a lane that stands for no point
};

// Fills the lanes from points[indices[0 .. count)), repeating the last with weight 0.
RIG_INLINE void gather(const ViewPoint* points, const std::uint32_t* indices, int count, PointLanes& out)
{
    alignas(32) double number[6][kLanes];
    for (int lane = 0; lane < kLanes; ++lane) {
        const ViewPoint& point = points[indices[lane < count ? lane : count - 1]];
        for (int i = 0; i < 3; ++i) {
            number[i][lane] = point.at_mm.data()[i];
        }
        for (int i = 0; i < 2; ++i) {
            number[3 + i][lane] =
                point.pixel.data()[i] - static_cast<double>(point.centre_offset_px.data()[i]);
        }
        number[5][lane] = lane < count ? 1.0 / static_cast<double>(point.sigma_px) : 0.0;
    }
    for (int i = 0; i < 3; ++i) {
        load(number[i], out.at[i]);
    }
    load(number[3], out.target[0]);
    load(number[4], out.target[1]);
    load(number[5], out.weight);
}

// A point's way to its residual, with what the derivatives need.
struct PinholePath {
    Lanes q[3];                   // R p_board
    Lanes x, y, z_inverse, r2;    // on the plane z = 1
    Lanes g, under_inverse, g_q;  // radial factor, its denominator's inverse, its slope by r2
    Lanes bent[2];                // distorted x, y
    Lanes residual[2];            // whitened
    Lanes z;
};

// The view's parameters as plain numbers.
struct PinholeView {
    std::array<double, 9> rotation;  // row by row
    std::array<double, 3> translation;
    std::array<double, kIntrinsicsMax> lens{};
};

RIG_INLINE PinholeView pinhole_view(const Camera& lens, const Pose& cam_from_board)
{
    PinholeView out;
    for (std::size_t i = 0; i < 9; ++i) {
        out.rotation[i] = cam_from_board.rotation(static_cast<int>(i / 3), static_cast<int>(i % 3));
    }
    for (std::size_t i = 0; i < 3; ++i) {
        out.translation[i] = cam_from_board.translation_mm[static_cast<int>(i)];
    }
    for (std::size_t i = 0; i < lens.intrinsics.size(); ++i) {
        out.lens[i] = lens.intrinsics[i];
    }
    return out;
}

template <int D>
RIG_INLINE void pinhole_path(const PinholeView& view, const PointLanes& point, PinholePath& out)
{
    const double* r = view.rotation.data();
    const double* k = view.lens.data() + kPinholeCount;
    for (int i = 0; i < 3; ++i) {
        out.q[i] = r[3 * i] * point.at[0] + r[3 * i + 1] * point.at[1] + r[3 * i + 2] * point.at[2];
    }
    out.z = out.q[2] + view.translation[2];
    out.z_inverse = 1.0 / out.z;
    out.x = (out.q[0] + view.translation[0]) * out.z_inverse;
    out.y = (out.q[1] + view.translation[1]) * out.z_inverse;
    out.r2 = out.x * out.x + out.y * out.y;
    const Lanes r2 = out.r2;
    const Lanes over = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    const Lanes over_q = k[0] + r2 * (2.0 * k[1] + r2 * (3.0 * k[4]));
    if (D >= 8) {
        const Lanes under = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
        const Lanes under_q = k[5] + r2 * (2.0 * k[6] + r2 * (3.0 * k[7]));
        out.under_inverse = 1.0 / under;
        out.g = over * out.under_inverse;
        out.g_q = (over_q - out.g * under_q) * out.under_inverse;
    } else {
        out.g = over;
        out.g_q = over_q;
    }
    const Lanes xy2 = 2.0 * out.x * out.y;
    out.bent[0] = out.x * out.g + k[2] * xy2 + k[3] * (r2 + 2.0 * out.x * out.x);
    out.bent[1] = out.y * out.g + k[2] * (r2 + 2.0 * out.y * out.y) + k[3] * xy2;
    if (D == 12) {
        out.bent[0] += r2 * (k[8] + r2 * k[9]);
        out.bent[1] += r2 * (k[10] + r2 * k[11]);
    }
    for (std::size_t i = 0; i < 2; ++i) {
        out.residual[i] =
            point.weight * (view.lens[i] * out.bent[i] + view.lens[2 + i] - point.target[i]);
    }
}

// Columns of J from distortion on, both rows times w; what belongs to fx fy cx cy is written by
// accumulate.
template <int D>
struct PinholeColumns {
    static constexpr std::size_t kCount = static_cast<std::size_t>(D + kMotionCount);
    Lanes u[kCount];
    Lanes v[kCount];
};

template <int D>
RIG_INLINE void pinhole_columns(const PinholeView& view, const PinholePath& p, const Lanes& w,
                                PinholeColumns<D>& columns)
{
    Lanes* u = columns.u;
    Lanes* v = columns.v;
    const double* k = view.lens.data() + kPinholeCount;
    const Lanes fu = view.lens[0] * w;
    const Lanes fv = view.lens[1] * w;
    const Lanes r2 = p.r2;
    const Lanes xy2 = 2.0 * p.x * p.y;
    const Lanes first = D >= 8 ? Lanes(r2 * p.under_inverse) : r2;
    const Lanes radial[3] = {first, r2 * first, r2 * r2 * first};
    const int place[3] = {0, 1, 4};
    for (int i = 0; i < 3; ++i) {
        u[place[i]] = fu * p.x * radial[i];
        v[place[i]] = fv * p.y * radial[i];
        if (D >= 8) {
            u[5 + i] = -p.g * u[place[i]];
            v[5 + i] = -p.g * v[place[i]];
        }
    }
    u[2] = fu * xy2;
    v[2] = fv * (r2 + 2.0 * p.y * p.y);
    u[3] = fu * (r2 + 2.0 * p.x * p.x);
    v[3] = fv * xy2;
    Lanes prism_x = {0.0, 0.0, 0.0, 0.0};
    Lanes prism_y = prism_x;
    if (D == 12) {
        const Lanes none = {0.0, 0.0, 0.0, 0.0};
        u[8] = fu * r2;
        u[9] = u[8] * r2;
        u[10] = u[11] = none;
        v[8] = v[9] = none;
        v[10] = fv * r2;
        v[11] = v[10] * r2;
        prism_x = 2.0 * (k[8] + 2.0 * r2 * k[9]);
        prism_y = 2.0 * (k[10] + 2.0 * r2 * k[11]);
    }
    const Lanes cross = xy2 * p.g_q + 2.0 * k[2] * p.x + 2.0 * k[3] * p.y;
    const Lanes xx = p.g + 2.0 * p.x * p.x * p.g_q + 2.0 * k[2] * p.y + 6.0 * k[3] * p.x + p.x * prism_x;
    const Lanes yy = p.g + 2.0 * p.y * p.y * p.g_q + 6.0 * k[2] * p.y + 2.0 * k[3] * p.x + p.y * prism_y;
    const Lanes by_x[2] = {fu * p.z_inverse * xx, fv * p.z_inverse * (cross + p.x * prism_y)};
    const Lanes by_y[2] = {fu * p.z_inverse * (cross + p.y * prism_x), fv * p.z_inverse * yy};
    for (int row = 0; row < 2; ++row) {
        Lanes* out = row == 0 ? u : v;
        const Lanes a = by_x[row];
        const Lanes b = by_y[row];
        const Lanes c = -(a * p.x + b * p.y);
        // d p = w x q: the row times it is w times q x (a, b, c).
        out[D] = p.q[1] * c - p.q[2] * b;
        out[D + 1] = p.q[2] * a - p.q[0] * c;
        out[D + 2] = p.q[0] * b - p.q[1] * a;
        out[D + 3] = a;
        out[D + 4] = b;
        out[D + 5] = c;
    }
}

// Upper triangle of J'J with J'r as last column, lane by lane.
template <int D>
struct PinholeSums {
    enum { kRest = D + kMotionCount };  // columns behind fx fy cx cy
    Lanes pinhole[6];                   // fx fx, fx cx, cx cx, and the same of fy, cy
    Lanes head[kPinholeCount][kRest + 1];
    Lanes rest[kRest][kRest + 1];
    Lanes squares;
};

template <int D>
RIG_INLINE void accumulate(const PinholePath& p, const Lanes& w, const PinholeColumns<D>& columns,
                           PinholeSums<D>& sums)
{
    enum { kRest = D + kMotionCount };
    const Lanes* u = columns.u;
    const Lanes* v = columns.v;
    const Lanes ru = p.residual[0];
    const Lanes rv = p.residual[1];
    const Lanes fu = w * p.bent[0];
    const Lanes fv = w * p.bent[1];
    sums.pinhole[0] += fu * fu;
    sums.pinhole[1] += fu * w;
    sums.pinhole[2] += w * w;
    sums.pinhole[3] += fv * fv;
    sums.pinhole[4] += fv * w;
    for (int j = 0; j < kRest; ++j) {
        sums.head[0][j] += fu * u[j];
        sums.head[1][j] += fv * v[j];
        sums.head[2][j] += w * u[j];
        sums.head[3][j] += w * v[j];
    }
    sums.head[0][kRest] += fu * ru;
    sums.head[1][kRest] += fv * rv;
    sums.head[2][kRest] += w * ru;
    sums.head[3][kRest] += w * rv;
    for (int i = 0; i < kRest; ++i) {
        const Lanes ui = u[i];
        const Lanes vi = v[i];
        for (int j = i; j < kRest; ++j) {
            sums.rest[i][j] += ui * u[j] + vi * v[j];
        }
        sums.rest[i][kRest] += ui * ru + vi * rv;
    }
}

template <int D>
RIG_INLINE void unload(const PinholeSums<D>& sums, LocalQuadratic* out)
{
    enum { kRest = D + kMotionCount, kCount = kPinholeCount + kRest };
    out->normal.resize(kCount, kCount);
    out->gradient.resize(kCount);
    auto& n = out->normal;
    n.topLeftCorner<kPinholeCount, kPinholeCount>().setZero();
    n(0, 0) = sum(sums.pinhole[0]);
    n(0, 2) = n(2, 0) = sum(sums.pinhole[1]);
    n(2, 2) = n(3, 3) = sum(sums.pinhole[2]);
    n(1, 1) = sum(sums.pinhole[3]);
    n(1, 3) = n(3, 1) = sum(sums.pinhole[4]);
    for (int i = 0; i < kPinholeCount; ++i) {
        for (int j = 0; j < kRest; ++j) {
            n(i, kPinholeCount + j) = n(kPinholeCount + j, i) = sum(sums.head[i][j]);
        }
        out->gradient[i] = sum(sums.head[i][kRest]);
    }
    for (int i = 0; i < kRest; ++i) {
        for (int j = i; j < kRest; ++j) {
            n(kPinholeCount + i, kPinholeCount + j) = n(kPinholeCount + j, kPinholeCount + i) =
                sum(sums.rest[i][j]);
        }
        out->gradient[kPinholeCount + i] = sum(sums.rest[i][kRest]);
    }
}

// Cauchy's loss c2 log(1 + s / c2) of the squared residuals s, and the root of its derivative. Of
// several factors 1 + s / c2 the product is taken first: one logarithm for many points.
struct CauchySum {
    enum { kFactors = 8 };  // each below 1e38: their product is a double
    Lanes product = {1.0, 1.0, 1.0, 1.0};
    double logarithms = 0.0;
    int factors = 0;
};

RIG_INLINE void take_logarithms(CauchySum& sums)
{
    for (int lane = 0; lane < kLanes; ++lane) {
        sums.logarithms += std::log(sums.product[lane]);
        sums.product[lane] = 1.0;
    }
    sums.factors = 0;
}

RIG_INLINE void cauchy_root(const Lanes& factor, CauchySum& sums, Lanes& root)
{
    sums.product *= factor;
    if (++sums.factors == CauchySum::kFactors) {
        take_logarithms(sums);
    }
    for (int lane = 0; lane < kLanes; ++lane) {
        root[lane] = std::sqrt(1.0 / factor[lane]);
    }
}

// local_quadratic for a lens of D coefficients.
template <int D>
RIG_INLINE bool pinhole_quadratic(const View& view, const Camera& lens, const Pose& cam_from_board,
                                  double cauchy, bool derive, LocalQuadratic* out)
{
    const PinholeView parameters = pinhole_view(lens, cam_from_board);
    PinholeSums<D> sums;
    std::memset(&sums, 0, sizeof sums);
    CauchySum loss;
    const double c2 = cauchy * cauchy;
    std::uint32_t indices[kLanes];
    int filled = 0;
    const std::size_t count = view.points.size();
    for (std::size_t i = 0; i < count; ++i) {
        if (view.points[i].used) {
            indices[filled++] = static_cast<std::uint32_t>(i);
        }
        if (filled == 0 || (filled < kLanes && i + 1 < count)) {
            continue;
        }
        PointLanes points;
        gather(view.points.data(), indices, filled, points);
        filled = 0;
        PinholePath path;
        pinhole_path<D>(parameters, points, path);
        for (int lane = 0; lane < kLanes; ++lane) {
            if (!(path.z[lane] >= kDepthMinMm)) {
                return false;
            }
        }
        Lanes w = points.weight;
        const Lanes squares = path.residual[0] * path.residual[0] + path.residual[1] * path.residual[1];
        if (cauchy > 0.0) {
            const Lanes factor = 1.0 + squares / c2;
            Lanes root;
            cauchy_root(factor, loss, root);
            w *= root;
            path.residual[0] *= root;
            path.residual[1] *= root;
        } else {
            sums.squares += squares;
        }
        if (derive) {
            PinholeColumns<D> columns;
            pinhole_columns<D>(parameters, path, w, columns);
            accumulate<D>(path, w, columns, sums);
        }
    }
    take_logarithms(loss);
    out->squares = cauchy > 0.0 ? c2 * loss.logarithms : sum(sums.squares);
    if (derive) {
        unload<D>(sums, out);
    }
    return true;
}

// view_residuals for a lens of D coefficients.
template <int D>
RIG_INLINE void pinhole_residuals(const View& view, const Camera& lens, const Pose& cam_from_board,
                                  double* out)
{
    const PinholeView parameters = pinhole_view(lens, cam_from_board);
    const std::size_t count = view.points.size();
    for (std::size_t i = 0; i < count; i += kLanes) {
        const int filled = static_cast<int>(std::min<std::size_t>(kLanes, count - i));
        std::uint32_t indices[kLanes];
        for (int lane = 0; lane < kLanes; ++lane) {
            indices[lane] = static_cast<std::uint32_t>(i) + static_cast<std::uint32_t>(lane);
        }
        PointLanes points;
        gather(view.points.data(), indices, filled, points);
        PinholePath path;
        pinhole_path<D>(parameters, points, path);
        for (int lane = 0; lane < filled; ++lane) {
            const bool seen = path.z[lane] >= kDepthMinMm;
            for (std::size_t row = 0; row < 2; ++row) {
                out[2 * (i + static_cast<std::size_t>(lane)) + row] =
                    seen ? path.residual[row][lane] : std::numeric_limits<double>::infinity();
            }
        }
    }
}

}  // namespace rig
