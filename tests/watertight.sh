#!/usr/bin/env bash
# Ten million rays of each watertight case on every instruction set, by hand: hours on all processors.
#
#   bash tests/watertight.sh [RAYS]
#
# After tests/run.sh, whose build and figures it uses. Writes what each instruction set gave to
# build/results/kernels.watertight.ISA.log and the table anew to build/results/stability.md. The exit code
# is 0 only if no ray was lost.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

rays=${1:-10000000}
results=build/results
isas=(scalar sse42 avx2 avx512) # slowest first; what this processor lacks is skipped with code 77

run_isa() {
    TRACER_ISA=$1 TRACER_TEST_RAYS=$2 build/bin/test_kernels_watertight >"$3/kernels.watertight.$1.log" 2>&1 ||
        [ $? -eq 77 ]
}
export -f run_isa
status=0
printf '%s\n' "${isas[@]}" | xargs -P "$(nproc)" -I{} bash -c "run_isa {} $rays $results" || status=1
python3 tests/support/stability.py "$results/ctest.xml" "$results"/kernels.watertight.*.log \
    --out "$results/stability.md"
head -n 1 "$results/stability.md"
exit $status
