# SPDX-License-Identifier: Apache-2.0
"""The whole of a first F12 in a new Blender, Cycles and Volley in turns, and the errors of the pictures that were
timed. Nothing is kept between renders: everything is evaluated, sent and built each time."""

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
MAX_DEPTH = 12  # Cycles' own default
PICTURE_WIDTH_PX = 320  # of the report's PNGs, at least
ENGINES = "CYCLES", "VOLLEY"
COLUMNS = ["scene", "Cycles, s", "Volley, s", "Cycles / Volley", "MSE, Volley / Cycles", "relMSE, Volley / Cycles",
           "Volley's mean / reference (R G B)"]


def measure(folders, size_px, options, scope):
    """{scene: what measure_scene() gives} of {scene: folder of its PNGs}; with options.only of those alone."""
    return {name: measure_scene(name, size_px, options, scope, pictures) for name, pictures in folders.items()
            if not options.only or name in options.only}


def measure_scene(name, size_px, options, scope, pictures):
    """{engine: {"seconds": of each repeat, errors}} of one scene, each repeat with another seed; a PNG of both
    into a folder."""
    own = arguments_of(name, size_px, options)
    blend, _key, _name = compare_cycles.prepared_scene(own)
    reference = error_time.Reference.of_stack(reference_stack(blend, scope, own))
    seconds, images = {engine: [] for engine in ENGINES}, {engine: [] for engine in ENGINES}
    for engine, took, picture in renders(blend, own, scope.repeats):
        seconds[engine].append(took)
        images[engine].append(picture)
    pictures.mkdir(parents=True, exist_ok=True)
    shown = [shrunk(picture) for picture in (*(images[engine][0] for engine in ENGINES), reference.mean)]
    compare.write_png(pictures / f"{name}.png", np.concatenate(shown, axis=1))
    stacks = {engine: np.stack(made) for engine, made in images.items()}
    return {engine: {"seconds": seconds[engine], **error_time.point_errors(stacks[engine], reference)}
            for engine in ENGINES}


def seconds_of(name, size_px, options, repeats):
    """{engine: seconds of each repeat} of one scene at that size, without its errors."""
    own = arguments_of(name, size_px, options)
    blend, _key, _name = compare_cycles.prepared_scene(own)
    seconds = {engine: [] for engine in ENGINES}
    for engine, took, _picture in renders(blend, own, repeats):
        seconds[engine].append(took)
    return seconds


def renders(blend, own, repeats):
    """(engine, its seconds, picture) of both engines in turns, each repeat with another seed."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.exr"
        for repeat in range(repeats):
            settings = settings_of(own, SAMPLES, compare_cycles.FIRST_REPEAT_SEED + repeat)
            for engine in ENGINES:
                took = compare_cycles.render(blend, engine, settings, own.frame, path, own)["engine_s"]
                yield engine, took, compare.read_rgb(path)


def arguments_of(name, size_px, options):
    """compare_cycles' options of a scene at that size."""
    return compare_cycles.parse_arguments([
        "--scene", name, "--width", str(size_px[0]), "--height", str(size_px[1]), "--threads", str(options.threads),
        "--build", str(options.build), "--blender", options.blender, "--scenes", str(options.scenes or ".")])


def shrunk(picture):
    """A picture that is at least twice PICTURE_WIDTH_PX wide by means of squares of pixels, others as they are."""
    step = max(1, picture.shape[1] // PICTURE_WIDTH_PX)
    height, width = (length // step for length in picture.shape[:2])
    return picture[:height * step, :width * step].reshape(height, step, width, step, -1).mean(axis=(1, 3))


def settings_of(own, samples, seed):
    """Both engines' settings of one picture, of as many samples: Volley takes no extra ones."""
    return {**scene_setups.DEFAULT_SETTINGS, "width": own.width, "height": own.height, "samples": samples,
            "seed": seed, "max_depth": MAX_DEPTH, "volley": {"extra_samples": 0.0}}


def reference_stack(blend, scope, own):
    """Cycles' pictures of more samples, from one process."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / f"{seed}.exr" for seed in range(scope.reference_seeds)]
        error_time.run_batch(blend, [("CYCLES", settings_of(own, scope.whole_reference_samples, seed), path)
                                     for seed, path in enumerate(paths)], own)
        return np.stack([compare.read_rgb(path) for path in paths])


def gains(results, key="seconds"):
    """(scene, seconds of Cycles over Volley's with interval) of each that has them, the lowest first."""
    found = [(name, estimates.ratio_with_interval(*(engines[engine][key] for engine in ENGINES)))
             for name, engines in results.items() if key in engines[ENGINES[0]]]
    return sorted(found, key=lambda row: row[1]["ratio"])


def losses(results, cycles="Cycles"):
    """Scenes in which Cycles is done sooner, or has the smaller error: the worse of two measures."""
    lines = [f"{words(name)}: F12 of {cycles} over Volley's {ratio(gain)}"
             for name, gain in (gains(results) if results else []) if gain["ratio"] < 1.0]
    for name, engines in results.items():
        found = {measure: error_ratios(engines)[key] for measure, key in (("MSE", "mse"), ("relMSE", "rel_mse"))}
        measure = max(found, key=found.get)
        if found[measure] > 1.0:
            lines.append(f"{words(name)}: {measure} over {cycles}' at equal samples **{digits(found[measure])}**")
    return lines


def error_ratios(engines):
    """{measure: Volley's error over Cycles'}."""
    theirs, ours = (engines[engine] for engine in ENGINES)
    return {measure_name: ours[measure_name] / theirs[measure_name] for measure_name in error_time.MEASURES}


def rows(results):
    """Seconds and errors of each scene, the lowest gain first."""
    made = []
    for name, gain in gains(results):
        engines = results[name]
        made.append([words(name), *(digits(statistics.median(engines[engine]["seconds"])) for engine in ENGINES),
                     ratio(gain), *map(digits, error_ratios(engines).values()),
                     " ".join(f"{each:.4f}" for each in engines["VOLLEY"]["mean_ratios"])])
    return made


def section_table(results):
    """The rows under their heads."""
    return table(COLUMNS, rows(results))
