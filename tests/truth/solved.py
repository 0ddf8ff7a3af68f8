"""A simulated rig that `tessera-rig solve` has calibrated, made once a test run and lent to all who ask.

    rig = solved()          three Brown cameras; rig.path is rig.json, rig.cameras, rig.poses the truth
    run("report", path)     tessera-rig as a user runs it
"""
import atexit
import functools
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import types

import numpy as np

import simulate

ROOT = pathlib.Path(__file__).resolve().parents[2]
RIG = str(pathlib.Path(os.environ.get("TESSERA_BIN", ROOT / "build" / "bin")) / "tessera-rig")
NOISE_PX = 0.02


def run(*arguments, stdin=None, expect=None):
    result = subprocess.run([RIG, *map(str, arguments)], input=stdin, capture_output=True, text=True,
                            timeout=300)
    assert expect is None or result.returncode == expect, result.stderr
    return result


def simulated(cameras, seed, frames=14):
    """(board, poses, rows) as these cameras see a board that wanders through the view."""
    board = simulate.grid_board(7, 12, 100.0, (12.0, 20.0))
    poses = simulate.make_path(frames, np.random.default_rng(seed), board)
    return board, poses, simulate.make_scene(cameras, board, poses, NOISE_PX, 0.0, seed)


def solve_into(folder, cameras, seed, *options, frames=14):
    """The folder's rig.json, solved from observations of these cameras; sigmas are given."""
    board, poses, rows = simulated(cameras, seed, frames)
    simulate.write_folder(folder / "in", cameras, board, rows, sigma=NOISE_PX)
    run("solve", folder / "in", "--out", folder / "out", "--model", cameras[0]["model"], *options, expect=0)
    path = folder / "out" / "rig.json"
    return types.SimpleNamespace(path=path, json=json.loads(path.read_text()), cameras=cameras,
                                 board=board, poses=poses, rows=rows)


@functools.lru_cache(maxsize=None)
def solved(seed=11, count=3):
    folder = pathlib.Path(tempfile.mkdtemp(prefix="tessera-solved-"))
    atexit.register(shutil.rmtree, folder, True)
    return solve_into(folder, simulate.make_cameras(count, np.random.default_rng(3)), seed)
