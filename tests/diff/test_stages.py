"""The fixed-point stages against the reference in double precision (tests/ref), on the same frames."""
import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests" / "ref"))

from ref_edges import crossings  # noqa: E402
from ref_ellipse import area_fit, direct_fit, geometric_fit  # noqa: E402
from ref_filters import along_gradient, correlate, derivatives, kernels  # noqa: E402
from ref_profile import profile_fit  # noqa: E402

BIN = Path(os.environ.get("TESSERA_BIN", ROOT / "build" / "bin"))
DUMP = os.environ.get("TESSERA_DUMP_STAGES", ROOT / "build" / "native" / "tests" / "dump_stages")

# Of each kind of frame what stresses the arithmetic: strong and weak edges, much and little blur.
FRAMES = {
    "strong": {"psf_sigma_px": 0.8, "noise": 0, "black": 5, "white": 250},
    "usual": {"psf_sigma_px": 1.0, "noise": 1, "black": 33, "white": 223},
    "weak": {"psf_sigma_px": 1.6, "noise": 2, "black": 100, "white": 160},
}
WIDTH, HEIGHT = 320, 240
RADIUS = 3            # of the default kernel
# The slope from dark to bright over the slope across it: from where on points must be edges, and below
# which they may not. Errors of 0.4 units in gradients of at least 40 move it by 0.01.
LEAN_SURE, LEAN_LEAST = 0.01, 0.26
GRADIENT_MIN = 40     # the default weakest edge, 2.5 grey levels a pixel, in 1/16


class Frame:
    """A frame, what the stages made of it, and the detector's last word."""

    def __init__(self, folder, camera, seed):
        target = folder / "target.json"
        run(BIN / "tessera-target", "--rows", 5, "--cols", 5, "--patch-mm", 100, "--seed", seed,
            "--out", target)
        scene = {"format": "tessera-render-scene", "version": 1, "target": "target.json", "seed": seed,
                 "cameras": [{"name": "c", "width": WIDTH, "height": HEIGHT, "fx": 800, **camera}],
                 "path": {"kind": "views", "views": [{"patch_px": 130, "turn_deg": 23 * seed,
                                                      "tilt_deg": 25, "tilt_axis_deg": 40}]}}
        (folder / "scene.json").write_text(json.dumps(scene))
        run(BIN / "tessera-render", folder / "scene.json", "--out", folder / "out")
        image = folder / "out" / "c" / "frame_00000.pgm"
        run(DUMP, image, folder)
        run(BIN / "tessera-detect", "--target", target, "--csv", folder / "found.csv", image)
        self.camera = camera
        self.grey = cv2.imread(str(image), cv2.IMREAD_UNCHANGED).astype(float)
        self.grey_q4 = 16 * self.grey
        self.reference = derivatives(self.grey_q4, RADIUS)
        steer = np.loadtxt(folder / "steer.csv", delimiter=",", skiprows=1)
        self.steer = {name: steer[:, i].reshape(HEIGHT, WIDTH)
                      for i, name in enumerate(("x", "y", "xx", "xy", "yy", "side"), 2)}
        self.edges = np.loadtxt(folder / "edges.csv", delimiter=",", skiprows=1)
        self.contours = np.loadtxt(folder / "contours.csv", delimiter=",", skiprows=1)
        self.fits = np.loadtxt(folder / "fits.csv", delimiter=",", skiprows=1, ndmin=2)
        with open(folder / "found.csv", newline="") as file:
            self.found = list(csv.DictReader(file))


@pytest.fixture(scope="module", params=FRAMES)
def frame(request, tmp_path_factory):
    return Frame(tmp_path_factory.mktemp(request.param), FRAMES[request.param],
                 list(FRAMES).index(request.param) + 1)


def run(*words):
    subprocess.run([str(word) for word in words], check=True, capture_output=True)


def show(what, errors, bounds):
    """Prints worst and RMS; the bound may differ from value to value."""
    errors, bounds = np.abs(np.asarray(errors)), np.broadcast_to(bounds, np.shape(errors))
    print(f"{what}: worst {errors.max():.6f}, RMS {np.sqrt(np.mean(errors ** 2)):.6f}, "
          f"{(errors / bounds).max():.3f} of the bound")
    assert (errors <= bounds).all(), what


def rounded(kernel, bits, centred):
    """Sum of |error| of a kernel whose taps are rounded; the centre takes what is left of the sum."""
    error = np.round(kernel * 2 ** bits) / 2 ** bits - kernel
    if centred:
        middle = len(kernel) // 2
        error[middle] = 0
        error[middle] = -error.sum()
    return np.abs(error).sum()


def filter_bounds(grey_q4):
    """The largest error of each derivative.

    Rows: a filter with wrong taps errs by the sum of |errors| times half the range of its input, for the
    errors add up to 0 (the sums are exact); then half a unit of the format is lost by rounding. The columns'
    filter passes the rows' error on, times its sum of |taps|, and adds its own."""
    g, first, second = kernels(RADIUS)
    unit = {"g": 1 / 8, "first": 1 / 8, "second": 1 / 4}  # rows: Q3, Q3, Q2
    kernel = {"g": g, "first": first, "second": second}
    wrong = {"g": rounded(g, 15, True), "first": rounded(first, 15, False),
             "second": rounded(second, 14, True)}
    out = {}
    for name, along_x, along_y, out_unit in (("x", "first", "g", 1 / 8), ("y", "g", "first", 1 / 8),
                                             ("xx", "second", "g", 1 / 4),
                                             ("xy", "first", "first", 1 / 4),
                                             ("yy", "g", "second", 1 / 4)):
        row = wrong[along_x] * np.ptp(grey_q4) / 2 + unit[along_x] / 2
        middle = correlate(grey_q4, kernel[along_x], 1)
        out[name] = (np.abs(kernel[along_y]).sum() + wrong[along_y]) * row + \
            wrong[along_y] * np.ptp(middle) / 2 + out_unit / 2
    return out


def second_bound(d, bounds):
    """The error of L_nn that errors of the derivatives within their bounds make, to first order: of the
    second derivatives, and of the direction by at most |error of the gradient| / |gradient|."""
    size, _ = along_gradient(d)
    size = np.maximum(size, 1)
    nx, ny = np.abs(d["x"]) / size, np.abs(d["y"]) / size
    turn = np.hypot(bounds["x"], bounds["y"]) / size
    bend = np.sqrt(d["xx"] ** 2 + 2 * d["xy"] ** 2 + d["yy"] ** 2)
    return (nx ** 2 * bounds["xx"] + 2 * nx * ny * bounds["xy"] + ny ** 2 * bounds["yy"] +
            2 * turn * bend) * (1 + 2 * turn)


def test_derivatives_are_the_gaussian_ones(frame):
    bounds = filter_bounds(frame.grey_q4)
    for name, unit in (("x", 8), ("y", 8), ("xx", 4), ("xy", 4), ("yy", 4)):
        show(name, frame.steer[name] / unit - frame.reference[name], bounds[name])


def test_sides_are_the_signs_of_the_second_derivative_along_the_gradient(frame):
    bounds = filter_bounds(frame.grey_q4)
    size, second = along_gradient(frame.reference)
    unsure = np.hypot(bounds["x"], bounds["y"])
    strong, weak = size > GRADIENT_MIN + unsure, size < GRADIENT_MIN - unsure
    assert (frame.steer["side"][weak] == 0).all()
    assert (frame.steer["side"][strong] != 0).all()
    told = strong & (np.abs(second) > second_bound(frame.reference, bounds))
    print(f"{strong.sum()} pixels on edges, sign of {strong.sum() - told.sum()} within the error")
    assert told.sum() > 0.9 * strong.sum() > 5000
    assert (frame.steer["side"][told] == np.sign(second[told])).all()


def test_edge_points_are_zeros_of_the_second_over_the_first_derivative(frame):
    d = frame.reference
    bounds = filter_bounds(frame.grey_q4)
    size, second = along_gradient(d)
    unsure = np.hypot(bounds["x"], bounds["y"])
    q = second / np.maximum(size, 1)
    q_error = (second_bound(d, bounds) + np.abs(q) * unsure) / np.maximum(size - unsure, 1)
    reference = crossings(d, GRADIENT_MIN)
    found = {}
    for across, row, column, x, y, squares_q6 in frame.edges:
        fraction = x / 65536 - column if across else y / 65536 - row
        found[(bool(across), int(row), int(column))] = (fraction, np.sqrt(squares_q6 / 2) / 8)

    both = sorted(set(found) & set(reference))
    assert len(both) > 5000
    errors, limits, steepness = [], [], []
    for name in both:
        fraction, gradient, lean, a, b = reference[name]
        assert lean > -LEAN_LEAST, name
        # Of t = qa / (qa - qb): (1 - t) of qa's error and t of qb's, over the difference as it may be.
        worst = max(q_error[a], q_error[b])
        room = abs(q[a] - q[b]) - 2 * worst
        # Third powers and shares of 16 bits move it by 6e-5 px (edges.c), the format by half of 1/65536 px.
        limits.append(min(1, worst / room if room > 0 else 1) + 6e-5 + 1 / 65536)
        errors.append(found[name][0] - fraction)
        steepness.append(found[name][1] - gradient)
    show("edge points, px", errors, np.array(limits))
    # As x and y.
    show("their gradients", steepness, unsure)

    # What only one of them has is where sign, threshold or the way to the bright side is in doubt.
    for name in set(found) ^ set(reference):
        across, row, column = name
        pixels = (row, column), (row, column + 1) if across else (row + 1, column)
        assert name in reference and reference[name][2] < LEAN_SURE or any(
            abs(size[p] - GRADIENT_MIN) <= unsure or
            abs(second[p]) <= second_bound(d, bounds)[p] for p in pixels), name


def ellipses(frame):
    """(points x, y, direct fit, refit, its residual, fit by area, its square residual) of the closed contours that
    all fits took."""
    for row in frame.fits:
        points = frame.contours[frame.contours[:, 0] == row[0]]
        scale = np.array([65536, 65536, 4096, 4096, 4096])
        yield (points[:, 2] / 65536, points[:, 3] / 65536, row[1:6] / scale, row[6:11] / scale,
               row[11] / 65536, row[12:17] / scale, row[17] / 4096)


def size_of(ellipse):
    return (ellipse[2] * ellipse[4] - ellipse[3] ** 2) ** 0.25


def test_direct_fit_is_fitzgibbons(frame):
    # directfit.h: the arithmetic alone errs by less than 2e-5 of the size; the format adds half of
    # 1/65536 px to the centre and half of 1/4096 px^2 to the shape matrix.
    centres, shapes, centre_bounds, shape_bounds = [], [], [], []
    for x, y, direct, *_ in ellipses(frame):
        reference = direct_fit(x, y)
        size = size_of(reference)
        centres.append(np.abs(direct - reference)[:2].max())
        centre_bounds.append(2e-5 * size + 0.5 / 65536)
        shapes.append(np.abs(direct - reference)[2:].max())
        shape_bounds.append(2 * 2e-5 * size ** 2 + 0.5 / 4096)
    assert len(centres) > 30
    show("centres, px", centres, np.array(centre_bounds))
    show("shape matrices, px^2", shapes, np.array(shape_bounds))


def test_refit_is_the_fit_of_least_distances(frame):
    # The refit is one step, by distances that are right to first order. What is left is of second order in
    # the points' distances d and in the step: an error of curvature d^2 / 2 a point, of which a centre takes
    # at most twice the mean. The greatest curvature of an ellipse is a / b^2.
    rows = []
    for x, y, direct, refit, residual, _, _ in ellipses(frame):
        reference, rms = geometric_fit(x, y, direct_fit(x, y))
        half, apart = (reference[2] + reference[4]) / 2, np.hypot(
            (reference[2] - reference[4]) / 2, reference[3])
        curvature = np.sqrt(half + apart) / (half - apart)
        step = np.abs(direct - reference)[:2].max()
        second_order = curvature * (rms ** 2 + step ** 2)
        rows.append((np.abs(refit - reference)[:2].max(),
                     2 * second_order + 2e-5 * size_of(reference) + 0.5 / 65536,
                     residual - rms, second_order + 1e-4))
    rows = np.array(rows)
    assert len(rows) > 30
    show("centres, px", rows[:, 0], rows[:, 1])
    show("RMS distances, px", rows[:, 2], rows[:, 3])


def test_fit_by_area_has_the_moments_of_the_area(frame):
    # areafit.h: the arithmetic errs like the direct fit's. The mean square distance is what the line's area lacks, for
    # which steps count as arcs but for the fifth power of their angle.
    rows = []
    for x, y, _, _, _, area, square in ellipses(frame):
        reference, arcs = area_fit(x, y)
        size, trace = size_of(reference), reference[2] + reference[4]
        share = arcs.sum() / (2 * np.pi)
        left_out = 3 / 40 * np.sum(np.abs(arcs) ** 5) / (2 * np.pi)
        rows.append((np.abs(area - reference)[:2].max(), 2e-5 * size + 0.5 / 65536,
                     np.abs(area - reference)[2:].max(), 2 * 2e-5 * size ** 2 + 0.5 / 4096,
                     square - max(0, 1 - share ** 2) * size ** 4 / (4 * trace),
                     2 * left_out * size ** 4 / (4 * trace) + 1 / 4096))
    rows = np.array(rows)
    assert len(rows) > 30
    show("centres, px", rows[:, 0], rows[:, 1])
    show("shape matrices, px^2", rows[:, 2], rows[:, 3])
    show("mean square distances, px^2", rows[:, 4], rows[:, 5])


def test_last_fit_is_the_likeliest_place_given_the_pixels(frame):
    # Both fit the same model to the pixels. The reference, converged on all pixels within two blurs of the
    # edge, takes all information there is; of any other unbiased fit with standard deviation sigma the
    # difference to it has the variance sigma^2 - reference^2 (else a mean of both were better still). Sigma
    # may be up to 10 % above the reference's, so RMS differences may be sqrt(1.1^2 - 1) = 0.46 sigma, and 4.5
    # times that, 2.1 sigma, in the worst of some hundred (1e-5). The detector makes two linear passes; from a
    # prediction 0.25 px off the first leaves about 0.25^2 / 2 s = 0.03 px, the second 0.03^2 / 2 s = 0.0005.
    blur = np.hypot(frame.camera["psf_sigma_px"], 12 ** -0.5)
    differences, sigmas, ratios = [], [], []
    for row in frame.found:
        x, y, sigma, major, minor, angle = (float(row[name]) for name in (
            "x", "y", "sigma", "major", "minor", "angle"))
        reach = major + 2 * blur + 2
        if min(x, y, WIDTH - 1 - x, HEIGHT - 1 - y) < reach:
            continue
        turn = np.deg2rad(angle)
        axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        shape = axes @ np.diag([major ** 2, minor ** 2]) @ axes.T
        start = [x, y, shape[0, 0], shape[0, 1], shape[1, 1]]
        reference, _, _, _, deviation = profile_fit(frame.grey, start, blur)
        differences += [*(reference[:2] - [x, y])]
        sigmas += [sigma, sigma]
        ratios.append(sigma / deviation)
    differences, sigmas = np.array(differences), np.array(sigmas)
    assert len(ratios) > 30
    show("centres, px", differences, 2.1 * sigmas + 0.0005)
    print(f"RMS difference {np.sqrt(np.mean((differences / sigmas) ** 2)):.3f} sigma, sigma over the "
          f"reference's {np.mean(ratios):.3f} ({min(ratios):.3f} to {max(ratios):.3f})")
    assert np.sqrt(np.mean((differences / sigmas) ** 2)) < 0.46
    assert 0.95 < np.mean(ratios) < 1.1
