"""Observations of a known rig, made by mathematics that shares no line with the solver: every circle's
edge is sampled densely, projected point by point, and an ellipse is fitted to the image of the edge. These are
the small scenes that tests change as they like; `truth_scenes.py` has the rigs that figures are of.

    simulate.py --out FOLDER [--cameras 3] [--frames 25] [--noise 0.02] [--outliers 0.02] ...

writes an observation folder and truth.json beside it (keys as in rig.json). `make_scene` is the same
for tests. Distances in mm, pixels with (0, 0) the centre of the top-left pixel.
"""
import argparse
import json
import pathlib

import numpy as np

from truth_circles import image_of_circles
from truth_lens import project  # noqa: F401  part of what tests use from here
from truth_scenes import LENSES, rotations


def rotation(vector):
    """Rodrigues' formula."""
    return rotations(vector)[0]


def centres(camera, cam_from_board, board):
    """Imaged ellipse centres of a board's points (rows: x, y, z, radius), nan where not wholly visible."""
    turn, shift = cam_from_board
    along = np.broadcast_to(turn[:, :2], (len(board), 3, 2))
    return image_of_circles(camera, board[:, :3] @ turn.T + shift, board[:, 3], along, samples=180)


def grid_board(rows=14, cols=24, pitch=50.0, radii=(5.0, 10.0)):
    """A flat board of circles: rows of x, y, z, radius; about the size of a 7x12 target of 100 mm."""
    y, x = np.mgrid[:rows, :cols]
    radius = np.where((x + y) % 7 == 0, radii[1], radii[0])
    return np.stack([pitch * (x + 0.5), pitch * (y + 0.5), 0.0 * x, radius], axis=-1).reshape(-1, 4)


def make_cameras(count, rng, model="brown", width=1920, height=1080):
    """Cameras on an arc of 300 mm steps, turned in towards a point 2 m in front of the first."""
    cameras = []
    for i in range(count):
        focal = {"fisheye": 700.0}.get(model, 1400.0) * (1 + 0.08 * i)
        turn = rotation([0.02 * i, 0.14 * i, 0.01 * i])
        centre = np.array([300.0 * i, 15.0 * i, 25.0 * i])
        scale = 1 - 0.1 * i
        cameras.append({"name": f"cam{i}", "width": width, "height": height, "model": model,
                        "fx": focal, "fy": focal * 1.002, "cx": (width - 1) / 2 + rng.normal(0, 8),
                        "cy": (height - 1) / 2 + rng.normal(0, 8),
                        "distortion": list(np.array(LENSES[model]) * scale),
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
