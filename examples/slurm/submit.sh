#!/usr/bin/env bash
# Renders an animation on a Slurm cluster: a job array over frames and blocks of their samples, and a job
# that merges each frame when all are there.
#
#   bash submit.sh FILE.blend FOLDER FIRST LAST [TASKS [BLOCKS]]
#
# FOLDER, shared by all nodes, gets parts/, frames/, logs/ and a summary. TASKS: of the array for each frame
# (1); BLOCKS: parts that each task writes one after the other (4), of which those that are finished stay
# when it is stopped: at its time limit or for a job that goes before, after which it comes back for the rest.
# Options of sbatch (partition, time, processors) come by the environment:
# SBATCH_OPTIONS="--partition=render --time=60 --cpus-per-task=8". BLENDER: the program, ADDON: the module's
# name ("volley"; as an extension "bl_ext.user_default.volley").
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

[ $# -ge 4 ] || { sed -n '2,14s/^# \{0,1\}//p' "${BASH_SOURCE[0]}" >&2; exit 2; }
export VOLLEY_FILE VOLLEY_FOLDER VOLLEY_FIRST=$3 VOLLEY_LAST=$4
export VOLLEY_TASKS=${5:-1} VOLLEY_BLOCKS=${6:-4}
export BLENDER=${BLENDER:-blender} ADDON=${ADDON:-volley}
VOLLEY_FILE=$(realpath "$1")
mkdir -p "$2"/{parts,frames,logs}
VOLLEY_FOLDER=$(realpath "$2")

read -ra options <<<"${SBATCH_OPTIONS:-}"
count=$(((VOLLEY_LAST - VOLLEY_FIRST + 1) * VOLLEY_TASKS))
# A job that gets SIGTERM, a minute before its time is over, puts itself back into the queue.
array=$(sbatch --parsable --job-name=volley --array="0-$((count - 1))" --requeue --open-mode=append \
    --signal=B:TERM@60 --output="$VOLLEY_FOLDER/logs/render-%A_%a.log" "${options[@]}" "$here/task.sh")
merge=$(sbatch --parsable --job-name=volley-merge --dependency="afterok:$array" --kill-on-invalid-dep=yes \
    --requeue --open-mode=append --output="$VOLLEY_FOLDER/logs/merge-%j.log" "${options[@]}" "$here/merge.sh")
printf 'Render: job %s, %d tasks; merge: job %s; progress: squeue -o "%%i %%T %%k"\n' "$array" "$count" "$merge"
printf '%s\n' "$array" >"$VOLLEY_FOLDER/array.job"
printf '%s\n' "$merge" >"$VOLLEY_FOLDER/merge.job"
