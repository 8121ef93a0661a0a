#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Time to read a folder of image files: by the library, whose files are read in processes of their own, and by
OpenImageIO in one process, file by file on as many threads as it likes.

    /usr/bin/python3 tests/bench/image_reading.py [--library build/lib/libtracer.so] [--rounds N] [FOLDER]

Without a folder files of the usual formats and sizes are made, with the noise of photographs. Rounds of the three
ways take turns, so that whatever else the machine does meets all of them; times are the minimum and the median of
each. The library's first file waits for its program to start, which "first" has and "library" has not. Only figures
of a quiet machine mean anything: on a busy one the processes of the library wait more than one process does.
"""

import argparse
import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "support"))
import addon_modules  # noqa: E402  (the folder is on the path only now)

# Extension: type of the pixels, width, height, how many of them.
_MADE = {"png": ("uint8", 2048, 2048, 4), "jpg": ("uint8", 4096, 2048, 4), "tif": ("uint16", 2048, 2048, 2),
         "exr": ("half", 2048, 1024, 2), "hdr": ("float", 2048, 1024, 2), "tga": ("uint8", 1024, 1024, 4)}
_NOISE = 0.03


def make_files(folder):
    """Write the files; smooth gradients with noise, about as compressible as photographs."""
    generator = np.random.default_rng(1)
    for extension, (kind, width, height, count) in _MADE.items():
        x, y = np.meshgrid(np.linspace(0.0, 3.0, width), np.linspace(0.0, 2.0, height))
        smooth = np.stack([0.5 + 0.4 * np.sin(x + k) * np.cos(y - k) for k in range(3)], axis=-1)
        for number in range(count):
            pixels = np.clip(smooth + generator.normal(0.0, _NOISE, smooth.shape), 0.0, 1.0).astype(np.float32)
            path = str(folder / f"{number}.{extension}")
            output = oiio.ImageOutput.create(path)
            if not output or not output.open(path, oiio.ImageSpec(width, height, 3, kind)) or \
                    not output.write_image(pixels):
                sys.exit(f"{path} cannot be written: {oiio.geterror()}")
            output.close()


def by_library(native, paths):
    """Seconds until a scene has all files, told of all beforehand as the add-on does."""
    start = time.perf_counter()
    scene = native.Scene()
    try:
        for path in paths:
            scene.expect_image(path=path, is_srgb=not path.endswith(("exr", "hdr")))
        for path in paths:
            scene.create_image(path=path, is_srgb=not path.endswith(("exr", "hdr")))
        return time.perf_counter() - start
    finally:
        scene.destroy()


def by_one_process(paths):
    """Seconds until all pixels are in memory as the library keeps them: bytes, else 16 or 32 bits."""
    start = time.perf_counter()
    for path in paths:
        image = oiio.ImageInput.open(path)
        kind = image.spec().format
        pixels = image.read_image("uint8" if kind == "uint8" else "float" if kind == "float" else "half")
        image.close()
        if pixels is None:
            sys.exit(f"{path} cannot be read")
    return time.perf_counter() - start


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--library", default=str(ROOT / "build/lib/libtracer.so"))
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("folder", nargs="?", type=Path)
    arguments = parser.parse_args()
    native = addon_modules.load("native")
    if not native.load(arguments.library):
        sys.exit(native.load_error())
    with tempfile.TemporaryDirectory() as made:
        if arguments.folder is None:
            make_files(Path(made))
        paths = sorted(str(path) for path in (arguments.folder or Path(made)).iterdir() if path.is_file())
        size = sum(Path(path).stat().st_size for path in paths)
        print(f"{len(paths)} files, {size / 2**20:.1f} MiB")
        print(f"{'first':16} {by_library(native, paths):8.3f} s")
        ways = {"library": lambda: by_library(native, paths), "one process": lambda: by_one_process(paths)}
        seconds = {name: [] for name in ways}
        for _ in range(arguments.rounds):
            for name, way in ways.items():
                seconds[name].append(way())
        for name, each in seconds.items():
            print(f"{name:16} {min(each):8.3f} s  median {statistics.median(each):8.3f} s")
        print(f"library over one process {min(seconds['library']) / min(seconds['one process']):.2f}")
    native.unload()


if __name__ == "__main__":
    main()
