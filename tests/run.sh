#!/usr/bin/env bash
# Set-up, build, every test; the last line is "N passed, N failed" (", N skipped").
#
#   bash tests/run.sh [--checks FILE] [--blender-next] [--blender-next-fast]
#
# FILE holds further results to count, one per line: "passed NAME" or "failed NAME". --blender-next runs
# the Blender tests in Blender 4.3 and 5.2 too, --blender-next-fast a selection of them (see
# blender_next.sh); where one of the two cannot be set up, it is one test skipped. What tests measured of
# numerical stability is in build/results/stability.md. The exit code is 0 only if something passed and nothing
# failed. Python tests find the build through these variables:
#   VOLLEY_BUILD          the build folder
#   BLENDER_USER_SCRIPTS  the folder that makes Blender find the add-on
# tests/support is on their import path.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

source tests/find_python.sh

results=build/results
summary=()
next=""   # what to run in newer Blenders: all or fast
suites=() # of Debian that have those

say() { printf '== %(%T)T %s\n' -1 "$*"; }

run_ctest() {
    say "Tests in C"
    ctest --test-dir build --output-on-failure --no-tests=ignore -j "$(nproc)" --no-compress-output \
        --test-output-size-passed 1000000 --output-junit "$PWD/$results/ctest.xml" </dev/null
}

run_pytest() {
    local folder folders=()
    for folder in api statistics blender; do
        if [ -n "$(find "tests/$folder" -name 'test_*.py' -print -quit 2>/dev/null)" ]; then
            folders+=("tests/$folder")
        fi
    done
    [ ${#folders[@]} -gt 0 ] || return 0
    say "Tests in Python"
    VOLLEY_BUILD=$PWD/build BLENDER_USER_SCRIPTS=$PWD/build/blender \
        PYTHONPATH=$PWD/tests/support${PYTHONPATH:+:$PYTHONPATH} \
        bash tests/run_pytest.sh "$python" "$results/pytest.xml" "${folders[@]}"
}

run_blender_next() {
    local suite=$1 status=0
    local name=$results/next_$suite
    local arguments=(--suite "$suite" --report "$name.xml" --results "$name")
    [ "$next" = all ] || arguments+=(--fast)
    bash tests/blender_next.sh "${arguments[@]}" 2>&1 | tee "$name.log" || status=$?
    if [ "$status" -eq 77 ]; then
        printf 'skipped %s\n' "$(tail -n 1 "$name.log")" >"$name.checks"
        summary+=(--checks "$name.checks")
    else
        summary+=(--pytest "$name.xml" "$status")
    fi
}

while [ $# -gt 0 ]; do
    case $1 in
        --checks) summary+=(--checks "${2:?--checks needs a file}"); shift 2 ;;
        --blender-next) next=all suites=(trixie sid); shift ;;
        --blender-next-fast) next=fast suites=(trixie sid); shift ;;
        *) printf 'tests/run.sh: unknown argument: %s\n' "$1" >&2; exit 2 ;;
    esac
done

if ! bash tests/setup.sh; then
    printf '0 passed, 1 failed\n'
    exit 1
fi
python=$(find_python numpy pytest xdist)
rm -rf "$results"
mkdir -p "$results"

status=0
run_ctest || status=$?
summary+=(--ctest "$results/ctest.xml" "$status")
"$python" tests/support/stability.py "$results/ctest.xml" --out "$results/stability.md" || true
status=0
run_pytest || status=$?
summary+=(--pytest "$results/pytest.xml" "$status")
for suite in "${suites[@]}"; do
    run_blender_next "$suite"
done
exec "$python" tests/support/summary.py "${summary[@]}"
