#!/usr/bin/env python3
"""The deepest stack of a function: tools/check/stack.py LIMIT ROOT FILE.ci...

FILE.ci are GCC's call graphs with stack use (-fcallgraph-info=su). A call through a pointer is taken to reach
every row kernel (dsp_*.c), the only functions that the core calls so. Prints the deepest path; fails
above LIMIT bytes, on recursion, and on a frame whose size is not fixed.
"""
import re
import sys

# What the C library's few functions use at most (memcpy, memset, memcmp: none; the rest by allowance).
OUTSIDE = 256


def main():
    limit, root, files = int(sys.argv[1]), sys.argv[2], sys.argv[3:]
    frame, calls = {}, {}
    for path in files:
        text = open(path, encoding="utf-8").read()
        for title, label in re.findall(r'node: \{ title: "([^"]+)" label: "([^"]*)"', text):
            if found := re.search(r"(\d+) bytes \((\w+)", label):
                if found[2] == "dynamic" and "bounded" not in label:
                    sys.exit(f"stack: {title} has a frame whose size is not fixed")
                frame[title] = int(found[1])
        for source, target in re.findall(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', text):
            calls.setdefault(source, set()).add(target)
    kernels = {title for title in frame if re.search(r"dsp_\w+\.c:|dsp_x86_rows\.h:", title)}
    plain = {title for title in kernels if "dsp_scalar.c:" in title}
    if root not in frame or not kernels:
        sys.exit(f"stack: no frame of {root} or no row kernel in the {len(files)} files; build with GCC first")
    deepest = {}

    def depth(title, above):
        if title in above:
            sys.exit(f"stack: recursion: {' -> '.join(above)} -> {title}")
        if title not in deepest:
            targets = calls.get(title, set())
            pointed = plain if title in kernels else kernels  # a variant hands narrow rows to the plain one
            below = [depth(k, above + [title]) for t in targets
                     for k in (pointed if t == "__indirect_call" else [t])]
            most, path = max(below, default=(0, []))
            deepest[title] = (frame.get(title, OUTSIDE) + most, [title] + path)
        return deepest[title]

    total, path = depth(root, [])
    for title in path:
        print(f"  {frame.get(title, OUTSIDE):6} {title}")
    print(f"stack: {root} needs {total} bytes, limit {limit}")
    if total > limit:
        sys.exit(f"stack: {total} bytes are more than {limit}")


main()
