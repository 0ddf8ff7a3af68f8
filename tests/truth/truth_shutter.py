"""Scenes of boards that move while cameras read their rows.

    scene = truth_scenes.make("small", seed=1)
    truth_shutter.roll(scene, [12e-6, 15e-6, 0.0], seed=1, shift_mm_s=300, turn_rad_s=1.0)

`roll` observes the scene anew. Row y of an image is seen at t = y * row time after the instant's stamp, and
`poses` are those half of the first camera's read-out later: rig_from_board is then
(exp(w s) R, t + v s), s seconds from there, w and v in the rig's axes, about the board's origin. Velocities
are drawn for each frame: directions anywhere, sizes of this mean square. All circles of a board are
turned with it; what a circle itself moves within its own rows does not move its centre, to first order.
"""
import numpy as np

import truth_circles
import truth_scenes

ROUNDS = 12  # of finding a point's row: each is a hundred times nearer


def middle_s(scene):
    """When the poses are given for, after the stamp."""
    return max(scene.row_time_s) * (scene.cameras[0]["height"] - 1) / 2


def moved(scene, frame, seconds):
    """Poses (n, 3, 3), (n, 3) of boards in frames (n,), so long after the stamp."""
    s = (seconds - middle_s(scene))[:, None]
    velocity = scene.velocity[frame]
    return (truth_scenes.rotations(s * velocity[:, :3]) @ scene.poses[0][frame],
            scene.poses[1][frame] + s * velocity[:, 3:])


def _view(scene, c, f, points, along):
    """Which points of a view are seen, and where, without noise."""
    camera = scene.cameras[c]
    turn_cr, shift_cr = camera["cam_from_rig"]
    widest = truth_scenes.reach(camera)
    rows = np.full(len(points), camera["height"] / 2)
    frame = np.full(len(points), f)
    for _ in range(ROUNDS):
        turn_rb, shift_rb = moved(scene, frame, scene.row_time_s[c] * rows)
        turn = turn_cr @ turn_rb
        there = (turn @ points[..., None])[..., 0] + shift_rb @ turn_cr.T + shift_cr
        near = np.hypot(there[:, 0], there[:, 1]) < widest * there[:, 2]
        pixels = np.full((len(points), 2), np.nan)
        if near.any():
            pixels[near] = truth_circles.image_of_circles(camera, there[near], scene.board[near, 3],
                                                          turn[near] @ along[near])
        rows = np.where(np.isfinite(pixels[:, 1]), pixels[:, 1], rows)
    facing = np.einsum("ni,ni->n", there, turn[:, :, 2])
    good = np.isfinite(pixels[:, 0]) & (facing > np.cos(np.radians(65)) * np.linalg.norm(there, axis=1))
    at = np.flatnonzero(good)
    return at, pixels[at]


def roll(scene, row_time_s, seed, shift_mm_s, turn_rad_s, outliers=0.0, estimate=()):
    """`estimate`: the cameras whose row time the solver is not told."""
    rng = np.random.default_rng([seed, 78])
    scene.row_time_s = list(row_time_s)
    frames = len(scene.poses[0])
    scene.velocity = rng.normal(0, 1 / np.sqrt(3), (frames, 6)) * np.repeat([turn_rad_s, shift_mm_s], 3)
    for c, camera in enumerate(scene.cameras):
        camera["row_time_ns"] = "estimate" if c in estimate else 1e9 * row_time_s[c]
    points, along = truth_scenes.true_points(scene)
    parts = []
    for c in range(len(scene.cameras)):
        for f in range(frames):
            at, pixels = _view(scene, c, f, points, along)
            if len(at) >= 8:
                parts.append((np.full(len(at), c), np.full(len(at), f), at, pixels))
    scene.camera, scene.frame, scene.point, scene.exact = (np.concatenate(p) for p in zip(*parts))
    return truth_scenes.add_noise(scene, rng, outliers)


def row_times(scene):
    """By observation, s after the time of the poses, by the row where it was observed."""
    return np.asarray(scene.row_time_s)[scene.camera] * scene.pixels[:, 1] - middle_s(scene)


def make(rig, seed, rolling=None, **scene):
    """truth_scenes.make, rolled where `rolling` gives row_time_s, shift_mm_s, turn_rad_s."""
    out = truth_scenes.make(rig, seed, **scene)
    if rolling:
        roll(out, seed=seed, outliers=scene.get("outliers", 0.0), **rolling)
    return out
