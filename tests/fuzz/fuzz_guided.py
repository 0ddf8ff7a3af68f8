#!/usr/bin/env python3
"""Lead fuzz targets by coverage (libFuzzer), and keep what they found.

    fuzz_guided.py --seconds 60 build/.../fuzz_wire ...   fuzz each for so long; exit 1 when one found a fault
    fuzz_guided.py --keep build/.../fuzz_wire ...         write tests/fuzz/corpus/NAME.hex: of what is kept and
                                                          what was found, least inputs that reach the same edges

What is found lies in build/fuzz/NAME/found, an input that ended the program beside it.
"""
import argparse
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

CORPUS = Path(__file__).parent / "corpus"
BYTES_MAX = {"frame": 256, "image": 2048, "scene": 1024, "rig": 2500}  # else 4096
# Seconds for one input: worlds above what any takes, so that only an endless one is told.
OPTIONS = ["-timeout=60", "-rss_limit_mb=4096", "-malloc_limit_mb=1024", "-print_final_stats=1"]


def unpack(name, folder):
    """The kept inputs as files, for libFuzzer."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    kept = CORPUS / f"{name}.hex"
    lines = kept.read_text().splitlines() if kept.exists() else []
    for number, line in enumerate(line for line in lines if not line.startswith("#")):
        (folder / f"kept_{number:04}").write_bytes(bytes.fromhex(line))
    return folder


def run(program, words, profile=os.devnull):
    environment = os.environ | {"LLVM_PROFILE_FILE": str(profile)}
    done = subprocess.run([program, *OPTIONS, *words], env=environment, capture_output=True, text=True,
                          errors="replace")
    return done.returncode, done.stdout + done.stderr


def last(pattern, text):
    found = re.findall(pattern, text)
    return found[-1] if found else "?"


def lines_reached(program, name, folders):
    """Share of the lines of the code under test that all inputs together reach; "" without LLVM's tools."""
    if not (shutil.which("llvm-profdata") and shutil.which("llvm-cov")):
        return ""
    raw, merged = folders[0].parent / "raw", folders[0].parent / "merged"
    run(program, ["-runs=0", *map(str, folders)], raw)
    subprocess.run(["llvm-profdata", "merge", "-o", merged, raw], check=True)
    report = subprocess.run(["llvm-cov", "report", program, f"-instr-profile={merged}",
                             "-ignore-filename-regex=tests/|deps/|/usr/"], check=True, capture_output=True,
                            text=True).stdout
    (folders[0].parent / "coverage.txt").write_text(report)
    return f", {report.splitlines()[-1].split()[9]} of lines"


def fuzz(program, name, seconds):
    home = Path("build/fuzz") / name
    seeds, found = unpack(name, home / "kept"), home / "found"
    found.mkdir(exist_ok=True)
    status, log = run(program, [f"-max_total_time={seconds}", f"-max_len={BYTES_MAX.get(name, 4096)}",
                                f"-artifact_prefix={home}/", str(found), str(seeds)])
    (home / "log.txt").write_text(log)
    print(f"fuzz: {name}: {last(r'number_of_executed_units: *([0-9]+)', log)} inputs, "
          f"{last(r'cov: ([0-9]+)', log)} edges"
          f"{lines_reached(program, name, [seeds, found]) if status == 0 else ''}", flush=True)
    if status != 0:
        print(f"fuzz: {name}: FAULT, see {home}/log.txt; the input is {last(r'written to (.*)', log)}", flush=True)
    return status == 0


def keep(program, name):
    home = Path("build/fuzz") / name
    seeds, least = unpack(name, home / "kept"), home / "least"
    shutil.rmtree(least, ignore_errors=True)
    least.mkdir()
    found = [str(home / "found")] if (home / "found").exists() else []
    status, log = run(program, ["-merge=1", "-use_counters=0", f"-max_len={BYTES_MAX.get(name, 4096)}",
                                str(least), str(seeds), *found])
    if status != 0:
        sys.exit(f"fuzz: {name} cannot be merged:\n{log[-2000:]}")
    lines = sorted((path.read_bytes().hex() for path in least.iterdir()), key=lambda line: (len(line), line))
    part = CORPUS / f"{name}.hex.part"
    part.write_text("# inputs of tests/fuzz/fuzz_" + name + ", one a line; by make fuzz-keep\n"
                    + "".join(line + "\n" for line in lines if line))
    part.rename(CORPUS / f"{name}.hex")
    print(f"fuzz: {name}: {len(lines)} inputs kept, {(CORPUS / f'{name}.hex').stat().st_size} bytes")


def main():
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("--seconds", type=int, default=60)
    words.add_argument("--keep", action="store_true")
    words.add_argument("programs", nargs="+")
    given = words.parse_args()
    good = True
    for program in given.programs:
        name = Path(program).name.removeprefix("fuzz_")
        if given.keep:
            keep(program, name)
        else:
            good = fuzz(program, name, given.seconds) and good
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
