"""Pictures without a target, of what a detector of circles and triangles may take for one."""
import numpy as np


def smooth(image, sigma):
    reach = int(4 * sigma) + 1
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    image = np.pad(image, reach, mode="edge")
    image = np.apply_along_axis(np.convolve, 0, image, kernel, "valid")
    return np.apply_along_axis(np.convolve, 1, image, kernel, "valid")


def paint_ellipse(image, x, y, major, minor, turn, level):
    reach = int(major) + 2
    low_y, low_x = max(0, int(y) - reach), max(0, int(x) - reach)
    part = image[low_y:int(y) + reach, low_x:int(x) + reach]
    yy, xx = np.mgrid[low_y:low_y + part.shape[0], low_x:low_x + part.shape[1]]
    u = (xx - x) * np.cos(turn) + (yy - y) * np.sin(turn)
    v = (yy - y) * np.cos(turn) - (xx - x) * np.sin(turn)
    part[(u / major) ** 2 + (v / minor) ** 2 < 1] = level


def paint_triangle(image, corners, level):
    low = np.maximum(np.floor(corners.min(0)).astype(int), 0)
    high = np.ceil(corners.max(0)).astype(int) + 1
    part = image[low[1]:high[1], low[0]:high[0]]
    yy, xx = np.mgrid[low[1]:low[1] + part.shape[0], low[0]:low[0] + part.shape[1]]
    sides = [(b[0] - a[0]) * (yy - a[1]) - (b[1] - a[1]) * (xx - a[0])
             for a, b in zip(corners, np.roll(corners, -1, 0))]
    part[(np.min(sides, 0) >= 0) | (np.max(sides, 0) <= 0)] = level


def clouds(rng, height, width):
    """1/f noise as of natural scenes, in part cut off hard."""
    fy, fx = np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None]
    power = 1 / np.maximum(np.hypot(fx, fy), 1 / width) ** rng.uniform(1.0, 1.6)
    image = np.fft.irfft2(power * np.exp(2j * np.pi * rng.random(power.shape)), (height, width))
    image /= image.std()
    steps = np.clip(0.5 + 0.5 * np.sign(image), 0, 1)
    share = rng.uniform(0, 1)
    return np.clip(share * steps + (1 - share) * (0.5 + 0.25 * image), 0, 1)


def discs(rng, height, width):
    image = np.full((height, width), 0.5)
    for _ in range(height * width // 700):
        major = rng.uniform(3, 40)
        paint_ellipse(image, rng.uniform(0, width), rng.uniform(0, height), major,
                      major * rng.uniform(0.5, 1), rng.uniform(0, np.pi), rng.random())
    return image


def circle_grid(rng, height, width):
    """Discs of two sizes on a lattice, black on white and white on black."""
    image = np.ones((height, width))
    pitch = rng.uniform(22, 45)
    image[:, width // 2:] = 0
    for row in range(int(height / pitch) + 1):
        for column in range(int(width / pitch) + 1):
            x, y = (column + 0.5 * (row & 1)) * pitch, row * pitch
            large = rng.random() < 0.1
            radius = pitch * (0.4 if large else 0.2)
            paint_ellipse(image, x, y, radius, radius, 0, float(x > width // 2))
    return image


def rings_and_triangles(rng, height, width):
    """The target's own parts, at places and in sizes of chance."""
    image = np.full((height, width), 0.5)
    for _ in range(height * width // 1500):
        centre = np.array([rng.uniform(0, width), rng.uniform(0, height)])
        side, turn = rng.uniform(10, 70), rng.uniform(0, 2 * np.pi)
        shape = np.array([[-0.5, -0.207], [0.5, -0.207], [0, 0.293]]) * side
        spin = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        black = rng.random() < 0.5
        paint_triangle(image, shape @ spin + centre, 0.0 if black else 1.0)
        paint_ellipse(image, *centre, 0.104 * side, 0.104 * side, 0, 0.85 if black else 0.15)
    return image


def checks(rng, height, width):
    """A chessboard with discs in its fields."""
    yy, xx = np.mgrid[0:height, 0:width]
    turn, pitch = rng.uniform(0, np.pi), rng.uniform(30, 80)
    u = (xx * np.cos(turn) + yy * np.sin(turn)) / pitch
    v = (yy * np.cos(turn) - xx * np.sin(turn)) / pitch
    field = (np.floor(u) + np.floor(v)) % 2
    near = np.hypot(u - np.floor(u) - 0.5, v - np.floor(v) - 0.5)
    radius = np.where((np.floor(u) + 2 * np.floor(v)) % 5 == 0, 0.4, 0.2)
    return np.where(near < radius, 1 - field, field)


KINDS = {"clouds": clouds, "discs": discs, "circle grid": circle_grid,
         "rings and triangles": rings_and_triangles, "checks": checks}


def write(path, kind, camera, seed):
    """An 8-bit PGM of that kind with the camera's blur, levels and noise."""
    rng = np.random.default_rng(seed)
    image = KINDS[kind](rng, camera["height"], camera["width"])
    image = smooth(image, camera["psf_sigma_px"])
    image = camera["black"] + (camera["white"] - camera["black"]) * image
    image += rng.normal(0, camera["noise"], image.shape)
    grey = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    with open(path, "wb") as file:
        file.write(f"P5\n{camera['width']} {camera['height']}\n255\n".encode())
        file.write(grey.tobytes())
