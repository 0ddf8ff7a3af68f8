"""Lenses of simulated cameras and their derivatives, from OpenCV's published formulas, and a smooth field
that no such formula fits.

A camera is a dict as in rig.json (model, fx, fy, cx, cy, distortion, width, height); "field" may add

    {"waves": [[ax, ay, kx, ky, phase], ...], "bumps": [[ax, ay, x0, y0, size], ...]}

which moves each pixel p by sum a sin(k.p + phase) + sum a exp(-|p - p0|^2 / (2 size^2)), in pixels.
Points are (..., 3) in the camera frame, mm; pixels have (0, 0) at the centre of the top-left one.
"""
import numpy as np

# Unknowns of a lens, in the order of the columns of `lens_jacobian`: fx, fy, cx, cy, then these.
COEFFICIENTS = {"brown": 5, "rational": 8, "thin-prism": 12, "fisheye": 4}


def coefficients(camera):
    """The twelve of OpenCV's general formula: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4."""
    full = np.zeros(12)
    full[:len(camera["distortion"])] = camera["distortion"]
    return full


def field_shift(camera, pixels):
    field, shift = camera.get("field"), np.zeros(pixels.shape)
    for ax, ay, kx, ky, phase in field["waves"] if field else ():
        wave = np.sin(kx * pixels[..., 0] + ky * pixels[..., 1] + phase)
        shift += wave[..., None] * np.array([ax, ay])
    for ax, ay, x0, y0, size in field["bumps"] if field else ():
        bump = np.exp(-((pixels[..., 0] - x0)**2 + (pixels[..., 1] - y0)**2) / (2 * size**2))
        shift += bump[..., None] * np.array([ax, ay])
    return shift


def field_jacobian(camera, pixels):
    """d(pixel with field) / d(pixel without), (..., 2, 2)."""
    out = np.broadcast_to(np.eye(2), (*pixels.shape[:-1], 2, 2)).copy()
    field = camera.get("field")
    for ax, ay, kx, ky, phase in field["waves"] if field else ():
        slope = np.cos(kx * pixels[..., 0] + ky * pixels[..., 1] + phase)
        out += slope[..., None, None] * np.outer([ax, ay], [kx, ky])
    for ax, ay, x0, y0, size in field["bumps"] if field else ():
        away = pixels - np.array([x0, y0])
        bump = np.exp(-(away**2).sum(axis=-1) / (2 * size**2)) / size**2
        out -= bump[..., None, None] * np.array([ax, ay])[:, None] * away[..., None, :]
    return out


def bend(camera, points):
    """x, y on the plane z = 1 after distortion, (..., 2); nan behind the camera."""
    if camera["model"] == "fisheye":
        d = camera["distortion"]
        r = np.hypot(points[..., 0], points[..., 1])
        theta = np.arctan2(r, points[..., 2])
        q = theta**2
        bent = theta * (1 + q * (d[0] + q * (d[1] + q * (d[2] + q * d[3]))))
        # bent / r -> 1 / z on the axis.
        scale = np.where(r > 1e-12, bent / np.maximum(r, 1e-12), 1 / np.maximum(points[..., 2], 1e-12))
        return points[..., :2] * scale[..., None]
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = coefficients(camera)
    depth = np.where(points[..., 2] > 1e-6, points[..., 2], np.nan)
    u, v = points[..., 0] / depth, points[..., 1] / depth
    q = u * u + v * v
    g = (1 + q * (k1 + q * (k2 + q * k3)))
    if k4 or k5 or k6:
        g = g / (1 + q * (k4 + q * (k5 + q * k6)))
    x = u * (g + 2 * p1 * v + 2 * p2 * u) + p2 * q
    y = v * (g + 2 * p2 * u + 2 * p1 * v) + p1 * q
    if s1 or s2 or s3 or s4:
        x = x + q * (s1 + q * s2)
        y = y + q * (s3 + q * s4)
    return np.stack([x, y], axis=-1)


def project(camera, points):
    """Pixels of points (..., 3) in the camera frame; nan behind the camera."""
    pixels = bend(camera, points)
    pixels *= [camera["fx"], camera["fy"]]
    pixels += [camera["cx"], camera["cy"]]
    return pixels + field_shift(camera, pixels) if camera.get("field") else pixels


def _bend_jacobian_fisheye(camera, points):
    d = camera["distortion"]
    x, y, z = np.moveaxis(points, -1, 0)
    r2 = x * x + y * y
    r, norm2 = np.sqrt(np.maximum(r2, 1e-24)), r2 + z * z
    theta = np.arctan2(r, z)
    q = theta**2
    bent = theta * (1 + q * (d[0] + q * (d[1] + q * (d[2] + q * d[3]))))
    slope = 1 + q * (3 * d[0] + q * (5 * d[1] + q * (7 * d[2] + q * 9 * d[3])))
    scale = bent / r
    ds = np.stack([(slope * z / norm2 - scale) * x / r2, (slope * z / norm2 - scale) * y / r2,
                   -slope / norm2], axis=-1)
    ds[..., :2] = np.where(r2[..., None] > 1e-18, ds[..., :2], 0)
    by_point = points[..., :2, None] * ds[..., None, :]
    by_point[..., 0, 0] += scale
    by_point[..., 1, 1] += scale
    powers = np.stack([theta * q**i for i in range(1, 5)], axis=-1)
    by_lens = (points[..., :2] / r[..., None])[..., None] * powers[..., None, :]
    return by_point, by_lens


def _bend_jacobian(camera, points):
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = coefficients(camera)
    z = points[..., 2]
    u, v = points[..., 0] / z, points[..., 1] / z
    q = u * u + v * v
    num, den = 1 + q * (k1 + q * (k2 + q * k3)), 1 + q * (k4 + q * (k5 + q * k6))
    g = num / den
    dg = (k1 + q * (2 * k2 + q * 3 * k3) - g * (k4 + q * (2 * k5 + q * 3 * k6))) / den
    sx, sy = 2 * (s1 + 2 * s2 * q), 2 * (s3 + 2 * s4 * q)
    cross = 2 * (u * v * dg + p1 * u + p2 * v)
    du = np.stack([g + 2 * u * u * dg + 2 * p1 * v + 6 * p2 * u + sx * u, cross + sy * u], axis=-1)
    dv = np.stack([cross + sx * v, g + 2 * v * v * dg + 6 * p1 * v + 2 * p2 * u + sy * v], axis=-1)
    by_point = np.stack([du, dv, -(du * u[..., None] + dv * v[..., None])], axis=-1) / z[..., None, None]
    o = np.zeros_like(u)
    ahead = np.stack([u, v], axis=-1)
    radial = [ahead * (q**i / den)[..., None] for i in (1, 2, 3)]
    below = [-ahead * (g * q**i / den)[..., None] for i in (1, 2, 3)]
    columns = [radial[0], radial[1], np.stack([2 * u * v, q + 2 * v * v], axis=-1),
               np.stack([q + 2 * u * u, 2 * u * v], axis=-1), radial[2], *below,
               np.stack([q, o], axis=-1), np.stack([q * q, o], axis=-1),
               np.stack([o, q], axis=-1), np.stack([o, q * q], axis=-1)]
    return by_point, np.stack(columns[:COEFFICIENTS[camera["model"]]], axis=-1)


def jacobians(camera, points):
    """Derivatives of `project`: by the point (..., 2, 3), and by fx fy cx cy and the coefficients."""
    by_point, by_bend = (_bend_jacobian_fisheye if camera["model"] == "fisheye" else _bend_jacobian)(
        camera, points)
    bent = bend(camera, points)
    focal = np.array([camera["fx"], camera["fy"]])
    by_lens = np.zeros((*points.shape[:-1], 2, 4 + by_bend.shape[-1]))
    by_lens[..., 0, 0], by_lens[..., 1, 1] = bent[..., 0], bent[..., 1]
    by_lens[..., 0, 2] = by_lens[..., 1, 3] = 1
    by_lens[..., 4:] = focal[:, None] * by_bend
    by_point = focal[:, None] * by_point
    if camera.get("field"):
        outer = field_jacobian(camera, bent * focal + [camera["cx"], camera["cy"]])
        return outer @ by_point, outer @ by_lens
    return by_point, by_lens


def unproject(camera, pixels, steps=60):
    """Unit rays (n, 3) of pixels (n, 2), by damped Newton on the ray's two angles; nan where it fails."""
    start = (pixels - [camera["cx"], camera["cy"]]) / [camera["fx"], camera["fy"]]
    radius = np.linalg.norm(start, axis=-1, keepdims=True)
    if camera["model"] == "fisheye":
        rays = np.concatenate([start / np.maximum(radius, 1e-12) * np.sin(radius), np.cos(radius)], axis=-1)
    else:
        rays = np.concatenate([start, np.ones_like(radius)], axis=-1)
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    for _ in range(steps):
        miss = pixels - project(camera, rays)
        if np.nanmax(np.abs(miss)) < 1e-10:
            break
        side = np.cross(rays, np.where(np.abs(rays[:, :1]) < 0.7, [1.0, 0, 0], [0, 1.0, 0]))
        side /= np.linalg.norm(side, axis=-1, keepdims=True)
        basis = np.stack([side, np.cross(rays, side)], axis=-1)
        step = np.linalg.solve(jacobians(camera, rays)[0] @ basis, miss[..., None])
        length = np.linalg.norm(step, axis=1, keepdims=True)
        step *= np.minimum(1, 0.2 / np.maximum(length, 1e-12))
        rays = rays + (basis @ step)[..., 0]
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    good = np.linalg.norm(pixels - project(camera, rays), axis=-1) < 1e-7
    return np.where(good[:, None], rays, np.nan)


def make_field(camera_size, rng, amplitude=0.7):
    """Two low waves and two bumps, whose peaks add up to about `amplitude` px in x and in y."""
    width, height = camera_size
    waves, bumps = [], []
    for _ in range(2):
        angle, length = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 0.9) * width
        k = 2 * np.pi / length * np.array([np.cos(angle), np.sin(angle)])
        a = amplitude / 2 * rng.choice([-1, 1], 2) * rng.uniform(0.7, 1.0, 2)
        waves.append([*map(float, (*a, *k, rng.uniform(0, 2 * np.pi)))])
    for _ in range(2):
        a = amplitude / 2 * rng.choice([-1, 1], 2) * rng.uniform(0.7, 1.0, 2)
        at = rng.uniform(0.2, 0.8, 2) * [width, height]
        bumps.append([*map(float, (*a, *at, rng.uniform(0.1, 0.15) * width))])
    return {"waves": waves, "bumps": bumps}
