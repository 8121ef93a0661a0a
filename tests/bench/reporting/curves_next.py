# SPDX-License-Identifier: Apache-2.0
"""Error against time in the next Blender: curves.py's, run in the folder of tests/blender_next.sh."""

import json
import pathlib
import subprocess
import tempfile

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "blender_next.sh"
CANNOT_BE_SET_UP = 77


def measure(scope):
    """{"blender": its version, "scenes": as curves.measure has them}; empty where the scope leaves it
    out or that Blender cannot be had."""
    if not scope.next_blender:
        return {}
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(["bash", str(SCRIPT), "--curves", folder], check=False)
        if done.returncode == CANNOT_BE_SET_UP:
            return {}
        done.check_returncode()
        found = {name: json.loads((pathlib.Path(folder) / f"{name}.json").read_text(encoding="utf-8"))
                 for name in ("machine", "curves")}
    return {"blender": found["machine"]["blender"], "scenes": found["curves"]}
