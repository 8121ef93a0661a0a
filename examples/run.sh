#!/usr/bin/env bash
# Installs what is missing, builds, renders the example character through Blender, and says where the
# picture is.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

out=$PWD/build/examples
picture=$out/character_0001.png

say() { printf '== %s\n' "$*"; }
die() { printf 'examples/run.sh: %s\n' "$*" >&2; exit 1; }

bash tests/setup.sh
mkdir -p "$out"
rm -f "$picture" "$out/character.blend"

say "Making the scene"
if ! blender -b --factory-startup --python-exit-code 1 --python examples/make_character.py -- \
    "$out/character.blend" >"$out/scene.log" 2>&1 </dev/null; then
    tail -n 40 "$out/scene.log" >&2
    die "the scene was not made; Blender's output: $out/scene.log"
fi
[ -s "$out/character.blend" ] || die "the script ran but left no $out/character.blend"

say "Rendering"
start=$EPOCHREALTIME
status=0
BLENDER_USER_SCRIPTS=$PWD/build/blender blender -b --addons volley "$out/character.blend" \
    -E VOLLEY -o "$out/character_####" -F PNG -f 1 >"$out/render.log" 2>&1 </dev/null ||
    status=$?
end=$EPOCHREALTIME
if [ "$status" -ne 0 ] || grep -qE '^Traceback|^Error:' "$out/render.log"; then
    tail -n 40 "$out/render.log" >&2
    die "the render failed (exit code $status); Blender's output: $out/render.log"
fi
[ -s "$picture" ] || die "Blender ended without an error but left no $picture"
[ "$(head -c 4 "$picture" | tail -c 3)" = PNG ] || die "$picture is not a PNG file"

grep -E '^ *Time: ' "$out/render.log" | tail -n 1 || true
# EPOCHREALTIME has the locale's decimal mark and always six decimals.
micros=$((${end/[.,]/} - ${start/[.,]/}))
printf 'Picture: %s\n' "$picture"
printf 'Time:    %d.%02d s, Blender start to end\n' $((micros / 1000000)) $((micros % 1000000 / 10000))
