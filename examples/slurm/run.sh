#!/usr/bin/env bash
# Renders the example's animation on Slurm. On a fresh Debian machine: installs what is missing, builds, and
# where there is no Slurm starts one of this machine alone (as root). Says where the frames are.
#
#   bash examples/slurm/run.sh [FIRST LAST]    frames 1 to 8 if not given
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

out=$PWD/build/examples/slurm
first=${1:-1} last=${2:-8}

say() { printf '== %s\n' "$*"; }
die() { printf 'slurm/run.sh: %s\n' "$*" >&2; exit 1; }

bash tests/setup.sh
rm -rf "$out"
mkdir -p "$out"
if ! timeout 10 sinfo >/dev/null 2>&1; then
    [ "$(id -u)" -eq 0 ] || die "there is no Slurm here; as root one is started"
    say "Starting a Slurm of this machine"
    if ! command -v slurmctld munged >/dev/null; then
        DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends slurm-wlm munge \
            </dev/null >"$out/install.log" 2>&1 || die "Slurm could not be installed: $out/install.log"
    fi
    cluster=$(mktemp -d --tmpdir volley_slurm.XXXXXX)
    trap 'bash examples/slurm/cluster.sh stop "$cluster"' EXIT
    bash examples/slurm/cluster.sh start "$cluster" 2
    export SLURM_CONF=$cluster/slurm.conf
fi

say "Making the scene"
blender -b --factory-startup --python-exit-code 1 --python examples/make_character.py -- \
    "$out/character.blend" >"$out/scene.log" 2>&1 </dev/null || die "the scene was not made: $out/scene.log"

say "Rendering"
export BLENDER_USER_SCRIPTS=$PWD/build/blender
bash examples/slurm/submit.sh "$out/character.blend" "$out" "$first" "$last" 2 2
merge=$(cat "$out/merge.job")
while state=$(squeue -h -j "$merge" -o %T 2>/dev/null) && [ -n "$state" ]; do
    case $state in COMPLETED | FAILED | CANCELLED | TIMEOUT) break ;; esac
    sleep 2
done
count=$(find "$out/frames" -name '*.exr' | wc -l)
[ "$count" -eq $((last - first + 1)) ] || die "$count frames are there; logs: $out/logs"
printf 'Frames: %s/frames (%d)\n' "$out" "$count"
