"""The joint maximum-likelihood solution of a scene: what a solver is measured against.

    solution = solve(scene, surface="known")

All lenses, camera poses and board poses at once, every point weighted alike (all have one noise), outliers
left out by their labels, started at the truth, by damped Gauss-Newton with the board poses eliminated
from the normal equations (Schur complement). `surface` says what is known of the board: `known`, its true heights;
`free`, heights unknown (cubic B-splines, piston and tilt taken out, for they are the pose); `flat`, taken
for flat, which is wrong where it is not.

A circle's offset from the image of its centre is held at the truth's: estimates are so near that it
changes by less than 1e-6 px. A smooth field of a lens (truth_lens.py) counts as known.

Boards that move (truth_shutter.py) have their velocities as unknowns too, known beforehand to be as large
as the truth's are in the mean square; row times are known.

Global unknowns: for each camera its lens (fx, fy, cx, cy, coefficients), for each but the first six of the
pose (turn and shift applied after cam_from_rig), then the surface's coefficients in mm.
"""
import dataclasses

import numpy as np

import truth_lens
import truth_scenes
import truth_shutter

SETTLED = 0.05


@dataclasses.dataclass
class Solution:
    cameras: list            # as in Scene, estimated
    poses: tuple             # R, t: rig_from_board, estimated
    height: np.ndarray       # (points,) estimated height of the board's surface, mm
    covariance: np.ndarray   # of the global unknowns
    lens_at: list            # of each camera: slice of its lens in the global unknowns
    pose_at: list            # of each camera: slice of its pose; None for the first
    residual_px: float       # RMS per axis, of what was used
    steps: int

    def rays(self, camera, pixels):
        return truth_lens.unproject(self.cameras[camera], pixels)

    def cam_from_rig(self, camera):
        return self.cameras[camera]["cam_from_rig"]


def spline_basis(board, columns, rows):
    """(points, n) orthonormal heights that a cubic B-spline surface of columns x rows coefficients can
    take, less those of a plane."""
    def one(x, count):
        low, high = x.min(), x.max()
        place = (x - low) / (high - low) * (count - 3)
        away = np.abs(place[:, None] - (np.arange(count) - 1)[None, :])
        return np.where(away < 1, 2 / 3 - away**2 + away**3 / 2, np.clip(2 - away, 0, None)**3 / 6)
    x, y = board[:, 0], board[:, 1]
    tensor = (one(x, columns)[:, :, None] * one(y, rows)[:, None, :]).reshape(len(board), -1)
    plane = np.linalg.qr(np.stack([np.ones_like(x), x, y], axis=-1))[0]
    tensor -= plane @ (plane.T @ tensor)
    left, size, _ = np.linalg.svd(tensor, full_matrices=False)
    return left[:, size > 1e-9 * size[0]]


def _skew(v):
    o = np.zeros(len(v))
    x, y, z = v.T
    return np.stack([o, -z, y, z, o, -x, -y, x, o], axis=-1).reshape(-1, 3, 3)


class _System:
    """The state, and its normal equations."""

    def __init__(self, scene, surface, spline):
        self.scene = scene
        self.cameras = [dict(camera) for camera in scene.cameras]
        self.turn, self.shift = (part.copy() for part in scene.poses)
        true_points, _ = truth_scenes.true_points(scene)
        self.offset = scene.exact.copy()
        self.points = scene.board[:, :3].copy() if surface == "flat" else true_points
        self.basis = spline_basis(scene.board, *spline) if surface == "free" else np.zeros((len(scene.board), 0))
        moves = scene.velocity is not None and scene.velocity.any()
        self.velocity = scene.velocity.copy() if moves else None
        self.times = truth_shutter.row_times(scene) if moves else None
        self.body = 12 if moves else 6
        good = ~scene.outlier
        self.parts = [np.flatnonzero(good & (scene.camera == c)) for c in range(len(scene.cameras))]
        for c, part in enumerate(self.parts):
            _, _, there = self.place(c, part, true_points)
            self.offset[part] -= truth_lens.project(self.cameras[c], there)
        self.lens_at, self.pose_at, size = [], [], 0
        for c, camera in enumerate(self.cameras):
            count = 4 + truth_lens.COEFFICIENTS[camera["model"]]
            self.lens_at.append(slice(size, size + count))
            size += count
            self.pose_at.append(slice(size, size + 6) if c else None)
            size += 6 if c else 0
        self.size = size + self.basis.shape[1]

    def place(self, c, part, points):
        """Points of observations: turned into the rig's axes, in the rig, in the camera."""
        frame = self.scene.frame[part]
        turned = (self.turn[frame] @ points[self.scene.point[part], :, None])[..., 0]
        rig = turned + self.shift[frame]
        if self.velocity is not None:
            moved = self.times[part, None] * self.velocity[frame]
            turned = (truth_scenes.rotations(moved[:, :3]) @ turned[..., None])[..., 0]
            rig = turned + self.shift[frame] + moved[:, 3:]
        turn, shift = self.cameras[c]["cam_from_rig"]
        return turned, rig, rig @ turn.T + shift

    def camera_rows(self, c, part):
        """Residuals (n, 2), derivatives by the camera's own unknowns (n, 2, own), by the board's pose
        (n, 2, 6; with its velocity 12) and by a board point's height (n, 2)."""
        turn = self.cameras[c]["cam_from_rig"][0]
        turned, rig, there = self.place(c, part, self.points)
        miss = truth_lens.project(self.cameras[c], there) + self.offset[part] - self.scene.pixels[part]
        by_point, own = truth_lens.jacobians(self.cameras[c], there)
        if c:
            own = np.concatenate([own, -by_point @ _skew(rig @ turn.T), by_point], axis=-1)
        in_rig = by_point @ turn
        board = np.concatenate([-in_rig @ _skew(turned), in_rig], axis=-1)
        if self.velocity is not None:
            board = np.concatenate([board, self.times[part, None, None] * board], axis=-1)
        up = self.turn[self.scene.frame[part], :, 2]
        return miss, own, board, (in_rig @ up[..., None])[..., 0]

    def normal(self):
        """H and g of the global unknowns; of each frame its 6 x 6, its coupling (6, global), its g."""
        frames, b = len(self.turn), self.body
        h, g = np.zeros((self.size, self.size)), np.zeros(self.size)
        h_ff, h_fg, g_f = np.zeros((frames, b, b)), np.zeros((frames, b, self.size)), np.zeros((frames, b))
        square, heights = 0.0, slice(self.size - self.basis.shape[1], self.size)
        for c, part in enumerate(self.parts):
            miss, own, board, height = self.camera_rows(c, part)
            square += (miss**2).sum()
            at = list(range(self.lens_at[c].start, (self.pose_at[c] or self.lens_at[c]).stop))
            at += list(range(heights.start, heights.stop))
            frame = self.scene.frame[part]
            ends = np.flatnonzero(np.diff(frame, prepend=-1, append=-1))
            for first, last in zip(ends[:-1], ends[1:]):
                f, view = frame[first], slice(first, last)
                columns = [own[view].reshape(2 * (last - first), -1)]
                if self.basis.shape[1]:
                    rows = self.basis[self.scene.point[part[view]]]
                    columns.append((height[view][..., None] * rows[:, None]).reshape(2 * (last - first), -1))
                columns.append(board[view].reshape(-1, b))
                j = np.concatenate(columns, axis=1)
                m, r = j.T @ j, j.T @ miss[view].ravel()
                h[np.ix_(at, at)] += m[:-b, :-b]
                g[at] += r[:-b]
                h_ff[f] += m[-b:, -b:]
                h_fg[f][:, at] += m[-b:, :-b]
                g_f[f] += r[-b:]
        if self.velocity is not None:
            known = self.known()
            h_ff[:, range(6, 12), range(6, 12)] += known
            g_f[:, 6:] += known * self.velocity
            square += (known * self.velocity**2).sum()
        return h, g, h_ff, h_fg, g_f, square

    def known(self):
        """What is known of velocities beforehand, in the unit of the sum of squares: (6,)."""
        turn, shift = ((self.scene.velocity[:, part]**2).mean() for part in (slice(3), slice(3, 6)))
        return self.scene.noise**2 / np.repeat([turn, shift], 3)

    def state(self):
        return [dict(camera) for camera in self.cameras], self.turn, self.shift, self.points, self.velocity

    def restore(self, state):
        self.cameras, self.turn, self.shift, self.points, self.velocity = state
        self.cameras = [dict(camera) for camera in self.cameras]

    def move(self, step, steps_f):
        for c, camera in enumerate(self.cameras):
            lens = step[self.lens_at[c]]
            for key, change in zip(("fx", "fy", "cx", "cy"), lens):
                camera[key] = camera[key] + change
            camera["distortion"] = [d + change for d, change in zip(camera["distortion"], lens[4:])]
            if c:
                turn, shift = camera["cam_from_rig"]
                pose = step[self.pose_at[c]]
                camera["cam_from_rig"] = (truth_scenes.rotations(pose[:3])[0] @ turn,
                                          shift + pose[3:])
        self.turn = truth_scenes.rotations(steps_f[:, :3]) @ self.turn
        self.shift = self.shift + steps_f[:, 3:6]
        if self.velocity is not None:
            self.velocity = self.velocity + steps_f[:, 6:]
        self.points = self.points.copy()
        self.points[:, 2] += self.basis @ step[self.size - self.basis.shape[1]:]


def _reduce(system):
    """Normal equations without the boards' poses: matrix, right side, and per frame what gives its step."""
    h, g, h_ff, h_fg, g_f, square = system.normal()
    h_ff[np.abs(h_ff).sum(axis=(1, 2)) == 0] = np.eye(system.body)
    solved = np.linalg.solve(h_ff, np.concatenate([h_fg, g_f[..., None]], axis=-1))
    reduced = h - np.einsum("fki,fkj->ij", h_fg, solved[..., :-1], optimize=True)
    right = g - np.einsum("fki,fk->i", h_fg, solved[..., -1])
    # Unknowns differ by many powers of ten in size.
    scale = 1 / np.sqrt(np.diag(reduced))
    return reduced * scale * scale[:, None], right * scale, scale, solved, square


def solve(scene, surface="known", spline=(12, 8), steps=25):
    """Levenberg-Marquardt: the coefficients of a rational lens stand in for one another, and a full step
    along that valley would leave it. Ends when a step lowers chi-square by less than 0.05, a fifth of one
    sigma along one of many unknowns. Of a valley so flat that its end is not reached in `steps` steps, that
    part near the truth is as good as any, if a step gains less than 1, one sigma; otherwise raises."""
    system = _System(scene, surface, spline)
    used = 2 * sum(map(len, system.parts))
    damping, chi2, gain = 0.0, np.inf, np.inf
    for count in range(1, steps + 1):
        now = _reduce(system)
        if now[-1] / scene.noise**2 < chi2:
            gain, chi2 = chi2 - now[-1] / scene.noise**2, now[-1] / scene.noise**2
            matrix, right, scale, solved, _ = now
            kept, damping = system.state(), damping / 10
            if gain < SETTLED:
                break
        else:
            if now[-1] / scene.noise**2 - chi2 < SETTLED:
                system.restore(kept)
                break
            system.restore(kept)
            damping = max(10 * damping, 1e-9)
        step = -scale * np.linalg.solve(matrix + damping * np.eye(len(right)), right)
        system.move(step, -(solved[..., :-1] @ step + solved[..., -1]))
    else:
        system.restore(kept)
        if gain > 1:
            raise RuntimeError(f"the reference has not settled after {steps} steps")
    inverse = np.linalg.inv(matrix) * scale * scale[:, None]
    return Solution(system.cameras, (system.turn, system.shift), system.points[:, 2],
                    inverse * scene.noise**2, system.lens_at, system.pose_at,
                    float(scene.noise * np.sqrt(chi2 / used)), count)
