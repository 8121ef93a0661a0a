#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Error and time with and without Denoise, of .blend files as they are.

    denoise.py FILE.blend... [--samples 4 16 64 256] [--width 320] [--height 180] [--pictures DIR]
    denoise.py FILE.blend... --flicker 4 [--samples 16] [--reference-samples 512]

For each file and number of samples: mean squared and relative squared error and FLIP against Volley's own
picture of many samples, which another seed made, how many times they are lower with Denoise, the worst 32 x 32
tile by that, and the seconds of both renders. Errors do not depend on the load of the machine, times do. With
--keep DIR the pictures without Denoise stay there and are not rendered again, and have no times then.

--flicker renders so many successive frames instead, each with another seed: relative squared changes of the
error from frame to frame, of pictures with Denoise, without, and without at 4 times the samples and no extra ones,
over the last.
"""

import argparse
import contextlib
import json
import math
import pathlib
import tempfile

import compare_cycles
import numpy as np

import compare  # found by compare_cycles' path
import flip

SEED, REFERENCE_SEED = 1, 1000
# Tiles whose relative error is below are as good as without noise.
LEAST_ERROR = 1e-5
LEAST_MEASURE = 1e-30  # of a picture without noise
EVEN = "plain, 4 times", "exact"  # pictures of measure_flicker() whose pixels all have as many samples


def job(options, samples, denoise, seed, output, frame=None, **volley):
    """One picture for scene_setups.py's batch."""
    settings = {"width": options.width, "height": options.height, "samples": samples, "seed": seed,
                "volley": {"use_denoising": denoise, **volley}}
    return {"engine": "VOLLEY", "frame": options.frame if frame is None else frame, "settings": settings,
            "output": str(output)}


def run_jobs(blend, jobs, options):
    """Render them in one Blender; the seconds of each."""
    with tempfile.TemporaryDirectory() as folder:
        jobs_path, seconds_path = (pathlib.Path(folder) / name for name in ("jobs", "seconds"))
        jobs_path.write_text(json.dumps(jobs))
        compare_cycles.run_blender(
            ["-t", options.threads, "--addons", "volley", blend, "--python-exit-code", 1, "-P",
             compare_cycles.SETUPS_FILE, "--", "batch", jobs_path, seconds_path], options)
        return json.loads(seconds_path.read_text())


def relative_error(picture, exact):
    """By pixel, as compare.rel_mse."""
    weights = (np.maximum(exact, 0.0) + compare.RELATIVE_FLOOR) ** -2.0
    return (weights * compare.squared_error(picture, exact)).mean(axis=-1)


def worst_tile(plain, clean, tile=32):
    """The largest error with Denoise over that without, by tile."""
    height, width = plain.shape
    parts = [(slice(y, y + tile), slice(x, x + tile))
             for y in range(0, height, tile) for x in range(0, width, tile)]
    return max(clean[part].mean() / max(plain[part].mean(), LEAST_ERROR) for part in parts)


@contextlib.contextmanager
def folder_of(blend, options):
    """Where pictures go: one that stays, or a temporary one."""
    if options.keep is None:
        with tempfile.TemporaryDirectory() as folder:
            yield pathlib.Path(folder)
        return
    folder = options.keep / f"{blend.stem}-{options.width}x{options.height}-{options.frame}"
    folder.mkdir(parents=True, exist_ok=True)
    yield folder


def render_all(blend, folder, options):
    """The seconds of each picture by (samples, denoise), NaN where it was there."""
    seconds = dict.fromkeys([(samples, denoise) for samples in options.samples for denoise in (False, True)],
                            math.nan)
    exact = (options.reference_samples, None)
    missing = [name for name in [exact, *seconds] if name[1] or not output(folder, *name).exists()]
    jobs = [job(options, samples, bool(denoise), REFERENCE_SEED if denoise is None else SEED,
                output(folder, samples, denoise)) for samples, denoise in missing]
    seconds.update(zip(missing, run_jobs(blend, jobs, options)))
    return seconds


def output(folder, samples, denoise):
    """The file of a picture; denoise None: of the reference."""
    return folder / f"{samples}-{({None: 'exact', False: 'plain', True: 'denoised'})[denoise]}.exr"


def measure(blend, options):
    """A row for each number of samples."""
    with folder_of(blend, options) as folder:
        seconds = render_all(blend, folder, options)
        exact = compare.read_rgb(output(folder, options.reference_samples, None)).astype(np.float64)
        for samples in options.samples:
            plain, clean = (compare.read_rgb(output(folder, samples, denoise)) for denoise in (False, True))
            errors = [relative_error(picture, exact) for picture in (plain, clean)]
            if options.pictures:
                options.pictures.mkdir(parents=True, exist_ok=True)
                for name, picture in (("plain", plain), ("denoised", clean), ("exact", exact)):
                    compare.write_png(options.pictures / f"{blend.stem}-{samples}-{name}.png", picture)
            yield {"file": blend.stem, "samples": samples,
                   "mse": [compare.mse(picture, exact) for picture in (plain, clean)],
                   "rel_mse": [float(error.mean()) for error in errors],
                   "flip": [flip.mean_flip(picture, exact) for picture in (plain, clean)],
                   "worst_tile": float(worst_tile(*errors)),
                   "seconds": [seconds[samples, denoise] for denoise in (False, True)]}


def flicker(changes, exact):
    """The mean relative square by which the error changes from one frame to the next."""
    errors = [picture - true for picture, true in zip(changes, exact)]
    return float(np.mean([relative_error(after - before + true, true)
                          for before, after, true in zip(errors, errors[1:], exact[1:])]))


def measure_flicker(blend, options):
    """A row for each number of samples: flicker by what was rendered."""
    frames = range(options.frame, options.frame + options.flicker)
    for samples in options.samples:
        kinds = {"denoised": (samples, True), "plain": (samples, False), "plain, 4 times": (4 * samples, False),
                 "exact": (options.reference_samples, False)}
        with tempfile.TemporaryDirectory() as folder:
            paths = {kind: [pathlib.Path(folder) / f"{kind}-{frame}.exr" for frame in frames] for kind in kinds}
            run_jobs(blend, [job(options, *kinds[kind], (REFERENCE_SEED if kind == "exact" else SEED) + frame,
                                 path, frame, **({"extra_samples": 0.0} if kind in EVEN else {}))
                             for kind in kinds for frame, path in zip(frames, paths[kind])], options)
            pictures = {kind: [compare.read_rgb(path).astype(np.float64) for path in made]
                        for kind, made in paths.items()}
        exact = pictures.pop("exact")
        yield {"file": blend.stem, "samples": samples, "frames": options.flicker,
               "flicker": {kind: flicker(made, exact) for kind, made in pictures.items()}}


def print_flicker(row):
    """One line: over that of 4 times the samples, which must not be exceeded."""
    base = row["flicker"]["plain, 4 times"]
    print(f"{row['file']:16} {row['samples']:5} samples, {row['frames']} frames: flicker with Denoise "
          f"{row['flicker']['denoised'] / base:.2f} of that of 4 times the samples, without "
          f"{row['flicker']['plain'] / base:.2f}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=pathlib.Path)
    parser.add_argument("--samples", nargs="+", type=int, default=[4, 16, 64, 256])
    parser.add_argument("--reference-samples", type=int, default=4096)
    parser.add_argument("--width", type=int, default=320)
    parser.add_argument("--height", type=int, default=180)
    parser.add_argument("--frame", type=int, default=1)
    parser.add_argument("--threads", type=int, default=0, help="0: all")
    parser.add_argument("--build", type=pathlib.Path, default=compare_cycles.PROJECT / "build")
    parser.add_argument("--blender", default="blender")
    parser.add_argument("--keep", type=pathlib.Path, metavar="DIR", help="pictures stay in it")
    parser.add_argument("--pictures", type=pathlib.Path, help="PNGs go here")
    parser.add_argument("--flicker", type=int, default=0, metavar="FRAMES", help="measure flicker over so many frames")
    parser.add_argument("--json", action="store_true", help="one JSON object a row")
    options = parser.parse_args()
    for blend in options.files:
        for row in measure_flicker(blend, options) if options.flicker else measure(blend, options):
            if options.json:
                print(json.dumps(row), flush=True)
                continue
            if options.flicker:
                print_flicker(row)
                continue
            gains = [row[name][0] / max(row[name][1], LEAST_MEASURE) for name in ("mse", "rel_mse", "flip")]
            print(f"{row['file']:16} {row['samples']:5} samples: MSE {gains[0]:6.2f}, relMSE {gains[1]:6.2f}, "
                  f"FLIP {gains[2]:5.2f} times lower, worst tile {row['worst_tile']:5.2f}; {row['seconds'][0]:.2f} to "
                  f"{row['seconds'][1]:.2f} s", flush=True)


if __name__ == "__main__":
    main()
