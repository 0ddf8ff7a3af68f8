#!/usr/bin/env python3
"""Run the test stages named after MAKE, each to its end whatever the others did, and sum them up.

The last line is `N passed, N failed, N skipped`. A stage that counts no tests of its own counts as one.
"""
import os
import re
import subprocess
import sys
import time

# Ours, and pytest's: `3 failed, 20 passed, 1 skipped in 4.56s (0:01:02)`.
SUM = re.compile(r"=*\s*\d+ (passed|failed|skipped|errors?)\b.*")
COUNT = re.compile(r"(\d+) (passed|failed|skipped|errors?)\b")
KINDS = ("passed", "failed", "skipped")


def run(command):
    """The exit code, and everything said, which is shown as it comes."""
    # The jobserver's descriptors go on to the inner make.
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, close_fds=False) as process:
        said = b""
        while chunk := os.read(process.stdout.fileno(), 65536):
            os.write(sys.stdout.fileno(), chunk)
            said += chunk
    return process.returncode, said.decode(errors="replace")


def counts(code, said):
    """The stage's own sum, from the last line that looks like one."""
    total = dict.fromkeys(KINDS, 0)
    sums = [found for line in said.splitlines() if (found := SUM.match(line) and COUNT.findall(line))]
    for number, kind in sums[-1] if sums else []:
        total[kind if kind in KINDS else "failed"] += int(number)
    if not any(total.values()):
        total["passed"] = 1 if code == 0 else 0
    # What failed without counting (a build, a crash) is not lost.
    if code != 0 and total["failed"] == 0:
        total["failed"] = 1
    return total


def main():
    make, *stages = sys.argv[1:]
    rows = []
    for stage in stages:
        print(f"\n== {stage}", flush=True)
        start = time.monotonic()
        rows.append((stage, counts(*run([make, "--no-print-directory", stage])), time.monotonic() - start))
    print("\nstage        passed  failed  skipped  seconds")
    for stage, total, seconds in rows:
        print(f"{stage:10}" + "".join(f"{total[kind]:9}" for kind in KINDS) + f"{seconds:9.0f}")
    sums = {kind: sum(total[kind] for _, total, _ in rows) for kind in KINDS}
    print(", ".join(f"{sums[kind]} {kind}" for kind in KINDS))
    sys.exit(1 if sums["failed"] else 0)


main()
