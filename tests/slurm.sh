#!/usr/bin/env bash
# The example's animation on a Slurm of this machine: every frame has the bits of one machine's though a node
# is killed in the middle, a job comes to its time limit, and another makes way for an urgent one. As root,
# with the packages slurm-wlm and munge. For the hand: some minutes.
#
#   bash tests/slurm.sh [--quick]     48 frames on 4 nodes, or 4 on 2
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

frames=48 nodes=4
[ "${1:-}" = --quick ] && frames=4 nodes=2
build=${VOLLEY_BUILD:-$PWD/build}
export BLENDER_USER_SCRIPTS=$build/blender
out=$(mktemp -d --tmpdir volley_farm.XXXXXX)
trap 'bash examples/slurm/cluster.sh stop "$out/cluster"' EXIT
LONG_BLOCKS=12
LONG_SAMPLES=$((LONG_BLOCKS * 64)) # which take a processor more than the minute of the shortest limit

die() { printf 'slurm.sh: %s; files: %s\n' "$*" "$out" >&2; exit 1; }
done_parts() { find "$1/parts" -name '*.part.exr' ! -name '.*' | wc -l; }
state_of() { squeue -h -j "$1" -o %T 2>/dev/null || true; }
restarts_of() { scontrol show job "$1" | sed -n 's/.*Restarts=\([0-9]*\).*/\1/p' | head -n 1; }

# The example's scene, small, with SAMPLES at WIDTH, in FILE.
save_scene() {
    local samples=$1 width=$2 file=$3
    blender -b --addons volley "$out/made.blend" --python-exit-code 1 --python-expr "
import bpy
render = bpy.context.scene.render
render.engine = 'VOLLEY'
render.resolution_x, render.resolution_y, render.resolution_percentage = $width, $width * 9 // 16, 100
render.image_settings.file_format, render.image_settings.color_depth = 'OPEN_EXR_MULTILAYER', '32'
bpy.context.scene.volley.samples = $samples
layer = bpy.context.view_layer
layer.use_pass_z = layer.use_pass_normal = layer.use_pass_cryptomatte_object = True
bpy.ops.wm.save_as_mainfile(filepath='$file')" >>"$out/scene.log" 2>&1 </dev/null
}

# Frames 1 to LAST by one machine, in FOLDER.
render_whole() {
    local file=$1 folder=$2 last=$3
    # -t 1 as on the nodes: two starts of Blender with more threads give meshes that differ in the last digit.
    blender -b -t 1 --addons volley "$file" --python-exit-code 1 --python-expr \
        "import volley.farm.command as c; c.main()" -- render --frames "1-$last" --threads 1 \
        --output "$folder/whole_####" >"$folder/whole.log" 2>&1 </dev/null || die "one machine failed"
}

wait_for_end() {
    local state
    for _ in $(seq 600); do
        state=$(state_of "$1")
        case $state in "" | COMPLETED | FAILED | CANCELLED) return ;; esac
        sleep 1
    done
}

# Frames 1 to LAST of FOLDER, merged, beside those that the folder WHOLE has.
compare() {
    local folder=$1 last=$2 whole=$3
    "$python" - "$folder" "$last" "$whole" <<'PYTHON' || die "frames differ"
import sys

import OpenImageIO as oiio
import numpy as np


def planes(path):
    image = oiio.ImageInput.open(path)
    if image is None:
        sys.exit(f"{path}: {oiio.geterror()}")
    pixels = image.read_image("float")
    return {name: np.ascontiguousarray(pixels[..., k]).view(np.uint32)
            for k, name in enumerate(image.spec().channelnames)}


folder, count, other = sys.argv[1], int(sys.argv[2]), sys.argv[3]
different = numbers = 0
for frame in range(1, count + 1):
    whole, merged = planes(f"{other}/whole_{frame:04d}.exr"), planes(f"{folder}/frames/frame_{frame:04d}.exr")
    assert whole.keys() == merged.keys() and len(whole) > 8, (sorted(whole), sorted(merged))
    different += sum(int((whole[name] != merged[name]).sum()) for name in whole)
    numbers += sum(values.size for values in whole.values())
print(f"{count} frames, {different} of {numbers} numbers differ")
sys.exit(different != 0)
PYTHON
}

test_killed_node() {
    local folder=$out/killed merge lost
    bash examples/slurm/submit.sh "$out/short.blend" "$folder" 1 "$frames" 1 2
    merge=$(cat "$folder/merge.job")
    while [ "$(done_parts "$folder")" -lt $((frames / 2)) ]; do
        [ -n "$(state_of "$merge")" ] || die "the jobs ended before a node was killed"
        sleep 0.2
    done
    lost=$(squeue -h -t running -n volley -o '%N' | head -n 1)
    bash examples/slurm/cluster.sh kill "$out/cluster" "${lost:-n1}"
    printf 'Killed %s after %d of %d parts\n' "${lost:-n1}" "$(done_parts "$folder")" $((2 * frames))
    render_whole "$out/short.blend" "$folder" "$frames"
    wait_for_end "$merge"
    compare "$folder" "$frames" "$folder"
    [ "$(grep -l 'Volley: summary' "$folder"/logs/render-*_*.log | wc -l)" -eq "$frames" ] ||
        die "not every task has its log"
    bash examples/slurm/cluster.sh revive "$out/cluster" "${lost:-n1}"
}

# A frame of many parts that is stopped in FOLDER: by OPTIONS of sbatch, and by a command WITHIN.
test_stopped() {
    local folder=$out/$1 options=$2 within=${3:-} array merge comment=""
    SBATCH_OPTIONS=$options bash examples/slurm/submit.sh "$out/long.blend" "$folder" 1 1 1 "$LONG_BLOCKS"
    merge=$(cat "$folder/merge.job") array=$(cat "$folder/array.job")
    while [ "$(done_parts "$folder")" -lt 2 ]; do
        [ -n "$(state_of "$merge")" ] || die "the job ended before it was stopped"
        sleep 0.2
    done
    [ -z "$within" ] || $within
    for _ in $(seq 300); do
        [ -n "$comment" ] || comment=$(squeue -h -j "$array" -o %k | grep progress || true)
        [ "$(restarts_of "$array")" -eq 0 ] || break
        sleep 0.5
    done
    [ "$(restarts_of "$array")" -gt 0 ] || die "$1: the job did not go back"
    find "$folder/parts" -name '*.part.exr' -printf '%f %i %T@\n' | sort >"$folder/kept"
    printf '%s: went back with %d of %d parts; its comment: %s\n' "$1" "$(wc -l <"$folder/kept")" \
        "$LONG_BLOCKS" "$comment"
    [ "$(wc -l <"$folder/kept")" -lt "$LONG_BLOCKS" ] || die "$1: it was not stopped"
    [ -n "$comment" ] || die "$1: the job's comment says nothing of its progress"
    wait_for_end "$merge"
    grep -q 'stopped by SIGTERM' "$folder"/logs/render-*_0.log || die "$1: it was not stopped by SIGTERM"
    find "$folder/parts" -name '*.part.exr' -printf '%f %i %T@\n' | sort >"$folder/parts.list"
    [ -z "$(comm -23 "$folder/kept" "$folder/parts.list")" ] || die "$1: finished parts were rendered again"
    compare "$folder" 1 "$out"
}

# A job on the node of the one that runs, which has to make way.
urgent_job() {
    sbatch -Q --partition=urgent --nodelist="$(squeue -h -t running -n volley -o %N | head -n 1)" \
        --output=/dev/null --wrap "sleep 3"
}

# A task of which no part fits into its time ends as failed, instead of coming back for ever.
test_hopeless() {
    local folder=$out/hopeless merge
    SBATCH_OPTIONS="--time=1 --signal=B:TERM@60" bash examples/slurm/submit.sh "$out/long.blend" "$folder" 1 1 1 1
    merge=$(cat "$folder/merge.job")
    wait_for_end "$merge"
    grep -q 'No part was finished' "$folder"/logs/render-*_0.log || die "a hopeless task was not refused"
    printf 'hopeless: refused\n'
}

python=$(bash -c 'source tests/find_python.sh && find_python OpenImageIO numpy')
blender -b --factory-startup --python-exit-code 1 --python examples/make_character.py -- "$out/made.blend" \
    >"$out/scene.log" 2>&1 </dev/null
save_scene 8 64 "$out/short.blend"
save_scene "$LONG_SAMPLES" 512 "$out/long.blend"
bash examples/slurm/cluster.sh start "$out/cluster" "$nodes" 27817
export SLURM_CONF=$out/cluster/slurm.conf
test_killed_node
render_whole "$out/long.blend" "$out" 1
test_stopped preempted "" urgent_job
test_stopped time_limit "--time=1 --signal=B:TERM@10"
test_hopeless
rm -rf "$out"/{killed,preempted,time_limit,hopeless} "$out"/whole_*
