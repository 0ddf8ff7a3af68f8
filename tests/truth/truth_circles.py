"""The quantity that is observed of a circle: the centre of the ellipse that its edge makes in the image.

The edge is sampled, projected point by point, and the ellipse with the least squared distances to the image,
each piece of edge weighted by its length there, has the centre: where distortion makes the edge no ellipse, "its"
ellipse needs a definition, and this is the renderer's and what a detector's edge pixels make. Distances are those of a
conic over its slope (Sampson), which is anew taken from the last fit. The edge is a smooth closed curve, so means over
equal steps of angle converge faster than any power of their number: two dozen samples give what thousands
give (`tests/system/test_simulate.py` shows it).
"""
import numpy as np

import truth_lens

EDGE_SAMPLES = 24


def _edge_derivative(samples):
    """Matrix that takes samples of a periodic function to its derivative: exact up to samples/2 waves."""
    k = np.arange(samples)
    difference = k[:, None] - k[None, :]
    with np.errstate(divide="ignore"):
        d = 0.5 * (-1.0)**difference / np.tan(difference * np.pi / samples)
    np.fill_diagonal(d, 0)
    return d


def ellipse_centres(edges, rounds=3):
    """Centres (n, 2) of the ellipses of least distance to closed edges (n, an even number, 2)."""
    mean = edges.mean(axis=1, keepdims=True)
    away = edges - mean
    size = np.sqrt((away**2).mean(axis=(1, 2), keepdims=True))
    away /= size
    x, y = away[..., 0], away[..., 1]
    # Equal steps of angle are unequal lengths of edge in the image; a detector sees edge pixels.
    turn = _edge_derivative(edges.shape[1]).T
    length = np.hypot(x @ turn, y @ turn)
    slope = np.ones_like(length)
    for _ in range(rounds):
        weight = np.sqrt(length) / slope
        design = np.stack([x * x, x * y, y * y, x, y], axis=1) * weight[:, None]
        normal = design @ design.transpose(0, 2, 1)
        right = design @ weight[..., None]
        a, b, c, d, e = np.linalg.solve(normal, right)[..., 0].T[..., None]
        slope = np.hypot(2 * a * x + b * y + d, b * x + 2 * c * y + e)
    a, b, c, d, e = (part[:, 0] for part in (a, b, c, d, e))
    det = 4 * a * c - b * b
    centre = np.stack([(b * e - 2 * c * d) / det, (b * d - 2 * a * e) / det], axis=-1)
    return mean[:, 0] + size[:, 0] * centre


def image_of_circles(camera, points, radius, along, samples=EDGE_SAMPLES, block=20000):
    """Ellipse centres of circles at points (n, 3) in the camera frame, in planes spanned by the
    perpendicular unit vectors along (n, 3, 2); nan where an edge leaves the image or has no image.
    Where the radius is 0 the image of the point itself."""
    pixels = truth_lens.project(camera, points)
    phi = np.arange(samples) * 2 * np.pi / samples
    circle = np.stack([np.cos(phi), np.sin(phi)])
    limit = np.array([camera["width"] - 1, camera["height"] - 1])
    round_ones = np.flatnonzero(radius > 0)
    for first in range(0, len(round_ones), block):
        at = round_ones[first:first + block]
        edge = points[at, None, :] + radius[at, None, None] * (along[at] @ circle).transpose(0, 2, 1)
        image = truth_lens.project(camera, edge)
        inside = ((image > 0) & (image < limit)).all(axis=(1, 2))
        pixels[at] = np.nan
        pixels[at[inside]] = ellipse_centres(image[inside])
    inside = ((pixels > 0) & (pixels < limit)).all(axis=1)
    pixels[~inside] = np.nan
    return pixels
