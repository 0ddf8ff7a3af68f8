#!/usr/bin/env python3
"""Writes common/target/layout_table.c: every feature of a patch at levels 2 and 3.

Usage: tools/gen/layout_table.py [--check]     (--check: exit 1 if the file differs)

Numbers are a + b*sqrt(2) with rational a and b until the last step, so each Q30 value is the exact
one rounded to nearest. The geometry is told in words in common/target/TARGET.md.
"""
import math
from fractions import Fraction as F
from pathlib import Path

from keep_file import keep

OUTPUT = Path(__file__).resolve().parents[2] / "common/target/layout_table.c"
GUARD_BITS = 200
ROOT2 = F(math.isqrt(2 << (2 * GUARD_BITS)), 1 << GUARD_BITS)  # sqrt(2) to 200 bits

H = (ROOT2 - 1) / 4  # inradius of a right isosceles triangle of hypotenuse 1/2
P = (2 - ROOT2) / 4  # inradius of one half of such a triangle of hypotenuse 1


def turned(points, quarters):
    """Points after clockwise quarter turns about the patch centre."""
    for _ in range(quarters):
        points = [(1 - v, u) for u, v in points]
    return points


class Frame:
    """A right isosceles triangle's own frame: x along the hypotenuse, y towards the right angle."""

    def __init__(self, origin, hypotenuse, flipped=False):
        self.origin = origin
        self.scale = -hypotenuse if flipped else hypotenuse

    def at(self, x, y):
        return (self.origin[0] + self.scale * x, self.origin[1] + self.scale * y)

    def length(self, units):
        return abs(self.scale) * units


# The small triangles of the top quarter, k = 0..3.
SMALL = [
    Frame((F(0), F(0)), F(1, 2)),
    Frame((F(3, 4), F(1, 4)), F(1, 2), flipped=True),
    Frame((F(1, 2), F(0)), F(1, 2)),
    Frame((F(1, 4), F(1, 4)), F(1, 2)),
]
ANCHOR_BIT = 12


def whole(frame):
    return [frame.at(F(0), F(0)), frame.at(F(1), F(0)), frame.at(F(1, 2), F(1, 2))]


def feature(centre, inradius, corners, quarter, bit, inverted):
    return {
        "centre": turned([centre], quarter)[0],
        "inradius": inradius,
        "corners": turned(corners, quarter),
        "bit": bit,
        "inverted": inverted,
    }


def anchor():
    top = Frame((F(0), F(0)), F(1))
    return feature((F(1, 2), 2 * H), 2 * H, whole(top), 0, ANCHOR_BIT, False)


def bit_level2(bit):
    small = SMALL[bit % 4]
    centre = small.at(F(1, 2), 2 * H)
    return feature(centre, small.length(2 * H), whole(small), 1 + bit // 4, bit, False)


def bit_level3(bit):
    small = SMALL[bit % 4]
    corners = [small.at(F(3, 4), F(1, 4)), small.at(F(1, 4), F(1, 4)), small.at(F(1, 2), F(0))]
    centre = small.at(F(1, 2), F(1, 4) - H)
    return feature(centre, small.length(H), corners, 1 + bit // 4, bit, False)


def satellite_level3(bit, j):
    small = SMALL[bit % 4]
    first_corner = [(F(0), F(0)), (F(1, 2), F(0)), (F(1, 4), F(1, 4))][j // 2]
    sub = Frame(small.at(*first_corner), small.scale / 2)
    if j % 2 == 0:
        corners = [sub.at(F(0), F(0)), sub.at(F(1, 2), F(0)), sub.at(F(1, 2), F(1, 2))]
        centre = sub.at(F(1, 2) - P, P)
    else:
        corners = [sub.at(F(1, 2), F(0)), sub.at(F(1), F(0)), sub.at(F(1, 2), F(1, 2))]
        centre = sub.at(F(1, 2) + P, P)
    return feature(centre, sub.length(P), corners, 1 + bit // 4, bit, j % 2 == 1)


def q30(value):
    return int(value * (1 << 30) + F(1, 2))


def row(f):
    eighths = [[int(c[axis] * 8) for c in f["corners"]] for axis in (0, 1)]
    assert all(F(e, 8) == c[axis] for axis in (0, 1) for e, c in zip(eighths[axis], f["corners"]))
    u, v = f["centre"]
    return "    {%d, %d, %d, %d, %s, {%s}, {%s}},\n" % (
        q30(u), q30(v), q30(f["inradius"]), f["bit"], "true" if f["inverted"] else "false",
        ", ".join(map(str, eighths[0])), ", ".join(map(str, eighths[1])))


def table(name, features):
    return "const struct layout_feature %s[%d] = {\n%s};\n" % (
        name, len(features), "".join(map(row, features)))


def holds(f, point):
    """Whether a point off all borders lies in the feature's triangle: right of each side, clockwise."""
    ends = zip(f["corners"], f["corners"][1:] + f["corners"][:1])
    return all((b[0] - a[0]) * (point[1] - a[1]) > (b[1] - a[1]) * (point[0] - a[0]) for a, b in ends)


def map_row(features, row, column):
    """The features that hold the left, top, bottom and right quarter of one square, cut by its diagonals."""
    middles = [(F(1, 6), F(1, 2)), (F(1, 2), F(1, 6)), (F(1, 2), F(5, 6)), (F(5, 6), F(1, 2))]
    points = [((column + x) / 8, (row + y) / 8) for x, y in middles]
    found = [[i for i, f in enumerate(features) if holds(f, point)] for point in points]
    assert all(len(one) == 1 for one in found)
    return "{%s}" % ", ".join(str(one[0]) for one in found)


def feature_map(name, features):
    rows = ["    {%s},\n" % ",\n     ".join(map_row(features, row, column) for column in range(8))
            for row in range(8)]
    return "const uint8_t %s[8][8][4] = {\n%s};\n" % (name, "".join(rows))


def text():
    bits = range(12)
    level2 = [anchor()] + [bit_level2(b) for b in bits]
    level3 = [anchor()] + [bit_level3(b) for b in bits]
    level3 += [satellite_level3(b, j) for b in bits for j in range(6)]
    return (
        "/* Generated by tools/gen/layout_table.py; do not edit.\n"
        " * Columns: u_q30, v_q30, inradius_q30, bit, inverted, corner_u_8th, corner_v_8th. Then, by squares of an\n"
        " * eighth, the features that hold the square's left, top, bottom and right quarter. */\n"
        '#include "common/target/layout.h"\n\n'
        + table("layout_table_level2", level2) + "\n" + table("layout_table_level3", level3) + "\n"
        + feature_map("layout_table_map2", level2) + "\n" + feature_map("layout_table_map3", level3))


if __name__ == "__main__":
    keep(OUTPUT, text, __doc__)
