#!/usr/bin/env python3
"""Renders the golden frames anew: tests/golden/make_frames.py BIN_FOLDER, from the tree's top.

They are committed; this says how they were made. The target follows the rule of golden_run.c. After a
change here run `make golden-accept`.
"""
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent / "frames"
TARGET = {
    "format": "tessera-target", "version": 1, "name": "golden", "rows": 16, "cols": 16, "patch_mm": 20,
    "ids": [[((r * 16 + c) * 2357 + 5) % 4096 for c in range(16)] for r in range(16)],
    "turns": [[(r * 16 + c) * 7 // 3 % 2 for c in range(16)] for r in range(16)],
}
VGA = {"width": 640, "height": 480, "fx": 620, "distortion": [-0.2, 0.06], "psf_sigma_px": 0.9, "noise": 1.5}
SMALL = {"width": 321, "height": 243, "fx": 300, "psf_sigma_px": 0.8, "noise": 1}
FRAMES = {  # name: camera, view, backdrop
    "tilted": (VGA, {"patch_px": 75, "turn_deg": 27, "tilt_deg": 35, "tilt_axis_deg": 60}),
    "small": (VGA, {"patch_px": 48, "turn_deg": -70, "tilt_deg": 20, "tilt_axis_deg": 10}),
    "edge_of_board": (dict(SMALL, background={"amplitude": 0.3, "clutter": 20}),
                      {"patch_px": 60, "turn_deg": 120, "shift_px": [150, -120]}),
    "twelve_bits": (dict(SMALL, bits=12, shading={"to": 0.3, "direction_deg": 30}),
                    {"patch_px": 70, "turn_deg": 5, "tilt_deg": 50, "tilt_axis_deg": 80}),
}


def main():
    render = Path(sys.argv[1]) / "tessera-render"
    for name, (camera, view) in FRAMES.items():
        with tempfile.TemporaryDirectory() as folder:
            work = Path(folder)
            (work / "target.json").write_text(json.dumps(TARGET))
            scene = {"format": "tessera-render-scene", "version": 1, "target": "target.json", "seed": 11,
                     "cameras": [dict(camera, name="cam0")], "path": {"kind": "views", "views": [view]}}
            (work / "scene.json").write_text(json.dumps(scene))
            subprocess.run([render, work / "scene.json", "--out", work / "out"], check=True)
            shutil.copy(work / "out/cam0/frame_00000.pgm", HERE / f"{name}.pgm")


main()
