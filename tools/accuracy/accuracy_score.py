"""Scores what was found against the truth, and against the Cramer-Rao limit.

The limit. A step edge of contrast C under Gaussian blur s, seen in pixels of noise m, tells the place of
its own normal with the information C^2 / (m^2 2 sqrt(pi) s) a pixel of its length. Summed over an ellipse
with edge normals n, the centre's information is that times the integral of n n' along the curve. Centre
and shape do not mix: the one is odd and the other even about the centre. For a circle of radius r the
standard deviation per axis is (m / C) sqrt(2 s / (sqrt(pi) r)).

s^2 = PSF^2 + 1/12 (the pixel's own width) and m^2 = noise^2 + 1/12 (rounding).
"""
import csv
import math
from dataclasses import dataclass, field

import numpy as np

from accuracy_conditions import FAR_OFF_PX

RATIO_MINOR_MIN_PX = 3.0  # smaller circles do not count in the ratio


def edge_share(target):
    """The step at a circle's edge over white minus black: 0.81 with the defaults."""
    level, sigma = target.get("edge_level", 0.8), target.get("gauss_sigma", 0.4)
    return level + (1 - level) * math.exp(-1 / (2 * sigma * sigma))


def centre_variance(major, minor, contrast, blur, noise):
    """The limit: variance of the centre along the major and along the minor axis, px^2. Arrays."""
    angle = (np.arange(64) + 0.5) * (2 * np.pi / 64)
    a, b = np.asarray(major)[:, None], np.asarray(minor)[:, None]
    speed = np.hypot(a * np.sin(angle), b * np.cos(angle))
    along_major = ((b * np.cos(angle)) ** 2 / speed).mean(1) * 2 * np.pi
    along_minor = ((a * np.sin(angle)) ** 2 / speed).mean(1) * 2 * np.pi
    information = contrast ** 2 / (noise ** 2 * 2 * math.sqrt(math.pi) * blur)
    return 1 / (information * along_major), 1 / (information * along_minor)


def limit_squared(rows, camera, target):
    """The limit of the squared distance for each truth row, px^2."""
    levels = 2 ** camera.get("bits", 8) - 1
    rounding = (255 / levels) ** 2 / 12
    variances = centre_variance(
        [row["major"] for row in rows], [row["minor"] for row in rows],
        edge_share(target) * (camera["white"] - camera["black"]),
        math.sqrt(camera["psf_sigma_px"] ** 2 + 1 / 12), math.sqrt(camera["noise"] ** 2 + rounding))
    return variances[0] + variances[1]


def read_rows(path):
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            yield {name: row[name] if name == "file" else float(row[name]) for name in row}


def key(row):
    return row["file"].rsplit("/", 1)[-1], int(row["patch"]), int(row["feature"])


@dataclass
class Score:
    """Sums over the frames of one row of the table."""
    frames: int = 0
    visible: dict = field(default_factory=lambda: {3: 0, 4: 0})  # 3: 3 to 4 px, 4: 4 px and more
    found: dict = field(default_factory=lambda: {3: 0, 4: 0})
    wrong_ids: int = 0
    far_off: int = 0
    worst_px: float = 0.0
    measured: int = 0          # features in the RMS and the ratio
    squared: float = 0.0       # sum of squared distances
    distance: float = 0.0      # sum of distances
    limit_squared: float = 0.0
    matched: int = 0           # features in the honesty
    normed: float = 0.0        # sum of squared distances over 2 sigma^2
    faults: list = field(default_factory=list)

    def add(self, other):
        for name, value in vars(other).items():
            own = getattr(self, name)
            if name == "worst_px":
                self.worst_px = max(own, value)
            elif isinstance(own, dict):
                setattr(self, name, {size: own[size] + value[size] for size in own})
            else:
                setattr(self, name, own + value)

    def found_share(self, size):
        return self.found[size] / self.visible[size] if self.visible[size] else None

    def rms_px(self):
        return math.sqrt(self.squared / self.measured) if self.measured else None

    def mean_px(self):
        return self.distance / self.measured if self.measured else None

    def limit_px(self):
        return math.sqrt(self.limit_squared / self.measured) if self.measured else None

    def ratio(self):
        return math.sqrt(self.squared / self.limit_squared) if self.measured else None

    def honesty(self):
        return math.sqrt(self.normed / self.matched) if self.matched else None


def score(truth_rows, found_rows, camera, target, frames):
    """One scene's Score. A circle found twice is a wrong id the second time; so is a centre that lies
    more than its circle's radius from where it should."""
    out = Score(frames=frames)
    truth = {key(row): row for row in truth_rows}
    limits = dict(zip(truth, limit_squared(list(truth.values()), camera, target))) if truth else {}
    seen = set()
    for row in found_rows:
        name = key(row)
        if name not in truth or name in seen:
            out.wrong_ids += 1
            out.faults.append(("wrong id", *name, row["x"], row["y"], 0.0, row["major"]))
            continue
        seen.add(name)
        own = truth[name]
        distance = math.hypot(row["x"] - own["x"], row["y"] - own["y"])
        if distance > own["major"]:
            out.wrong_ids += 1
            out.faults.append(("wrong id", *name, row["x"], row["y"], distance, own["major"]))
            continue
        if distance > FAR_OFF_PX:
            out.far_off += 1
            out.faults.append(("far off", *name, row["x"], row["y"], distance, own["major"]))
        out.worst_px = max(out.worst_px, distance)
        out.matched += 1
        out.normed += distance ** 2 / (2 * row["sigma"] ** 2)
        if own["visible"] == 1 and own["minor"] >= RATIO_MINOR_MIN_PX:
            out.measured += 1
            out.squared += distance ** 2
            out.distance += distance
            out.limit_squared += limits[name]
    for name, row in truth.items():
        size = math.sqrt(row["major"] * row["minor"])
        if row["visible"] != 1 or size < 3:
            continue
        bin_px = 4 if size >= 4 else 3
        out.visible[bin_px] += 1
        if name in seen:
            out.found[bin_px] += 1
        else:
            out.faults.append(("missed", *name, row["x"], row["y"], 0.0, row["major"]))
    return out


