#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Soaks Blender by hand: cycles of renders started, cancelled and freed while a viewport renders.

    python3 tests/soak.py [--cycles N]

What a cycle is stands in support/soak.py. Prints memory over time; the exit code is 1 if it has grown.
Blender is the one of support/blender.py, with the add-on of BLENDER_USER_SCRIPTS or build/blender.
"""

import argparse
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
import blender  # noqa: E402  (found by the line above)
import soak  # noqa: E402

LINES = 20  # of the curve


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cycles", type=int, default=1000)
    arguments = parser.parse_args()
    runner = blender.Blender()
    rows, cancelled = runner.run_in_window(soak.inside_soak, arguments.cycles, size=soak.WINDOW,
                                           timeout=60 + 10 * arguments.cycles)
    print("cycle  seconds     MiB")
    for number in range(0, len(rows), max(1, len(rows) // LINES)):
        print(f"{number:5} {rows[number][0]:8.1f} {rows[number][1]:7.1f}")
    grown = soak.growth(rows)
    print(f"{len(rows)} cycles, {cancelled} renders cancelled; memory grew by {grown:.1f} MiB after the "
          f"first {100 * soak.WARM_SHARE:.0f} %, {soak.ALLOWED_GROWTH:.0f} are allowed")
    failures = [line for line in runner.output.splitlines() if "Traceback" in line or "rror:" in line]
    print("\n".join(failures), end="")
    return int(grown > soak.ALLOWED_GROWTH or bool(failures))


if __name__ == "__main__":
    sys.exit(main())
