#!/usr/bin/env python3
"""Solves a scene with mrcal's joint optimisation and its outlier rejection.

    peer_mrcal.py SCENE.npz OUT.json seed|near     (written by peer_scene.py; OUT.json has rig.json's cameras)

Lens OPENCV5, which is `brown`; the board flat and known, so that the unknowns are ours. `seed` goes the way of
its manual: a stereographic seed, poses, focal lengths, then everything. That seed may leave a board in the
pose's second solution, where whole views end as outliers; `near` starts at the truth but for a little
(peer_scene.py) with everything at once. Times the solve alone, without Python's start and reading.
"""
import sys
import time

import mrcal
import numpy as np
from peer_scene import load, two_paths, write_result

LENS = "LENSMODEL_OPENCV5"


def problem(lens, cameras, frames, seen, poses, model):
    """By the names of the version that is there: 2.5 has others than 2.2, and does not take those for its own."""
    names = (("rt_cam_ref", "rt_ref_frame") if "rt_cam_ref" in mrcal.optimize.__doc__ else
             ("extrinsics_rt_fromref", "frames_rt_toref"))
    return {"intrinsics": lens, names[0]: cameras, names[1]: frames, "points": None,
            "observations_board": seen, "indices_frame_camintrinsics_camextrinsics": poses,
            "observations_point": None, "indices_point_camintrinsics_camextrinsics": None, "lensmodel": model}


def seeded(scene, poses, seen, fixed):
    """Lenses without distortion, cameras and frames from the observations alone."""
    lens, cameras, frames = mrcal.seed_stereographic(
        imagersizes=scene["sizes"], focal_estimate=float(scene["start_lenses"][0, 0]),
        indices_frame_camera=scene["indices"], observations=seen,
        object_spacing=fixed["calibration_object_spacing"])
    for core in (False, True):
        mrcal.optimize(**problem(lens, cameras, frames, seen, poses, "LENSMODEL_STEREOGRAPHIC"),
                       do_optimize_intrinsics_core=core, do_optimize_intrinsics_distortions=False,
                       do_apply_outlier_rejection=False, do_apply_regularization=False, **fixed)
    return lens, cameras, frames


def solve(scene, own_seed):
    indices, seen = scene["indices"], scene["observations"].copy()
    poses = np.column_stack([indices, indices[:, 1] - 1]).astype(np.int32)
    fixed = {"imagersizes": scene["sizes"], "calibration_object_spacing": float(scene["spacing"]),
             "do_optimize_calobject_warp": False, "verbose": False}
    if own_seed:
        lens, cameras, frames = seeded(scene, poses, seen, fixed)
    else:
        lens, cameras, frames = scene["start_lenses"], scene["start_cameras"], scene["start_frames"]
    lens = np.concatenate([lens, np.zeros((len(lens), 5))], axis=1)
    # Its weak pull of the coefficients to 0 leads there; it is taken away at last, for it biases.
    for pull in (True, False):
        result = mrcal.optimize(**problem(lens, cameras, frames, seen, poses, LENS),
                                do_apply_outlier_rejection=True, do_apply_regularization=pull, **fixed)
    return lens, cameras, result


def main():
    scene_path, out_path, way = two_paths(__doc__, ("seed", "near"))
    scene = load(scene_path)
    start = time.process_time()
    lens, cameras, result = solve(scene, own_seed=way == "seed")
    seconds = time.process_time() - start
    turns = [np.eye(3)] + [mrcal.R_from_r(rt[:3]) for rt in cameras]
    shifts = [np.zeros(3)] + [rt[3:] for rt in cameras]
    write_result(out_path, scene, lens, turns, shifts, seconds,
                 rmse_px=float(result["rms_reproj_error__pixels"]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
