"""The simulator that the solver is measured with: its shortcuts against the plain and slow way."""
import json
import pathlib
import sys

import cv2
import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "truth"))
import truth_circles  # noqa: E402
import truth_folder  # noqa: E402
import truth_lens  # noqa: E402
import truth_scenes  # noqa: E402

LENSES = [(model, 0.0) for model in truth_scenes.LENSES] + [("brown", 0.7), ("fisheye", 0.7)]


def camera_of(model, field=0.0):
    rng = np.random.default_rng(11)
    return truth_scenes._camera("one", (4096, 3000), 2500.0 if model == "fisheye" else 4000.0, model, rng,
                                field, np.eye(3), np.zeros(3))


def points_in_view(camera, rng, count=200):
    pixels = rng.uniform([40, 40], [4056, 2960], (count, 2))
    return truth_lens.unproject(camera, pixels) * rng.uniform(900, 3000, (count, 1))


@pytest.mark.parametrize("model, field", LENSES)
def test_derivatives_of_the_projection_are_its_differences(model, field):
    camera, rng = camera_of(model, field), np.random.default_rng(2)
    points = points_in_view(camera, rng)
    by_point, by_lens = truth_lens.jacobians(camera, points)
    # Central differences: truncation some (1e-3)^2 of the value, rounding 1e-12 * 4e3 / step.
    for i in range(3):
        step = np.eye(3)[i] * 0.05
        numeric = (truth_lens.project(camera, points + step) - truth_lens.project(camera, points - step)) / 0.1
        assert np.abs(numeric - by_point[..., i]).max() < 1e-6 * np.abs(by_point).max()
    flat = [camera["fx"], camera["fy"], camera["cx"], camera["cy"], *camera["distortion"]]
    for i, value in enumerate(flat):
        h = 1e-4 * max(abs(value), 0.01) if i >= 4 else 1e-2
        both = []
        for sign in (1, -1):
            moved = list(flat)
            moved[i] += sign * h
            other = {**camera, **dict(zip(("fx", "fy", "cx", "cy"), moved)), "distortion": moved[4:]}
            both.append(truth_lens.project(other, points))
        numeric = (both[0] - both[1]) / (2 * h)
        assert np.abs(numeric - by_lens[..., i]).max() < 1e-5 * max(np.abs(by_lens[..., i]).max(), 1), i


@pytest.mark.parametrize("model", truth_scenes.LENSES)
def test_projection_without_field_is_opencvs(model):
    camera = camera_of(model)
    points = points_in_view(camera, np.random.default_rng(3))
    matrix = np.array([[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]])
    d, zero = np.array(camera["distortion"]), np.zeros(3)
    if model == "fisheye":
        known = cv2.fisheye.projectPoints(points[None], zero, zero, matrix, d)[0]
    else:
        known = cv2.projectPoints(points, zero, zero, matrix, d)[0]
    # Both are double arithmetic on numbers of some 1e3.
    assert np.abs(truth_lens.project(camera, points) - known.reshape(-1, 2)).max() < 1e-8


@pytest.mark.parametrize("model, field", LENSES)
def test_few_samples_of_an_edge_have_the_centre_that_thousands_have(model, field):
    """Circles of up to 40 px seen at up to 65 degrees, out to the corners."""
    camera, rng = camera_of(model, field), np.random.default_rng(5)
    points = points_in_view(camera, rng, 200)
    tilt = truth_scenes.rotations(rng.uniform(-1.1, 1.1, (200, 1)) * [[1.0, 0, 0]])
    turn = truth_scenes.rotations(rng.uniform(0, 6.28, (200, 1)) * [[0, 0, 1.0]]) @ tilt
    seen = (points * turn[:, :, 2]).sum(axis=1) > np.cos(np.radians(65)) * np.linalg.norm(points, axis=1)
    points, along = points[seen], turn[seen, :, :2]
    radius = rng.uniform(2, 40, len(points)) * np.linalg.norm(points, axis=1) / camera["fx"]
    few = truth_circles.image_of_circles(camera, points, radius, along)
    many = truth_circles.image_of_circles(camera, points, radius, along, samples=360)
    assert np.isfinite(many[:, 0]).sum() > 100
    assert np.nanmax(np.abs(few - many)) < 1e-5


def test_an_undistorted_circle_has_the_centre_of_its_conic():
    """Without distortion the edge's image is an ellipse exactly: pole of the line at infinity's image."""
    camera = {**camera_of("brown"), "distortion": [0.0] * 5}
    turn, centre, radius = truth_scenes.rotations([0.9, 0.3, 0.1])[0], np.array([300.0, -200, 1500]), 30.0
    found = truth_circles.image_of_circles(camera, centre[None], np.array([radius]), turn[None, :, :2])[0]
    matrix = np.array([[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]])
    homography = matrix @ np.stack([turn[:, 0], turn[:, 1], centre], axis=-1)
    dual = homography @ np.diag([radius**2, radius**2, -1]) @ homography.T
    assert np.abs(found - dual[:2, 2] / dual[2, 2]).max() < 1e-8
    plain = truth_lens.project(camera, centre[None])[0]
    assert np.linalg.norm(found - plain) > 0.1  # what a solver that takes the circle's centre is off by


@pytest.mark.parametrize("kind", truth_scenes.SURFACES)
def test_surfaces_are_a_millimetre_high_and_slope_as_they_should(kind):
    board = truth_scenes.grid(42, 24, 28.0, 5.0)
    surface = {"kind": kind, "height_mm": 1.0}
    height, slope = truth_scenes.surface_at(surface, board)
    # Twice the amplitude from corner to corner of a twist. The highest board point is up to half a
    # pitch from the top of a dent of 112 mm: 0.8 %.
    assert np.abs(height).max() == pytest.approx(0 if kind == "flat" else 1, abs=0.02)
    square = height.reshape(24, 42)
    numeric = np.stack([np.gradient(square, 28.0, axis=1), np.gradient(square, 28.0, axis=0)], axis=-1)
    inner = (slice(1, -1), slice(1, -1))
    # Differences over 28 mm of a dent's slope: (h^2 / 6) z''' of some (28 / 117)^2 / 6 * 1.4 / 117.
    assert np.abs(numeric[inner] - slope.reshape(24, 42, 2)[inner]).max() < 1.5e-4


def test_a_folder_holds_what_was_made(tmp_path):
    scene = truth_scenes.make("small", seed=4, noise=0.1, outliers=0.05, surface="bow")
    truth_folder.write_folder(tmp_path, scene)
    truth_folder.write_truth(tmp_path / "truth.json", scene)
    lines = (tmp_path / "observations.csv").read_text().splitlines()
    assert len(lines) == len(scene.camera) + 1
    truth = json.loads((tmp_path / "truth.json").read_text())
    # Outliers are 5 px off and more, the others six sigmas at most in all but 2e-9 of the draws.
    miss = np.linalg.norm(scene.pixels - scene.exact, axis=1)
    assert set(truth["outlier_lines"]) == {i + 2 for i in np.flatnonzero(miss > 2.5)}
    name, frame, board, point, x, y, sigma = lines[17].split(",")
    assert (name, int(frame), int(point)) == (f"cam{scene.camera[16]}", scene.frame[16], scene.point[16])
    assert np.allclose([float(x), float(y)], scene.pixels[16], atol=1e-6) and float(sigma) == 0.1 and board == "a"
    again = truth_scenes.make("small", seed=4, noise=0.1, outliers=0.05, surface="bow")
    assert np.array_equal(again.pixels, scene.pixels)
    assert not np.array_equal(truth_scenes.make("small", seed=5).pixels[:50], scene.pixels[:50])
