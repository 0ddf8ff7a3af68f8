#!/bin/sh
# The main job, end to end: a target, frames of it, three cameras that detect and stream, one receiver, the
# solved rig, and how far all of that is from the truth. Everything is written below build/demo (or $1).
set -eu
cd "$(dirname "$0")/../.."
out=${1:-build/demo}
bin=build/bin
cameras="cam0 cam1 cam2"

step() { printf '\n== %s\n' "$*"; }
die() { printf 'demo: error: %s\n' "$*" >&2; exit 1; }

for program in tessera-target tessera-render tessera-replay tessera-cam tessera-rig; do
    [ -x "$bin/$program" ] || die "$bin/$program is not built; run: make all"
done

mkdir -p "$out"
running=
# Whatever ends this script ends its processes too.
trap 'kill $running 2>/dev/null || true' EXIT
trap 'exit 130' INT TERM

step "1/6 target: 7 x 12 patches of 120 mm -> $out/target.pdf"
"$bin/tessera-target" --rows 7 --cols 12 --patch-mm 120 --seed 7 --name demo \
    --out "$out/target.json" --pdf "$out/target.pdf" --png "$out/target.png" --dpi 30

step "2/6 frames with truth: 3 cameras, 25 instants -> $out/recording"
rm -rf "$out/recording"
"$bin/tessera-render" tools/render/scenes/demo.json --target "$out/target.json" \
    --out "$out/recording" --jobs "$(nproc)"

step "3/6 receiver -> $out/demo.journal"
rm -f "$out/demo.journal" "$out/port"
"$bin/tessera-rig" receive --listen 127.0.0.1:0 --port-file "$out/port" --cameras 3 --until-closed \
    --journal "$out/demo.journal" &
receiver=$!
running=$receiver
waited=0
while [ ! -s "$out/port" ]; do
    kill -0 "$receiver" 2>/dev/null || die "the receiver did not start"
    [ "$waited" -lt 100 ] || die "the receiver names no port"
    waited=$((waited + 1))
    sleep 0.1
done
port=$(cat "$out/port")

step "4/6 three cameras detect and stream features (no image leaves them)"
names=
for camera in $cameras; do
    "$bin/tessera-replay" --frames "$out/recording/$camera" --device /dev/video0 --once -- \
        "$bin/tessera-cam" --device /dev/video0 --serial "$camera" --clock file --wait \
        --target "$out/target.json" --to "127.0.0.1:$port" &
    names="$names $camera:$!"
    running="$running $!"
done
for name in $names; do
    wait "${name#*:}" || die "${name%:*} failed (see above)"
done
wait "$receiver" || die "the receiver failed (see above)"
running=

step "5/6 solve -> $out/result"
"$bin/tessera-rig" solve "$out/demo.journal" --target "$out/target.json" --out "$out/result"

step "6/6 compare with the truth"
"$bin/tessera-rig" journal csv "$out/demo.journal" >"$out/features.csv"
/usr/bin/python3 tools/demo/compare.py --recording "$out/recording" --features "$out/features.csv" \
    --result "$out/result"

cat <<END

Written:
  $out/target.pdf            the target, to print
  $out/recording/            the frames and their truth
  $out/demo.journal          what the cameras sent
  $out/result/rig.json       the calibrated rig
  $out/result/summary.txt    the summary, with pictures beside it
END
