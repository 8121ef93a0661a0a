#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Render the same .blend with Cycles and with Volley: times, means, errors, and a picture.

    compare_cycles.py FILE.blend --frame 1 --width 320 --height 180 --samples 64 --repeats 3
    compare_cycles.py --scene robot --scenes DIR

Both engines run through the same command line in interleaved order, each repeat with another seed.
Errors are against a Cycles picture of many samples with a seed of its own, kept in
BUILD/references under a hash of scene, settings and Blender version. ``--scenes`` is a folder of
scenes as described in scene_setups.py; the scene "example" needs none.
"""

import argparse
import hashlib
import json
import os
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import compare  # noqa: E402  (the folders are on the path only now)
import numpy as np  # noqa: E402
import scene_setups  # noqa: E402

SETUPS_FILE = pathlib.Path(scene_setups.__file__).resolve()
PROJECT = SETUPS_FILE.parents[2]
REFERENCE_SEED = 1
FIRST_REPEAT_SEED = 101
# Blender 5 has the time and "render |" before it.
BLENDER_TIME = re.compile(r"^(?:.*\|)? ?Time: ([\d:.]+) \(Saving: ([\d:.]+)\)", re.MULTILINE)


# Running Blender -------------------------------------------------------------------------------

def clock_seconds(text):
    """Seconds of Blender's clock notation.

    >>> clock_seconds("01:02.50"), clock_seconds("1:00:00.25")
    (62.5, 3600.25)
    """
    seconds = 0.0
    for part in text.split(":"):
        seconds = 60.0 * seconds + float(part)
    return seconds


def parse_render_time(log):
    """Seconds of the last frame's render without saving, from Blender's output.

    >>> parse_render_time("Saved: 'x.exr'\\n Time: 00:01.50 (Saving: 00:00.25)\\n")
    1.25
    >>> parse_render_time("00:01.314  render           | Time: 00:00.75 (Saving: 00:00.25)\\n")
    0.5
    """
    found = BLENDER_TIME.findall(log)
    if not found:
        raise RuntimeError("Blender printed no render time:\n" + log[-3000:])
    total, saving = found[-1]
    return clock_seconds(total) - clock_seconds(saving)


def run_blender(arguments, options):
    """Run Blender in the background; returns its output and the process's wall time in seconds."""
    environment = {**os.environ, "BLENDER_USER_SCRIPTS": str(options.build.resolve() / "blender")}
    start = time.perf_counter()
    done = subprocess.run([options.blender, "-b", "--factory-startup", *map(str, arguments)],
                          env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True, errors="replace", check=False)
    wall = time.perf_counter() - start
    if done.returncode != 0:
        raise RuntimeError(f"Blender ended with {done.returncode}:\n{done.stdout[-3000:]}")
    return done.stdout, wall


def render(blend, engine, settings, frame, output, options):
    """Render one frame to ``output``; returns engine and wall time in seconds."""
    with tempfile.TemporaryDirectory() as folder:
        prefix = pathlib.Path(folder) / "frame_"
        addon = [] if engine == "CYCLES" and options.reference_only else ["--addons", "volley"]
        log, wall = run_blender(
            ["-t", options.threads, *addon, blend, "--python-exit-code", 1, "-P", SETUPS_FILE,
             "-E", engine, "-o", prefix, "-F", "OPEN_EXR", "-f", frame,
             "--", "settings", json.dumps(settings)], options)
        written = sorted(pathlib.Path(folder).glob("frame_*.exr"))
        if len(written) != 1:
            raise RuntimeError(f"{engine} wrote no picture:\n{log[-3000:]}")
        output.parent.mkdir(parents=True, exist_ok=True)
        output.write_bytes(written[0].read_bytes())
    return {"engine_s": parse_render_time(log), "wall_s": wall}


# Scenes and references -------------------------------------------------------------------------

def prepared_scene(options):
    """The .blend to render, a key for its content, and its name."""
    if options.file:
        key = hashlib.sha256(options.file.read_bytes()).hexdigest()[:16]
        return options.file, key, options.file.stem
    key = scene_setups.source_key(options.scene, options.scenes)
    blend = options.build / "references" / f"{options.scene}-{key}.blend"
    if not blend.exists():
        blend.parent.mkdir(parents=True, exist_ok=True)
        run_blender(["--python-exit-code", 1, "-P", SETUPS_FILE, "--", "prepare", options.scene,
                     options.scenes, blend.resolve()], options)
    return blend, key, options.scene


def comparison_settings(options):
    """The settings of both engines, without seed."""
    return {**scene_setups.DEFAULT_SETTINGS, "width": options.width, "height": options.height,
            "samples": options.samples, "max_depth": options.max_depth,
            "volley": dict(options.volley)}


def blender_version(options):
    """The first line of what Blender says of itself."""
    return subprocess.run([options.blender, "--version"], capture_output=True, text=True,
                          check=True).stdout.splitlines()[0]


def reference_path(key, name, settings, options):
    """Where the reference of a scene and settings is kept."""
    identity = json.dumps([key, blender_version(options), options.frame, settings], sort_keys=True)
    digest = hashlib.sha256(identity.encode()).hexdigest()[:16]
    return options.build / "references" / f"{name}-{settings['samples']}spp-{digest}.exr"


def cached_cycles(blend, key, name, samples, seed, options):
    """A Cycles picture of so many samples, rendered on first use; returns its path."""
    settings = {**comparison_settings(options), "samples": samples, "seed": seed, "volley": {}}
    path = reference_path(key, name, settings, options)
    if not path.exists():
        times = render(blend, "CYCLES", settings, options.frame, path, options)
        path.with_suffix(".json").write_text(json.dumps(
            {"scene": name, "frame": options.frame, **settings, **times}, indent=1) + "\n")
    return path


# Comparison ------------------------------------------------------------------------------------

def render_repeats(blend, name, options):
    """All renders in interleaved order: {engine: [{"path", "engine_s", "wall_s"}, ...]}."""
    runs = {engine: [] for engine in options.engines}
    for repeat in range(options.repeats):
        settings = {**comparison_settings(options), "seed": FIRST_REPEAT_SEED + repeat}
        for engine in options.engines:
            path = options.out / f"{name}-{engine.lower()}-{options.samples}spp-{repeat}.exr"
            times = render(blend, engine, settings, options.frame, path, options)
            runs[engine].append({"path": path, **times})
    return runs


def summarise_engine(runs, reference):
    """Median times, means over all repeats, and mean errors of one engine."""
    images = [compare.read_rgb(run["path"]) for run in runs]
    return {
        "wall_s": statistics.median(run["wall_s"] for run in runs),
        "engine_s": statistics.median(run["engine_s"] for run in runs),
        "means": compare.channel_means(np.mean(images, axis=0)).tolist(),
        "mean_ratios": compare.mean_ratios(np.mean(images, axis=0), reference).tolist(),
        "mse": statistics.mean(compare.mse(image, reference) for image in images),
        "rel_mse": statistics.mean(compare.rel_mse(image, reference) for image in images),
        "error_p999": statistics.mean(compare.error_percentile(i, reference) for i in images),
        "non_finite_pixels": max(compare.non_finite_pixels(image) for image in images),
    }


def compare_engines(runs, reference):
    """The report of all engines, ratios to the first one, and the test for bias."""
    report = {"engines": {engine: summarise_engine(runs[engine], reference) for engine in runs}}
    if len(runs) == 2:
        first, second = report["engines"].values()
        report["ratios"] = {
            "engine_time": first["engine_s"] / max(second["engine_s"], 1e-3),
            "wall_time": first["wall_s"] / second["wall_s"],
            "mse": second["mse"] / first["mse"] if first["mse"] else None,
            "rel_mse": second["rel_mse"] / first["rel_mse"] if first["rel_mse"] else None,
            "means": [s / f if f else None for f, s in zip(first["means"], second["means"])],
        }
        if min(len(side) for side in runs.values()) >= 2:
            sides = [[compare.read_rgb(run["path"]) for run in side] for side in runs.values()]
            report["bias"] = compare.bias_test(*sides)
    return report


def write_pictures(runs, name, stops, out):
    """A side-by-side PNG of the first repeats; returns its path, or None for one engine."""
    if len(runs) != 2:
        return None
    first, second = (compare.read_rgb(side[0]["path"]) for side in runs.values())
    path = out / f"{name}-compare.png"
    compare.write_png(path, compare.side_by_side(first, second) * 2.0 ** stops)
    return path


def print_report(report):
    """A table for a reader."""
    print(f"{report['scene']}: {report['width']}x{report['height']}, {report['samples']} samples, "
          f"frame {report['frame']}, {report['repeats']} repeats, reference {report['reference']}")
    print("engine    render s   wall s        MSE     relMSE     p99.9   mean / reference (R G B)")
    for engine, row in report["engines"].items():
        means = " ".join(f"{ratio:.4f}" for ratio in row["mean_ratios"])
        bad = f"  {row['non_finite_pixels']} non-finite!" if row["non_finite_pixels"] else ""
        print(f"{engine:8s} {row['engine_s']:9.2f} {row['wall_s']:8.2f} {row['mse']:10.4g} "
              f"{row['rel_mse']:10.4g} {row['error_p999']:9.4g}   {means}{bad}")
    if "ratios" in report:
        ratios = report["ratios"]
        first, second = report["engines"]
        print(f"{first} / {second}: render time {ratios['engine_time']:.2f}, "
              f"wall time {ratios['wall_time']:.2f}")
        print(f"{second} / {first}: means {ratios['means']}, MSE {ratios['mse']}, "
              f"relMSE {ratios['rel_mse']}")
    for key in ("bias", "picture"):
        if report.get(key):
            print(f"{key}: {report[key]}")


# Program ---------------------------------------------------------------------------------------

def key_value(text):
    """KEY=VALUE with the value as JSON if it is that, else as text.

    >>> key_value("light_samples=4"), key_value("sampler=SOBOL")
    (('light_samples', 4), ('sampler', 'SOBOL'))
    """
    key, _separator, value = text.partition("=")
    try:
        return key, json.loads(value)
    except json.JSONDecodeError:
        return key, value


def parse_arguments(arguments):
    """Command line to options, with a known scene's defaults filled in."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("file", nargs="?", type=pathlib.Path, help="a .blend to render as it is")
    parser.add_argument("--scene", choices=scene_setups.SCENES, help="a scene to prepare instead")
    parser.add_argument("--scenes", type=pathlib.Path, default=pathlib.Path("."),
                        help="the folder of scenes")
    parser.add_argument("--width", type=int)
    parser.add_argument("--height", type=int)
    parser.add_argument("--frame", type=int)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--max-depth", type=int, default=50)
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--engines", nargs="+", default=["CYCLES", "VOLLEY"], type=str.upper)
    parser.add_argument("--volley", nargs="*", type=key_value, default=[], metavar="KEY=VALUE",
                        help="properties of scene.volley")
    parser.add_argument("--reference-samples", type=int, default=4096)
    parser.add_argument("--reference-only", action="store_true",
                        help="only make the reference and one Cycles picture of --samples")
    parser.add_argument("--threads", type=int, default=0, help="0: all")
    parser.add_argument("--build", type=pathlib.Path, default=PROJECT / "build")
    parser.add_argument("--out", type=pathlib.Path, help="pictures go here (BUILD/compare)")
    parser.add_argument("--blender", default="blender")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args(arguments)
    if bool(options.file) == bool(options.scene):
        parser.error("give either a .blend file or --scene")
    known = scene_setups.SCENES.get(options.scene)
    options.width = options.width or (known.width if known else 320)
    options.height = options.height or (known.height if known else 180)
    if options.frame is None:
        options.frame = known.frame if known else 1
    options.stops = known.stops if known else 0.0
    options.out = options.out or options.build / "compare"
    return options


def make_references(blend, key, name, options):
    """Render, or find, the reference and a picture of ``--samples``; returns their report."""
    paths = [cached_cycles(blend, key, name, options.reference_samples, REFERENCE_SEED, options),
             cached_cycles(blend, key, name, options.samples, FIRST_REPEAT_SEED, options)]
    reference, image = (compare.read_rgb(path) for path in paths)
    picture = paths[0].with_suffix(".png")
    compare.write_png(picture, compare.side_by_side(reference, image) * 2.0 ** options.stops)
    return {"scene": name, "reference": str(paths[0]), "cycles": str(paths[1]),
            "picture": str(picture), **compare.measure(image, reference)}


def main(arguments=None):
    """Run the comparison and print its report."""
    options = parse_arguments(arguments)
    blend, key, name = prepared_scene(options)
    if options.reference_only:
        print(json.dumps(make_references(blend, key, name, options)))
        return 0
    reference = cached_cycles(blend, key, name, options.reference_samples, REFERENCE_SEED, options)
    runs = render_repeats(blend, name, options)
    report = {"scene": name, "width": options.width, "height": options.height,
              "samples": options.samples, "frame": options.frame, "repeats": options.repeats,
              "max_depth": options.max_depth, "reference": str(reference),
              **compare_engines(runs, compare.read_rgb(reference)),
              "picture": str(write_pictures(runs, name, options.stops, options.out) or "")}
    if options.json:
        print(json.dumps(report))
    else:
        print_report(report)
    return 0


if __name__ == "__main__":
    sys.exit(main())
