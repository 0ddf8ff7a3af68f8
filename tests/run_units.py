#!/usr/bin/env python3
"""Run Unity programs, show what fails, and sum them up: `N passed, N failed, N skipped`."""
import re
import subprocess
import sys

passed = failed = skipped = 0
for program in sys.argv[1:]:
    run = subprocess.run([program], capture_output=True, text=True, errors="replace")
    summary = re.search(r"^(\d+) Tests (\d+) Failures (\d+) Ignored", run.stdout, re.MULTILINE)
    name = program.rsplit("/", 1)[-1]
    if summary is None:
        failed += 1
        print(f"  CRASH  {name} (exit {run.returncode})\n{run.stdout}{run.stderr}", flush=True)
        continue
    total, bad, ignored = (int(number) for number in summary.groups())
    # A program that ran no test, or whose exit code disagrees with its words, is a failure.
    if total == 0 or (run.returncode != 0) != (bad != 0):
        bad += 1
        total += 1
    passed += total - bad - ignored
    failed += bad
    skipped += ignored
    print(f"  {'FAIL' if bad else 'ok':5}  {name}: {total} tests", flush=True)
    if bad:
        print(run.stdout + run.stderr)
print(f"{passed} passed, {failed} failed, {skipped} skipped")
sys.exit(1 if failed or not passed else 0)
