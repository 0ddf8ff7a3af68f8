#!/bin/sh
# Fetches what cross-built programs link with, for the architecture named on the command line (Debian's
# name: arm64, armhf), into build/deps/ARCH: libpng and zlib as static libraries, and cJSON as source, for
# Debian has no static library of it. Nothing of the system's own package set changes: apt works in folders
# of its own.
set -eu
[ $# -eq 1 ] || { echo "usage: $0 arm64|armhf" >&2; exit 2; }
arch=$1
top=$(cd "$(dirname "$0")/../.." && pwd)
into=$top/build/deps/$arch

say() { printf 'foreign: %s\n' "$*" >&2; }
die() { printf 'foreign: error: %s\n' "$*" >&2; exit 1; }

[ ! -f "$into/complete" ] || exit 0
command -v apt-get >/dev/null 2>&1 ||
    die "no apt-get: put libpng.a, libz.a, cJSON.c and their headers for $arch into $into, as in $0"
say "fetching libpng, zlib and cJSON for $arch"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mirror=$(apt-get indextargets --format '$(SITE)' 'Created-By: Packages' | grep -v security | head -n 1)
suite=$(. /etc/os-release && echo "$VERSION_CODENAME")
keyring=/usr/share/keyrings/debian-archive-keyring.gpg
mkdir -p "$work/lists/partial" "$work/cache/archives/partial" "$into"
: > "$work/status"
printf 'deb%s [signed-by='"$keyring"'] '"$mirror $suite main\n" '' -src > "$work/s.list"
private() {
    (cd "$work" && apt-get -q -o APT::Architecture="$arch" -o APT::Architectures::="$arch" \
        -o Dir::Etc::sourcelist="$work/s.list" -o Dir::Etc::sourceparts=- \
        -o Dir::State::lists="$work/lists" -o Dir::State::status="$work/status" \
        -o Dir::Cache="$work/cache" -o APT::Sandbox::User=root -o Acquire::Languages=none \
        -o Acquire::IndexTargets::deb::Contents-deb::DefaultEnabled=false "$@" > log 2>&1) ||
        { tail -n 3 "$work/log" >&2; return 1; }
}
private update || die "the package lists for $arch could not be fetched from $mirror"
private download libpng-dev zlib1g-dev || die "libpng-dev and zlib1g-dev could not be fetched for $arch"
for package in "$work"/*.deb; do
    dpkg-deb -x "$package" "$into" || die "$package could not be unpacked"
done
private source --download-only --only-source cjson || die "cjson's source could not be fetched"
tar -xf "$work"/cjson_*.orig.tar.* -C "$work" || die "cjson's source could not be unpacked"
mkdir -p "$into/cjson"
cp "$work"/*/cJSON.c "$work"/*/cJSON.h "$into/cjson/" || die "cjson's source holds no cJSON.c"
touch "$into/complete"
