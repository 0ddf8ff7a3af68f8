"""Gaussian derivatives in double precision, by the definition: correlation with sampled kernels.

A kernel of radius R samples a Gaussian of sigma R / 3 and its derivatives. A sampled derivative is not
quite a derivative; these are the multiples of (1), (x) and (x^2 + const) times the sampled Gaussian that
are exact on polynomials up to the second order. Beyond the image its border pixels repeat.
"""
import numpy as np


def kernels(radius):
    """g, g', g'': weights at -R..R of a correlation."""
    x = np.arange(-radius, radius + 1, dtype=float)
    g = np.exp(-0.5 * (x * 3 / radius) ** 2)
    g /= g.sum()
    spread = (x ** 2 * g).sum()
    first = x * g / spread                       # of a ramp: 1
    second = (x ** 2 - spread) * g               # of a constant: 0
    second *= 2 / (x ** 2 * second).sum()        # of x^2: 2
    return g, first, second


def correlate(image, kernel, axis):
    radius = len(kernel) // 2
    pad = [(0, 0), (0, 0)]
    pad[axis] = (radius, radius)
    padded = np.pad(image, pad, mode="edge")
    size = image.shape[axis]
    return sum(w * np.take(padded, np.arange(i, i + size), axis) for i, w in enumerate(kernel))


def derivatives(image, radius):
    """Maps x, y, xx, xy, yy of the image to arrays of its size."""
    g, first, second = kernels(radius)
    return {name: correlate(correlate(image, along_x, 1), along_y, 0)
            for name, along_x, along_y in (("x", first, g), ("y", g, first), ("xx", second, g),
                                           ("xy", first, first), ("yy", g, second))}


def along_gradient(d):
    """|gradient|, and the second derivative in the gradient's direction (0 where there is none)."""
    size = np.hypot(d["x"], d["y"])
    safe = np.where(size > 0, size, 1)
    nx, ny = d["x"] / safe, d["y"] / safe
    return size, nx * nx * d["xx"] + 2 * nx * ny * d["xy"] + ny * ny * d["yy"]
