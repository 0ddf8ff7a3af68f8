"""Scenes of known rigs: cameras, a board with its true surface, its poses, and what the cameras observe.

    scene = make("paper", seed=1, noise=0.05, model="brown", surface="bow", outliers=0.02)

Rigs (RIGS): `paper`, two 12 MP cameras and 50 frames of 1,008 points; `ring`, 8 cameras of 2 MP around the
board, 100 frames; `room`, 16 around the walls, 300 frames, some 1.6 million points; `small`, three
cameras and few points, for everyday. Everything is drawn from the seed: lenses, rig, poses and noise.
Frames: camera, rig (that of the first camera) and board as in common/README.md; mm and px.
"""
import dataclasses

import numpy as np

import truth_circles
import truth_lens

LENSES = {"brown": [-0.28, 0.09, 0.0004, -0.0003, -0.012],
          "rational": [0.35, 0.12, 0.0003, -0.0002, 0.01, 0.65, 0.22, 0.03],
          "thin-prism": [-0.25, 0.08, 0.0002, -0.0003, -0.01, 0, 0, 0, 0.0006, -0.0002, -0.0005, 0.0002],
          "fisheye": [-0.03, 0.008, -0.004, 0.0007]}
SURFACES = ("flat", "bow", "twist", "dent")


@dataclasses.dataclass
class Scene:
    cameras: list           # dicts as in rig.json, with cam_from_rig = (R, t)
    board: np.ndarray       # (points, 4): x, y, 0, radius: what the solver is told
    surface: dict           # {"kind", "height_mm"}: what is true
    poses: tuple            # R (frames, 3, 3), t (frames, 3): rig_from_board
    noise: float
    camera: np.ndarray = None    # of each observation, sorted by camera, frame, point
    frame: np.ndarray = None
    point: np.ndarray = None
    exact: np.ndarray = None     # (n, 2) without noise
    pixels: np.ndarray = None    # (n, 2) as observed
    outlier: np.ndarray = None
    row_time_s: list = None      # of each camera, where boards move (truth_shutter.py)
    velocity: np.ndarray = None  # (frames, 6) likewise: w rad/s, v mm/s


def rotations(vectors):
    """Rotation matrices (n, 3, 3) of rotation vectors (n, 3)."""
    vectors = np.atleast_2d(np.asarray(vectors, float))
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = (vectors / np.maximum(angle[:, 0], 1e-300)).T
    o = np.zeros_like(x)
    k = np.stack([o, -z, y, z, o, -x, -y, x, o], axis=-1).reshape(-1, 3, 3)
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)


def grid(columns, rows, pitch, radius):
    """(points, 4) row by row, with a margin of half a pitch. Every seventh circle is twice as large."""
    y, x = np.mgrid[:rows, :columns]
    r = np.where((x + y) % 7 == 0, 2.0 * radius, radius)
    return np.stack([pitch * (x + 0.5), pitch * (y + 0.5), 0.0 * x, r], axis=-1).reshape(-1, 4)


def surface_at(surface, board):
    """Height (points,) of the true surface above the plane z = 0, and its slopes (points, 2).
    `height_mm` is the largest deviation: bow, the middle against the edges; twist, corners up and
    down; dent, the bottom of a Gaussian of a tenth of the board's width."""
    low, high = board[:, :2].min(axis=0), board[:, :2].max(axis=0)
    half = (high - low) / 2
    u, v = ((board[:, :2] - (low + high) / 2) / half).T
    o, height = np.zeros_like(u), surface["height_mm"]
    if surface["kind"] == "bow":
        z, zu, zv = 1 - (u * u + v * v) / 2, -u, -v
    elif surface["kind"] == "twist":
        z, zu, zv = u * v, v, u
    elif surface["kind"] == "dent":
        # As wide as high: lengths in units of half the width.
        size, up = 0.2, half[1] / half[0]
        du, dv = u - 0.3, v * up + 0.2 * up
        z = np.exp(-(du**2 + dv**2) / (2 * size**2))
        zu, zv = -z * du / size**2, -z * dv / size**2 * up
    else:
        z, zu, zv = o, o, o
    return height * z, height * np.stack([zu, zv], axis=-1) / half


def true_points(scene):
    """(points, 3) on the true surface, and the tangent vectors there (points, 3, 2)."""
    z, slope = surface_at(scene.surface, scene.board)
    points = scene.board[:, :3] + np.stack([0 * z, 0 * z, z], axis=-1)
    along = np.zeros((len(z), 3, 2))
    along[:, 0, 0] = along[:, 1, 1] = 1
    along[:, 2] = slope
    return points, along


def _camera(name, size, focal, model, rng, field, turn, centre):
    scale = 1 + rng.normal(0, 0.05)
    camera = {"name": name, "width": size[0], "height": size[1], "model": model,
              "fx": focal * (1 + rng.normal(0, 0.01)), "cx": (size[0] - 1) / 2 + rng.normal(0, size[0] / 200),
              "cy": (size[1] - 1) / 2 + rng.normal(0, size[0] / 200),
              "distortion": [float(v * scale) for v in LENSES[model]],
              "cam_from_rig": (turn, -turn @ centre)}
    camera["fy"] = camera["fx"] * (1 + rng.normal(0, 0.001))
    if field:
        camera["field"] = truth_lens.make_field(size, rng, field)
    return camera


def _towards(centre, target, roll):
    """cam_from_world rotation of a camera at `centre` that looks at `target`, world z up."""
    z = (target - centre) / np.linalg.norm(target - centre)
    x = np.cross(z, [0, 0, 1.0])
    x /= np.linalg.norm(x)
    return rotations([0, 0, roll])[0] @ np.stack([x, np.cross(z, x), z])


def _around(count, size, focal, radius, heights, model, rng, field):
    cameras = []
    for i in range(count):
        angle = 2 * np.pi * (i + rng.uniform(-0.1, 0.1)) / count
        centre = np.array([radius[0] * np.cos(angle), radius[1] * np.sin(angle), rng.uniform(*heights)])
        turn = _towards(centre, rng.normal(0, 100, 3), rng.normal(0, 0.03))
        cameras.append(_camera(f"cam{i}", size, focal, model, rng, field, turn, centre))
    return cameras


def _walk_around(frames, board, spread, rng):
    """Board poses in the world: anywhere in an ellipsoid, upright within 35 degrees, facing anywhere."""
    middle = board[:, :3].mean(axis=0)
    facing, lean = rng.uniform(0, 2 * np.pi, frames), rng.uniform(-0.6, 0.6, (frames, 2))
    # x of the board to the viewer's right, y down, z away from the viewer who stands at `facing`.
    z = np.stack([-np.cos(facing), -np.sin(facing), 0 * facing], axis=-1)
    y = np.broadcast_to([0.0, 0, -1], z.shape)
    upright = np.stack([np.cross(y, z), y, z], axis=-1)
    turn = upright @ rotations(np.stack([lean[:, 0], 0 * facing, lean[:, 1]], axis=-1))
    at = rng.uniform(-1, 1, (frames, 3)) * spread
    return turn, at - turn @ middle


def _into_rig(cameras, poses):
    """From the world's frame to that of the first camera."""
    turn, shift = cameras[0]["cam_from_rig"]
    for camera in cameras:
        r, t = camera["cam_from_rig"]
        camera["cam_from_rig"] = (r @ turn.T, t - r @ turn.T @ shift)
    cameras[0]["cam_from_rig"] = (np.eye(3), np.zeros(3))
    return turn @ poses[0], poses[1] @ turn.T + shift


def in_front(frames, board, cameras, distance, rng, share):
    """Board poses before cameras that look the same way, drawn until each sees `share` of the points."""
    middle = board[:, :3].mean(axis=0)
    first, turns, shifts = cameras[0], [], []
    while len(turns) < frames:
        z = rng.uniform(*distance)
        at = rng.uniform([-0.1, -0.1], [1.1, 1.1]) * [first["width"], first["height"]]
        ray = (at - [first["cx"], first["cy"]]) / first["fx"]
        turn = rotations([*rng.uniform(-0.7, 0.7, 2), 0])[0] @ rotations([0, 0, rng.uniform(-0.6, 0.6)])[0]
        shift = np.array([*(ray * z), z]) - turn @ middle
        points = board[:, :3] @ turn.T + shift
        seen = [_visible(c, points @ c["cam_from_rig"][0].T + c["cam_from_rig"][1],
                         c["cam_from_rig"][0] @ turn[:, 2], reach(c)).mean() for c in cameras]
        if min(seen) >= share:
            turns.append(turn)
            shifts.append(shift)
    return np.array(turns), np.array(shifts)


def reach(camera):
    """tan of the widest angle in the image, with a margin: beyond it a polynomial may fold back."""
    if camera["model"] == "fisheye":
        return np.inf
    corners = np.array([[x, y] for x in (0, camera["width"] - 1.0) for y in (0, camera["height"] - 1.0)])
    rays = truth_lens.unproject(camera, corners)
    return 1.1 * np.max(np.hypot(rays[:, 0], rays[:, 1]) / rays[:, 2])


def _visible(camera, points, normal, widest):
    """Which points (n, 3) of a board with that normal (away from the viewer) have an image: in view,
    and seen at 65 degrees of tilt at most."""
    facing = points @ normal > np.cos(np.radians(65)) * np.linalg.norm(points, axis=1)
    near = np.hypot(points[:, 0], points[:, 1]) < widest * points[:, 2] if np.isfinite(widest) else True
    at = np.flatnonzero(facing & near)
    pixels = truth_lens.project(camera, points[at])
    inside = ((pixels > 0) & (pixels < [camera["width"] - 1, camera["height"] - 1])).all(axis=1)
    seen = np.zeros(len(points), bool)
    seen[at[inside]] = True
    return seen


def observe(scene, rng, outliers=0.0):
    """Fills in the observations: every circle that is wholly in an image, with noise, and outliers
    that lie 5 to 80 px away."""
    points, along = true_points(scene)
    parts = []
    for c, camera in enumerate(scene.cameras):
        turn_cr, shift_cr = camera["cam_from_rig"]
        widest = reach(camera)
        for f, (turn_rb, shift_rb) in enumerate(zip(*scene.poses)):
            turn = turn_cr @ turn_rb
            there = points @ turn.T + (turn_cr @ shift_rb + shift_cr)
            at = np.flatnonzero(_visible(camera, there, turn[:, 2], widest))
            if not len(at):
                continue
            exact = truth_circles.image_of_circles(camera, there[at], scene.board[at, 3], turn @ along[at])
            good = np.isfinite(exact[:, 0])
            if good.sum() >= 8:
                parts.append((np.full(good.sum(), c), np.full(good.sum(), f), at[good], exact[good]))
    scene.camera, scene.frame, scene.point, scene.exact = (np.concatenate(p) for p in zip(*parts))
    return add_noise(scene, rng, outliers)


def add_noise(scene, rng, outliers):
    """What is observed, from what is exact."""
    count = len(scene.camera)
    scene.outlier = rng.random(count) < outliers
    angle, far = rng.uniform(0, 2 * np.pi, count), rng.uniform(5, 80, count)
    wrong = far[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    scene.pixels = scene.exact + rng.normal(0, scene.noise, (count, 2)) + wrong * scene.outlier[:, None]
    return scene


def _paper(rng, model, field, frames, radius):
    # Two cameras side by side, 300 mm apart, turned in; a board of 1,200 x 686 mm.
    size, cameras = (4096, 3000), []
    for i in range(2):
        turn = rotations(np.array([0.01, 0.12, 0.01]) * i + rng.normal(0, 0.005, 3) * i)[0]
        centre = np.array([300.0, 5, 10]) * i
        cameras.append(_camera(f"cam{i}", size, 4000.0, model, rng, field, turn, centre))
    board = grid(42, 24, 1200 / 42, radius)
    return cameras, board, in_front(frames, board, cameras, (1300.0, 2400.0), rng, 1.0)


def _small(rng, model, field, frames, radius):
    size, cameras = (1280, 1024), []
    for i in range(3):
        turn = rotations(np.array([0.02, 0.14, 0.01]) * i)[0]
        cameras.append(_camera(f"cam{i}", size, 1200.0, model, rng, field, turn,
                               np.array([250.0, 15, 25]) * i))
    board = grid(12, 9, 60.0, radius)
    return cameras, board, in_front(frames, board, cameras, (800.0, 1800.0), rng, 0.4)


def _ring(rng, model, field, frames, radius):
    cameras = _around(8, (1920, 1080), 1400.0, (1900.0, 1900.0), (-300.0, 300.0), model, rng, field)
    board = grid(24, 14, 40.0, radius)
    return cameras, board, _into_rig(cameras, _walk_around(frames, board, [900.0, 900, 450], rng))


def _room(rng, model, field, frames, radius):
    cameras = _around(16, (1920, 1200), 1300.0, (3000.0, 2500.0), (-600.0, 1200.0), model, rng, field)
    board = grid(42, 24, 36.0, radius)
    return cameras, board, _into_rig(cameras, _walk_around(frames, board, [1400.0, 1100, 600], rng))


# name -> (builder, frames, radius of the small circles in mm)
RIGS = {"paper": (_paper, 50, 5.0), "small": (_small, 15, 8.0), "ring": (_ring, 100, 8.0),
        "room": (_room, 300, 8.0)}


def make(rig, seed, noise=0.05, model="brown", surface="flat", outliers=0.0, field=0.0, frames=None,
         radius=None, height_mm=1.0):
    """A whole scene. `field`: amplitude in px of a smooth shift that no model fits. radius 0: corners."""
    build, usual_frames, usual_radius = RIGS[rig]
    rng = np.random.default_rng([seed, 77])
    cameras, board, poses = build(rng, model, field, frames or usual_frames,
                                  usual_radius if radius is None else radius)
    scene = Scene(cameras, board, {"kind": surface, "height_mm": 0.0 if surface == "flat" else height_mm},
                  poses, noise)
    return observe(scene, rng, outliers)
