#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""clang-tidy over the library: the host's files, and the kernels as one instruction set has them.

    python3 tests/tidy.py [--build BUILD] [--set SET] [FILE]...

Compile commands are those of a configured build. FILE: only sources whose path ends so. Prints what
clang-tidy says; the exit code is 1 if it says anything. Paths through kernels are not analyzed: what takes
a second for a file of the host takes a minute for one of wide code.
"""

import argparse
import json
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROGRAM = "clang-tidy-14"
PRECOMPILED = re.compile(r" -include \S*cmake_pch\.h\b")  # GCC's, which clang does not read


def chosen(commands, instruction_set, endings):
    """One command for each of the library's files: {path: command}."""
    found = {}
    for command in commands:
        path = Path(command["file"])
        if not path.is_relative_to(ROOT / "libtracer" / "src") or f"tracer_kernels_{instruction_set}.dir" \
                not in command["command"] and "tracer_core.dir" not in command["command"]:
            continue
        if not endings or any(str(path).endswith(ending) for ending in endings):
            found[path] = {**command, "command": PRECOMPILED.sub("", command["command"])}
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=Path, default=ROOT / "build")
    parser.add_argument("--set", default="scalar", help="the instruction set of the kernels (scalar)")
    parser.add_argument("files", nargs="*")
    options = parser.parse_args()
    commands = chosen(json.loads((options.build / "compile_commands.json").read_text()), options.set,
                      options.files)
    if not commands:
        sys.exit("no such source in compile_commands.json")
    folder = options.build / "tidy"  # a file with a command for each set would be looked at as often
    folder.mkdir(exist_ok=True)
    (folder / "compile_commands.json").write_text(json.dumps(list(commands.values())))

    def look_at(path):
        checks = ["--checks=-clang-analyzer-*"] if "kernels" in path.parts else []
        done = subprocess.run([PROGRAM, "-p", str(folder), "--quiet", "--extra-arg=-Wno-unknown-warning-option",
                               *checks, str(path)], capture_output=True, text=True)
        return done.stdout if done.returncode == 0 else done.stdout + done.stderr
    # The largest first, so that none is left alone at the end.
    paths = sorted(commands, key=lambda path: -path.stat().st_size)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        said = "".join(filter(None, pool.map(look_at, paths)))
    print(said, end="")
    return 1 if said else 0


if __name__ == "__main__":
    sys.exit(main())
