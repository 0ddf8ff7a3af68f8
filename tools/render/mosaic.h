/* The board's reflectance, exactly, and its average over small cells of the image.
 *
 * Lattice frame: the board's own, in eighths of a patch side, before the print's measured scale. Every
 * triangle edge of the target lies on the lines x = i, y = i, x - y = i or x + y = i, i integer. So a
 * unit square with its two diagonals has four pieces, each of one colour and in one triangle, and
 * where an edge runs is a look-up. */
#ifndef RENDER_MOSAIC_H
#define RENDER_MOSAIC_H

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "common/targetfile/targetfile.h"

namespace render {

// One circle of the board. Polarity: true is a white circle in a black triangle.
struct Disc {
    Eigen::Vector2d centre; // lattice
    double radius;          // lattice
    bool white;
    unsigned patch;   // id
    unsigned feature; // index in the patch
};

// A square cell of the image and where it lies on the board, to first order.
struct Cell {
    Eigen::Vector2d centre;   // lattice
    Eigen::Matrix2d per_px;   // lattice per pixel
    double side_px;
    double behind; // what stands behind the board there, [0, 1]
};

class Mosaic {
public:
    explicit Mosaic(const targetfile& file);

    // True when the cell crosses no edge and no peak; `value` is its reflectance then.
    bool flat(const Cell& cell, double& value) const;
    // Average reflectance over the cell: exact for one straight edge, circles by their tangent at the
    // right mean distance, everything else by cutting the cell into four.
    double average(const Cell& cell) const { return average(cell, depth_max); }

    const std::vector<Disc>& discs() const { return discs_; }
    // Millimetres of the print per lattice unit, along X and Y.
    const Eigen::Vector2d& mm_per_unit() const { return mm_per_unit_; }
    // The board with its white border, lattice.
    const Eigen::Vector2d& low() const { return low_; }
    const Eigen::Vector2d& high() const { return high_; }

private:
    static constexpr int depth_max = 5;
    struct Piece {
        std::int32_t disc = -1; // -1: in the white border
        bool white = true;
    };
    // Pieces east (+x), south (+y), west, north of the square's centre.
    using Square = std::array<Piece, 4>;
    // The edge that runs through a cell, if it is one.
    struct Crossing {
        enum Kind { none, straight, many } kind = none;
        const Piece* here = nullptr;   // holds the cell's centre
        const Piece* there = nullptr;  // straight: beyond the edge
        Eigen::Vector2d normal{0, 0};  // straight: unit, from here to there
        double distance = 0;           // straight: from the centre to the edge, lattice, >= 0
    };
    // How the cell lies to the board's outer border.
    struct Border {
        enum Kind { inside, across, corner, outside } kind = inside;
        Eigen::Vector2d normal{0, 0};  // across: unit, outwards
        double distance = 0;           // across: from the centre to the border, negative outside
    };

    double average(const Cell& cell, int depth) const;
    double quarters(const Cell& cell, int depth) const;
    double sample(const Eigen::Vector2d& at, double behind) const;
    double level(const Disc& disc, double t2) const;
    const Piece* piece_at(const Eigen::Vector2d& at) const;
    Crossing cross(const Cell& cell) const;
    Crossing cross_meeting(const Eigen::Vector2d& at, const Piece* here, double reach) const;
    Border border(const Cell& cell) const;
    const Square& square(int i, int j) const;
    void paint(const struct layout_feature& shape, bool turned, int i0, int j0, const Piece& piece);

    int columns_ = 0; // squares, with a ring of border squares round the grid
    int rows_ = 0;
    std::vector<Square> squares_;
    std::vector<Disc> discs_;
    Eigen::Vector2d mm_per_unit_;
    Eigen::Vector2d low_;
    Eigen::Vector2d high_;
    double edge_level_ = 0;
    double peak_falloff_ = 0; // 1 / (2 gauss_sigma^2)
    double gap_ = 0;          // smallest distance from a circle to its triangle's edges
};

} // namespace render

#endif
