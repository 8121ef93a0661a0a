#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Render whole files by Volley and by Cycles without diffuse bounces: how far they are apart, and pictures.

    beside_cycles.py [--window] [--lens-blur] [--motion-blur] [--pictures DIR] FILE.blend...

A line for each file: the largest difference of a channel's mean and of a tile's, over the mean of the picture,
as far as noise (and in a window the screen's 256 levels) does not explain them, and the warnings below. With
--window it is the viewport of a window on a virtual display. Ends with 1 if a mean differs by 1 % or a tile by 3 %.
"""

import argparse
import os
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
import blender  # noqa: E402  (the folder is on the path only now)
import compare  # noqa: E402
import numpy as np  # noqa: E402

MEAN_TOLERANCE, TILE_TOLERANCE = 0.01, 0.03
LONGEST_SECONDS = 550
SCREEN_LEVEL = 1 / 255
DARKEST = 1e-6  # mean that errors are taken relative to


def inside_background(path, size, samples, switches):
    import whole_files
    return whole_files.in_background(path, size, samples, **switches)


def inside_window(path, size, samples, switches):
    import whole_files
    return whole_files.in_window(path, size, samples, **switches)


def measure(options, path):
    """The errors of a file, (mean, tile), as a line and the warnings of Volley tell them."""
    started = blender.Blender()
    switches = {"has_lens_blur": options.lens_blur, "has_motion_blur": options.motion_blur}
    run, inside = (started.run_in_window, inside_window) if options.window else (started.run, inside_background)
    sides, told = run(inside, os.path.abspath(path), options.size, options.samples, switches,
                      timeout=LONGEST_SECONDS)
    ours, theirs = (np.asarray(side)[..., :3] for side in sides)
    scale = max(float(theirs.mean()), DARKEST)
    rounding = SCREEN_LEVEL if options.window else 0.0
    errors = [max(error - rounding, 0.0) / scale for error in compare.unexplained(ours, theirs)]
    plain = np.abs(compare.channel_means(ours.mean(axis=0)) - compare.channel_means(theirs.mean(axis=0))).max() / scale
    print(f"{os.path.basename(path):32} mean {scale:8.4f}  off {plain:7.3%}  beyond noise {errors[0]:7.3%}  "
          f"tile {errors[1]:7.3%}", *told, sep="\n    ", flush=True)
    if options.pictures:
        os.makedirs(options.pictures, exist_ok=True)
        pair = compare.side_by_side(ours.mean(axis=0)[::-1], theirs.mean(axis=0)[::-1])
        compare.write_png(os.path.join(options.pictures, pathlib.Path(path).stem + ".png"), pair)
    return errors


def main():
    """Run the program; returns 1 if a file is not as in Cycles, else 0."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("files", nargs="+", metavar="FILE.blend")
    parser.add_argument("--window", action="store_true", help="the viewport of a window")
    parser.add_argument("--lens-blur", action="store_true", help="switch the camera's depth of field on")
    parser.add_argument("--motion-blur", action="store_true", help="switch motion blur on")
    parser.add_argument("--size", type=int, default=160, help="longer side of the picture, pixels")
    parser.add_argument("--samples", type=int, default=1024, help="of each pixel, shared out among four seeds")
    parser.add_argument("--pictures", metavar="DIR", help="write Volley | Cycles | 8 times the difference here")
    options = parser.parse_args()
    errors = np.array([measure(options, path) for path in options.files])
    return int((errors > (MEAN_TOLERANCE, TILE_TOLERANCE)).any())


if __name__ == "__main__":
    sys.exit(main())
