"""Writes a scene as an observation folder and truth.json: exactly what the solver may see, and the rest.

    truth_folder.py --out FOLDER --rig paper --seed 1 --noise 0.05 [--model brown] [--surface bow]
                    [--outliers 0.02] [--field 0.7] [--frames 50] [--radius 0] [--sigma]

truth.json: cameras and frames as in rig.json, lenses with their "field" (truth_lens.py), and the true
height of every board point in mm. Outliers are named by their line in observations.csv (2 is the first).
"""
import argparse
import json
from pathlib import Path

import numpy as np

import truth_scenes

LINES_AT_ONCE = 200_000


def _pose_json(turn, shift):
    return {"rotation": [float(v) for v in np.ravel(turn)], "translation_mm": [float(v) for v in shift]}


def _write_observations(path, scene, sigma):
    names = [camera["name"] for camera in scene.cameras]
    with open(path, "w") as file:
        file.write("camera,frame,board,point,x,y" + (",sigma" if sigma else "") + "\n")
        end = f",{scene.noise:.9g}\n" if sigma else "\n"
        for first in range(0, len(scene.camera), LINES_AT_ONCE):
            part = slice(first, first + LINES_AT_ONCE)
            file.writelines(
                f"{names[c]},{f},a,{p},{x:.6f},{y:.6f}{end}" for c, f, p, (x, y) in zip(
                    scene.camera[part].tolist(), scene.frame[part].tolist(), scene.point[part].tolist(),
                    scene.pixels[part].tolist()))


def write_folder(folder, scene, sigma=True):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.json").write_text(json.dumps({
        "format": "tessera-scene", "version": 1,
        "cameras": [{k: c[k] for k in ("name", "width", "height", "row_time_ns") if k in c}
                    for c in scene.cameras],
        "boards": [{"name": "a", "points": "points.csv"}]}))
    with open(folder / "points.csv", "w") as file:
        file.write("point,x,y,z,radius\n")
        for i, row in enumerate(scene.board.tolist()):
            file.write(f"{i}," + ",".join(f"{v:.12g}" for v in row) + "\n")
    _write_observations(folder / "observations.csv", scene, sigma)


def write_truth(path, scene):
    cameras = [{**c, "cam_from_rig": _pose_json(*c["cam_from_rig"])} for c in scene.cameras]
    Path(path).write_text(json.dumps({
        "format": "tessera-truth", "version": 1, "noise_px": scene.noise, "cameras": cameras,
        "boards": [{"name": "a", **scene.surface,
                    "surface_mm": [float(z) for z in truth_scenes.surface_at(scene.surface, scene.board)[0]]}],
        "frames": [{"frame": i, "board": "a", "rig_from_board": _pose_json(r, t)}
                   for i, (r, t) in enumerate(zip(*scene.poses))],
        "outlier_lines": (np.flatnonzero(scene.outlier) + 2).tolist()}, indent=1))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", required=True)
    parser.add_argument("--rig", choices=truth_scenes.RIGS, default="paper")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--noise", type=float, default=0.05, help="px per axis")
    parser.add_argument("--model", choices=truth_scenes.LENSES, default="brown")
    parser.add_argument("--surface", choices=truth_scenes.SURFACES, default="flat", help="by 1 mm")
    parser.add_argument("--outliers", type=float, default=0.0, help="share, 0 to 1")
    parser.add_argument("--field", type=float, default=0.0, help="px that no lens model fits")
    parser.add_argument("--frames", type=int)
    parser.add_argument("--radius", type=float, help="of the circles in mm; 0: corners")
    parser.add_argument("--sigma", action="store_true", help="tell the solver the noise")
    given = vars(parser.parse_args())
    out, sigma = Path(given.pop("out")), given.pop("sigma")
    scene = truth_scenes.make(**given)
    write_folder(out, scene, sigma)
    write_truth(out / "truth.json", scene)
    print(f"{out}: {len(scene.camera)} observations of {len(scene.cameras)} cameras")


if __name__ == "__main__":
    main()
