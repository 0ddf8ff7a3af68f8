#!/usr/bin/env python3
"""Turn the output of `make --dry-run V=1` (standard input) into a compile_commands.json."""
import json
import os
import shlex
import sys

entries = []
for line in sys.stdin:
    line = line.strip()
    if " -c -o " not in line:
        continue
    words = shlex.split(line)
    if words[-1].endswith((".c", ".cc")):
        entries.append({"directory": os.getcwd(), "file": words[-1], "arguments": words})
json.dump(entries, sys.stdout, indent=1)
