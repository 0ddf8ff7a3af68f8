#!/usr/bin/env python3
"""Measures tessera-detect against rendered truth and the Cramer-Rao limit.

Renders frames for a grid of conditions, runs the detector, and prints one table; with --out also
writes it there, with the paper's Figures 8 and 9. `make accuracy` and `make accuracy-short` call it.
Frames are kept in build/accuracy and used again as long as renderer and scene are the same.
"""
import argparse
import os
import re
import sys
from pathlib import Path

import accuracy_conditions
from accuracy_run import Run
from accuracy_score import Score
from accuracy_table import missed_lines, table

ROOT = Path(__file__).resolve().parents[2]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true", help="few and small frames")
    parser.add_argument("--seed", type=int, default=1,
                        help="of targets, views, noise (default 1: tune the detector on another)")
    parser.add_argument("--only", metavar="REGEX", help="rows whose `group: name` matches")
    parser.add_argument("--list", action="store_true", help="list the rows and end")
    parser.add_argument("--faults", metavar="FILE",
                        help="CSV of every circle missed, far off, or with a wrong id")
    parser.add_argument("--out", metavar="FOLDER", help="write accuracy.md and the figures there")
    parser.add_argument("--work", metavar="FOLDER", default=ROOT / "build" / "accuracy",
                        help="where frames are kept")
    parser.add_argument("--jobs", type=int, default=1, help="threads of the renderer")
    parser.add_argument("--detect", metavar="OPTION", action="append", default=[],
                        help="further option for tessera-detect, e.g. --detect=--kernel=9")
    return parser.parse_args()


def measure_all(run, rows, progress):
    results = []
    for count, row in enumerate(rows, 1):
        if progress:
            print(f"{count}/{len(rows)} {row.group}: {row.name}", file=sys.stderr, flush=True)
        results.append((row, run.measure(row)))
    return results


def total_line(results):
    total = Score()
    for row, score in results:
        if row.dense:
            total.add(score)
    shares = [f"{total.found[size]} of {total.visible[size]} visible circles {words} found"
              for size, words in ((4, "of 4 px and more"), (3, "of 3 to 4 px"))]
    return (f"{sum(score.frames for _, score in results)} frames: {shares[0]}, {shares[1]}, "
            f"{sum(score.wrong_ids for _, score in results)} wrong ids, "
            f"{sum(score.far_off for _, score in results)} centres off by more than 0.3 px.")


def write_faults(path, results):
    with open(path, "w") as file:
        file.write("condition,fault,file,patch,feature,x,y,distance_px,major\n")
        for row, score in results:
            for kind, name, patch, feature, x, y, distance, major in score.faults:
                file.write(f"\"{row.group}: {row.name}\",{kind},{name},{patch},{feature},{x:.3f},"
                           f"{y:.3f},{distance:.4f},{major:.3f}\n")


def report(results):
    """The lines printed, and kept in accuracy.md."""
    misses = missed_lines(results)
    lines = [*table(results), "", total_line(results), ""]
    if misses:
        lines += ["Missed:", "", *(f"- {line}" for line in misses)]
    else:
        lines += ["Missed: nothing."]
    return lines


def main():
    options = arguments()
    rows = accuracy_conditions.rows(options.seed, options.short)
    if options.only:
        rows = [row for row in rows if re.search(options.only, f"{row.group}: {row.name}")]
    if options.list:
        print("\n".join(f"{row.group}: {row.name}" for row in rows))
        return 0
    if not rows:
        print("accuracy: no row matches --only; --list names them", file=sys.stderr)
        return 2
    if options.out and (options.only or options.short or options.seed != 1 or options.detect):
        print("accuracy: --out is for the whole table with the default seed and detector",
              file=sys.stderr)
        return 2
    bin_folder = os.environ.get("TESSERA_BIN", ROOT / "build" / "bin")
    try:
        run = Run(bin_folder, options.work, options.seed, options.jobs, options.detect)
        results = measure_all(run, rows, progress=True)
        lines = report(results)
        print("\n".join(lines))
        if options.faults:
            write_faults(options.faults, results)
        if options.out:
            from accuracy_document import write
            write(Path(options.out), results, lines)
    except (OSError, RuntimeError) as error:
        print(f"accuracy: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
