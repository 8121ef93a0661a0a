# SPDX-License-Identifier: Apache-2.0
"""What Blender waits for besides rays: starting with the add-on, and sending edits to the library."""

import pathlib
import time

import compare_cycles

from . import programs

VIEWPORT = pathlib.Path(compare_cycles.SETUPS_FILE).with_name("viewport.py")
FINAL_EDITS = VIEWPORT.with_name("final_edits.py")


def measure(options, scope):
    """{"start": {case: seconds of each repeat}, "edits": rows of viewport.py, "final_edits": of final_edits.py}."""
    cases = {"without the add-on": [], "with the add-on": ["--addons", "volley"]}
    start = {case: [] for case in cases}
    for _repeat in range(scope.repeats + 1):
        for case, arguments in cases.items():
            begin = time.perf_counter()
            compare_cycles.run_blender([*arguments, "--python-expr", "pass"], options)
            start[case].append(time.perf_counter() - begin)
    # The first start of each reads its files from the disk.
    return {"start": {case: seconds[1:] for case, seconds in start.items()},
            "edits": rows_of(VIEWPORT, "volley", [], options, scope),
            "final_edits": rows_of(FINAL_EDITS, "volley,cycles", ["--objects", *scope.edited_objects], options, scope)
            if scope.edited_objects else []}


def rows_of(script, addons, arguments, options, scope):
    """Medians of each kind of edit, milliseconds."""
    return programs.run_json_inside(
        lambda path: compare_cycles.run_blender(
            ["--addons", addons, "--python-exit-code", 1, "--python", script, "--", *arguments, "--repeats",
             scope.repeats, "--json", path], options))
