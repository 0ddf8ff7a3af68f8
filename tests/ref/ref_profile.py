"""A circle's appearance fitted to pixels: the definition in firmware/detect/refine.h, by brute force.

At the distance d = (1 - rho) h inside the edge (h = rho / |grad f|, rho the radius in the ellipse's unit
frame, f = (rho^2 - 1) / 2) a pixel has the brightness b + c g(rho) P(d / s): P is the normal integral, g
the printed Gaussian peak over its level at the edge, 1 outside. Unknown: the ellipse, b, c and s. The
pixels within `reach` times s of the edge count, all alike.
"""
import math

import numpy as np

from ref_ellipse import slopes

NORMAL = np.vectorize(lambda z: 0.5 * (1 + math.erf(z / math.sqrt(2))))


def unit_frame(ellipse, x, y):
    """rho, and the distance inside the edge, of each pixel."""
    root = np.linalg.cholesky([[ellipse[2], ellipse[3]], [ellipse[3], ellipse[4]]])
    unit = np.linalg.solve(root, np.stack([x, y]) - ellipse[:2, None])
    rho = np.maximum(np.hypot(*unit), 1e-9)
    gradient = np.hypot(*np.linalg.solve(root.T, unit))
    return rho, (1 - rho) * rho / gradient


def peak(rho, edge_level, gauss_sigma):
    """The level at rho over that at the edge, for a white circle (black ones mirror it)."""
    def level(t):
        return edge_level + (1 - edge_level) * np.exp(-t * t / (2 * gauss_sigma ** 2))
    return np.where(rho < 1, level(rho) / level(1.0), 1.0)


def model(unknowns, x, y, edge_level, gauss_sigma):
    outside, contrast, blur = unknowns[5:]
    rho, inside = unit_frame(unknowns[:5], x, y)
    return outside + contrast * peak(rho, edge_level, gauss_sigma) * NORMAL(inside / blur)


def profile_fit(image, start, blur, reach=2.0, edge_level=0.8, gauss_sigma=0.4):
    """(ellipse, blur, contrast, noise, sigma of the centre per axis, RMS of both). The window follows the fit
    until it stands still."""
    ellipse = np.array(start, float)
    size = math.sqrt(max(ellipse[2], ellipse[4])) + reach * blur + 2
    low = np.maximum(np.floor(ellipse[:2] - size).astype(int), 0)
    high = np.ceil(ellipse[:2] + size).astype(int) + 1
    part = image[low[1]:high[1], low[0]:high[0]]
    yy, xx = np.mgrid[low[1]:low[1] + part.shape[0], low[0]:low[0] + part.shape[1]]
    unknowns = None
    for _ in range(12):
        _, inside = unit_frame(ellipse, xx.ravel().astype(float), yy.ravel().astype(float))
        near = np.abs(inside) <= reach * blur
        x, y, grey = xx.ravel()[near] * 1.0, yy.ravel()[near] * 1.0, part.ravel()[near]
        if unknowns is None:
            rise = NORMAL(inside[near] / blur)
            matrix = np.stack([np.ones_like(rise), rise], 1)
            unknowns = np.array([*ellipse, *np.linalg.lstsq(matrix, grey, rcond=None)[0], blur])

        def curve(u):
            return model(u, x, y, edge_level, gauss_sigma)
        jacobian = slopes(curve, unknowns)
        step = np.linalg.lstsq(jacobian, grey - curve(unknowns), rcond=None)[0]
        unknowns = unknowns + step
        ellipse, blur = unknowns[:5], unknowns[7]
        if np.abs(step[:5]).max() < 1e-6:
            break
    rest = grey - curve(unknowns)
    noise = math.sqrt((rest ** 2).sum() / (len(grey) - len(unknowns)))
    covariance = np.linalg.inv(jacobian.T @ jacobian) * noise ** 2
    return (ellipse, blur, unknowns[6], noise,
            math.sqrt((covariance[0, 0] + covariance[1, 1]) / 2))
