# SPDX-License-Identifier: Apache-2.0
"""Error against time of Volley and Cycles, and the time that an equal error takes.

Pictures and their errors are error_time.py's; here they get their scope and their intervals. Errors
are measured on small pictures with several seeds, times on larger ones of the same scene. A sample
count whose time was not measured gets that of the line through those that were: a fixed part, for
synchronising and the picture, and a part for each sample.
"""

import compare
import compare_cycles
import error_time
import numpy as np

from . import estimates
from .scope import SAMPLERS

MEASURES = {"mse": "MSE", "rel_mse": "relMSE", "p999": "99.9th percentile", "flip": "FLIP"}
BASE = "cycles"
DEFAULT = "volley sobol l1"  # Volley as it is without touching anything
SHEET_SAMPLES = (1, 16)      # of the pictures to look at


def measure(options, scope, pictures):
    """{scene: errors, times and comparison}, pictures of each scene in a folder; with options.only of those alone."""
    return {name: measure_scene(name, options, scope, pictures) for name in scope.scenes
            if not options.only or name in options.only}


def measure_scene(name, options, scope, pictures):
    """One scene, as error_time measures it, with intervals."""
    own = error_options(options, scope, configurations(name, scope))
    scene = error_time.measure_scene(name, own)
    scene["comparison"] = compare_configurations(scene)
    write_sheet(name, own, pictures)
    return scene


def error_options(options, scope, made):
    """error_time.py's options for a scope and configurations."""
    own = error_time.parse_arguments([
        "--times", "--samples", *map(str, scope.samples),
        "--time-samples", *map(str, scope.time_samples), "--seeds", str(scope.seeds),
        "--reference-samples", str(scope.reference_samples),
        "--reference-seeds", str(scope.reference_seeds), "--repeats", str(scope.repeats),
        "--times-scale", str(scope.times_scale), "--threads", str(options.threads),
        "--build", str(options.build), "--blender", options.blender, "--scenes", str(options.scenes or ".")])
    own.configurations = made
    return error_time.identify(own)


def write_sheet(name, options, folder):
    """One PNG: Cycles above Volley, at few and at more samples, the reference at the end of both. The
    pictures are those that errors were taken of."""
    own = error_time.scene_options(name, options)
    blend, key, _name = compare_cycles.prepared_scene(own)
    seeds = list(range(error_time.FIRST_SEED, error_time.FIRST_SEED + own.seeds))
    points = [(samples, seeds) for samples in SHEET_SAMPLES if samples in own.samples]
    reference = error_time.reference_stack(blend, key, own).mean(axis=0)
    rows = [np.concatenate([*(stack[0] for stack in error_time.render_stacks(
        blend, key, configuration, points, own)), reference], axis=1)
        for configuration in own.configurations if configuration.name in (BASE, DEFAULT)]
    folder.mkdir(parents=True, exist_ok=True)
    compare.write_png(folder / f"{name}.png", np.concatenate(rows) * 2.0 ** own.stops)


def configurations(name, scope):
    """Cycles, Volley with each number of light samples, and with the other samplers."""
    made = [error_time.Configuration(BASE, "CYCLES")]
    for count in scope.light_samples:
        made.append(volley("SOBOL", count))
    if name in scope.sampler_scenes:
        made += [volley(sampler, scope.light_samples[0]) for sampler in SAMPLERS
                 if sampler != "SOBOL"]
    return made


def volley(sampler, light_samples):
    """Volley with that sampler and number of shadow rays at each camera hit."""
    return error_time.Configuration(f"volley {sampler.lower()} l{light_samples}", "VOLLEY",
                                    {"sampler": sampler, "light_samples": light_samples})


# Comparison --------------------------------------------------------------------------------------

def curve(scene, name, measure_name, mean=lambda values: sum(values) / len(values),
          median=lambda values: estimates.spread(values)["median"]):
    """(seconds, errors) of a configuration; ``mean`` joins seeds and ``median`` repeats."""
    points, times = scene["curves"][name], scene["times"][name]
    timed = {int(samples): median(entry["runs"]) for samples, entry in times.items()}
    fixed, each = estimates.affine_seconds(list(timed), list(timed.values()))
    seconds = [timed.get(int(samples), fixed + each * int(samples)) for samples in points]
    return seconds, [mean(point["seeds"][measure_name]) for point in points.values()]


def compare_configurations(scene):
    """{configuration: ratios of time at equal error to Cycles with intervals, slope, bias}."""
    report = {}
    for name in scene["curves"]:
        entry = {"slope": slope(scene, name), **bias(scene, name)}
        if name != BASE:
            for measure_name in MEASURES:
                entry[f"time_ratio_{measure_name}"] = time_ratio(scene, name, measure_name)
        report[name] = entry
    return report


def time_ratio(scene, name, measure_name):
    """How many times Volley's time Cycles needs for the same error, or None where the curves do not
    meet."""
    base, other = (curve(scene, each, measure_name) for each in (BASE, name))
    ratio = estimates.cost_ratio(base, other)
    if ratio is None:
        return None
    bootstrap = estimates.Bootstrap()

    def draw():
        return estimates.cost_ratio(*(curve(scene, each, measure_name, bootstrap.mean,
                                            bootstrap.median) for each in (BASE, name)))
    return {"ratio": ratio, "interval": bootstrap.interval(draw)}


def slope(scene, name):
    """The exponent of samples in the MSE, with its interval."""
    points = scene["curves"][name]
    samples = [int(count) for count in points]
    bootstrap = estimates.Bootstrap()

    def draw():
        return estimates.slope(samples, [bootstrap.mean(point["seeds"]["mse"])
                                         for point in points.values()])
    return {"slope": estimates.slope(samples, [point["mse"] for point in points.values()]),
            "interval": bootstrap.interval(draw)}


def bias(scene, name):
    """Squared bias and variance at the most samples; tiles whose mean differs from Cycles'."""
    finest = list(scene["curves"][name].values())[-1]
    test = scene["bias"].get(name, {})
    return {"bias_squared": finest["bias_squared"], "variance": finest["variance"],
            "mean_ratios": finest["mean_ratios"], "tiles": test.get("tests"),
            "biased_tiles": test.get("failed")}


def headline_rows(scenes):
    """(scene, {measure: ratio}) of Volley as it is by default, least ratio of MSE first."""
    rows = []
    for name, scene in scenes.items():
        entry = scene["comparison"][DEFAULT]
        rows.append((name, {key: entry[f"time_ratio_{key}"] for key in ("mse", "rel_mse")}))
    return sorted(rows, key=lambda row: row[1]["mse"]["ratio"] if row[1]["mse"] else 0.0)
