#!/usr/bin/env bash
# One task of the array of submit.sh.
set -uo pipefail

frame=$((VOLLEY_FIRST + SLURM_ARRAY_TASK_ID / VOLLEY_TASKS))
task=$((SLURM_ARRAY_TASK_ID % VOLLEY_TASKS))
first=$((task * VOLLEY_BLOCKS))
threads=${SLURM_CPUS_PER_TASK:-${SLURM_CPUS_ON_NODE:-0}}
main="import importlib; importlib.import_module('$ADDON.farm.command').main()"

STOPPED=143 # of Blender: by SIGTERM, at a time limit or for a job that goes before

parts_of_frame() { find "$VOLLEY_FOLDER/parts" -name "$(printf '%06d' "$frame").*.part.exr" | wc -l; }

is_preempted() { scontrol show job "$SLURM_JOB_ID" | grep -q 'PreemptTime=[0-9]'; }

# Lines of progress become the job's comment, the others its log.
watch() {
    local line
    while IFS= read -r line; do
        printf '%s\n' "$line"
        case $line in
        "Volley: frame "*" progress "*) scontrol update JobId="$SLURM_JOB_ID" Comment="${line#Volley: }" \
            >/dev/null 2>&1 || true ;;
        esac
    done
}

exec > >(watch) 2>&1
before=$(parts_of_frame)
# -t for what Blender itself evaluates: some of its modifiers differ in the last digit with more threads.
"$BLENDER" -b -t "$threads" --addons "$ADDON" "$VOLLEY_FILE" --python-exit-code 1 --python-expr "$main" -- render \
    --frames "$frame" --parts "$VOLLEY_FOLDER/parts" --strict --summary "$VOLLEY_FOLDER/logs/summary.json" \
    --blocks "$first-$((first + VOLLEY_BLOCKS - 1))/$((VOLLEY_TASKS * VOLLEY_BLOCKS))" </dev/null &
blender=$!
trap 'kill -TERM "$blender" 2>/dev/null' TERM
wait "$blender"
status=$?
while kill -0 "$blender" 2>/dev/null; do # it was the signal that ended the wait
    wait "$blender"
    status=$?
done
if [ "$status" -eq "$STOPPED" ]; then
    # A task that cannot finish a part in its time would come back for ever; one that made way may.
    if [ "$(parts_of_frame)" -gt "$before" ] || is_preempted; then
        scontrol requeue "$SLURM_JOB_ID" && exit "$status"
    fi
    printf 'No part was finished in the time of the job: give it more time, or the frame more blocks\n'
fi
exit "$status"
