#!/usr/bin/env python3
"""Count what frames made to be slow cost, in instructions by callgrind.

    worst_frames.py build/native/tests/cost_frames [--size 1920x1080] [--only WORD]

Two ratios stand beside each: over the busiest frame full of target (64 px a patch: circles from 3.3 px, seen in full),
and over one of 130 px a patch with the same settings, most of which is seen at half size. Exit 1 where the first
is more than four.
"""
import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

MOST = 4.0
BUSIEST = "full target, 64 px patches"
STAGES = {"steer": "steer_row", "edges": "edges_scan_row", "chains": "chains_link_row",
          "ellipses": "ellipses_add|ellipses_end", "marks": "marks_classify", "patches": "patches_decode",
          "refine": "refine_marks", "lattice": "lattice_extend"}


def count(program, size, index):
    """Instructions of pipeline_run on one frame: all, by stage, and what the program says of the frame."""
    with tempfile.TemporaryDirectory() as work:
        pixels, out = Path(work) / "pixels", Path(work) / "out"
        with pixels.open("wb") as to:
            subprocess.run([program, "draw", *size, index], stdout=to, check=True)
        said = subprocess.run(["valgrind", "-q", "--tool=callgrind", f"--callgrind-out-file={out}",
                               "--toggle-collect=pipeline_run", program, "run", *size, index],
                              stdin=pixels.open("rb"), check=True, capture_output=True, text=True).stdout.strip()
        table = subprocess.run(["callgrind_annotate", "--inclusive=yes", "--threshold=100", out], check=True,
                               capture_output=True, text=True).stdout
    of = {}
    for number, name in re.findall(r"^ *([0-9,]+) .*?:(\w+)", table, re.MULTILINE):
        of.setdefault(name, int(number.replace(",", "")))
    total = int(re.search(r"^ *([0-9,]+).*PROGRAM TOTALS", table, re.MULTILINE)[1].replace(",", ""))
    return total, {stage: sum(of.get(name, 0) for name in names.split("|")) for stage, names in STAGES.items()}, said


def main():
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("program")
    words.add_argument("--size", default="1920x1080")
    words.add_argument("--only", default="", help="names that hold this")
    given = words.parse_args()
    size = given.size.split("x")
    pixels = int(size[0]) * int(size[1])
    names = subprocess.run([given.program, "names"], check=True, capture_output=True, text=True).stdout
    rows = [line.split(" ", 2) for line in names.splitlines()]
    print(f"instructions a pixel, {given.size}; over the busiest frame full of target; over one of 130 px a patch")
    # The normal frames first: the others are held against them.
    rows.sort(key=lambda row: row[2] != BUSIEST and row[0] != row[1])
    totals, worst = {}, 0.0
    for index, normal, name in rows:
        if given.only in name or index == normal or name == BUSIEST:
            total, stages, said = count(given.program, size, index)
            totals[index] = totals[name] = total
            print(f"{name:36} {total / pixels:7.1f}", end="")
            if BUSIEST in totals:
                worst = max(worst, total / totals[BUSIEST])
                print(f" {total / totals[BUSIEST]:6.2f} {total / totals[normal]:6.2f}", end="")
            print("  " + " ".join(f"{stage} {value / pixels:.0f}" for stage, value in stages.items())
                  + f"  ({said})", flush=True)
    print(f"the worst costs {worst:.2f} times the busiest frame full of target; at most {MOST:g}")
    sys.exit(1 if worst > MOST else 0)


if __name__ == "__main__":
    main()
