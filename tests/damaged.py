#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Renders damaged images of every format by the ten thousand in one Blender, by hand.

    /usr/bin/python3 tests/damaged.py [--files N] [--seed N] [--also FOLDER]

What is rendered and what must hold stands in support/damaged.py. --also adds the images and meshes of a
folder, as they are. Prints what became of the files, times and the peaks of memory; the exit code is 1 if
anything was lost. Blender is the one of support/blender.py, with the add-on of BLENDER_USER_SCRIPTS or
build/blender.
"""

import argparse
import os
import pathlib
import statistics
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
import blender  # noqa: E402  (found by the line above)
import damaged  # noqa: E402

SIDE = 16  # squares of a picture in a row
SECONDS_PER_FILE = 1.0
MESHES = {".obj", ".glb", ".gltf"}
IMAGES = {".exr", ".png", ".jpg", ".tif", ".tga", ".bmp", ".hdr", ".dds", ".psd", ".sgi"}


def _files(folder, endings):
    return [str(path) for path in sorted(folder.rglob("*")) if path.suffix.lower() in endings] if folder else []


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", type=int, default=20000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--also", type=pathlib.Path)
    arguments = parser.parse_args()
    whole, meshes = _files(arguments.also, IMAGES), _files(arguments.also, MESHES)
    with tempfile.TemporaryDirectory(prefix="volley_") as folder:
        os.environ["TMPDIR"] = folder  # of what Blender leaves
        begin = time.monotonic()
        result = damaged.run(blender.Blender(folder), arguments.files, arguments.seed, SIDE, whole, meshes,
                             timeout=120 + SECONDS_PER_FILE * arguments.files)
        seconds = time.monotonic() - begin
    print("\n".join(result.problems))
    print(f"{arguments.files} damaged files (seed {arguments.seed}), {len(whole)} images and {len(meshes)} meshes as "
          f"they are, {len(result.seconds)} renders in one Blender: {result.shown} images shown, {result.missing} "
          f"missing, {len(result.problems)} problems")
    print(f"{seconds:.0f} s in all; a render {statistics.median(result.seconds):.1f} s, the slowest "
          f"{max(result.seconds):.1f} s")
    print("peaks of memory, MiB: " + ", ".join(f"{name} {peak:.0f}" for name, peak in result.memory.items()))
    return int(bool(result.problems))


if __name__ == "__main__":
    sys.exit(main())
