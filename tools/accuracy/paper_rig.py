#!/usr/bin/env python3
"""Renders the paper's set-up, finds the target with tessera-detect, solves the rig, and judges the result by the
reprojection error over all points, the paper's own figure. `make paper-accuracy` calls it; --out keeps the table.
"""
import argparse
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
from accuracy_document import write_whole
from accuracy_score import Score, score
from paper_frames import PAPER, ROOT, SHORT, Frames

import truth_honesty
import truth_score

WHITENED = (0.8, 1.25)  # RMS of the residuals over their sigmas that is called honest

INTRODUCTION = """\
# The paper's experiment, from pixels to the rig

Written by `make paper-accuracy`; not to be edited. Frames are rendered as the paper's cameras took theirs (two
of 4096 x 3000 pixels with 12 mm lenses, 50 instants, the target on a screen of 65 inches; contrast 190 grey
levels, blur 0.9 px, noise 1.5 grey levels), the target is found by `tessera-detect`, and the rig is solved by
`tessera-rig solve` as it comes, without options. No frame of this table was used to tune either.

- *RMSE, all points*: root mean square length of the residuals of every point that the detector reported,
  rejected or not. Required: at most 0.008 px. *limit*: the Cramér-Rao limit of the same. The paper has 0.249
  (whole target) and 0.242 px (parts), and 0.059 and 0.062 over the best 98 points of a frame.
- *whitened*: RMS per axis of residual over sigma, left and right, as `summary.txt` gives it. Required: 0.8 to
  1.25.
- *detector*: RMS distance of its centres from the truth, and of that over sigma per axis.
- *projection*, *baseline*: error of the result against the truth: of projection over a grid in the image after
  the best rotation, and of the distance between the cameras; beside each, the error that the result itself
  expects.

"""


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true", help="few and small frames")
    parser.add_argument("--only", metavar="REGEX", default="", help=f"of {', '.join(s.name for s in PAPER)}")
    parser.add_argument("--seed", type=int, default=1, help="of target, rig, poses and noise")
    parser.add_argument("--keep", action="store_true", help="keep the frames (2.5 GB)")
    parser.add_argument("--split", action="store_true",
                        help="print residuals by size, tilt, place in the image and circle")
    parser.add_argument("--solve", metavar="OPTION", action="append", default=[],
                        help="further option for tessera-rig solve, e.g. --solve=--flat")
    parser.add_argument("--out", metavar="FOLDER", help="write paper_accuracy.md there")
    parser.add_argument("--work", metavar="FOLDER", default=ROOT / "build" / "paper", help="where files are kept")
    parser.add_argument("--jobs", type=int, default=1, help="threads of the renderer")
    return parser.parse_args()


def detector_score(frames):
    """Against the truth."""
    total = Score()
    rows_of = {}
    for c, _, row in frames.detections():
        rows_of.setdefault(c, []).append(row)
    for c, truth in enumerate(frames.true_rows()):
        total.add(score(truth, rows_of.get(c, []), frames.camera, frames.target, frames.setup.instants))
    return total


def baseline_mm(pose):
    return float(np.linalg.norm(pose[1]))


def solved(frames, bin_folder, options):
    """The result of tessera-rig solve on what the detector found."""
    observations, out = frames.found / "observations", frames.found / "result"
    frames.write_observations(observations)
    (out / "rig.json").unlink(missing_ok=True)
    run = subprocess.run([Path(bin_folder) / "tessera-rig", "solve", observations, "--out", out, *options],
                         capture_output=True, text=True)
    if run.returncode != 0:
        raise RuntimeError(f"tessera-rig solve failed: {run.stderr.strip().splitlines()[-1]}")
    return truth_score.RigFile(out / "rig.json", Path(bin_folder) / "tessera-rig")


def expected_baseline_mm(claims):
    """Standard deviation of |t| of the second camera, whose covariance is of shifts of it."""
    _, shift = claims.cam_from_rig(1)
    along = shift / np.linalg.norm(shift)
    return float(np.sqrt(along @ claims.covariance_of(1)[-3:, -3:] @ along))


def judge(frames, rig):
    """What the table says of one set-up."""
    claims = truth_honesty.Claims(rig)
    content, truth = rig.content, frames.truth
    points = sum(1 for _ in frames.detections())
    expected = np.sqrt(np.mean([truth_honesty.projection_expected(camera, claims.covariance_of(c))
                                for c, camera in enumerate(truth.cameras)]))
    whitened = [camera["whitened_rms"] for camera in rig.cameras]
    good = (content["rmse_all_px"] <= frames.setup.rmse_max_px
            and all(WHITENED[0] <= w <= WHITENED[1] for w in whitened)
            and content["observations"] + content["rejected"] == points)
    return {"points": points, "detector": detector_score(frames), "rmse": content["rmse_px"],
            "rmse all": content["rmse_all_px"], "rejected": content["rejected"], "whitened": whitened,
            "projection": truth_score.projection_error_of_all(truth, rig), "projection expected": expected,
            "baseline": baseline_mm(rig.cam_from_rig(1)) - baseline_mm(truth.cameras[1]["cam_from_rig"]),
            "baseline expected": expected_baseline_mm(claims), "good": bool(good)}


HEAD = ["set-up", "points a frame", "found of those in view", "detector px", "error / sigma",
        "RMSE, all points px", "limit", "required", "RMSE px", "rejected", "whitened", "projection px", "baseline mm", "verdict"]


def line(frames, found):
    setup, detector = frames.setup, found["detector"]
    share = sum(detector.found.values()) / sum(detector.visible.values())
    return [setup.name, f"{found['points'] / (2 * setup.instants):.1f}",
            f"{100 * share:.2f} %", f"{detector.rms_px():.5f}",
            f"{detector.honesty():.3f}", f"**{found['rmse all']:.5f}**", f"{detector.limit_px():.5f}",
            f"<= {setup.rmse_max_px:g}", f"{found['rmse']:.5f}", f"{found['rejected']}",
            ", ".join(f"{w:.3f}" for w in found["whitened"]),
            f"{found['projection']:.5f} ({found['projection expected']:.5f})",
            f"{found['baseline']:+.5f} ({found['baseline expected']:.5f})", "ok" if found["good"] else "**over**"]


def table(rows):
    return ["| " + " | ".join(HEAD) + " |", "|---|" + "--:|" * (len(HEAD) - 1),
            *("| " + " | ".join(cells) + " |" for cells in rows)]


def main():
    options = arguments()
    setups = [s for s in ([SHORT] if options.short else PAPER) if re.search(options.only, s.name)]
    if not setups:
        print("paper_rig: no set-up matches --only", file=sys.stderr)
        return 2
    if options.out and (options.short or options.only or options.seed != 1 or options.solve):
        print("paper_rig: --out is for the whole table with the default seed and no options", file=sys.stderr)
        return 2
    bin_folder = os.environ.get("TESSERA_BIN", ROOT / "build" / "bin")
    rows, good = [], True
    try:
        for setup in setups:
            frames = Frames(setup, options.seed, bin_folder, options.work, options.keep, options.jobs,
                            lambda text: print(text, file=sys.stderr, flush=True))
            frames.look_at_all()
            rig = solved(frames, bin_folder, options.solve)
            found = judge(frames, rig)
            rows.append(line(frames, found))
            good = good and found["good"]
            if options.split:
                import paper_split
                print("\n".join(paper_split.tables(frames, rig)))
    except (OSError, RuntimeError) as error:
        print(f"paper_rig: {error}", file=sys.stderr)
        return 1
    print("\n".join(table(rows)))
    if options.out:
        write_whole(Path(options.out) / "paper_accuracy.md", INTRODUCTION + "\n".join(table(rows)) + "\n")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
