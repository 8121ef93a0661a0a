#!/usr/bin/env bash
# Set-up, build, every test; the last line is "N passed, N failed" (", N skipped").
#
#   bash tests/run.sh [--checks FILE]
#
# FILE holds further results to count, one per line: "passed NAME" or "failed NAME". The exit code is 0
# only if something passed and nothing failed. Python tests find the build through these variables:
#   VOLLEY_BUILD          the build folder
#   BLENDER_USER_SCRIPTS  the folder that makes Blender find the add-on
# tests/support is on their import path.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

results=build/results
summary=(--ctest "$results/ctest.xml" --pytest "$results/pytest.xml")

say() { printf '== %s\n' "$*"; }

# The first interpreter that has numpy and pytest: Debian's, even if another comes first in PATH.
find_python() {
    local python
    for python in python3 /usr/bin/python3; do
        if "$python" -c 'import numpy, pytest' >/dev/null 2>&1 </dev/null; then
            printf '%s\n' "$python"
            return
        fi
    done
    printf 'tests/run.sh: no python3 with numpy and pytest\n' >&2
    return 1
}

run_ctest() {
    say "Tests in C"
    ctest --test-dir build --output-on-failure --no-tests=ignore -j "$(nproc)" --no-compress-output \
        --output-junit "$PWD/$results/ctest.xml" </dev/null
}

run_pytest() {
    local folder folders=()
    for folder in api statistics blender golden; do
        if [ -n "$(find "tests/$folder" -name 'test_*.py' -print -quit 2>/dev/null)" ]; then
            folders+=("tests/$folder")
        fi
    done
    [ ${#folders[@]} -gt 0 ] || return 0
    say "Tests in Python"
    VOLLEY_BUILD=$PWD/build BLENDER_USER_SCRIPTS=$PWD/build/blender \
        PYTHONPATH=$PWD/tests/support${PYTHONPATH:+:$PYTHONPATH} \
        "$python" -m pytest -q -ra -p no:cacheprovider --rootdir tests \
        --junit-xml "$results/pytest.xml" "${folders[@]}" </dev/null
}

while [ $# -gt 0 ]; do
    case $1 in
        --checks) summary+=(--checks "${2:?--checks needs a file}"); shift 2 ;;
        *) printf 'tests/run.sh: unknown argument: %s\n' "$1" >&2; exit 2 ;;
    esac
done

if ! bash tests/setup.sh; then
    printf '0 passed, 1 failed\n'
    exit 1
fi
python=$(find_python)
rm -rf "$results"
mkdir -p "$results"

ctest_status=0
run_ctest || ctest_status=$?
pytest_status=0
run_pytest || pytest_status=$?
exec "$python" tests/support/summary.py "${summary[@]}" \
    --ctest-status "$ctest_status" --pytest-status "$pytest_status"
