"""Observations of a known rig, made by mathematics that shares no line with the solver: every circle's
edge is sampled densely, projected point by point, and an ellipse is fitted to the image of the edge.

    simulate.py --out FOLDER [--cameras 3] [--frames 25] [--noise 0.02] [--outliers 0.02] ...

writes an observation folder and truth.json beside it (keys as in rig.json). `make_scene` is the same
for tests. Distances in mm, pixels with (0, 0) the centre of the top-left pixel.
"""
import argparse
import json
import pathlib

import numpy as np

EDGE_SAMPLES = 180


def rotation(vector):
    """Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    if angle == 0:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def project(camera, points):
    """Pixels of points (..., 3) in the camera frame; nan behind the camera."""
    d = np.zeros(12)
    given = np.asarray(camera["distortion"], float)
    d[:len(given)] = given
    if camera["model"] == "fisheye":
        r = np.hypot(points[..., 0], points[..., 1])
        theta = np.arctan2(r, points[..., 2])
        q = theta**2
        bent = theta * (1 + q * (d[0] + q * (d[1] + q * (d[2] + q * d[3]))))
        scale = bent / np.maximum(r, 1e-12)
        x, y = points[..., 0] * scale, points[..., 1] * scale
    else:
        depth = np.where(points[..., 2] > 1e-6, points[..., 2], np.nan)
        u, v = points[..., 0] / depth, points[..., 1] / depth
        q = u * u + v * v
        k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = d
        g = (1 + k1 * q + k2 * q**2 + k3 * q**3) / (1 + k4 * q + k5 * q**2 + k6 * q**3)
        x = u * g + 2 * p1 * u * v + p2 * (q + 2 * u * u) + s1 * q + s2 * q**2
        y = v * g + p1 * (q + 2 * v * v) + 2 * p2 * u * v + s3 * q + s4 * q**2
    return np.stack([camera["fx"] * x + camera["cx"], camera["fy"] * y + camera["cy"]], axis=-1)


def ellipse_centres(edges):
    """Centres of the least-squares conics through edges (n, EDGE_SAMPLES, 2)."""
    mean = edges.mean(axis=1, keepdims=True)
    size = np.sqrt(((edges - mean)**2).mean(axis=(1, 2), keepdims=True))
    x, y = np.moveaxis((edges - mean) / size, -1, 0)
    # Samples stand for unequal lengths of edge in the image; a detector sees edge pixels.
    step = np.roll(edges, -1, axis=1) - np.roll(edges, 1, axis=1)
    weight = np.sqrt(np.linalg.norm(step, axis=-1))
    design = np.stack([x * x, x * y, y * y, x, y], axis=-1) * weight[..., None]
    normal = np.einsum("nki,nkj->nij", design, design)
    right = np.einsum("nki,nk->ni", design, weight)
    a, b, c, d, e = np.linalg.solve(normal, right[..., None])[..., 0].T
    det = 4 * a * c - b * b
    centre = np.stack([(b * e - 2 * c * d) / det, (b * d - 2 * a * e) / det], axis=-1)
    return mean[:, 0] + size[:, 0] * centre


def centres(camera, cam_from_board, board):
    """Imaged ellipse centres of a board's points (rows: x, y, z, radius), nan where not wholly visible."""
    turn, shift = cam_from_board
    points, radius = board[:, :3], board[:, 3]
    pixels = project(camera, points @ turn.T + shift)
    round_ones = radius > 0
    if round_ones.any():
        phi = np.arange(EDGE_SAMPLES) * 2 * np.pi / EDGE_SAMPLES
        circle = np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=-1)
        edge = points[round_ones, None, :] + radius[round_ones, None, None] * circle
        image = project(camera, edge @ turn.T + shift)
        good = np.isfinite(image).all(axis=(1, 2))
        fitted = np.full((len(image), 2), np.nan)
        fitted[good] = ellipse_centres(image[good])
        inside = ((image > 0) & (image < [camera["width"] - 1, camera["height"] - 1])).all(axis=(1, 2))
        pixels[round_ones] = np.where(inside[:, None], fitted, np.nan)
    inside = ((pixels > 0) & (pixels < [camera["width"] - 1, camera["height"] - 1])).all(axis=1)
    return np.where(inside[:, None], pixels, np.nan)


def grid_board(rows=14, cols=24, pitch=50.0, radii=(5.0, 10.0)):
    """A flat board of circles: rows of x, y, z, radius; about the size of a 7x12 target of 100 mm."""
    y, x = np.mgrid[:rows, :cols]
    radius = np.where((x + y) % 7 == 0, radii[1], radii[0])
    return np.stack([pitch * (x + 0.5), pitch * (y + 0.5), 0.0 * x, radius], axis=-1).reshape(-1, 4)


def make_cameras(count, rng, model="brown", width=1920, height=1080):
    """Cameras on an arc of 300 mm steps, turned in towards a point 2 m in front of the first."""
    sets = {"brown": [-0.28, 0.09, 0.0004, -0.0003, -0.012],
            "rational": [0.35, 0.12, 0.0003, -0.0002, 0.01, 0.65, 0.22, 0.03],
            "thin-prism": [-0.25, 0.08, 0.0002, -0.0003, -0.01, 0, 0, 0, 0.0006, -0.0002, -0.0005, 0.0002],
            "fisheye": [-0.03, 0.008, -0.004, 0.0007]}
    cameras = []
    for i in range(count):
        focal = {"fisheye": 700.0}.get(model, 1400.0) * (1 + 0.08 * i)
        turn = rotation([0.02 * i, 0.14 * i, 0.01 * i])
        centre = np.array([300.0 * i, 15.0 * i, 25.0 * i])
        scale = np.ones(len(sets[model])) * (1 - 0.1 * i)
        cameras.append({"name": f"cam{i}", "width": width, "height": height, "model": model,
                        "fx": focal, "fy": focal * 1.002, "cx": (width - 1) / 2 + rng.normal(0, 8),
                        "cy": (height - 1) / 2 + rng.normal(0, 8),
                        "distortion": list(np.array(sets[model]) * scale),
                        "cam_from_rig": (turn, -turn @ centre)})
    return cameras


def make_path(frames, rng, board, tilt=0.6, distance=(900.0, 2200.0)):
    """Board poses in the rig frame: the board's middle wanders through the view, tilted at random."""
    middle = board[:, :3].mean(axis=0)
    poses = []
    for _ in range(frames):
        z = rng.uniform(*distance)
        at = np.array([rng.uniform(-0.45, 0.45) * z + 150, rng.uniform(-0.25, 0.25) * z, z])
        turn = rotation(np.array([rng.uniform(-tilt, tilt), rng.uniform(-tilt, tilt), 0])) @ rotation(
            [0, 0, rng.uniform(-0.5, 0.5)])
        poses.append((turn, at - turn @ middle))
    return poses


def make_scene(cameras, board, poses, noise=0.02, outliers=0.0, seed=1):
    """Rows (camera index, frame, point, x, y, is_outlier)."""
    rng = np.random.default_rng(seed)
    rows = []
    for c, camera in enumerate(cameras):
        turn_cr, shift_cr = camera["cam_from_rig"]
        for frame, (turn_rb, shift_rb) in enumerate(poses):
            pose = (turn_cr @ turn_rb, turn_cr @ shift_rb + shift_cr)
            pixels = centres(camera, pose, board)
            for point in np.flatnonzero(np.isfinite(pixels[:, 0])):
                wrong = rng.random() < outliers
                shift = rng.normal(0, noise, 2)
                if wrong:
                    shift = rng.uniform(5, 80) * np.array([np.cos(a := rng.uniform(0, 6.28)), np.sin(a)])
                rows.append((c, frame, int(point), *(pixels[point] + shift), wrong))
    return rows


def write_folder(folder, cameras, board, rows, sigma=None):
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.json").write_text(json.dumps({
        "format": "tessera-scene", "version": 1,
        "cameras": [{k: c[k] for k in ("name", "width", "height")} for c in cameras],
        "boards": [{"name": "a", "points": "points.csv"}]}))
    with open(folder / "points.csv", "w") as file:
        file.write("point,x,y,z,radius\n")
        for i, (x, y, z, r) in enumerate(board):
            file.write(f"{i},{x:.9g},{y:.9g},{z:.9g},{r:.9g}\n")
    with open(folder / "observations.csv", "w") as file:
        file.write("camera,frame,board,point,x,y" + (",sigma" if sigma else "") + "\n")
        for c, frame, point, x, y, _ in rows:
            file.write(f"{cameras[c]['name']},{frame},a,{point},{x:.6f},{y:.6f}"
                       + (f",{sigma}" if sigma else "") + "\n")


def pose_json(pose):
    return {"rotation": list(np.ravel(pose[0])), "translation_mm": list(pose[1])}


def write_truth(path, cameras, poses):
    pathlib.Path(path).write_text(json.dumps({
        "format": "tessera-truth", "version": 1,
        "cameras": [{**c, "cam_from_rig": pose_json(c["cam_from_rig"])} for c in cameras],
        "boards": [{"name": "a", "surface": None}],
        "frames": [{"frame": i, "board": "a", "rig_from_board": pose_json(p)}
                   for i, p in enumerate(poses)]}, indent=1))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("--out", required=True)
    parser.add_argument("--cameras", type=int, default=3)
    parser.add_argument("--frames", type=int, default=25)
    parser.add_argument("--model", default="brown")
    parser.add_argument("--noise", type=float, default=0.02)
    parser.add_argument("--outliers", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    cameras = make_cameras(given.cameras, rng, given.model)
    board = grid_board()
    poses = make_path(given.frames, rng, board)
    rows = make_scene(cameras, board, poses, given.noise, given.outliers, given.seed)
    write_folder(given.out, cameras, board, rows)
    write_truth(pathlib.Path(given.out) / "truth.json", cameras, poses)


if __name__ == "__main__":
    main()
