#!/usr/bin/env python3
"""Who may include whom. Run from the tree's top: tools/check/layers.py

Each folder names what its files may include: folders and headers of ours, and <system> headers where
they are restricted. In firmware/detect and host also the order of the street counts: a stage may include
its own headers and those of the stages before it.
"""
import re
import subprocess
import sys
from pathlib import Path

CORE = "stdint.h stdbool.h stddef.h assert.h string.h".split()  # no heap, no input or output, no float
VECTORS = "emmintrin.h immintrin.h arm_neon.h".split()  # for the row kernels; make symbols watches the rest
ANY = None  # any system header
RULES = {  # folder: (folders and headers of ours, system headers); the longest folder that fits counts
    "common": ([], CORE),
    "common/fx": (["common/fx"], CORE[:4]),
    "common/wire": (["common/wire", "common/fx"], CORE),
    "common/target": (["common/target", "common/fx"], CORE),
    "common/targetfile": (["common/targetfile", "common/target", "common/fx"], ANY),
    "firmware": ([], CORE),
    "firmware/detect": (["firmware/detect", "common/fx", "common/wire", "common/target",
                         "firmware/frame.h", "firmware/limits.h"], CORE + VECTORS),
    "firmware/capture": (["firmware/capture", "firmware/frame.h", "firmware/limits.h"], ANY),
    "firmware/net": (["firmware/net"], ANY),
    "firmware/app": (["firmware", "common"], ANY),
    "host/base": (["host/base"], ANY),
    "host": (["host", "common"], ANY),
    "host/rig": (["host", "common"], ANY),
    "tools": (["tools", "host", "common", "firmware/detect", "firmware/frame.h"], ANY),
    "tools/bench": (["tools/bench", "common", "firmware"], ANY),
    "tools/check": (["common", "firmware"], ANY),
    "tests": ([""], ANY),
}
STREETS = {
    "firmware/detect": "arena taps profile curve halve rimrow dsp luma steer edges quota chains arcs ellipse "
                       "areafit directfit refit ellipses marks patchmap keysort patches survey boardmap pattern "
                       "junction rim circlefit light refine lattice packet".split(),
    "host": "base net journal assoc obs model solve report rig".split(),
}


def street_fault(folder, source, include):
    for street, order in STREETS.items():
        if folder == street or folder.startswith(street + "/"):
            def stage(path):
                name = Path(path).relative_to(street).parts[0].split(".")[0]
                name = re.sub(r"^(dsp|taps|profile|curve|halve|rimrow)_.*", r"\1", name)
                return order.index(name) if name in order else None
            if include.startswith(street + "/"):
                here, there = stage(source), stage(include)
                if here is None or there is None:
                    return f"no place on the street of {street}; add it to tools/check/layers.py"
                if there > here:
                    return "a later stage"
    return None


def fault(source, include, system):
    folder = max((f for f in RULES if source.startswith(f + "/")), key=len)
    ours, systems = RULES[folder]
    if system:
        return f"not for {folder}" if systems is not ANY and include not in systems else None
    known = include == "common/version.h" or any(
        o == "" or include == o or include.startswith(o + "/") for o in ours)
    return street_fault(folder, source, include) if known else f"not for {folder}"


def main():
    if sys.argv[1:]:
        print(__doc__)
        sys.exit(0 if sys.argv[1:] == ["--help"] else 2)
    files = subprocess.run("git ls-files -co --exclude-standard *.c *.cc *.h".split(), check=True,
                           capture_output=True, text=True).stdout.split()
    bad = checked = 0
    for source in files:
        for number, line in enumerate(Path(source).read_text().splitlines(), 1):
            if found := re.match(r'\s*#\s*include\s*([<"])([^">]+)', line):
                checked += 1
                if why := fault(source, found[2], found[1] == "<"):
                    bad += 1
                    print(f"{source}:{number}: includes {found[2]}: {why}")
    if bad or checked < 100:
        sys.exit(f"layers: {bad} of {checked} includes point the wrong way")
    print(f"layers: {checked} includes follow the street")


if __name__ == "__main__":
    main()
