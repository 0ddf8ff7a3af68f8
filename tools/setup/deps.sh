#!/bin/sh
# Installs the Debian packages of the groups named on the command line (see packages.txt) and,
# for group `test`, fetches Unity. Does nothing, quickly, when all of it is there already.
set -eu
here=$(dirname "$0")

say() { printf 'deps: %s\n' "$*" >&2; }
die() { printf 'deps: error: %s\n' "$*" >&2; exit 1; }

[ $# -gt 0 ] || die "name at least one group: build, test"

missing=
for group in "$@"; do
    for package in $(awk -v g="$group" '$1 == g { print $2 }' "$here/packages.txt"); do
        dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null | grep -qx installed ||
            missing="$missing $package"
    done
done

if [ -n "$missing" ]; then
    command -v apt-get >/dev/null 2>&1 ||
        die "this is not a Debian system (no apt-get); install by hand:$missing"
    if [ "$(id -u)" -eq 0 ]; then
        root=
    elif command -v sudo >/dev/null 2>&1; then
        root=sudo
    else
        die "not root and no sudo; as root run: apt-get install$missing"
    fi
    say "installing:$missing"
    export DEBIAN_FRONTEND=noninteractive
    log=$(mktemp)
    if ! $root apt-get -q update >"$log" 2>&1; then
        tail -n 5 "$log" >&2
        die "apt-get update failed (see above): is the package mirror reachable?"
    fi
    # shellcheck disable=SC2086  # a list of package names
    if ! $root apt-get -q install -y --no-install-recommends $missing >"$log" 2>&1; then
        tail -n 5 "$log" >&2
        die "apt-get install failed (see above); missing:$missing"
    fi
    rm -f "$log"
    say "installed"
else
    say "nothing to install for: $*"
fi

for group in "$@"; do
    [ "$group" != test ] || "$here/unity.sh"
done
