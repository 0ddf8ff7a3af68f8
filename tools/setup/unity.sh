#!/bin/sh
# Puts Unity (ThrowTheSwitch, MIT) into build/deps/unity: unity.c, unity.h, unity_internals.h.
#
# Debian 12 has no Unity of its own. Debian's later suites carry it inside the package `cmock`
# (architecture "all", so it can be unpacked anywhere); the copy used here is pinned by its digest and
# fetched with a private apt configuration, so that the system's own stays as it is.
# Order: UNITY_DIR given by the user, an installed cmock, the pinned package, cjson's bundled copy.
set -eu
top=$(cd "$(dirname "$0")/../.." && pwd)
to=$top/build/deps/unity
package=cmock_2.5.3+git40-g379a9a8-2_all.deb
digest=166e45090937251892363d10860b5e7aa5353d5553fde2cbaba514760ba3785e

say() { printf 'deps: %s\n' "$*" >&2; }
die() { printf 'deps: error: %s\n' "$*" >&2; exit 1; }

install_from() { # folder that holds unity.c
    mkdir -p "$to"
    cp "$1/unity.c" "$1/unity.h" "$1/unity_internals.h" "$to/"
    say "Unity from $2"
    exit 0
}

if [ -f "$to/unity.c" ]; then
    say "Unity is there"
    exit 0
fi
if [ -n "${UNITY_DIR:-}" ]; then
    [ -f "$UNITY_DIR/unity.c" ] || die "UNITY_DIR=$UNITY_DIR holds no unity.c"
    install_from "$UNITY_DIR" "UNITY_DIR"
fi
if [ -f /usr/share/cmock/vendor/unity/src/unity.c ]; then
    install_from /usr/share/cmock/vendor/unity/src "the installed package cmock"
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mirror=$(apt-get indextargets --format '$(SITE)' 'Created-By: Packages' 2>/dev/null |
    grep -v security | head -n 1)
keyring=/usr/share/keyrings/debian-archive-keyring.gpg
if [ -n "$mirror" ] && [ -f "$keyring" ]; then
    mkdir -p "$work/lists/partial" "$work/cache/archives/partial"
    echo "deb [signed-by=$keyring] $mirror trixie main" >"$work/s.list"
    private() {
        (cd "$work" && apt-get -q -o "Dir::Etc::sourcelist=$work/s.list" -o Dir::Etc::sourceparts=- \
            -o "Dir::State::lists=$work/lists" -o "Dir::Cache=$work/cache" \
            -o APT::Sandbox::User=root -o Acquire::Languages=none \
            -o Acquire::IndexTargets::deb::Contents-deb::DefaultEnabled=false "$@" >"$work/log" 2>&1)
    }
    say "fetching Unity (Debian package cmock, pinned)"
    if private update && private download cmock &&
        echo "$digest  $work/$package" | sha256sum -c --status; then
        dpkg-deb -x "$work/$package" "$work/pkg"
        install_from "$work/pkg/usr/share/cmock/vendor/unity/src" "$package"
    fi
fi
say "the pinned package cannot be had; trying the copy in cjson's source"
if (cd "$work" && apt-get -q source --download-only --only-source cjson >"$work/log" 2>&1) &&
    tar -xf "$work"/cjson_*.orig.tar.* -C "$work"; then
    for folder in "$work"/*/tests/unity/src; do
        [ ! -f "$folder/unity.c" ] || install_from "$folder" "cjson's source package"
    done
fi
die "Unity cannot be had: install the Debian package cmock, or set UNITY_DIR to a folder with unity.c and unity.h"
