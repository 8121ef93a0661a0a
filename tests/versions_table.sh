#!/usr/bin/env bash
# Measures how far shaders, nodes, lights and passes are from Cycles' in the Blender of this system and in 4.3
# and 5.2 (see blender_next.sh), and writes tests/versions_table.md. Of the build as it is; about a quarter of
# an hour on two processors.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source tests/find_python.sh

results=$PWD/build/results
mapfile -t tests < <(grep -l 'write_result(' tests/blender/test_*.py)
mkdir -p "$results"
rm -rf "$results"/next_*/
VOLLEY_BUILD=$PWD/build BLENDER_USER_SCRIPTS=$PWD/build/blender PYTHONPATH=$PWD/tests/support \
    bash tests/run_pytest.sh "$(find_python numpy pytest xdist)" "$results/versions.xml" "${tests[@]}"
for suite in trixie sid; do
    bash tests/blender_next.sh --suite "$suite" --results "$results/next_$suite" "${tests[@]}"
done
python3 tests/versions_table.py
