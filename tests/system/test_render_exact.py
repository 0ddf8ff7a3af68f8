"""The renderer's own error in a circle's centre, against two judges that share no code with it:
the centre of mass of single circles, and brute force: the target drawn from its description by plain
arithmetic at thousands of points a pixel.

The bound is 0.0005 px in any single circle: a quarter of the 0.002 px that a detector is to reach on
frames without noise."""
import csv
import json
import math
import os
import random
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

BIN = Path(os.environ.get("TESSERA_BIN", Path(__file__).parents[2] / "build" / "bin"))
BOUND_PX = 0.0005
ID = 0b101101010011  # seven ones: a white anchor triangle, and both colours in each quarter
H = (np.sqrt(2) - 1) / 4
CDF = np.vectorize(lambda z: 0.5 * (1 + math.erf(z / math.sqrt(2))))  # of the normal distribution


def render(folder, target, camera, views):
    """Renders `views` of a one-patch target as floats; returns [(image, truth rows, pose)]."""
    target = {"format": "tessera-target", "version": 1, "rows": 1, "cols": 1, "patch_mm": 100,
              "ids": [[ID]], "turns": [[0]], **target}
    camera = {"name": "c", "fx": 2000, "black": 0, "white": 255, **camera}
    scene = {"format": "tessera-render-scene", "version": 1, "target": "target.json",
             "cameras": [camera], "path": {"kind": "views", "views": views}}
    (folder / "target.json").write_text(json.dumps(target))
    (folder / "scene.json").write_text(json.dumps(scene))
    out = folder / "out"
    subprocess.run([BIN / "tessera-render", folder / "scene.json", "--out", out, "--float"],
                   check=True, capture_output=True)
    truth = json.loads((out / "truth.json").read_text())
    rows = list(csv.DictReader((out / "c" / "truth.csv").open()))
    result = []
    for frame in truth["frames"]:
        name = f"frame_{frame['frame']:05d}.pfm"
        image = cv2.imread(str(out / "c" / name), cv2.IMREAD_UNCHANGED).astype(float)
        own = [{k: v if k == "file" else float(v) for k, v in row.items()}
               for row in rows if row["file"] == name]
        pose = frame["rig_from_board"]
        result.append((image, own, (np.array(pose["rotation"]).reshape(3, 3),
                                    np.array(pose["translation_mm"]))))
    return truth["cameras"][0], result


def centre_of_mass_error(image, row):
    """Centre of mass of a flat circle in its flat triangle, less the truth.

    Blur and pixel area keep a centre of mass. Sampling disturbs it by the blurred spectrum at one
    cycle a pixel, exp(-2 (pi 0.6)^2) = 0.0008 of what an unblurred circle of 3 px shows (0.01 px)."""
    x, y, major, minor = row["x"], row["y"], row["major"], row["minor"]
    reach = 4.5 * 0.6 + 1
    low_x, low_y = int(x - major - reach), int(y - major - reach)
    high_x, high_y = int(x + major + reach) + 2, int(y + major + reach) + 2
    assert low_x >= 0 and low_y >= 0 and high_x <= image.shape[1] and high_y <= image.shape[0]
    yy, xx = np.mgrid[low_y:high_y, low_x:high_x]
    turn = np.deg2rad(row["angle"])
    u = (xx - x) * np.cos(turn) + (yy - y) * np.sin(turn)
    v = (yy - y) * np.cos(turn) - (xx - x) * np.sin(turn)
    mass = np.abs(image[low_y:high_y, low_x:high_x] - (0 if row["polarity"] == 1 else 255))
    mass = mass * ((u / (major + reach)) ** 2 + (v / (minor + reach)) ** 2 < 1)
    return np.hypot((mass * xx).sum() / mass.sum() - x, (mass * yy).sum() / mass.sum() - y)


# circle_ratio 0.25 leaves three radii of flat triangle round a circle: at 3.4 px and 45 degrees of tilt
# the blur's reach of 2.7 px stays clear of all edges. Patches of 130, 300 and 780 px have circles of
# 3.4, 6.7, 7.8, 15.5, 20.2 and 40.4 px.
@pytest.mark.parametrize("patch_px", [130, 300, 780])
@pytest.mark.parametrize("tilt_deg", [0, 20, 45])
@pytest.mark.parametrize("k", [0, 0.2])
def test_circles_have_their_centre_of_mass_where_the_truth_says(tmp_path, patch_px, tilt_deg, k):
    rng = random.Random(patch_px * 1000 + tilt_deg + int(10 * k))
    views = [{"patch_px": patch_px, "turn_deg": rng.uniform(-180, 180), "tilt_deg": tilt_deg,
              "tilt_axis_deg": rng.uniform(0, 360), "shift_px": [rng.random(), rng.random()]}
             for _ in range(4 if patch_px < 500 else 1)]
    size = int(1.55 * patch_px) + 40
    camera = {"width": size, "height": size, "psf_sigma_px": 0.6, "distortion": [k, k * k],
              "background": {"level": 1}}
    _, frames = render(tmp_path, {"circle_ratio": 0.25, "edge_level": 1}, camera, views)
    errors = [centre_of_mass_error(image, row) for image, rows, _ in frames for row in rows]
    assert len(errors) == 13 * len(views)
    print(f"patch {patch_px} tilt {tilt_deg} k {k}: rms {np.sqrt(np.mean(np.square(errors))):.6f} "
          f"worst {max(errors):.6f} px")
    assert max(errors) < BOUND_PX


def reflectance(u, v, ratio, edge_level, gauss_sigma):
    """The patch ID at patch coordinates, straight from the description of the target; 1 outside."""
    outside = (u < 0) | (v < 0) | (u >= 1) | (v >= 1)
    quarter = np.where(v < u, np.where(u + v < 1, 0, 1), np.where(u + v < 1, 3, 2))
    # Turned back into the frame of the top quarter: counter-clockwise is (u, v) -> (v, 1 - u).
    for turn in (1, 2, 3):
        back = quarter >= turn
        u, v = np.where(back, v, u), np.where(back, 1 - u, v)
    small = np.where(u + v < 0.5, 0, np.where(u - v > 0.5, 2, np.where(v > 0.25, 3, 1)))
    centre_u = np.choose(small, [0.25, 0.5, 0.75, 0.5])
    centre_v = np.choose(small, [H, 0.25 - H, H, 0.25 + H])
    bits = np.array([(ID >> i) & 1 for i in range(12)])
    white_circle = bits[np.clip(4 * (quarter - 1) + small, 0, 11)] == 1
    anchor = quarter == 0
    centre_u = np.where(anchor, 0.5, centre_u)
    centre_v = np.where(anchor, 2 * H, centre_v)
    white_circle = np.where(anchor, bits.sum() % 2 == 0, white_circle)
    radius = ratio * np.where(anchor, 2 * H, H)
    t = np.hypot(u - centre_u, v - centre_v) / radius
    level = np.where(t < 1, edge_level + (1 - edge_level) * np.exp(-t * t / (2 * gauss_sigma ** 2)), 0)
    return np.where(outside, 1, np.where(white_circle, level, 1 - level))


def undistorted(camera, x, y):
    """Normalised rays of pixels: the distortion's fixed point, until it stands still."""
    k1, k2, p1, p2, k3 = camera["distortion"]
    xd, yd = (x - camera["cx"]) / camera["fx"], (y - camera["cy"]) / camera["fy"]
    xu, yu = xd.copy(), yd.copy()
    for _ in range(100):
        r2 = xu * xu + yu * yu
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        new_x = (xd - 2 * p1 * xu * yu - p2 * (r2 + 2 * xu * xu)) / radial
        new_y = (yd - p1 * (r2 + 2 * yu * yu) - 2 * p2 * xu * yu) / radial
        step = max(np.abs(new_x - xu).max(), np.abs(new_y - yu).max())
        xu, yu = new_x, new_y
        if step < 1e-13:
            break
    return xu, yu


def brute_force(camera, pose, look, low, size, sigma, samples):
    """Grey levels of the size x size pixels from `low` on: samples x samples points a pixel."""
    rotation, translation = pose
    border = int(np.ceil(5 * sigma)) + 1
    count = (size + 2 * border) * samples
    at = (np.arange(count) + 0.5) / samples - 0.5 - border
    taps = np.zeros((size, count))
    for i in range(size):
        away = at - i
        if sigma > 0:
            near = np.abs(away) < border + 0.5
            taps[i, near] = CDF((away[near] + 0.5) / sigma) - CDF((away[near] - 0.5) / sigma)
        else:
            taps[i] = np.abs(away) < 0.5
        taps[i] /= taps[i].sum()
    half = np.zeros((count, size))
    for first in range(0, count, 200):  # by strips: keeps the arrays small
        x, y = np.meshgrid(at + low[0], at[first:first + 200] + low[1])
        xu, yu = undistorted(camera, x, y)
        rays = np.stack([xu, yu, np.ones_like(xu)], -1) @ rotation  # in board axes
        eye = rotation.T @ translation
        depth = eye[2] / rays[..., 2]
        board = rays[..., :2] * depth[..., None] - eye[:2]
        half[first:first + 200] = reflectance(board[..., 0] / 100, board[..., 1] / 100, *look) @ taps.T
    return 255 * (taps @ half)


def shift_between(image, reference):
    """The small shift that best turns `reference` into `image`, by least squares."""
    gy, gx = np.gradient(reference)
    inner = (slice(1, -1), slice(1, -1))
    gx, gy, change = gx[inner].ravel(), gy[inner].ravel(), (image - reference)[inner].ravel()
    return -np.linalg.lstsq(np.stack([gx, gy], 1), change, rcond=None)[0]


# Points a pixel so many that the brute force's own error stays below a third of the bound: an edge
# crossing is placed to 1 / (samples sqrt(12)) px on each of 4 r samples scan lines.
@pytest.mark.parametrize("patch_px, feature, tilt_deg, k, sigma, samples", [
    (60, 1, 20, 0.0, 0.8, 90),     # radius 3.1
    (60, 8, 0, 0.33, 0.8, 90),
    (100, 6, 30, 0.1, 0.0, 64),    # radius 5.2, no blur at all: pixels alone
    (100, 3, 45, 0.0, 1.2, 64),
    (130, 0, 30, -0.2, 0.9, 40),   # radius 13
])
def test_circles_lie_where_brute_force_puts_them(tmp_path, patch_px, feature, tilt_deg, k, sigma,
                                                 samples):
    rng = random.Random(patch_px + feature)
    camera = {"width": 200, "height": 200, "fx": 600, "psf_sigma_px": sigma,
              "distortion": [k, k * k, 0.001, -0.002, 0.0], "background": {"level": 1}}
    views = [{"patch_px": patch_px, "turn_deg": rng.uniform(-180, 180), "tilt_deg": tilt_deg,
              "tilt_axis_deg": rng.uniform(0, 360), "shift_px": [rng.random(), rng.random()]}]
    lens, [(image, rows, pose)] = render(tmp_path, {}, camera, views)
    row = next(row for row in rows if row["feature"] == feature)
    # Just the circle and its edge: the triangles' edges are looked at below.
    size = int(2 * row["major"] + 4)
    low = (round(row["x"] - size / 2), round(row["y"] - size / 2))
    reference = brute_force(lens, pose, (0.5, 0.8, 0.4), low, size, sigma, samples)
    window = image[low[1]:low[1] + size, low[0]:low[0] + size]
    shift = shift_between(window, reference)
    print(f"shift {np.hypot(*shift):.6f} px, worst pixel {np.abs(window - reference).max():.3f} grey")
    assert np.hypot(*shift) < BOUND_PX


# Where many edges meet, pixel by pixel. The sharpest edge has 255 / (sqrt(2 pi) 0.85) = 120 grey levels
# a pixel: 0.4 grey levels are 0.003 px of one edge in one pixel. Brute force at 64 points a side places
# an oblique edge in a pixel to 1 / (64 sqrt(12 64)) px, 0.1 grey levels.
@pytest.mark.parametrize("u, v", [(0.5, 0.5), (0.25, 0.25), (0.5, 1.0), (1.0, 0.0), (0.75, 0.75)])
def test_corners_where_edges_meet_are_right_to_the_pixel(tmp_path, u, v):
    camera = {"width": 200, "height": 200, "fx": 600, "psf_sigma_px": 0.8, "distortion": [0.1],
              "background": {"level": 1}}
    views = [{"patch_px": 90, "turn_deg": 17, "tilt_deg": 30, "tilt_axis_deg": 70,
              "shift_px": [0.3, 0.7]}]
    lens, [(image, _, pose)] = render(tmp_path, {}, camera, views)
    point = pose[0] @ np.array([100 * u, 100 * v, 0]) + pose[1]
    pixel = cv2.projectPoints(point[None], np.zeros(3), np.zeros(3), np.array(
        [[lens["fx"], 0, lens["cx"]], [0, lens["fy"], lens["cy"]], [0, 0, 1]]),
        np.array(lens["distortion"]))[0].ravel()
    size = 14
    low = tuple(int(round(c - size / 2)) for c in pixel)
    reference = brute_force(lens, pose, (0.5, 0.8, 0.4), low, size, 0.8, 64)
    window = image[low[1]:low[1] + size, low[0]:low[0] + size]
    assert np.ptp(reference) > 200  # it does look at edges
    print(f"worst pixel {np.abs(window - reference).max():.3f} grey levels")
    assert np.abs(window - reference).max() < 0.4
