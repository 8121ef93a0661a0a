# SPDX-License-Identifier: Apache-2.0
"""Runs the measuring programs and reads what they write, one JSON object per line."""

import json
import pathlib
import subprocess
import tempfile


def run_json(command):
    """Run a program that takes ``--json FILE``; its rows."""
    def run(path):
        done = subprocess.run([*map(str, command), "--json", str(path)], capture_output=True,
                              text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(f"{command[0]} ended with {done.returncode}:\n{done.stderr[-3000:]}")
    return run_json_inside(run)


def run_json_inside(run):
    """The rows that ``run(path)`` leaves in a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "rows.json"
        run(path)
        return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def tool(options, name):
    """The path of a program of the build."""
    return options.build / "bin" / name
