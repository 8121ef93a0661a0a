#!/usr/bin/env bash
# One task of the array of submit.sh.
set -uo pipefail

frame=$((VOLLEY_FIRST + SLURM_ARRAY_TASK_ID / VOLLEY_TASKS))
task=$((SLURM_ARRAY_TASK_ID % VOLLEY_TASKS))
first=$((task * VOLLEY_BLOCKS))
threads=${SLURM_CPUS_PER_TASK:-${SLURM_CPUS_ON_NODE:-0}}
main="import importlib; importlib.import_module('$ADDON.farm.command').main()"

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
# -t for what Blender itself evaluates: some of its modifiers differ in the last digit with more threads.
"$BLENDER" -b -t "$threads" --addons "$ADDON" "$VOLLEY_FILE" --python-exit-code 1 --python-expr "$main" -- render \
    --frames "$frame" --parts "$VOLLEY_FOLDER/parts" --strict --summary "$VOLLEY_FOLDER/logs/summary.json" \
    --blocks "$first-$((first + VOLLEY_BLOCKS - 1))/$((VOLLEY_TASKS * VOLLEY_BLOCKS))" </dev/null &
blender=$!
trap 'kill -TERM "$blender"; was_stopped=1' TERM
was_stopped=
wait "$blender"
status=$?
if [ -n "$was_stopped" ]; then
    wait "$blender" # the first one ended with the signal
    status=$?
    # Preempted jobs go back by themselves.
    [ "$status" -eq 0 ] || scontrol requeue "$SLURM_JOB_ID" || true
fi
exit "$status"
