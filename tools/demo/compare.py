#!/usr/bin/env python3
"""How far a demonstration's result is from the truth that was rendered.

Prints each figure beside what it has to reach; exits 1 when one does not.
"""
import argparse
import collections
import csv
import json
import math
import os
import sys

PIXELS_APART = 0.5  # a named feature farther than this from its truth is another circle


def read_truth(recording, cameras):
    """Circle places by (camera, frame's time, patch, feature) -> (x, y, visible)."""
    truth = {}
    for camera in cameras:
        folder = os.path.join(recording, camera)
        with open(os.path.join(folder, "times.csv"), encoding="utf-8", newline="") as file:
            times = {row["file"]: int(row["t_ns"]) for row in csv.DictReader(file)}
        with open(os.path.join(folder, "truth.csv"), encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                # V4L2 carries capture times in whole microseconds.
                key = (camera, times[row["file"]] // 1000, int(row["patch"]), int(row["feature"]))
                truth[key] = (float(row["x"]), float(row["y"]), row["visible"] == "1")
    return truth


def read_found(path):
    found = {}
    with open(path, encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            key = (row["camera"], int(row["t_ns"]) // 1000, int(row["patch"]),
                   int(row["feature"]))
            found[key] = (float(row["x"]), float(row["y"]), float(row["sigma"]))
    return found


def compare_features(truth, found):
    """Share of visible patches found whole, wrong ids, RMS distance, RMS of error over sigma."""
    patches = collections.defaultdict(list)
    for key, (_, _, visible) in truth.items():
        patches[key[:3]].append((key, visible))
    # A patch counts as visible when all its circles are in the image and visible.
    most = max(len(circles) for circles in patches.values())
    whole = [circles for circles in patches.values()
             if len(circles) == most and all(visible for _, visible in circles)]
    complete = sum(all(key in found for key, _ in circles) for circles in whole)
    wrong = 0
    squares = whitened = 0.0
    good = 0
    for key, (x, y, sigma) in found.items():
        if key not in truth:
            wrong += 1
            continue
        square = (x - truth[key][0]) ** 2 + (y - truth[key][1]) ** 2
        if square > PIXELS_APART ** 2:
            wrong += 1
            continue
        good += 1
        squares += square
        whitened += square / sigma ** 2 / 2
    return complete, len(whole), wrong, math.sqrt(squares / good), math.sqrt(whitened / good)


def transpose(r):
    return [r[3 * j + i] for i in range(3) for j in range(3)]


def multiply(a, b):
    return [sum(a[3 * i + k] * b[3 * k + j] for k in range(3)) for i in range(3) for j in range(3)]


def centre(pose):
    """Where a camera stands: -R' t."""
    r, t = pose["rotation"], pose["translation_mm"]
    return [-sum(r[3 * k + i] * t[k] for k in range(3)) for i in range(3)]


def angle_deg(a, b):
    d = multiply(a, transpose(b))
    # The sine from the antisymmetric part is exact for small angles, where the cosine is blind.
    sine = math.sqrt((d[7] - d[5]) ** 2 + (d[2] - d[6]) ** 2 + (d[3] - d[1]) ** 2) / 2
    return math.degrees(math.atan2(sine, (d[0] + d[4] + d[8] - 1) / 2))


def compare_rigs(truth, result):
    """Worst position (mm), rotation (degrees) and focal length (%) over the cameras."""
    by_name = {camera["name"]: camera for camera in truth["cameras"]}
    position = rotation = focal = 0.0
    for camera in result["cameras"]:
        true = by_name[camera["name"]]
        mine, other = camera["cam_from_rig"], true["cam_from_rig"]
        position = max(position, math.dist(centre(mine), centre(other)))
        rotation = max(rotation, angle_deg(mine["rotation"], other["rotation"]))
        for key in ("fx", "fy"):
            focal = max(focal, 100 * abs(camera[key] / true[key] - 1))
    return position, rotation, focal


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--recording", required=True)
    parser.add_argument("--features", required=True)
    parser.add_argument("--result", required=True)
    options = parser.parse_args()
    with open(os.path.join(options.recording, "truth.json"), encoding="utf-8") as file:
        truth = json.load(file)
    with open(os.path.join(options.result, "rig.json"), encoding="utf-8") as file:
        result = json.load(file)
    cameras = [camera["name"] for camera in truth["cameras"]]
    if sorted(camera["name"] for camera in result["cameras"]) != sorted(cameras):
        sys.exit("the result does not have the cameras of the recording")

    complete, whole, wrong, rms, whitened = compare_features(
        read_truth(options.recording, cameras), read_found(options.features))
    position, rotation, focal = compare_rigs(truth, result)

    rows = [
        ("visible patches found with every feature", 100 * complete / whole, "%", ">=", 95.0),
        ("wrong ids", wrong, "", "<=", 0),
        ("reprojection RMSE, all points", result["rmse_all_px"], "px", "<=", 0.05),
        ("relative camera position, worst", position, "mm", "<=", 0.2),
        ("relative camera rotation, worst", rotation, "deg", "<=", 0.01),
        ("focal length, worst", focal, "%", "<=", 0.05),
    ]
    print(f"{'':44}{'measured':>12}  {'to reach':>10}")
    missed = 0
    for name, value, unit, relation, limit in rows:
        reached = value >= limit if relation == ">=" else value <= limit
        missed += not reached
        print(f"  {name:42}{value:12.5g} {unit:4}{relation} {limit:<8g}"
              f"{'ok' if reached else 'MISSED'}")
    print(f"  {'feature error against the truth, RMS':42}{rms:12.5g} px")
    print(f"  {'feature error over its own sigma, RMS':42}{whitened:12.5g}")
    print(f"  ({complete} of {whole} wholly visible patches)")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
