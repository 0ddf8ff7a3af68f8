#!/usr/bin/env python3
"""Runs a command and writes what it took to a file: seconds on the wall and of the processor, peak memory.

    measure_child.py RESULT.json COMMAND...

It stands alone and imports little because Linux hands the peak memory of the process that forks on to its
child: started by a program that holds arrays, the figure would be that program's.
"""
import json
import os
import sys
import time


def main():
    if len(sys.argv) < 3:
        print(__doc__)
        return 0 if sys.argv[1:] == ["--help"] else 2
    result, command = sys.argv[1], sys.argv[2:]
    start = time.monotonic()
    child = os.posix_spawnp(command[0], command, os.environ)
    _, status, usage = os.wait4(child, 0)
    wall = time.monotonic() - start
    with open(result, "w") as file:
        json.dump({"wall_s": wall, "cpu_s": usage.ru_utime + usage.ru_stime,
                   "peak_mb": usage.ru_maxrss / 1024}, file)
    return os.waitstatus_to_exitcode(status)


if __name__ == "__main__":
    sys.exit(main())
