"""Errors over what an estimate says of them: 1 in the root mean square where its covariance is honest.

    normalised(scene, estimate)     mean squares of one draw, by what was looked at

An estimate has `cameras`, `rays`, `cam_from_rig` (truth_score.py), and `covariance_of(c)`: the covariance of
a camera's lens (fx fy cx cy, coefficients) and, but for the first, of its pose: turn (rad) and shift (mm)
after cam_from_rig. The covariance may be known as a diagonal only; what needs more is then left out.
"""
import numpy as np

import truth_lens
import truth_score


class Claims:
    """What a result file claims, as covariances of one camera at a time."""

    def __init__(self, rig):
        self.rig, self.cameras = rig, rig.cameras
        self.rays, self.cam_from_rig = rig.rays, rig.cam_from_rig
        joint = rig.content.get("covariance")
        self.whole = joint is not None
        if self.whole:
            self.names = {name: i for i, name in enumerate(joint["parameters"])}
            size = len(self.names)
            self.matrix = np.zeros((size, size))
            self.matrix[np.tril_indices(size)] = joint["lower"]
            self.matrix += np.tril(self.matrix, -1).T

    def covariance_of(self, c):
        camera = self.cameras[c]
        if self.whole:
            at = [i for name, i in self.names.items() if name.startswith(camera["name"] + ".")]
            return self.matrix[np.ix_(at, at)]
        std = camera["standard_deviation"]
        flat = [std[key] for key in ("fx", "fy", "cx", "cy")] + std["distortion"]
        if c:
            flat += [*np.radians(std["rotation_deg"]), *std["translation_mm"]]
        return np.diag(np.square(flat))


class ReferenceClaims:
    """The same of a truth_reference.Solution: shows that the instrument itself is true."""
    whole = True

    def __init__(self, solution):
        self.solution, self.cameras = solution, solution.cameras
        self.rays, self.cam_from_rig = solution.rays, solution.cam_from_rig

    def covariance_of(self, c):
        at = slice(self.solution.lens_at[c].start, (self.solution.pose_at[c] or self.solution.lens_at[c]).stop)
        return self.solution.covariance[at, at]


def rotation_vector(turn):
    """Of a small rotation."""
    sine = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    return sine * (1 + (sine @ sine) / 6)


def parameter_error(scene, estimate, c):
    known, found = scene.cameras[c], estimate.cameras[c]
    error = [found[key] - known[key] for key in ("fx", "fy", "cx", "cy")]
    error += list(np.subtract(found["distortion"], known["distortion"]))
    if c:
        turn, shift = known["cam_from_rig"]
        found_turn, found_shift = estimate.cam_from_rig(c)
        error += [*rotation_vector(found_turn @ turn.T), *(found_shift - shift)]
    return np.array(error)


def projection_expected(camera, covariance):
    """Expected mean square (px^2) of truth_score.projection_error, from the covariance of the lens."""
    pixels = truth_score.image_grid(camera)
    rays = truth_lens.unproject(camera, pixels)
    by_point, by_lens = truth_lens.jacobians(camera, rays)
    by_lens = by_lens.reshape(2 * len(pixels), -1)
    turns = np.linalg.qr(np.cross(by_point, rays[:, None, :]).reshape(-1, 3))[0]
    left = by_lens - turns @ (turns.T @ by_lens)
    count = left.shape[1]
    return float(np.einsum("ij,jk,ik->", left, covariance[:count, :count], left) / len(pixels))


def place_expected(camera, covariance):
    """Expected square (mm^2, rad^2) of the errors of a camera's place and direction."""
    turn, shift = camera["cam_from_rig"]
    x, y, z = shift
    by_pose = turn.T @ np.concatenate([-np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), -np.eye(3)], axis=1)
    pose = covariance[-6:, -6:]
    return float(np.trace(by_pose @ pose @ by_pose.T)), float(np.trace(pose[:3, :3]))


def normalised(scene, estimate):
    """By kind: (sum of squared errors, sum of what was expected), over the cameras; for parameters each
    error is squared over its own variance."""
    found = {}

    def add(kind, error, expected):
        before = found.get(kind, (0.0, 0.0))
        found[kind] = (before[0] + error, before[1] + expected)
    for c, camera in enumerate(scene.cameras):
        covariance, error = estimate.covariance_of(c), parameter_error(scene, estimate, c)
        square = error**2 / np.diag(covariance)
        lens = len(error) - (6 if c else 0)
        add("lens parameters", square[:lens].sum(), lens)
        if c:
            add("pose parameters", square[lens:].sum(), 6)
        if not estimate.whole:
            continue
        scale = np.sqrt(np.diag(covariance))
        white = np.linalg.solve(covariance / scale / scale[:, None], error / scale)
        add("parameters jointly", float(white @ (error / scale)), len(error))
        add("projection, px", truth_score.projection_error(scene, estimate, c)**2,
            projection_expected(camera, covariance))
        if c:
            place, angle = truth_score.pose_error(scene, estimate, c)
            expected_place, expected_angle = place_expected(camera, covariance)
            add("place of a camera, mm", place**2, expected_place)
            add("direction of a camera, rad", np.radians(angle)**2, expected_angle)
    return found
