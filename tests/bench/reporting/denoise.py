# SPDX-License-Identifier: Apache-2.0
"""Denoise: errors and times with it and without beside Cycles, flicker, what the filter costs, and whether the
number of threads changes it."""

import argparse
import os
import pathlib
import statistics
import tempfile
from dataclasses import replace

import compare
import compare_cycles
import denoise
import error_time
import numpy as np

from . import curves, estimates
from .scope import DENOISE_FILES, FOLDER_DENOISE, picture_folders

DENOISED = "volley denoised"
PLAIN = curves.DEFAULT
# What is timed of a scope: enough to tell a tenth.
TIMED = {"time_samples": (4, 64), "repeats": 2}
# Without smooth meshes, whose normals Blender finds with other last digits by several threads.
COST_SCENE, COST_WIDTH, COST_HEIGHT, COST_SAMPLES, COST_REPEATS = "texture", 960, 540, 2, 9
PICTURE_SAMPLES = 16
TABLES = ("scenes", "worst_tiles", "flicker")  # of what measure() gives, those by scene
FLICKER_SCENES, FLICKER_FRAMES, FLICKER_SAMPLES, FLICKER_REFERENCE_SAMPLES = ("example_motion", "robot_motion"), 24, 16, 512


def measure(options, scope, pictures):
    """{"scenes": as curves.measure, "worst_tiles", "flicker", "costs"}; empty where the scope leaves it out.
    With options.only of those scenes alone, and without costs."""
    if not scope.denoise:
        return {}
    made, scenes, tiles = replace(scope, **TIMED), {}, {}
    configurations = [error_time.Configuration(curves.BASE, "CYCLES"), curves.volley("SOBOL", 1),
                      error_time.Configuration(DENOISED, "VOLLEY", {**curves.volley("SOBOL", 1).volley,
                                                                    "use_denoising": True})]
    known = picture_folders(scope.scenes + DENOISE_FILES, FOLDER_DENOISE, options, pictures)
    folders = {name: folder for name, folder in known.items() if not options.only or name in options.only}
    for name, folder in folders.items():
        own = curves.error_options(options, made, configurations)
        scenes[name] = error_time.measure_scene(name, own)
        tiles[name] = _tiles_and_picture(name, own, folder)
    return {"scenes": scenes, "worst_tiles": tiles, **({} if options.only else {"costs": costs(options)}),
            "flicker": {name: flicker(name, options) for name in FLICKER_SCENES if name in folders}}


def _tiles_and_picture(name, options, folder):
    """{samples: the largest error with Denoise over that without, of tiles}; writes the plain picture, the filtered
    one and the reference side by side."""
    own = error_time.scene_options(name, options)
    blend, key, _name = compare_cycles.prepared_scene(own)
    seeds = list(range(error_time.FIRST_SEED, error_time.FIRST_SEED + own.seeds))
    points = [(samples, seeds) for samples in own.samples]
    reference = error_time.Reference.of_stack(error_time.reference_stack(blend, key, own))
    plain, clean = (dict(zip(own.samples, error_time.render_stacks(blend, key, configuration, points, own)))
                    for configuration in own.configurations if configuration.name in (PLAIN, DENOISED))
    folder.mkdir(parents=True, exist_ok=True)
    compare.write_png(folder / f"denoise-{name}.png", np.concatenate(
        [plain[PICTURE_SAMPLES][0], clean[PICTURE_SAMPLES][0], reference.mean], axis=1) * 2.0 ** own.stops)
    return {samples: denoise.worst_tile(*(_mean_error(stacks[samples], reference) for stacks in (plain, clean)))
            for samples in own.samples}


def _mean_error(stack, reference):
    """relMSE by pixel, the mean over seeds; the reference's own variance is taken off."""
    noise = (reference.weights("rel_mse") * reference.variance).mean(axis=-1)
    return np.mean([denoise.relative_error(picture, reference.mean) for picture in stack], axis=0) - noise


def flicker(name, options):
    """{"with", "without": flicker over that of 4 times the samples} of successive frames of a scene."""
    own = error_time.scene_options(name, curves.error_options(options, options.scope, []))
    blend, _key, _name = compare_cycles.prepared_scene(own)
    asked = argparse.Namespace(**{**vars(own), "frame": 1, "flicker": FLICKER_FRAMES, "samples": [FLICKER_SAMPLES],
                                  "reference_samples": FLICKER_REFERENCE_SAMPLES})
    row, = denoise.measure_flicker(pathlib.Path(blend), asked)
    found, base = row["flicker"], row["flicker"]["plain, 4 times"]
    return {"with": found["denoised"] / base, "without": found["plain"] / base}


def costs(options):
    """For one thread and all: seconds a megapixel that the filter adds, and whether the picture has the same bits
    as by one thread."""
    own = error_time.scene_options(COST_SCENE, curves.error_options(options, replace(options.scope, **TIMED), []))
    blend, _key, _name = compare_cycles.prepared_scene(own)
    own.width, own.height, rows, first = COST_WIDTH, COST_HEIGHT, [], None
    with tempfile.TemporaryDirectory() as folder:
        paths = {kind: pathlib.Path(folder) / f"{kind}.exr" for kind in (False, True)}
        for own.threads in sorted({1, options.threads or os.cpu_count()}):
            kinds = [False, True] * (1 + COST_REPEATS)  # the first of each pays for pages
            seconds = denoise.run_jobs(blend, [denoise.job(own, COST_SAMPLES, kind, 1, paths[kind]) for kind in kinds], own)
            plain, clean = (seconds[start::2][1:] for start in (0, 1))
            picture = compare.read_rgb(paths[True])
            first = picture if first is None else first
            rows.append({"threads": own.threads, "same_bits": bool(np.array_equal(picture, first)),
                         "seconds": [(b - a) / (COST_WIDTH * COST_HEIGHT / 1e6) for a, b in zip(plain, clean)]})
    return rows


def error_ratio(scene, measure_name, samples):
    """An error with Denoise over that without."""
    return scene["curves"][DENOISED][samples][measure_name] / scene["curves"][PLAIN][samples][measure_name]


def time_ratio(scene, name, measure_name, samples):
    """Seconds of Cycles at so many samples over those of a configuration at its error; None outside the curve."""
    seconds, errors = curves.curve(scene, curves.BASE, measure_name)
    index = list(scene["curves"][curves.BASE]).index(str(samples))
    needed = estimates.cost_at(*curves.curve(scene, name, measure_name), errors[index])
    return seconds[index] / needed if needed else None


def middle(values):
    """The median of those that there are, None of none."""
    known = [value for value in values if value is not None]
    return statistics.median(known) if known else None
