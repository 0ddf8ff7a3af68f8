#!/usr/bin/env python3
"""Solves a scene of two cameras with OpenCV, as its manual does: each camera alone, then the pair with the
lenses held.

    peer_opencv.py SCENE.npz OUT.json     (as peer_mrcal.py)
"""
import sys
import time

import cv2
import numpy as np
from peer_scene import load, two_paths, write_result


def solve(scene):
    indices, seen = scene["indices"], scene["observations"]
    rows, columns = seen.shape[1:3]
    y, x = np.mgrid[:rows, :columns] * float(scene["spacing"])
    board = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3).astype(np.float32)
    views = {(frame, camera): seen[i].reshape(-1, 3) for i, (frame, camera) in enumerate(indices.tolist())}
    lenses = []
    for c, size in enumerate(scene["sizes"].tolist()):
        own = [view for (_, camera), view in sorted(views.items()) if camera == c]
        good = [view[:, 2] > 0 for view in own]
        _, matrix, distortion, _, _ = cv2.calibrateCamera(
            [board[g] for g in good], [v[g, :2].astype(np.float32) for v, g in zip(own, good)], tuple(size),
            None, None)
        lenses.append((matrix, distortion))
    boards, left, right = [], [], []
    for frame in sorted({frame for frame, _ in views}):
        if (frame, 0) in views and (frame, 1) in views:
            a, b = views[frame, 0], views[frame, 1]
            both = (a[:, 2] > 0) & (b[:, 2] > 0)
            boards.append(board[both])
            left.append(a[both, :2].astype(np.float32))
            right.append(b[both, :2].astype(np.float32))
    found = cv2.stereoCalibrate(boards, left, right, *lenses[0], *lenses[1], tuple(scene["sizes"][0].tolist()),
                                flags=cv2.CALIB_FIX_INTRINSIC)
    return lenses, found[5], found[6].ravel(), found[0]


def main():
    scene_path, out_path = two_paths(__doc__)
    scene = load(scene_path)
    cv2.setNumThreads(1)
    start = time.process_time()
    lenses, turn, shift, rmse = solve(scene)
    seconds = time.process_time() - start
    flat = [[m[0, 0], m[1, 1], m[0, 2], m[1, 2], *d.ravel()[:5]] for m, d in lenses]
    write_result(out_path, scene, flat, [np.eye(3), turn], [np.zeros(3), shift], seconds, rmse_px=rmse)
    return 0


if __name__ == "__main__":
    sys.exit(main())
