#!/usr/bin/env bash
# Which lines and branches of the library the tests run through, in C and in Blender where it is: by hand, it
# takes long.
#
#   bash tests/coverage.sh [CTEST ARGUMENTS]      such as -R '^unit|scalar'
#
# Builds into build-coverage, runs the tests, prints a table by file and writes the lines that were not
# reached to build-coverage/coverage.txt, the branches to build-coverage/branches.txt. Kernels are counted
# over all instruction sets together. Branches that only the compiler made (exceptions, unreachable) do not
# count.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if ! command -v gcovr >/dev/null; then
    printf 'gcovr is missing: apt-get install gcovr\n' >&2
    exit 1
fi
cmake -G Ninja -C .cmake/coverage.cmake -S . -B build-coverage
cmake --build build-coverage
find build-coverage -name '*.gcda' -delete
# Tests of many rays prove nothing more here.
TRACER_TEST_RAYS=2000 ctest --test-dir build-coverage --output-on-failure -j "$(nproc)" "$@"
if command -v blender >/dev/null; then
    source tests/find_python.sh
    # A test that fails here, say since it had to wait too long, still runs through lines.
    BLENDER_USER_SCRIPTS=$PWD/build-coverage/blender VOLLEY_BUILD=$PWD/build-coverage \
        "$(find_python numpy pytest)" -m pytest -q -p no:cacheprovider --rootdir tests tests/blender || true
fi
report=(gcovr --root . --filter libtracer/ --exclude-throw-branches --exclude-unreachable-branches
    --object-directory build-coverage)
"${report[@]}" --txt build-coverage/coverage.txt
"${report[@]}" --branches --txt build-coverage/branches.txt
cat build-coverage/coverage.txt
printf 'branches: %s\n' "$(tail -n 2 build-coverage/branches.txt | head -n 1)"
