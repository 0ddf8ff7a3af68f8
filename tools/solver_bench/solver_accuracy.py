#!/usr/bin/env python3
"""Measures tessera-rig solve on simulated observations against the joint maximum-likelihood solution.

Prints one table; with --out also writes it there. `make solver-accuracy` calls it.
"""
import argparse
import hashlib
import json
import re
import shutil
import sys
from pathlib import Path

import solver_rows
from solver_run import ROOT, rig_program, say, solve

import truth_folder
import truth_reference
import truth_score
import truth_shutter

# Seeds of the kept table. Whoever changes the solver looks at others.
FIRST_SEED, SEEDS = 101, 8
ERRORS = ("px", "data_px", "mm", "deg", "triangulation_mm")
JUDGED = ("px", "mm", "deg", "triangulation_mm")


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", metavar="REGEX", help="rows whose `rig: name` matches")
    parser.add_argument("--list", action="store_true", help="list the rows and end")
    parser.add_argument("--seeds", type=int, default=SEEDS, help=f"draws of each row (default {SEEDS})")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED,
                        help=f"default {FIRST_SEED}: tune the solver on others")
    parser.add_argument("--frames", type=int, help="board poses of each scene instead of the rig's own number")
    parser.add_argument("--option", action="append", default=[],
                        help="further option for tessera-rig solve, e.g. --option=--flat")
    parser.add_argument("--again", action="store_true",
                        help="measure rows again that this very tessera-rig has been measured on")
    parser.add_argument("--out", metavar="FOLDER", help="write solver_accuracy.md there")
    parser.add_argument("--work", metavar="FOLDER", type=Path, default=ROOT / "build" / "solver_accuracy")
    return parser.parse_args()


def errors_of(scene, row, estimate, judged):
    """`judged`: the cells of the grid of each camera that px is over."""
    data = [truth_score.cells_with_data(scene, c) for c in range(len(scene.cameras))]
    found = {"px": truth_score.projection_error_of_all(scene, estimate, judged),
             "data_px": truth_score.projection_error_of_all(scene, estimate, data)}
    found["mm"], found["deg"] = truth_score.pose_error_of_all(scene, estimate)
    if row.triangulates:
        found["triangulation_mm"] = truth_score.triangulation_error(scene, estimate)
    return found


def measure(row, seed, work, frames=None, more=()):
    """Errors of ours (None where nothing was written) and of the reference; a remark; which part of the
    image's cells px is not over, because the reference has no ray there."""
    scene = truth_shutter.make(row.rig, seed, frames=frames, **row.scene)
    truth_folder.write_folder(work / "scene", scene, sigma=False)
    optimum = truth_reference.solve(scene, "known")
    judged = [truth_score.cells_with_rays(scene, optimum, c) for c in range(len(scene.cameras))]
    reference = errors_of(scene, row, optimum, judged)
    left_out = 1 - float(sum(cells.mean() for cells in judged)) / len(judged)
    done = solve(work / "scene", work / "result", [*row.options, *more])
    if done.status:
        return None, reference, f"seed {seed}: {done.complaint}", left_out
    ours = errors_of(scene, row, truth_score.RigFile(work / "result" / "rig.json", rig_program()), judged)
    words = [f"{key} {ours[key]:.5f} / {reference[key]:.5f}" for key in ("px", "mm")]
    return ours, reference, ", ".join(words), left_out


def measure_row(row, options):
    """RMS over seeds of each error, ours and the reference's, and what failed."""
    ours, reference, failed, left_out = [], [], [], []
    for seed in range(options.first_seed, options.first_seed + options.seeds):
        one, other, remark, without = measure(row, seed, options.work, options.frames, options.option)
        say(f"    seed {seed}: {remark}")
        reference.append(other)
        left_out.append(without)
        if one is None:
            failed.append(remark)
        else:
            ours.append(one)
    present = [key for key in ERRORS if key in reference[0]]
    return {"ours": {k: truth_score.rms([e[k] for e in ours]) if ours else float("nan") for k in present},
            "reference": {k: truth_score.rms([e[k] for e in reference]) for k in present},
            "failed": failed, "seeds": options.seeds, "left_out": sum(left_out) / len(left_out)}


def kept_path(row, options):
    """Where a row's result is kept: another program, seed or scene is another file."""
    program = hashlib.sha1(rig_program().read_bytes()).hexdigest()
    what = [program, ERRORS, "judged where the reference has rays", row.name, row.scene, row.options, options.option, options.frames, options.seeds,
            options.first_seed]
    return options.work / "rows" / (hashlib.sha1(json.dumps(what).encode()).hexdigest() + ".json")


def measured(row, options):
    """The row's result, from an earlier run where there is one: a whole table takes hours."""
    path = kept_path(row, options)
    if path.exists() and not options.again:
        return json.loads(path.read_text())
    result = measure_row(row, options)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(result))
    return result


def ratios(row, result):
    """What the row is judged by: error over reference, or the one absolute error."""
    if row.worst_px:
        return {"data_px": result["ours"]["data_px"]}
    return {key: result["ours"][key] / result["reference"][key] for key in JUDGED if key in result["ours"]}


def passes(row, result):
    limit = row.worst_px or row.ratio
    return not result["failed"] and all(value <= limit for value in ratios(row, result).values())


def cell(value, digits=3):
    """Three significant digits, without an exponent."""
    return "" if value is None else f"{float(f'{value:.{digits}g}'):.7f}".rstrip("0").rstrip(".")


def kept_lines(document):
    """Of a document written before: the cells of its table's rows, and its remarks, by row."""
    rows, remarks = {}, {}
    for line in document.splitlines():
        if line.startswith("| "):
            cells = [text.strip() for text in line.strip("|").split(" | ")]
            rows[cells[0]] = cells
        elif line.startswith("- ") and ": " in line:
            name = ": ".join(line[2:].split(": ")[:2])
            remarks.setdefault(name, []).append(line)
    return rows, remarks


def table(results, kept=None):
    """Rows of results; with `kept`, cells by row, those of all scenarios that are in either."""
    head = ["scenario", "px", "reference", "ratio", "px, data", "reference", "ratio", "mm", "reference", "ratio", "deg, ratio",
            "triangulated mm", "reference", "ratio", "required", "failed", "verdict"]
    lines = [head, ["---"] + ["--:"] * (len(head) - 1)]
    by_name = {row.name: (row, result) for row, result in results}
    for name in [row.name for row in solver_rows.rows()] if kept else by_name:
        if name not in by_name:
            lines.extend([kept[name]] if name in kept else [])
            continue
        row, result = by_name[name]
        ours, other = result["ours"], result["reference"]

        def pair(key):
            if key not in ours:
                return ["", "", ""]
            return [cell(ours[key]), cell(other[key]), f"{ours[key] / other[key]:.2f}"]
        required = f"data <= {row.worst_px}" if row.worst_px else f"<= {row.ratio}"
        lines.append([row.name, *pair("px"), *pair("data_px"), *pair("mm"), pair("deg")[2], *pair("triangulation_mm"), required,
                      f"{len(result['failed'])} of {result['seeds']}",
                      "ok" if passes(row, result) else "**over**"])
    width = [max(len(line[i]) for line in lines) for i in range(len(head))]
    return ["| " + " | ".join(text.ljust(w) if i == 0 else text.rjust(w) for i, (text, w) in
                              enumerate(zip(line, width))) + " |" for line in lines]


def report(results, document=""):
    """With a `document`: rows that results do not have are those that it has."""
    kept, remarks = kept_lines(document)
    lines = table(results, kept)
    names = {row.name for row, _ in results}
    failed = [f"- {row.name}: {remark}" for row, result in results for remark in result["failed"]]
    failed += [line for row in solver_rows.rows() if row.name not in names
               for line in remarks.get(row.name, []) if "seed " in line]
    left_out = [f"- {row.name}: px is without {100 * result['left_out']:.2g} % of the image, where the reference "
                "has no ray" for row, result in results if result["left_out"] > 0]
    left_out += [line for row in solver_rows.rows() if row.name not in names
                 for line in remarks.get(row.name, []) if "px is without" in line]
    good = sum(line.rstrip("| ").endswith(" ok") for line in lines)
    return [*lines, "", f"{good} of {len(lines) - 2} rows as required.",
            *(["", *left_out] if left_out else []),
            *(["", "Refused:", "", *failed] if failed else [])]


PREFACE = f"""# How exact the solver is

Written by `make solver-accuracy`; not to be edited. Simulated observations with known truth
(`tests/truth/truth_scenes.py`), each row the root mean square over {SEEDS} draws of rig, lenses, poses and noise.
No seed of this table was used to tune the solver. `make solver-accuracy SOLVER='--only ring --first-seed 1'`
measures on others. Rows that `--only` leaves out stand as they were measured last.

- *reference*: the joint maximum-likelihood solution (`tests/truth/truth_reference.py`): started at the truth,
  outliers left out by their labels, the board's true surface known and, in the last row of a rig, the lens's
  field too. The same draws, so that a ratio says more than its two figures.
- *px*: RMS error of projection over a grid in the image, after the best single rotation of the rays, over the
  cells where the reference has a ray (its lens may fold in a corner without data; said below). *px, data*:
  the same over those cells of the grid that hold observations; a rational lens's coefficients stand in for
  one another, and in corners without data it says little. The lens that no model fits is judged there.
- *mm*, *deg*: error of the other cameras' places and directions in the first camera's frame.
- *triangulated*: error of points in the volume of the boards, intersected from all cameras that see them,
  after the best rigid motion.
- *failed*: draws that the solver refused; the errors are over the others.
- *rolling shutters*: rows read 10 to 15 us apart of boards that move at 300 mm/s and 1 rad/s (RMS;
  `tests/truth/truth_shutter.py`); the reference has their velocities as unknowns, but knows row times, and
  boards that are held still to be so.
- `paper`: two cameras of 12 MP, 50 frames of 1,008 points; `ring`: 8 of 2 MP, 100 frames of 336 points;
  `room`: 16 of 2 MP, 300 frames, 1.6 million observations. Noise 0.05 px, Brown's lens (given by --model), a
  flat board of circles, no outliers, where nothing else is said. No sigma is given.
"""


def main():
    options = arguments()
    rows = solver_rows.rows()
    if options.only:
        rows = [row for row in rows if re.search(options.only, row.name)]
    if options.list:
        print("\n".join(row.name for row in rows))
        return 0
    if not rows:
        print("solver_accuracy: no row matches --only; --list names them", file=sys.stderr)
        return 2
    regular = not (options.option or options.frames or options.seeds != SEEDS
                   or options.first_seed != FIRST_SEED)
    options.work.mkdir(parents=True, exist_ok=True)
    results = []
    try:
        for count, row in enumerate(rows, 1):
            say(f"{count}/{len(rows)} {row.name}")
            results.append((row, measured(row, options)))
    except (OSError, RuntimeError) as error:
        print(f"solver_accuracy: {error}", file=sys.stderr)
        return 1
    shutil.rmtree(options.work / "scene", ignore_errors=True)
    print("\n".join(report(results)))
    if options.out and regular:
        # Rows that this program has not been measured on stand as they were.
        path = Path(options.out) / "solver_accuracy.md"
        document = path.read_text() if path.exists() else ""
        results = [(row, json.loads(kept_path(row, options).read_text())) for row in solver_rows.rows()
                   if kept_path(row, options).exists()]
        missing = [f"- {row.name}" for row in solver_rows.rows()
                   if not kept_path(row, options).exists() and row.name not in kept_lines(document)[0]]
        lines = report(results, document) + (["", "Not measured:", "", *missing] if missing else [])
        path.write_text(PREFACE + "\n" + "\n".join(lines) + "\n")
    elif options.out:
        say("other seeds, frames or options than the kept table's: printed only")
    return 0


if __name__ == "__main__":
    sys.exit(main())
