"""A scene as other people's solvers take it, and their results as ours writes its own.

SCENE.npz: indices (views, 2) frame and camera, in order; observations (views, rows, columns, 3) x, y and
weight, which is 1, or -1 where the point was not seen; sizes (cameras, 2); spacing (mm) of the grid; names.
For solvers that must be started: start_lenses (fx fy cx cy), start_cameras and start_frames (rotation vector,
mm), which are the truth less its distortion and moved by 1 %, half a degree and 10 mm.
"""
import argparse
import json
from pathlib import Path

import numpy as np
import solver_run  # noqa: F401  the simulator's folder on the path

import truth_scenes


def two_paths(doc, ways=()):
    """The command line of a peer: scene, result and, where there are several, the way to solve."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", metavar="SCENE.npz")
    parser.add_argument("out", metavar="OUT.json")
    if ways:
        parser.add_argument("way", choices=ways)
    return tuple(vars(parser.parse_args()).values())


def _moved(turns, shifts, rng):
    """Rows of rotation vector and shift, a little off."""
    import cv2  # not where another Python only reads
    moved = truth_scenes.rotations(rng.normal(0, 0.009, (len(turns), 3))) @ turns
    return np.column_stack([np.array([cv2.Rodrigues(turn)[0].ravel() for turn in moved]).reshape(-1, 3),
                            shifts + rng.normal(0, 10, (len(turns), 3))])


def _start(scene):
    rng = np.random.default_rng(1)
    lenses = [[1.01 * c["fx"], 1.01 * c["fx"], (c["width"] - 1) / 2, (c["height"] - 1) / 2]
              for c in scene.cameras]
    cameras = [c["cam_from_rig"] for c in scene.cameras[1:]]
    # Their board begins at its first point, ours half a pitch before it.
    first = scene.board[0, :3]
    return {"start_lenses": np.array(lenses),
            "start_cameras": _moved(np.array([r for r, _ in cameras]).reshape(-1, 3, 3),
                                    np.array([t for _, t in cameras]).reshape(-1, 3), rng),
            "start_frames": _moved(scene.poses[0], scene.poses[1] + scene.poses[0] @ first, rng)}


def save(path, scene):
    """`scene`: truth_scenes.Scene whose board is a grid."""
    columns = int((scene.board[:, 1] == scene.board[0, 1]).sum())
    rows = len(scene.board) // columns
    view = scene.frame * len(scene.cameras) + scene.camera
    views, which = np.unique(view, return_inverse=True)
    seen = np.zeros((len(views), rows * columns, 3))
    seen[..., 2] = -1
    seen[which, scene.point, :2] = scene.pixels
    seen[which, scene.point, 2] = 1
    np.savez(path, indices=np.stack([views // len(scene.cameras), views % len(scene.cameras)],
                                    axis=-1).astype(np.int32),
             observations=seen.reshape(len(views), rows, columns, 3),
             sizes=np.array([[c["width"], c["height"]] for c in scene.cameras], np.int32),
             spacing=scene.board[1, 0] - scene.board[0, 0], names=[c["name"] for c in scene.cameras],
             **_start(scene))


def load(path):
    with np.load(path) as file:
        return {key: file[key] for key in file.files}


def write_result(path, scene, lenses, turns, shifts, seconds, rmse_px):
    """Lenses fx fy cx cy k1 k2 p1 p2 k3; cam_from_rig as R and t."""
    cameras = [{"name": str(name), "width": int(w), "height": int(h), "model": "brown",
                **dict(zip(("fx", "fy", "cx", "cy"), map(float, lens[:4]))),
                "distortion": [float(v) for v in lens[4:9]],
                "cam_from_rig": {"rotation": [float(v) for v in np.ravel(turn)],
                                 "translation_mm": [float(v) for v in shift]}}
               for name, (w, h), lens, turn, shift in zip(scene["names"], scene["sizes"], lenses, turns, shifts)]
    Path(path).write_text(json.dumps({"format": "tessera-rig", "version": 1, "rmse_px": rmse_px,
                                      "solve_s": seconds, "cameras": cameras}, indent=1))
