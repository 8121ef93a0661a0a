#!/usr/bin/env bash
# Runs Python tests, two at once, and then by themselves those in windows, which go by the clock.
#
#   bash tests/run_pytest.sh PYTHON REPORT [PYTEST ARGUMENT]...
#
# REPORT is JUnit XML of all. The exit code is 0 if all pass, else that of the first run that fails.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

NONE_COLLECTED=5

python=$1 report=$2
shift 2
of_windows=${report%.xml}_window.xml
status=0

run() {
    local own=0
    "$python" -m pytest -q -ra -p no:cacheprovider --rootdir tests "$@" </dev/null || own=$?
    [ "$own" -ne "$NONE_COLLECTED" ] || own=0
    [ "$status" -ne 0 ] || status=$own
}

rm -f "$report" "$of_windows"
run "$@" -m "not window" -n 2 --dist loadfile --junit-xml "$report"
run "$@" -m window --junit-xml "$of_windows"
"$python" tests/support/merge_reports.py "$report" "$of_windows" || status=1
exit "$status"
