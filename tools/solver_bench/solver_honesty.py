#!/usr/bin/env python3
"""Repeated sampling: are the errors of tessera-rig solve as large as its rig.json says?

Solves many draws of a small rig and prints, for parameters, projection and relative pose, the root mean
square of error over claimed standard deviation, which is 1 for honest claims, with its statistical width;
beside it the same of the reference solution, which shows the instrument's own. `make solver-honesty`.
"""
import argparse
import math
import sys
from pathlib import Path

import numpy as np
from solver_run import ROOT, rig_program, say, solve

import truth_folder
import truth_honesty
import truth_reference
import truth_scenes
import truth_score

LOW, HIGH = 0.9, 1.1


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rig", choices=truth_scenes.RIGS, default="small")
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--first-seed", type=int, default=201)
    parser.add_argument("--model", choices=truth_scenes.LENSES, default="brown")
    parser.add_argument("--surface", choices=truth_scenes.SURFACES, default="flat")
    parser.add_argument("--outliers", type=float, default=0.0)
    parser.add_argument("--noise", type=float, default=0.05)
    parser.add_argument("--sigma", action="store_true", help="tell the solver the noise")
    parser.add_argument("--option", action="append", default=[], help="further option for tessera-rig solve")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "solver_honesty")
    return parser.parse_args()


def sample(options, seed):
    """Mean squares of one draw: ours (None where refused) and the reference's."""
    scene = truth_scenes.make(options.rig, seed, options.noise, options.model, options.surface,
                              options.outliers)
    truth_folder.write_folder(options.work / "scene", scene, options.sigma)
    surface = "known" if options.surface == "flat" else "free"
    reference = truth_honesty.normalised(scene, truth_honesty.ReferenceClaims(
        truth_reference.solve(scene, surface)))
    done = solve(options.work / "scene", options.work / "result", ["--model", options.model, *options.option])
    if done.status:
        say(f"seed {seed} refused: {done.complaint}")
        return None, reference
    rig = truth_score.RigFile(options.work / "result" / "rig.json", rig_program())
    return truth_honesty.normalised(scene, truth_honesty.Claims(rig)), reference


def spread(draws, kind):
    """Root of (mean square over expected), and its standard deviation from the scatter of the draws."""
    pairs = np.array([draw[kind] for draw in draws])
    ratio = pairs[:, 0].sum() / pairs[:, 1].sum()
    each = (pairs[:, 0] - ratio * pairs[:, 1]) / pairs[:, 1].mean()
    width = each.std(ddof=1) / math.sqrt(len(pairs)) if len(pairs) > 1 else math.inf
    return math.sqrt(ratio), width / (2 * math.sqrt(ratio))


def verdict(value, width):
    """`scatter`: outside the bounds, but within two widths of them."""
    if not math.isfinite(value):
        return "NO RAY"  # a lens that has none for a pixel of the image
    if LOW <= value <= HIGH:
        return "ok"
    return "scatter" if LOW - 2 * width <= value <= HIGH + 2 * width else "OVER" if value > HIGH else "UNDER"


def main():
    options = arguments()
    options.work.mkdir(parents=True, exist_ok=True)
    ours, reference, refused = [], [], 0
    try:
        for count in range(options.seeds):
            one, other = sample(options, options.first_seed + count)
            reference.append(other)
            refused += one is None
            if one is not None:
                ours.append(one)
            if (count + 1) % 5 == 0:
                say(f"{count + 1}/{options.seeds} draws")
    except (OSError, RuntimeError) as error:
        print(f"solver_honesty: {error}", file=sys.stderr)
        return 1
    print(f"{options.rig}, {options.model}, noise {options.noise} px: {len(ours)} draws, {refused} refused; "
          f"error over claimed standard deviation, {LOW} to {HIGH} required")
    print(f"{'':28} {'ours':>16} {'reference':>16}  verdict")
    bad = bool(refused)
    for kind in reference[0]:
        other = "{:.3f} +- {:.3f}".format(*spread(reference, kind))
        if ours and kind in ours[0]:
            value, width = spread(ours, kind)
            said = verdict(value, width)
            bad |= said.isupper()
            print(f"{kind:28} {f'{value:.3f} +- {width:.3f}':>16} {other:>16}  {said}")
        else:
            print(f"{kind:28} {'not claimed':>16} {other:>16}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
