#!/bin/sh
# Installs the Debian packages of the groups named on the command line (see packages.txt) and,
# for group `test`, fetches Unity. Does nothing, quickly, when all of it is there already.
set -eu
here=$(dirname "$0")

say() { printf 'deps: %s\n' "$*" >&2; }
die() { printf 'deps: error: %s\n' "$*" >&2; exit 1; }

[ $# -gt 0 ] || die "name at least one group: build, test"

# What of the groups' packages is not installed.
missing_of() {
    for group in "$@"; do
        for package in $(awk -v g="$group" '$1 == g { print $2 }' "$here/packages.txt"); do
            dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null | grep -qx installed ||
                printf ' %s' "$package"
        done
    done
}

# Copies apt's words to the log and tells every hundredth of the two steps that each package takes.
told() { # how many packages
    steps=0
    tee "$log" | while read -r line; do
        case $line in "Unpacking "* | "Setting up "*)
            steps=$((steps + 1))
            [ $((steps % 100)) -ne 0 ] || say "    $steps of $((2 * $1)) steps"
        esac
    done
}

missing=$(missing_of "$@")
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
    log=$(mktemp)
    trap 'rm -f "$log"' EXIT
    # sudo drops the environment, so the variable is set behind it.
    # Freshly started machines often upgrade themselves at first: the lock is waited for.
    apt() { $root env DEBIAN_FRONTEND=noninteractive LC_ALL=C apt-get -q -o DPkg::Lock::Timeout=300 "$@" 2>&1; }
    complaints() { grep -E '^(E|W|sudo|dpkg): ?' "$log" | tail -n 5 >&2; }
    say "1/3 reading the package lists"
    # A source that does not answer need not be the one that has our packages: what matters is what follows.
    apt update >"$log" || true
    complaints
    say "2/3 downloading (some hundred MB with what they depend on)"
    # shellcheck disable=SC2086  # a list of package names
    if ! apt install -y --no-install-recommends --download-only $missing >"$log"; then
        complaints
        die "packages cannot be had (see above): does this machine reach its Debian 12 mirror?"
    fi
    count=$(sed -n 's/.* \([0-9]*\) newly installed.*/\1/p' "$log")
    say "3/3 unpacking and setting up ${count:-the} packages"
    # shellcheck disable=SC2086  # a list of package names
    apt install -y --no-install-recommends $missing </dev/null | told "${count:-0}"
    missing=$(missing_of "$@")
    if [ -n "$missing" ]; then
        complaints
        die "the packages could not be set up (see above); by hand: apt-get install$missing"
    fi
    say "installed"
else
    say "nothing to install for: $*"
fi

for group in "$@"; do
    [ "$group" != test ] || "$here/unity.sh"
done
