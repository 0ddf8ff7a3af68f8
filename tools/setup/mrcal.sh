#!/bin/sh
# mrcal 2.5 into build/deps/mrcal (200 MB), for a Python of 3.12 or later: its wheels are for these, and Debian 12
# has 3.11. $PEER_PYTHON names one; else the first that is found. Where there is none, or the package cannot be had,
# it says so and leaves the comparison to Debian's mrcal 2.2.
set -eu
cd "$(dirname "$0")/../.."
to=build/deps/mrcal

say() { printf 'mrcal: %s\n' "$*" >&2; }
can() { "$1" -c 'import sys, venv; sys.exit(sys.version_info < (3, 12))' >/dev/null 2>&1; }

[ ! -e "$to/complete" ] || exit 0
python=
for candidate in ${PEER_PYTHON:-} python3 python3.14 python3.13 python3.12 "$HOME"/.pyenv/versions/3.1[2-9]*/bin/python3; do
    if can "$candidate"; then
        python=$candidate
        break
    fi
done
if [ -z "$python" ]; then
    say "no Python of 3.12 or later found (PEER_PYTHON=... names one): solver-bench takes Debian's mrcal instead"
    exit 0
fi
rm -rf "$to"
mkdir -p build/deps
# Without all its dependencies: drawing, not solving, wants the others, and one of them builds from source only.
if "$python" -m venv "$to" && "$to/bin/pip" install -q --disable-pip-version-check --no-deps \
        mrcal==2.5.2.post1 numpy==2.5.5 numpysane==0.45 packaging==26.4 opencv-python-headless==5.0.0.93; then
    touch "$to/complete"
    say "2.5.2 installed into $to"
else
    rm -rf "$to"
    say "2.5.2 cannot be had (see above): solver-bench takes Debian's mrcal instead"
fi
