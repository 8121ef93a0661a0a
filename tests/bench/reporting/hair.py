# SPDX-License-Identifier: Apache-2.0
"""Hair, fur and grass: the whole of a first F12 in a new Blender, Cycles and Volley in turns, and the errors of
the pictures that were timed. Nothing is kept between renders: strands are grown, sent and built each time."""

import statistics
import tempfile
from pathlib import Path

import compare
import compare_cycles
import error_time
import numpy as np
import scene_setups

from . import estimates
from .tables import digits, ratio, table, words

SAMPLES = 64
SIZE_PX = 240, 180
MAX_DEPTH = 12  # Cycles' own default
ENGINES = "CYCLES", "VOLLEY"


def measure(options, scope, pictures):
    """{scene: {engine: {"seconds": of each repeat, errors}}}; PNGs of both into a folder."""
    return {name: measure_scene(name, options, scope, pictures) for name in scope.hair_scenes}


def measure_scene(name, options, scope, pictures):
    """One scene, each repeat with another seed."""
    own = compare_cycles.parse_arguments([
        "--scene", name, "--width", str(SIZE_PX[0]), "--height", str(SIZE_PX[1]), "--threads", str(options.threads),
        "--build", str(options.build), "--blender", options.blender])
    blend, _key, _name = compare_cycles.prepared_scene(own)
    reference = error_time.Reference.of_stack(reference_stack(blend, scope, own))
    seconds, images = {engine: [] for engine in ENGINES}, {engine: [] for engine in ENGINES}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.exr"
        for repeat in range(scope.repeats):
            for engine in ENGINES:
                settings = settings_of(SAMPLES, compare_cycles.FIRST_REPEAT_SEED + repeat)
                seconds[engine].append(
                    compare_cycles.render(blend, engine, settings, own.frame, path, own)["engine_s"])
                images[engine].append(compare.read_rgb(path))
    pictures.mkdir(parents=True, exist_ok=True)
    compare.write_png(pictures / f"{name}.png",
                      np.concatenate([*(images[engine][0] for engine in ENGINES), reference.mean], axis=1))
    stacks = {engine: np.stack(made) for engine, made in images.items()}
    return {engine: {"seconds": seconds[engine], **error_time.point_errors(stacks[engine], reference)}
            for engine in ENGINES}


def settings_of(samples, seed):
    """Both engines' settings of one picture."""
    return {**scene_setups.DEFAULT_SETTINGS, "width": SIZE_PX[0], "height": SIZE_PX[1], "samples": samples,
            "seed": seed, "max_depth": MAX_DEPTH}


def reference_stack(blend, scope, own):
    """Cycles' pictures of more samples, from one process."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / f"{seed}.exr" for seed in range(scope.reference_seeds)]
        error_time.run_batch(blend, [("CYCLES", settings_of(scope.hair_reference_samples, seed), path)
                                     for seed, path in enumerate(paths)], own)
        return np.stack([compare.read_rgb(path) for path in paths])


def gains(results):
    """(scene, seconds of Cycles over Volley's with interval) of each, the lowest first."""
    found = [(name, estimates.ratio_with_interval(*(engines[engine]["seconds"] for engine in ENGINES)))
             for name, engines in results.items()]
    return sorted(found, key=lambda row: row[1]["ratio"])


def headline(results):
    """The least and the most gain."""
    ratios = [gain["ratio"] for _name, gain in gains(results)]
    return (f"With {len(ratios)} scenes of hair, a first F12 of {SAMPLES} samples takes Cycles {digits(ratios[0], 2)} to "
            f"{digits(ratios[-1], 2)} times as long.")


def losses(results):
    """Scenes in which Cycles is done sooner, or has the smaller error."""
    lines = [f"{words(name)}: F12 of Cycles over Volley's {ratio(gain)}"
             for name, gain in (gains(results) if results else []) if gain["ratio"] < 1.0]
    for name, engines in results.items():
        made = error_ratios(engines)["mse"]
        if made > 1.0:
            lines.append(f"{words(name)}: MSE over Cycles' at equal samples **{digits(made)}**")
    return lines


def error_ratios(engines):
    """{measure: Volley's error over Cycles'}."""
    theirs, ours = (engines[engine] for engine in ENGINES)
    return {measure_name: ours[measure_name] / theirs[measure_name] for measure_name in error_time.MEASURES}


def section(results):
    """Seconds and errors of each scene, the lowest gain first."""
    rows = []
    for name, gain in gains(results):
        engines = results[name]
        rows.append([words(name), *(digits(statistics.median(engines[engine]["seconds"])) for engine in ENGINES),
                     ratio(gain), *map(digits, error_ratios(engines).values()),
                     " ".join(f"{each:.4f}" for each in engines["VOLLEY"]["mean_ratios"])])
    return "\n\n".join([
        "## Hair",
        f"A first F12 in a new Blender at {SIZE_PX[0]}×{SIZE_PX[1]} and {SAMPLES} samples: Blender's growing of the "
        "strands, sync, build and rays. Errors are against a Cycles picture of more samples, the same for both.",
        table(["scene", "Cycles, s", "Volley, s", "Cycles / Volley", "MSE, Volley / Cycles", "relMSE, Volley / Cycles",
               "Volley's mean / reference (R G B)"], rows)])
