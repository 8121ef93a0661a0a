#!/usr/bin/env bash
# Measures speed against error and writes a report: Markdown, SVG plots, pictures, raw JSON.
#
#   bash tests/bench/report.sh [--quick|--full] [--out DIR] [--draw] [--baseline] [--parts PART...]
#
# The default takes about 35 minutes on two quiet cores, --quick about 4, --full a night. --draw draws
# the report of DIR anew from its JSON. DIR is build/report; tests/bench/report is the committed one.
# With --quick the ratios are compared with the committed baseline: the exit code is 1 if one of them
# fell far in repeated runs; with --baseline too, that baseline is written instead. A run into
# tests/bench/report brings README.md up to it. What is missing is installed as tests/setup.sh does it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

find_python() {
    local python
    for python in python3 /usr/bin/python3; do
        if "$python" -c 'import numpy, matplotlib' >/dev/null 2>&1 </dev/null; then
            printf '%s\n' "$python"
            return
        fi
    done
    printf 'report.sh: no python3 with numpy and matplotlib (python3-matplotlib)\n' >&2
    return 1
}

# A build that is there is measured as it is; a report can be drawn without one.
if [ ! -x build/bin/tracer_bench ] || [ ! -x build/bin/frame_bench ] || ! find_python >/dev/null; then
    bash tests/setup.sh --report
fi
python=$(find_python)
exec "$python" tests/bench/report.py "$@"
