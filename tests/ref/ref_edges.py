"""Edge points: on each line between two neighbouring pixels, where q = L_nn / |L_n| changes its sign.

L_nn is positive on the dark side of an edge and negative on its bright side, so from the positive pixel to
the negative one it must become brighter: elsewhere lies the flattest place between two edges. `lean` is that
slope over the slope across it; about 0 (an edge that runs along the line of the two pixels) it tells little.
q is taken as linear between the two pixels. Both must have at least the least gradient.
"""
import numpy as np

from ref_filters import along_gradient


def crossings(d, gradient_min):
    """{(across, row, column): (fraction, RMS |gradient|, lean, first pixel, second pixel)}: the point lies
    that fraction of the way from (row, column) to the next column, or down to the next row."""
    gradient, second = along_gradient(d)
    out = {}
    for across in (True, False):
        here, there = slices(1 if across else 0)
        strong = (gradient[here] >= gradient_min) & (gradient[there] >= gradient_min)
        found = strong & ((second[here] >= 0) != (second[there] >= 0))
        for row, column in zip(*np.nonzero(found)):
            a = (row, column)
            b = (row, column + 1) if across else (row + 1, column)
            qa, qb = second[a] / gradient[a], second[b] / gradient[b]
            brighter = np.array([d["x"][b] + d["x"][a], d["y"][b] + d["y"][a]]) * np.sign(qa - qb)
            along, beside = brighter if across else brighter[::-1]
            out[(across, int(row), int(column))] = (
                qa / (qa - qb), np.hypot(gradient[a], gradient[b]) / np.sqrt(2),
                along / max(abs(beside), 1e-9), a, b)
    return out


def slices(axis):
    first, last = [slice(None)] * 2, [slice(None)] * 2
    first[axis], last[axis] = slice(None, -1), slice(1, None)
    return tuple(first), tuple(last)
