#!/usr/bin/env bash
# The example's animation on a Slurm of this machine, a node of which is killed in the middle: every frame has
# the bits of one machine's. As root, with the packages slurm-wlm and munge. For the hand.
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

die() { printf 'slurm.sh: %s; files: %s\n' "$*" "$out" >&2; exit 1; }
done_parts() { find "$out/parts" -name '*.part.exr' ! -name '.*' | wc -l; }

blender -b --factory-startup --python-exit-code 1 --python examples/make_character.py -- "$out/made.blend" \
    >"$out/scene.log" 2>&1 </dev/null
blender -b --addons volley "$out/made.blend" --python-exit-code 1 --python-expr "
import bpy
render = bpy.context.scene.render
render.engine = 'VOLLEY'
render.resolution_x, render.resolution_y, render.resolution_percentage = 64, 36, 100
render.image_settings.file_format, render.image_settings.color_depth = 'OPEN_EXR_MULTILAYER', '32'
bpy.context.scene.volley.samples = 8
layer = bpy.context.view_layer
layer.use_pass_z = layer.use_pass_normal = layer.use_pass_cryptomatte_object = True
bpy.ops.wm.save_as_mainfile(filepath='$out/scene.blend')" >>"$out/scene.log" 2>&1 </dev/null
bash examples/slurm/cluster.sh start "$out/cluster" "$nodes" 27817
export SLURM_CONF=$out/cluster/slurm.conf
bash examples/slurm/submit.sh "$out/scene.blend" "$out" 1 "$frames" 1 2
merge=$(cat "$out/merge.job")

while [ "$(done_parts)" -lt $((frames / 2)) ]; do
    squeue -h -j "$merge" -o %T | grep -q . || die "the jobs ended before a node was killed"
    sleep 0.2
done
lost=$(squeue -h -t running -n volley -o '%N' | head -n 1)
bash examples/slurm/cluster.sh kill "$out/cluster" "${lost:-n1}"
printf 'Killed %s after %d of %d parts\n' "${lost:-n1}" "$(done_parts)" $((2 * frames))

# -t 1 as on the nodes: two starts of Blender with more threads give meshes that differ in the last digit.
blender -b -t 1 --addons volley "$out/scene.blend" --python-exit-code 1 --python-expr \
    "import volley.farm.command as c; c.main()" -- render --frames "1-$frames" --threads 1 \
    --output "$out/whole_####" >"$out/whole.log" 2>&1 </dev/null || die "one machine failed"
for _ in $(seq 600); do
    state=$(squeue -h -j "$merge" -o %T 2>/dev/null || true)
    case $state in "" | COMPLETED | FAILED | CANCELLED) break ;; esac
    sleep 1
done
python=$(bash -c 'source tests/find_python.sh && find_python OpenImageIO numpy')
"$python" - "$out" "$frames" <<'PYTHON' || die "frames differ"
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


folder, count = sys.argv[1], int(sys.argv[2])
different = numbers = 0
for frame in range(1, count + 1):
    whole, merged = planes(f"{folder}/whole_{frame:04d}.exr"), planes(f"{folder}/frames/frame_{frame:04d}.exr")
    assert whole.keys() == merged.keys() and len(whole) > 8, (sorted(whole), sorted(merged))
    different += sum(int((whole[name] != merged[name]).sum()) for name in whole)
    numbers += sum(values.size for values in whole.values())
print(f"{count} frames, {different} of {numbers} numbers differ")
sys.exit(different != 0)
PYTHON
rm -rf "$out"/{parts,frames,logs} "$out"/whole_*
