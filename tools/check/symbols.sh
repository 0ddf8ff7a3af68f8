#!/bin/sh
# The core's objects: no operating system, no heap, no floating point.
#
# Usage: tools/check/symbols.sh ARCHIVE...
# Environment: NM, OBJDUMP (default nm, objdump).
#
# Fails when an object of an archive needs a symbol that neither an archive nor the short list below
# defines (soft-float helpers and libm would be such symbols), or holds a floating-point instruction.
# The compiler refuses floating point already (-mgeneral-regs-only); this proves what it made.
set -eu
nm=${NM:-nm}
objdump=${OBJDUMP:-objdump}
[ $# -gt 0 ] || { echo "usage: $0 ARCHIVE..." >&2; exit 2; }
for archive; do
    [ -f "$archive" ] || { echo "$0: no archive $archive; build it first" >&2; exit 2; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Besides the C library's four: what compilers put in by themselves, integer helpers of theirs included.
allowed='memcpy|memset|memmove|memcmp|__assert_fail|_GLOBAL_OFFSET_TABLE_|__stack_chk_fail'
allowed="$allowed|__popcount[sd]i2|__aeabi_(u?idiv(mod)?|u?ldivmod|lmul|llsl|llsr|lasr)"
"$nm" --defined-only --extern-only "$@" | awk 'NF == 3 { print $3 }' | sort -u > "$work/ours"
# Lines "archive:object: U symbol"
"$nm" -A -u "$@" > "$work/needed"
status=0
awk -v allowed="^($allowed)\$" -v ours="$work/ours" '
    BEGIN { while ((getline name < ours) > 0) defined[name] = 1 }
    NF >= 2 && !($NF in defined) && $NF !~ allowed {
        kind = $NF ~ /^_+(aeabi_)?[a-z]*[sdtx]f[a-z0-9]*$|^__(fix|float)/ ? " (soft float)" : ""
        split($1, at, ":")
        printf "%s, %s needs %s%s, which the core may not use\n", at[1], at[2], $NF, kind
        bad = 1
    }
    END { exit bad }' "$work/needed" || status=1

# x87 (f..., but not "fs" prefixes), MMX, SSE and AVX registers; on ARM, vector and float registers.
for archive; do
    "$objdump" -d --no-show-raw-insn "$archive" > "$work/code"
    awk -v archive="$archive" '
        /file format/ { object = $1; arm = /aarch64|arm/; next }
        /^[0-9a-f]+ <.*>:$/ { place = $2; next }
        {
            count += /^ +[0-9a-f]+:\t/
            code = $0
            sub(/^[^\t]*\t/, "", code)
            sub(/<.*/, "", code)
            sub(/[#;].*/, "", code)
            if (!arm && (code ~ /%([xyz]mm|mm|st)[0-7(]?/ || code ~ /^f[a-z0-9]+([ \t]|$)/) ||
                arm && code ~ /^(f[a-z0-9]+|[su]cvtf|v[a-z0-9.]+)[ \t]|[ ,{][bhsdqv][0-9]+([.,} ]|$)/) {
                printf "%s %s function %s has a floating-point or vector instruction: %s\n", \
                       archive, object, place, code
                bad = 1
            }
        }
        END { if (count < 100) { print archive ": no code seen, so nothing is proved"; bad = 1 }
              exit bad }' "$work/code" || status=1
done
[ $status -ne 0 ] || echo "symbols: no float, no heap, no system call in: $*"
exit $status
