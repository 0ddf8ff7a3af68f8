"""Ellipses through points: the direct least-squares fit, the one of least squared distances, and that of the same area
and moments as the closed line through them.

An ellipse is (x, y, sxx, sxy, syy): centre and shape matrix S, (p - c)' S^-1 (p - c) = 1.
"""
import numpy as np


def from_conic(a, b, c, d, e, f):
    """a x^2 + b x y + c y^2 + d x + e y + f = 0."""
    form = np.array([[a, b / 2], [b / 2, c]])
    centre = np.linalg.solve(2 * form, [-d, -e])
    level = centre @ form @ centre - f
    shape = np.linalg.inv(form) * level
    return np.array([*centre, shape[0, 0], shape[0, 1], shape[1, 1]])


def direct_fit(x, y):
    """Fitzgibbon, Pilu and Fisher: least squares of the conic's values under 4 a c - b^2 = 1; solved as
    Halir and Flusser do. The fit moves with the points under affine maps; points of mean 0 and size 1 keep
    its numbers well."""
    mean, size = np.array([x.mean(), y.mean()]), np.hypot(x - x.mean(), y - y.mean()).mean()
    u, v = (x - mean[0]) / size, (y - mean[1]) / size
    quadratic = np.stack([u * u, u * v, v * v], 1)
    linear = np.stack([u, v, np.ones_like(u)], 1)
    s1, s2, s3 = quadratic.T @ quadratic, quadratic.T @ linear, linear.T @ linear
    to_linear = -np.linalg.solve(s3, s2.T)
    reduced = s1 + s2 @ to_linear
    constraint = np.array([[0, 0, 2], [0, -1, 0], [2, 0, 0]])
    _, vectors = np.linalg.eig(np.linalg.solve(constraint, reduced))
    vectors = np.real(vectors)
    kind = 4 * vectors[0] * vectors[2] - vectors[1] ** 2
    best = vectors[:, np.argmax(kind)]
    ellipse = from_conic(*best, *(to_linear @ best))
    ellipse[:2] = ellipse[:2] * size + mean
    ellipse[2:] *= size ** 2
    return ellipse


def rim(ellipse, angle):
    """Points of the ellipse by the angle in its unit frame, and their derivative by that angle."""
    root = np.linalg.cholesky([[ellipse[2], ellipse[3]], [ellipse[3], ellipse[4]]])
    turn = np.stack([np.cos(angle), np.sin(angle)])
    along = np.stack([-np.sin(angle), np.cos(angle)])
    return ellipse[:2, None] + root @ turn, root @ along, -(root @ turn)


def distances(ellipse, x, y):
    """Signed distances of the points from the ellipse, outside positive: Newton on the foot point."""
    root = np.linalg.cholesky([[ellipse[2], ellipse[3]], [ellipse[3], ellipse[4]]])
    unit = np.linalg.solve(root, np.stack([x, y]) - ellipse[:2, None])
    angle = np.arctan2(unit[1], unit[0])
    for _ in range(8):
        at, first, second = rim(ellipse, angle)
        away = np.stack([x, y]) - at
        slope = -(away * first).sum(0)
        bend = (first * first).sum(0) - (away * second).sum(0)
        angle = angle - slope / np.maximum(bend, 1e-9)
    at, _, _ = rim(ellipse, angle)
    away = np.hypot(x - at[0], y - at[1])
    return np.where(np.hypot(*unit) > 1, away, -away)


def slopes(function, at):
    """Derivatives of a vector function by central differences, a column each."""
    columns = []
    for i, value in enumerate(at):
        step = 1e-5 * max(1.0, abs(value))
        low, high = at.copy(), at.copy()
        low[i] -= step
        high[i] += step
        columns.append((function(high) - function(low)) / (2 * step))
    return np.stack(columns, 1)


def geometric_fit(x, y, start):
    """Least squared distances: Gauss and Newton from `start` until nothing moves. Also the RMS distance."""
    ellipse = np.array(start, float)
    for _ in range(50):
        matrix = slopes(lambda e: distances(e, x, y), ellipse)
        step = np.linalg.lstsq(matrix, -distances(ellipse, x, y), rcond=None)[0]
        ellipse = ellipse + step
        if np.abs(step).max() < 1e-8:
            break
    return ellipse, np.sqrt(np.mean(distances(ellipse, x, y) ** 2))


def area_fit(x, y):
    """The ellipse with the centroid and the second moments of the area within the closed line through the points.
    Moments are integrals of polar sectors, r^2 / 2 da of area, by the trapezoidal rule in the angle. Also the
    angles that the steps are of its circumference, as seen in its unit frame; their sum tells the line's area."""
    origin = np.array([x.mean(), y.mean()])
    at = np.stack([x, y], 1) - origin
    turn = at[:, 0] * np.roll(at[:, 1], -1) - at[:, 1] * np.roll(at[:, 0], -1)
    share = (turn + np.roll(turn, 1)) / 2  # r^2 da, of the steps beside each point
    offset = 2 / 3 * share @ at / share.sum()
    shape = 2 * (at.T * share) @ at / share.sum() - 4 * np.outer(offset, offset)
    ellipse = np.array([*(origin + offset), shape[0, 0], shape[0, 1], shape[1, 1]])
    own = np.sqrt(np.linalg.det(shape))  # a b
    return ellipse, np.arcsin(np.clip(turn / own, -1, 1))
