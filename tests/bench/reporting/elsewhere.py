# SPDX-License-Identifier: Apache-2.0
"""Parts measured with newer Blenders and a newer Embree, in the Debians of tests/blender_next.sh."""

import json
import pathlib
import subprocess
import tempfile

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "blender_next.sh"
CANNOT_BE_SET_UP = 77
SYSTEMS = {"trixie": "Debian 13", "sid": "Debian unstable"}


def measure(options, suite, part):
    """{"system", "blender", "embree": names and versions, "made": as the part's measure() has it}; empty where
    the scope leaves it out or that Debian cannot be had. With options.only of those scenes alone."""
    if not options.scope.elsewhere:
        return {}
    scenes = ["--scenes", str(options.scenes)] if options.scenes else []
    only = ["--only", *options.only] if options.only else []
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(["bash", str(SCRIPT), "--suite", suite, *scenes, "--measure", part, folder, *only],
                              check=False)
        if done.returncode == CANNOT_BE_SET_UP:
            return {}
        done.check_returncode()
        machine, made = (json.loads((pathlib.Path(folder) / f"{name}.json").read_text(encoding="utf-8"))
                         for name in ("machine", part))
    return {"system": SYSTEMS[suite], "blender": machine["blender"], "embree": machine["embree"], "made": made}


def of_part(results, part):
    """Of a report's results: what measure() gave for a part in each Debian that was there."""
    found = (results.get(f"{part}_{suite}") for suite in SYSTEMS)
    return [run for run in found if run]


def beside(results, part):
    """(peer's name, what the part's measure() gave) of each Blender that it was measured in, this one first."""
    own = [("Cycles", results[part])] if results.get(part) else []
    return own + [(f"Cycles of {run['blender']}", run["made"]) for run in of_part(results, part)]


def embree_name(run):
    """Embree and its version without those of the package."""
    return f"Embree {run['embree'].split('+')[0]}"
