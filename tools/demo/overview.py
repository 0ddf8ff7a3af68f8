#!/usr/bin/env python3
"""Draw docs/overview.png: one frame of the demonstration with what the detector found in it.

    overview.py FRAME.pgm FEATURES.csv OUT.png     (FEATURES.csv from tessera-detect)
"""
import csv
import sys

import cv2
import numpy

SCALE = 2  # drawn larger than the frame, then halved: smooth thin lines


def main():
    if len(sys.argv) != 4:
        print(__doc__)
        return 0 if sys.argv[1:] == ["--help"] else 2
    frame_path, csv_path, out_path = sys.argv[1:]
    grey = cv2.imread(frame_path, cv2.IMREAD_GRAYSCALE)
    picture = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
    picture = cv2.resize(picture, None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_LINEAR)
    with open(csv_path, encoding="utf-8", newline="") as file:
        features = list(csv.DictReader(file))
    for f in features:
        # OpenCV's drawing takes fixed point with 4 fractional bits; resizing keeps pixel centres.
        x, y = ((float(f[key]) + 0.5) * SCALE - 0.5 for key in ("x", "y"))
        axes = tuple(int(round(float(f[key]) * SCALE)) for key in ("major", "minor"))
        colour = (60, 200, 60) if f["polarity"] == "1" else (230, 130, 30)
        cv2.ellipse(picture, (int(round(x)), int(round(y))), axes, float(f["angle"]), 0, 360,
                    colour, 2 * SCALE, cv2.LINE_AA)
        if f["feature"] == "0":
            cv2.putText(picture, f["patch"], (int(x) + 14 * SCALE, int(y) + 5 * SCALE),
                        cv2.FONT_HERSHEY_SIMPLEX, 0.6 * SCALE, (40, 40, 230), 2 * SCALE,
                        cv2.LINE_AA)
    picture = cv2.resize(picture, (960, 540), interpolation=cv2.INTER_AREA)
    # A palette keeps the file small: grey levels and three colours.
    cv2.imwrite(out_path, picture, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(f"{out_path}: {len(features)} features, {numpy.prod(picture.shape[:2])} pixels")
    return 0


if __name__ == "__main__":
    sys.exit(main())
