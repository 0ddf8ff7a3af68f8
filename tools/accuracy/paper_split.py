"""Residuals of a solved set-up by what could make them large, against the limit of the same points: a share that is
worse than the rest shows where detector or model are not what they could be.

Residuals are computed here anew: the circles' edges projected by the result's own numbers, dense samples of
them fitted (tests/truth/truth_circles.py), so that they also check the solver's own figure.
"""
import numpy as np
from accuracy_score import key, limit_squared

import truth_circles


def columns(frames, rig):
    """Arrays over all points: camera, dx, dy, sigma, limit^2, and what they are split by."""
    index = {point: i for i, point in enumerate(frames.ids)}
    pose = {frame["frame"]: (np.array(frame["rig_from_board"]["rotation"]).reshape(3, 3),
                             np.array(frame["rig_from_board"]["translation_mm"])) for frame in rig.content["frames"]}
    truth = [dict(zip(map(key, rows), zip(rows, limit_squared(rows, frames.camera, frames.target))))
             for rows in frames.true_rows()]
    rows = []
    views = {}
    for c, instant, row in frames.detections():
        views.setdefault((c, instant), []).append(row)
    for (c, instant), found in sorted(views.items()):
        if instant not in pose:
            continue
        turn_cr, shift_cr = rig.cam_from_rig(c)
        turn, shift = turn_cr @ pose[instant][0], turn_cr @ pose[instant][1] + shift_cr
        at = [index[int(row["patch"]) * 128 + int(row["feature"])] for row in found]
        points = frames.board[at, :3] @ turn.T + shift
        modelled = truth_circles.image_of_circles(rig.cameras[c], points, frames.board[at, 3],
                                                  np.broadcast_to(turn[:, :2], (len(at), 3, 2)), samples=64)
        tilt = np.degrees(np.arccos(np.abs(points @ turn[:, 2]) / np.linalg.norm(points, axis=1)))
        camera = frames.truth.cameras[c]
        for row, model, angle in zip(found, modelled, tilt):
            known = truth[c].get(key(row))
            if known is None or not np.isfinite(model).all():
                continue
            radius = np.hypot(row["x"] - camera["cx"], row["y"] - camera["cy"]) / (np.hypot(*frames.setup.size) / 2)
            rows.append([c, model[0] - row["x"], model[1] - row["y"], row["x"] - known[0]["x"],
                         row["y"] - known[0]["y"], row["sigma"], known[1], np.sqrt(row["major"] * row["minor"]),
                         row["minor"] / row["major"], angle, radius, row["feature"], row["polarity"],
                         known[0]["visible"]])
    return np.array(rows)


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def _line(name, part):
    residual, error = np.hypot(part[:, 1], part[:, 2]), np.hypot(part[:, 3], part[:, 4])
    return (f"{name:28} {len(part):7} {_rms(residual):9.5f} {_rms(error):9.5f} {np.sqrt(part[:, 6].mean()):9.5f} "
            f"{_rms(error) / np.sqrt(part[:, 6].mean()):7.3f} {_rms(residual / part[:, 5]) / np.sqrt(2):8.3f} "
            f"{np.max(error):9.4f} {part[:, 1].mean():9.5f} {part[:, 2].mean():9.5f}")


def tables(frames, rig):
    data = columns(frames, rig)
    lines = [f"{'':28} {'points':>7} {'residual':>9} {'error':>9} {'limit':>9} {'ratio':>7} {'whitened':>8} "
             f"{'worst':>9} {'mean dx':>9} {'mean dy':>9}", _line("all", data)]
    splits = [("radius px", 7, [3, 5, 7, 9, 12, 15, 20, 25, 35, 50, 80]),
              ("minor / major", 8, [0, 0.5, 0.7, 0.8, 0.9, 1]),
              ("tilt deg", 9, [0, 10, 20, 30, 40, 50, 65]), ("from the centre", 10, [0, 0.25, 0.5, 0.75, 1.0, 1.1]),
              ("feature", 11, list(range(14))), ("polarity", 12, [0, 1, 2]), ("wholly in view", 13, [0, 1, 2])]
    for name, column, edges in splits:
        for low, high in zip(edges, edges[1:]):
            part = data[(data[:, column] >= low) & (data[:, column] < high)]
            if len(part):
                lines.append(_line(f"{name} {low:g} to {high:g}", part))
    return lines
