#!/usr/bin/env python3
"""Time and memory of tessera-rig solve beside mrcal and OpenCV on the same simulated observations, in
interleaved runs on one thread, and its growth with the number of observations. `make solver-bench` calls it;
`make peers` installs the others, which are left out where they are missing.
"""
import argparse
import importlib.util
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import peer_scene
from solver_run import ROOT, rig_program, run, say, solve

import truth_folder
import truth_scenes
import truth_score

FOLDER = Path(__file__).resolve().parent
SCENES = {"paper": ("paper", {}), "paper, 2 % outliers": ("paper", {"outliers": 0.02}), "ring": ("ring", {}),
          "room": ("room", {})}
# Frames of the paper's rig: 4,032 residuals each, so some 1e4, 1e5, 1e6 and 1e7 of them. Corners; then circles.
GROWTH = (4, 25, 250, 2500)
# Where tools/setup/mrcal.sh puts it, with a Python of its own.
MRCAL_NEW = ROOT / "build" / "deps" / "mrcal"
# The unknowns that the others solve for: Brown's lens, boards flat.
OURS = ("--model", "brown", "--flat")

INTRODUCTION = """\
# How fast the solver is

Written by `make solver-speed`; not to be edited. Simulated points with noise 0.05 px (`tests/truth/truth_scenes.py`),
all programs on the same ones, interleaved, on one thread but for `tessera-rig` (all cores; seconds of the processor
count, so that it gains nothing by them), which is told what the others hold as well: `tessera-rig solve --model brown --flat`.

- *solving*: seconds of the processor that a program says its solving took, without reading and writing files
  (`tessera-rig`'s from the observations to the covariance; mrcal's and OpenCV's without covariance); all of
  `mrcal-calibrate-cameras`'s. *over ours*: that over `tessera-rig`'s, the ratio to go by on any machine.
- *peak MB*: of memory. *px*, *mm*: errors of projection over a grid in the image and of the cameras' places.
- *started near*: with lenses, cameras and boards of the truth, off by 1 %, half a degree and 10 mm, as a favour;
  `tessera-rig` and the others start from the observations.

"""


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", metavar="REGEX", default="^paper|^growth",
                        help=f"of {', '.join(SCENES).replace('%', '%%')}, growth (default: the paper's rig and growth)")
    parser.add_argument("--programs", metavar="REGEX", default="", help="of tessera, opencv, mrcal")
    parser.add_argument("--rounds", type=int, default=2, help="runs of each; the fastest counts")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--frames", type=int, help="instead of the rig's own number")
    parser.add_argument("--residuals", type=float, default=1e7, help="end of the growth (default 1e7)")
    parser.add_argument("--option", action="append", default=[], help="further option for tessera-rig solve")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="write solver_speed.md there")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "solver_bench")
    return parser.parse_args()


def write_corners(path, scene):
    """What mrcal-calibrate-cameras takes for the corners found in images."""
    with open(path, "w") as file:
        file.write("# filename x y level\n")
        for (frame, camera), view in zip(scene["indices"].tolist(), scene["observations"]):
            image = f"cam{camera}-{frame:05d}.jpg"
            file.writelines(f"{image} {x:.6f} {y:.6f} 0\n" if weight > 0 else f"{image} - - -\n"
                            for x, y, weight in view.reshape(-1, 3).tolist())


def mrcal_tool(work):
    """The command line of mrcal's own calibration tool for the saved scene."""
    scene = peer_scene.load(work / "scene.npz")
    write_corners(work / "corners.vnl", scene)
    (work / "mrcal").mkdir(exist_ok=True)
    rows, columns = scene["observations"].shape[1:3]
    return ["mrcal-calibrate-cameras", "--corners-cache", work / "corners.vnl", "--lensmodel",
            "LENSMODEL_OPENCV5", "--focal", float(scene["start_lenses"][0, 0]), "--imagersize",
            *scene["sizes"][0].tolist(), "--object-spacing", float(scene["spacing"]), "--object-width-n", columns,
            "--object-height-n", rows, "--skip-calobject-warp-solve", "--outdir", work / "mrcal",
            *[f"cam{i}-*.jpg" for i in range(len(scene["sizes"]))]]


def mrcal_solvers():
    """Name -> its Python, newest first; empty where none is installed."""
    found = {}
    if (MRCAL_NEW / "complete").exists():
        found["mrcal 2.5"] = str(MRCAL_NEW / "bin" / "python")
    if importlib.util.find_spec("mrcal"):
        version = subprocess.run(["dpkg-query", "-W", "-f", "${Version}", "python3-mrcal"], capture_output=True,
                                 text=True, check=False).stdout.split("-")[0]
        found[f"mrcal {version}".strip()] = sys.executable
    return found


def commands(work, cameras, options):
    """Name -> command, and where its rig is written (None where that is not read)."""
    scene, result = work / "scene.npz", work / "peer"
    found = {"tessera-rig solve": ([rig_program(), "solve", work / "scene", "--out", work / "tessera", *OURS,
                                    *options.option], work / "tessera" / "rig.json")}
    if cameras == 2 and importlib.util.find_spec("cv2"):
        found["OpenCV, two stages"] = ([sys.executable, FOLDER / "peer_opencv.py", scene, f"{result}-cv.json"],
                                       Path(f"{result}-cv.json"))
    if cameras == 2 and shutil.which("mrcal-calibrate-cameras"):  # hours for a room
        found["mrcal-calibrate-cameras"] = (mrcal_tool(work), None)
    for number, (name, python) in enumerate(mrcal_solvers().items()):
        for way, words in (("seed", "solver alone"), ("near", "solver alone, started near")):
            path = Path(f"{result}-{way}-{number}.json")
            found[f"{name}, {words}"] = ([python, FOLDER / "peer_mrcal.py", scene, path, way], path)
    return {name: value for name, value in found.items() if re.search(options.programs, name)}


def judged(scene, path):
    """Errors in px and mm, and the seconds that a program says its solving took."""
    rig = truth_score.RigFile(path, rig_program())
    return (truth_score.projection_error_of_all(scene, rig), truth_score.pose_error_of_all(scene, rig)[0],
            rig.content.get("solve_s"))


def race(name, options):
    kind, more = SCENES[name]
    scene = truth_scenes.make(kind, options.seed, radius=0.0, frames=options.frames, **more)
    truth_folder.write_folder(options.work / "scene", scene, sigma=False)
    peer_scene.save(options.work / "scene.npz", scene)
    entries = commands(options.work, len(scene.cameras), options)
    best, errors = {}, {}
    for number in range(options.rounds):
        for program, (command, path) in entries.items():
            done = run(command, timeout=7200)
            say(f"    round {number + 1}, {program}: {done.cpu_s:.2f} s of the processor, "
                f"{done.wall_s:.2f} on the wall")
            if done.status:
                say(f"    {program} failed: {done.complaint}")
                continue
            before = best.get(program, (float("inf"),) * 3)
            solving = done.cpu_s
            if path:
                *errors[program], said = judged(scene, path)
                told = re.search(r"solved in ([0-9.]+) s of the processor", done.stderr)
                solving = said or (float(told[1]) if told else done.cpu_s)
            best[program] = (min(before[0], done.cpu_s), min(before[1], solving), done.peak_mb)
    ours = best.get("tessera-rig solve", (float("nan"),) * 3)[1]
    lines = [f"{name}: {len(scene.camera)} observations, {len(scene.cameras)} cameras, {len(scene.poses[0])} frames; "
             f"best of {options.rounds}", "",
             f"| {'program':42} | {'CPU s':>8} | {'solving':>8} | {'over ours':>9} | {'peak MB':>8} | {'px':>9} | "
             f"{'mm':>9} |",
             "|---|--:|--:|--:|--:|--:|--:|"]
    for program, (cpu, solving, peak) in best.items():
        px, mm = (f"{error:9.5f}" for error in errors[program]) if program in errors else ("        -",) * 2
        lines.append(f"| {program:42} | {cpu:8.2f} | {solving:8.2f} | {solving / ours:9.2f} | {peak:8.0f} | "
                     f"{px} | {mm} |")
    return lines


def took(options, name, scene, lines):
    """A line of the growth's table."""
    truth_folder.write_folder(options.work / "scene", scene, sigma=False)
    residuals = 2 * len(scene.camera)
    scene.exact = scene.pixels = scene.outlier = None  # gigabytes of them
    runs = [solve(options.work / "scene", options.work / "tessera", [*OURS, *options.option])
            for _ in range(options.rounds if residuals < 1e6 else 1)]
    if any(done.status for done in runs):
        lines.append(f"| {name} | {residuals} | refused: {runs[-1].complaint} | | |")
    else:
        cpu = min(done.cpu_s for done in runs)
        lines.append(f"| {name:28} | {residuals:10} | {cpu:8.2f} | {1e6 * cpu / residuals:14.2f} | "
                     f"{runs[-1].peak_mb:8.0f} |")
    say(lines[-1])


def grow(options):
    lines = [f"growth: tessera-rig solve {' '.join([*OURS, *options.option])}", "",
             f"| {'':28} | {'residuals':>10} | {'CPU s':>8} | {'us a residual':>14} | {'peak MB':>8} |",
             "|---|--:|--:|--:|--:|"]
    for frames in GROWTH:
        if frames * 4032 <= 1.1 * options.residuals:
            took(options, f"paper's rig, {frames} frames",
                 truth_scenes.make("paper", options.seed, radius=0.0, frames=frames), lines)
    if options.residuals >= 1e7:
        took(options, "room of 16 cameras, circles", truth_scenes.make("room", options.seed), lines)
    return lines


def main():
    options = arguments()
    options.work.mkdir(parents=True, exist_ok=True)
    if not mrcal_solvers():
        say("mrcal is not installed (make peers); its lines are left out")
    text = ""

    def show(lines):
        nonlocal text
        text += "\n".join(lines) + "\n\n"
        print("\n".join(lines) + "\n", flush=True)
    try:
        for name in [name for name in SCENES if re.search(options.only, name)]:
            say(name)
            show(race(name, options))
        if re.search(options.only, "growth"):
            show(grow(options))
        if options.out:
            (options.out / "solver_speed.md").write_text(INTRODUCTION + text.rstrip("\n") + "\n")
    except (OSError, RuntimeError, json.JSONDecodeError) as error:
        print(f"solver_bench: {error}", file=sys.stderr)
        return 1
    shutil.rmtree(options.work / "scene", ignore_errors=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
