#!/usr/bin/env bash
# Ten million rays of each watertight case, of triangles and of strands, on every instruction set, by hand: hours on
# all processors.
#
#   bash tests/watertight.sh [RAYS [PROGRAM...]]
#
# After tests/run.sh, whose build and figures it uses. PROGRAM is watertight or curves; both by default. Writes what
# each instruction set gave to build/results/kernels.PROGRAM.ISA.log and the table anew to
# build/results/stability.md. The exit code is 0 only if no ray was lost.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

rays=${1:-10000000}
programs=("${@:2}")
[ ${#programs[@]} -gt 0 ] || programs=(curves watertight)
results=build/results
isas=(scalar sse42 avx2 avx512) # slowest first; what this processor lacks is skipped with code 77

run_isa() {
    TRACER_ISA=$1 TRACER_TEST_RAYS=$2 "build/bin/test_kernels_$4" >"$3/kernels.$4.$1.log" 2>&1 ||
        [ $? -eq 77 ]
}
export -f run_isa
status=0
logs=()
for program in "${programs[@]}"; do
    printf '%s\n' "${isas[@]}" | xargs -P "$(nproc)" -I{} bash -c "run_isa {} $rays $results $program" || status=1
    logs+=("$results/kernels.$program".*.log)
done
python3 tests/support/stability.py "$results/ctest.xml" "${logs[@]}" --out "$results/stability.md"
head -n 1 "$results/stability.md"
exit $status
