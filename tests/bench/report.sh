#!/usr/bin/env bash
# Measures speed against error and writes a report: Markdown, SVG plots, pictures, raw JSON.
#
#   bash tests/bench/report.sh [--quick|--full] [--out DIR] [--measure|--draw [--again DIR]]
#                              [--baseline] [--parts PART... [--only SCENE...]]
#
# On two quiet cores --quick takes about 4 minutes; the default an estimated 300, --full a night.
# --measure draws nothing; --draw draws the report of DIR anew from its JSON, with --again a second
# run's beside it. DIR is build/report; tests/bench/report is the committed one. With --quick the
# ratios are compared with the committed baseline: the exit code is 1 if one of them fell far in
# repeated runs; with --baseline too, that baseline is written instead. A run into tests/bench/report
# brings README.md up to it. `--parts denoise` takes some 30 minutes. What is missing is installed as
# tests/setup.sh does it. Parts in _trixie and _sid are beside Cycles of Blender 4.3 and 5.2, kernels_sid beside
# Embree 4 (see blender_next.sh); they are left out where those cannot be had. --scenes names the folder of scenes
# that are not made here.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

source tests/find_python.sh

# A build that is there is measured as it is; a report can be drawn without one.
if [ ! -x build/bin/tracer_bench ] || [ ! -x build/bin/frame_bench ] ||
    ! find_python numpy matplotlib >/dev/null; then
    bash tests/setup.sh --report
fi
python=$(find_python numpy matplotlib)
exec "$python" tests/bench/report.py "$@"
