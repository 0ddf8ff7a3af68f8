#!/bin/sh
# Instructions a pixel, repeatable where times are not: tools/bench/count.sh TARGET.json FRAME.pgm...
#
# x86-64 by callgrind, by stage; aarch64 by QEMU with a counting plug-in, if it was built (make ARCH=aarch64
# count_frame).
set -eu
target=$1
shift
native=build/native/tests/count_frame
foreign=build/aarch64/tests/count_frame
plugin=build/native/count_plugin.so
stages='steer_row edges_scan_row chains_link_row ellipses_add marks_classify patches_decode refine_marks lattice_extend'
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

executed() { # runs
    qemu-aarch64 -plugin "$plugin" -d plugin "$foreign" "$1" "$target" "$frame" "$2" 2>&1 >/dev/null |
        awk '/^executed/ { print $2 }'
}

for frame; do
    name=${frame#build/bench/}
    if command -v valgrind >/dev/null; then
        for dsp in best scalar; do
            pixels=$(valgrind -q --tool=callgrind --callgrind-out-file="$work/out" \
                --toggle-collect=pipeline_run "$native" $dsp "$target" "$frame" 1 2>/dev/null)
            callgrind_annotate --inclusive=yes --threshold=100 "$work/out" 2>/dev/null > "$work/table"
            awk -v pixels="$pixels" -v stages="$stages" -v title="x86-64 $dsp, $name" '
                / PROGRAM TOTALS/ { gsub(",", "", $1); total = $1 }
                { split($0, at, ":"); word = at[2]; sub(/ .*/, "", word); sub(/\(.*/, "", $1)
                  gsub(",", "", $1); if (!(word in count)) count[word] = $1 }
                END {
                    printf "instructions a pixel, %s: %.1f (", title, total / pixels
                    n = split(stages, list, " ")
                    for (i = 1; i <= n; i++) printf "%s%s %.1f", (i > 1 ? ", " : ""), list[i], count[list[i]] / pixels
                    print ")"
                }' "$work/table"
        done
    fi
    if [ -x "$foreign" ] && [ -f "$plugin" ]; then
        for dsp in neon scalar; do
            pixels=$(qemu-aarch64 "$foreign" $dsp "$target" "$frame" 1)
            awk -v one="$(executed $dsp 1)" -v two="$(executed $dsp 2)" -v pixels="$pixels" \
                "BEGIN { printf \"instructions a pixel, aarch64 $dsp, $name: %.1f\n\", (two - one) / pixels }"
        done
    else
        echo "aarch64 not counted: make cross-deps, make ARCH=aarch64 count_frame"
    fi
done
