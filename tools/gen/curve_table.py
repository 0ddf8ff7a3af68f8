#!/usr/bin/env python3
"""Make firmware/detect/curve_table.c: how blur moves the rim of an ellipse that it does not dwarf.

    curve_table.py [--check]     (--check: exit 1 if the file differs)

What is fitted. An ellipse with semi-axes a >= b, R = sqrt(a b), bright inside, seen through a
Gaussian blur of standard deviation s, is at the point x

    D(x) = integral over the ellipse of exp(-|x - u|^2 / 2 s^2) / (2 pi s^2) du.

At a straight edge D is Phi(t), Phi the normal distribution's integral and t the distance inside in
blurs. Here D is written as Phi(t'), with eps = s / R, alpha = b / a and

    rho, phi   x in polar coordinates where the ellipse is the unit circle, phi from the major axis
    v          (R / h)^2 = i0 + y, h the distance from the centre to the tangent at phi;
               i0 = (1 / alpha + alpha) / 2, y = -(1 / alpha - alpha) / 2 cos 2 phi
    hr         h / R = 1 / sqrt(v)
    tau        (1 - rho) h / s, the distance inside in blurs, to first order
    t'         tau + eps hr P(tau, y)
    P          sum of c_jk tau^j y^k over the 15 (j, k) of TERMS

The c_jk are the table, in Q14, at nodes of eps and alpha, bilinear between. As eps goes to 0 a
circle's c_00 tends to -1/2: half the curvature.

How. Least squares of D - Phi(t'), by steps of Gauss and Newton from c = 0; all nodes at once, for
every ellipse between nodes sees four. All sums are quadratures, nothing is drawn:
  ellipses  4 x 4 Gauss points of every cell of the table, where b >= s (smaller ones are not
            fitted); each counts as its share of eps and alpha, the nearly round ones three times
  pixels    even in area over |tau| <= 2, rho > 0.05, the band that a circle is fitted in; a quarter
            where the next triangles begin (farther out than h less 1.2 blurs, and than 0.43 blurs),
            for they are seen there unless they have the same colour
  D         one integral in closed form (Phi), the other by Gauss-Legendre: 3e-6
A ridge of 1e-5 of the mean weight holds down the second differences of c along eps and alpha: it
carries the table on to nodes that no fitted ellipse reaches.

What is left. RMS 0.0008, on 700 other ellipses drawn at random (154000 pixels) as on the fitted
ones; largest for eps 0.45 .. 0.6: 0.002 for alpha below 0.42, 0.0008 above 0.84. The worst pixel,
at the centre of such an ellipse (rho 0.05), is off by 0.017. For eps below 0.06: RMS 0.0002.

Arithmetic. The last bits of exp and of the linear solution differ between builds of NumPy and BLAS,
and show where an entry lies next to a rounding boundary: noise of 1e-9 in Phi and its density moves
entries by 1. So --check takes entries within 3 units; moving all at random by so much changes D by
2e-5 RMS.
"""
import math
import re
from pathlib import Path

import numpy as np

from keep_file import keep

OUTPUT = Path(__file__).resolve().parents[2] / "firmware/detect/curve_table.c"

BITS = 14
SLACK = 3
BLURS = np.array([0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9])
ASPECTS = np.array([0.32, 0.42, 0.54, 0.68, 0.84, 1.0])
TERMS = [(j, k) for j, last in enumerate((3, 3, 3, 1, 0)) for k in range(last + 1)]
NODES = len(BLURS) * len(ASPECTS)

BAND = 2.0        # blurs
STEPS = 8         # the seventh moves no entry any more
RIDGE = 1e-5
REACH = 5.0       # blurs: 6e-7 of the Gaussian lies beyond

EDGE_AT = np.linspace(-9, 9, 36001)  # linear between these: 0.25 h^2 / 8 = 8e-9
EDGE = np.array([0.5 * math.erfc(-t / math.sqrt(2)) for t in EDGE_AT])


def edge(t):
    return np.interp(t, EDGE_AT, EDGE)


def bell(t):
    return np.exp(-0.5 * t * t) / math.sqrt(2 * math.pi)


def gauss(count, low, high):
    """Gauss-Legendre places and weights on [low, high], also of arrays: count is the last axis."""
    at, weight = np.polynomial.legendre.leggauss(count)
    half = np.expand_dims((np.asarray(high) - low) / 2, -1)
    return np.expand_dims(low, -1) + half * (1 + at), half * weight


def blurred(eps, alpha, x, y, count=24):
    """D at (x, y), R = 1: along one axis (u = a sin angle) by quadrature, across it in closed form.
    The axis is the one the rim nearby runs along, so that the chords' ends move smoothly."""
    a, b = alpha**-0.5, alpha**0.5
    steep = np.abs(x / a**2) > np.abs(y / b**2)
    a, b, x, y = (np.where(steep, q, p)[..., None] for p, q in ((a, b), (b, a), (x, y), (y, x)))
    angle, weight = gauss(count, np.arcsin(np.clip((x - REACH * eps) / a, -1, 1))[..., 0],
                          np.arcsin(np.clip((x + REACH * eps) / a, -1, 1))[..., 0])
    half = b * np.cos(angle)
    chord = edge((half - y) / eps) - edge((-half - y) / eps)
    along = bell((x - a * np.sin(angle)) / eps) * a * np.cos(angle) / eps
    return (along * chord * weight).sum(-1)


def pixels(eps, alpha, rings=10, rays=8):
    """The band of one ellipse, one quarter of it: tau, y, hr, D and weights that sum to 1."""
    phi = (np.arange(rays) + 0.5) * math.pi / 2 / rays
    y = -(1 / alpha - alpha) / 2 * np.cos(2 * phi)
    hr = ((1 / alpha + alpha) / 2 + y) ** -0.5
    tau, weight = gauss(rings, -BAND, np.minimum(BAND, 0.95 * hr / eps))
    phi, y, hr = (np.broadcast_to(v[:, None], tau.shape) for v in (phi, y, hr))
    rho = 1 - tau * eps / hr
    weight = weight * rho / hr  # area: rho drho dphi
    weight = np.where(-tau * eps > np.maximum(hr - 1.2 * eps, 0.43 * eps), 0.25, 1) * weight
    exact = blurred(eps, alpha, alpha**-0.5 * rho * np.cos(phi), alpha**0.5 * rho * np.sin(phi))
    return [v.ravel() for v in (tau, y, hr, exact, weight / weight.sum())]


def cell(i, j, count=4):
    """Cell (i, j): columns of c (4 nodes' terms), tau, (t' - tau) / c by column, D, weights."""
    parts = []
    for eps, eps_weight in zip(*gauss(count, BLURS[i], BLURS[i + 1])):
        for alpha, alpha_weight in zip(*gauss(count, ASPECTS[j], ASPECTS[j + 1])):
            if math.sqrt(alpha) < eps:
                continue
            tau, y, hr, exact, weight = pixels(eps, alpha)
            f = (eps - BLURS[i]) / (BLURS[i + 1] - BLURS[i])
            g = (alpha - ASPECTS[j]) / (ASPECTS[j + 1] - ASPECTS[j])
            terms = np.stack([eps * hr * tau**p * y**q for p, q in TERMS], -1)
            shares = ((1 - f) * (1 - g), (1 - f) * g, f * (1 - g), f * g)
            share = eps_weight * alpha_weight * (3 if alpha > 0.88 else 1)
            parts.append((tau, np.hstack([terms * s for s in shares]), exact, share * weight))
    corners = [(i + m) * len(ASPECTS) + j + n for m in (0, 1) for n in (0, 1)]
    columns = np.concatenate([node * len(TERMS) + np.arange(len(TERMS)) for node in corners])
    return (columns, *(np.concatenate(v) for v in zip(*parts))) if parts else None


def roughness():
    """Sum of squared second differences along eps and along alpha, as a quadratic form in c."""
    def second(count):
        return np.diff(np.eye(count), 2, axis=0)
    form = (np.kron(second(len(BLURS)).T @ second(len(BLURS)), np.eye(len(ASPECTS)))
            + np.kron(np.eye(len(BLURS)), second(len(ASPECTS)).T @ second(len(ASPECTS))))
    return np.kron(form, np.eye(len(TERMS)))


def fit():
    """The table in Q14, and the RMS of D - Phi(t')."""
    cells = [cell(i, j) for i in range(len(BLURS) - 1) for j in range(len(ASPECTS) - 1)]
    cells = [c for c in cells if c]
    total = sum(c[-1].sum() for c in cells)
    c = np.zeros(NODES * len(TERMS))
    ridge = RIDGE * total / len(c) * roughness()
    for _ in range(STEPS):
        form = ridge + 1e-11 * total * np.eye(len(c))
        rest = -form @ c
        squares = 0.0
        for columns, tau, terms, exact, weight in cells:
            t = tau + terms @ c[columns]
            slope = terms * bell(t)[:, None]
            miss = exact - edge(t)
            form[np.ix_(columns, columns)] += slope.T @ (slope * weight[:, None])
            rest[columns] += slope.T @ (miss * weight)
            squares += weight @ miss**2
        c += np.linalg.solve(form, rest)
    table = np.rint(c * 2**BITS).astype(int).reshape(len(BLURS), len(ASPECTS), len(TERMS))
    return table, math.sqrt(squares / total)


def text(values):
    assert np.abs(values).max() < 32768
    out = ["/* Generated by tools/gen/curve_table.py; `make tables` checks it. */",
           '#include "firmware/detect/curve.h"', "",
           "const int16_t curve_table_q14[CURVE_BLURS][CURVE_ASPECTS][CURVE_TERMS] = {"]
    for eps, row in zip(BLURS, values):
        out.append("    {")
        for alpha, terms in zip(ASPECTS, row):
            out.append(f"        /* eps {eps:.2f} alpha {alpha:.2f} */")
            out.append("        {" + ", ".join(str(v) for v in terms[:8]) + ",")
            out.append("         " + ", ".join(str(v) for v in terms[8:]) + "},")
        out.append("    },")
    out.append("};")
    return "\n".join(out) + "\n"


def agrees():
    """Whether the file is the table to SLACK units, and to the letter otherwise."""
    if not OUTPUT.exists():
        return False
    found = OUTPUT.read_text()
    numbers = [int(n) for n in re.findall(r"-?\d+(?=[,}])", found)]
    if len(numbers) != NODES * len(TERMS):
        return False
    values = np.array(numbers).reshape(len(BLURS), len(ASPECTS), len(TERMS))
    return found == text(values) and np.abs(values - fit()[0]).max() <= SLACK


def fitted():
    table, rms = fit()
    print(f"{OUTPUT.name}: RMS of what the fit leaves {rms:.5f}")
    return text(table)


if __name__ == "__main__":
    keep(OUTPUT, fitted, __doc__, agrees)
