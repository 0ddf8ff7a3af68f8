#!/bin/sh
# File name = module = prefix of its symbols, and no two source files share a name.
#
# Usage: tools/check/names.sh OBJECT_FOLDER    (objects of C modules lie there as path/to/FILE.c.o)
set -eu
[ $# -eq 1 ] || { echo "usage: $0 OBJECT_FOLDER" >&2; exit 2; }
objects=$1
status=0

# README.md and objects.mk stand in many folders, a header may share its source's name.
git ls-files --cached --others --exclude-standard -- '*.c' '*.cc' '*.h' '*.py' '*.sh' | awk -F/ '
    {
        if ($NF in first) {
            printf "%s and %s share a name; rename one\n", first[$NF], $0
            bad = 1
        }
        first[$NF] = $0
    }
    END { if (NR == 0) { print "names: no source files seen"; bad = 1 }; exit bad }' || status=1

checked=0
for source in $(git ls-files --cached --others --exclude-standard -- \
                'common/*.c' 'firmware/detect/*.c' 'firmware/app/*.c' 'firmware/capture/*.c' \
                'firmware/net/*.c' 'tests/unit/synth*.c'); do
    object=$objects/$source.o
    [ -f "$object" ] || continue
    checked=$((checked + 1))
    name=$(basename "$source" .c)
    case $name in
    *_table)        prefix=${name%_table}_ ;;      # generated: taps_table, layout_table_level2 ...
    dsp_*)          prefix=$name ;;                # one kernel table, named as its file
    sock_sys_linux) prefix=sock_sys_ ;;            # the seam's real side: declared in sock_sys.h
    synth_patch)    prefix=synth_ ;;               # second half of synth.h
    *_main|main_*)  prefix=main ;;
    *)              prefix=${name}_ ;;
    esac
    # A symbol may be the module's name itself.
    foreign=$(nm --defined-only --extern-only "$object" | awk -v prefix="$prefix" \
        'NF == 3 && index($3, prefix) != 1 && $3 "_" != prefix { print $3 }')
    for symbol in $foreign; do
        echo "$source exports $symbol, which does not begin with $prefix"
        status=1
    done
done
if [ $checked -lt 20 ]; then
    echo "names: only $checked objects in $objects; build first"
    status=1
fi
[ $status -ne 0 ] || echo "names: unique, and $checked modules export only their own"
exit $status
