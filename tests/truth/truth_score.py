"""How far an estimated rig is from the truth.

    rig = RigFile("DIR/rig.json", "build/bin/tessera-rig")     or a truth_reference.Solution
    projection_error(scene, rig, c)      RMS px over a grid in the image after the best single rotation
    pose_error(scene, rig, c)            mm of the camera's place in the first camera's frame, and degrees
    triangulation_error(scene, rig)      RMS mm of points in the boards' volume, after the best motion

Each takes anything with `rays(c, pixels)` (n, 3) and `cam_from_rig(c)` (R, t). nan where a ray is missing.
"""
import json
import subprocess
from pathlib import Path

import numpy as np

import truth_lens
import truth_scenes

COLUMNS, ROWS = 40, 30


class RigFile:
    """A result, its lenses used through `tessera-rig unproject` as any user's program would."""

    def __init__(self, path, program):
        self.path, self.program = Path(path), str(program)
        self.content = json.loads(self.path.read_text())
        self.cameras = self.content["cameras"]

    def rays(self, camera, pixels):
        text = "x,y\n" + "".join(f"{x!r},{y!r}\n" for x, y in pixels.tolist())
        done = subprocess.run([self.program, "unproject", str(self.path), "--camera",
                               self.cameras[camera]["name"]], input=text, capture_output=True, text=True,
                              check=False)
        if done.returncode:
            raise RuntimeError(done.stderr.strip())
        return np.genfromtxt(done.stdout.splitlines()[1:], delimiter=",").reshape(-1, 3)

    def cam_from_rig(self, camera):
        pose = self.cameras[camera]["cam_from_rig"]
        return np.array(pose["rotation"]).reshape(3, 3), np.array(pose["translation_mm"])


def image_grid(camera):
    """Pixels (COLUMNS * ROWS, 2) in the middles of equal cells, row by row."""
    x = (np.arange(COLUMNS) + 0.5) * camera["width"] / COLUMNS - 0.5
    y = (np.arange(ROWS) + 0.5) * camera["height"] / ROWS - 0.5
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def cells_with_data(scene, c):
    """Which cells of the grid hold observations that are not outliers."""
    camera = scene.cameras[c]
    used = scene.exact[(scene.camera == c) & ~scene.outlier]
    cell = ((used + 0.5) / [camera["width"], camera["height"]] * [COLUMNS, ROWS]).astype(int)
    count = np.bincount(cell[:, 1] * COLUMNS + cell[:, 0], minlength=COLUMNS * ROWS)
    return count > 0


def cells_with_rays(scene, estimate, c):
    """Which cells of the grid have a ray in an estimate: a fold may leave corners without."""
    return np.isfinite(estimate.rays(c, image_grid(scene.cameras[c]))).all(axis=1)


def aligned_miss(camera, rays, pixels):
    """(n, 2) px between pixels and where the true lens puts their estimated rays, after the one rotation
    that makes it least in the mean square."""
    turn = np.eye(3)
    for _ in range(8):
        turned = rays @ turn.T
        miss = truth_lens.project(camera, turned) - pixels
        by_point = truth_lens.jacobians(camera, turned)[0]
        design = np.cross(by_point, turned[:, None, :]) * -1.0
        step = np.linalg.lstsq(design.reshape(-1, 3), -miss.ravel(), rcond=None)[0]
        turn = truth_scenes.rotations(step)[0] @ turn
        if np.linalg.norm(step) < 1e-13:
            break
    return truth_lens.project(camera, rays @ turn.T) - pixels


def projection_error(scene, rig, c, cells=None):
    """Over all cells of the grid, or over those of a mask."""
    camera = scene.cameras[c]
    pixels = image_grid(camera)
    if cells is not None:
        pixels = pixels[cells]
    rays = rig.rays(c, pixels)
    if not np.isfinite(rays).all():
        return np.nan
    return float(np.sqrt((aligned_miss(camera, rays, pixels)**2).sum(axis=1).mean()))


def projection_error_of_all(scene, rig, cells=None):
    """RMS over the cameras; `cells`: a mask of each."""
    return rms([projection_error(scene, rig, c, cells and cells[c]) for c in range(len(scene.cameras))])


def pose_error(scene, rig, c):
    turn, shift = scene.cameras[c]["cam_from_rig"]
    found_turn, found_shift = rig.cam_from_rig(c)
    place = np.linalg.norm(turn.T @ shift - found_turn.T @ found_shift)
    between = found_turn @ turn.T
    sine = np.linalg.norm([between[2, 1] - between[1, 2], between[0, 2] - between[2, 0],
                           between[1, 0] - between[0, 1]]) / 2
    return float(place), float(np.degrees(np.arctan2(sine, (np.trace(between) - 1) / 2)))


def pose_error_of_all(scene, rig):
    """RMS over the cameras but the first: mm, degrees."""
    errors = [pose_error(scene, rig, c) for c in range(1, len(scene.cameras))]
    return tuple(rms(part) for part in zip(*errors)) if errors else (0.0, 0.0)


def rms(values):
    values = np.asarray(values, float)
    return float(np.sqrt((values**2).mean()))


def _intersect(origins, rays, weights):
    """Points (n, 3) nearest to weighted rays (views, n, 3) from origins (views, 3)."""
    across = (np.eye(3) - rays[..., :, None] * rays[..., None, :]) * weights[..., None, None]
    return np.linalg.solve(across.sum(axis=0), (across @ origins[:, None, :, None]).sum(axis=0))[..., 0]


def best_motion(source, target):
    """R, t with the least sum of |R source + t - target|^2."""
    a, b = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((target - b).T @ (source - a))
    turn = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    return turn, b - turn @ a


def triangulation_error(scene, rig, count=500, seed=1):
    """Points spread over where boards were, seen without noise by all cameras that have them in view,
    intersected with the estimated lenses and poses."""
    rng = np.random.default_rng(seed)
    frame = rng.integers(len(scene.poses[0]), size=count)
    board = scene.board[rng.integers(len(scene.board), size=count), :3]
    points = (scene.poses[0][frame] @ board[..., None])[..., 0] + scene.poses[1][frame]
    cameras = len(scene.cameras)
    origins, rays, weights = np.zeros((cameras, 3)), np.zeros((cameras, count, 3)), np.zeros((cameras, count))
    for c, camera in enumerate(scene.cameras):
        turn, shift = camera["cam_from_rig"]
        there = points @ turn.T + shift
        pixels = truth_lens.project(camera, there)
        seen = ((pixels > 0) & (pixels < [camera["width"] - 1, camera["height"] - 1])).all(axis=1)
        seen &= np.hypot(there[:, 0], there[:, 1]) < truth_scenes.reach(camera) * there[:, 2]
        found_turn, found_shift = rig.cam_from_rig(c)
        origins[c] = -found_turn.T @ found_shift
        rays[c, seen] = rig.rays(c, pixels[seen]) @ found_turn
        weights[c, seen] = 1 / (there[seen]**2).sum(axis=1)
    enough = (weights > 0).sum(axis=0) >= 2
    found = _intersect(origins, rays[:, enough], weights[:, enough])
    if not np.isfinite(found).all():
        return np.nan
    turn, shift = best_motion(found, points[enough])
    return rms(np.linalg.norm(found @ turn.T + shift - points[enough], axis=1))
