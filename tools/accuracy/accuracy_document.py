"""Writes docs/accuracy.md and the paper's Figures 8 and 9 with our curve in them."""
import math
import os

from accuracy_chart import Chart

OURS, LIMIT, PAPER, PEER = "#0b5fa5", "#2e8b57", "#d2691e", "#808080"

# Mean errors in px of others on frames of the same kind (1080p, contrast 190, blur 1 px, noise 1),
# measured in November 2026: at turns of +-15 degrees, and at k = 0.1 and 0.33. Circle grid and ringgrid
# against the image of the circle's centre. None: nothing found.
PEERS = {
    "cornerSubPix (11)": (0.020, 0.018, 0.017),
    "libcbdetect": (0.008, 0.009, 0.009),
    "ChArUco (OpenCV 5)": (0.060, 0.054, 0.071),
    "AprilTag 3": (0.075, 0.061, 0.097),
    "locus-tag": (0.013, 0.020, 0.022),
    "circle grid (OpenCV)": (0.006, 0.037, None),
    "ringgrid": (0.035, 0.033, 0.035),
}
# The paper's words on its own figures: its target "around 0.01 pixels", the chessboard's corners "around
# 0.2 pixels at best", 0.15 where nothing is distorted.
PAPER_TARGET_PX = 0.01
PAPER_CORNERS_PX = (0.15, 0.2)

INTRODUCTION = """\
# How exact the detector is

Written by `make accuracy`; not to be edited. Every frame is rendered with known truth (`tessera-render`, whose own
error is below 0.0005 px); no frame of this table was used to tune the detector. `make accuracy
ACCURACY='--seed 7 --only tilt'` measures on other frames, `--faults FILE` lists what was missed or wrong.

- A centre is that of the ellipse which the circle's edge makes in the image. It is not the image of the
  circle's centre (0.03 to 0.1 px apart at 15 to 45 degrees of tilt).
- Where nothing else is said: 1920x1080, 8 bit, patch side 130 px (radii 6.7 and 13.5 px), contrast 190 grey
  levels, Gaussian blur 1 px, noise 1 grey level, turns of any angle.
- *>= 4 px*, *3 to 4 px*: circles in view by radius (geometric mean of the semi-axes): all whose circle, with
  half a radius around it, is in the image and not covered. Required of them: 99.5 % and 97 % found (judged
  from 30 circles on).
- *wrong ids*, *> 0.3 px*: none may be.
- *RMS*, *limit*, *ratio*: RMS distance from the truth, the Cramér-Rao limit of the same, one over the other,
  over circles in view whose semi-minor axis is 3 px or more. The limit counts the circle's edge alone; its
  Gaussian peak tells a little more, so a ratio may be just below 1. In bad light the ratio may be 6:
  three times the limit at half the contrast.
- *error / sigma*: RMS per axis of error over reported sigma, all features found. Required: 0.8 to 1.25.

"""

FIGURES = """
## The paper's Figures 8 and 9

![Mean error against the turn](accuracy_turn.svg)

![Mean error against k](accuracy_distortion.svg)

Means of the distance, as in the paper. *Paper*: its text, since the figures' points are not tabled. The
others were measured on frames of the same kind; circle grid and ringgrid against the image of the circle's
centre, which is what they mean to give.

"""


def curves(results, group):
    rows = [(row.at, score) for row, score in results if row.group == group and score.measured]
    ours = [(at, score.mean_px()) for at, score in rows]
    # Of a distance whose two components are equal and normal the mean is sqrt(pi) / 2 of the RMS.
    limit = [(at, math.sqrt(math.pi) / 2 * score.limit_px()) for at, score in rows]
    return ours, limit


def add_common(chart, ours, limit):
    chart.band("chessboard corners (paper)", *PAPER_CORNERS_PX, PAPER)
    chart.level("fractal target (paper)", PAPER_TARGET_PX, PAPER, 2)
    chart.curve("Cramér-Rao limit", limit, LIMIT, 1.5, "5 4")
    chart.curve("this detector", ours, OURS, 2.2, dots=3.2)


def turn_figure(results):
    ours, limit = curves(results, "turn (Figure 8)")
    ticks = [(t, f"{t}°") for t in range(-15, 16, 5)]
    chart = Chart("Error against the turn in the plane", "turn", (-16, 16), ticks, (0.001, 1))
    for name, (turned, _, _) in PEERS.items():
        chart.level(name, turned, PEER, 1, "2 3")
    add_common(chart, ours, limit)
    return chart.svg()


def distortion_figure(results):
    ours, limit = curves(results, "distortion k (Figure 9)")
    ticks = [(10.0 ** p, f"1e{p}") for p in range(-5, 0)] + [(0.33, "0.33")]
    chart = Chart("Error against radial distortion, k1 = k, k2 = k²", "k", (1e-5, 0.36), ticks,
                  (0.001, 1), x_log=True)
    for name, (_, tenth, third) in PEERS.items():
        points = [(k, value) for k, value in ((0.1, tenth), (0.33, third)) if value is not None]
        chart.curve(name, points, PEER, 1, "2 3", dots=2.5)
    add_common(chart, ours, limit)
    return chart.svg()


def points_table(results):
    lines = ["| turn | mean px | RMS px | | k | mean px | RMS px |", "|--:|--:|--:|---|--:|--:|--:|"]
    columns = [[[f"{row.at:g}", f"{score.mean_px():.4f}", f"{score.rms_px():.4f}"]
                for row, score in results if row.group == group and score.measured]
               for group in ("turn (Figure 8)", "distortion k (Figure 9)")]
    for i in range(max(map(len, columns))):
        left, right = (column[i] if i < len(column) else ["", "", ""] for column in columns)
        lines.append("| " + " | ".join([*left, "", *right]) + " |")
    return "\n".join(lines) + "\n"


def write_whole(path, content):
    """By renaming: a full disk leaves the old file as it was."""
    beside = path.with_name(path.name + ".new")
    beside.write_text(content, encoding="utf-8")
    os.replace(beside, path)


def write(folder, results, lines):
    write_whole(folder / "accuracy_turn.svg", turn_figure(results))
    write_whole(folder / "accuracy_distortion.svg", distortion_figure(results))
    write_whole(folder / "accuracy.md", INTRODUCTION + "\n".join(lines) + "\n" + FIGURES +
                points_table(results))
