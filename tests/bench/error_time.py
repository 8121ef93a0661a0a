#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Error against samples and time, Cycles beside Volley, per number of light samples and sampler.

    error_time.py --scenes DIR                       errors of five scenes
    error_time.py --scenes DIR --times               the times too; run it alone on the machine
    error_time.py --scene billiards --engines VOLLEY --light-samples 0 \\
        --samplers SOBOL SUDOKU JITTER BLUE_NOISE INDEPENDENT --pictures OUT

The five default scenes have motion blur, depth of field, soft shadows and gloss at once; ``DIR`` is
described in scene_setups.py. Both engines have the same light transport (diffuse bounces 0), no
denoising and no adaptive sampling. Every error is the mean over seeds, against the mean of several
Cycles pictures of many samples whose own variance is measured and subtracted; it is split into
variance, which needs no reference, and squared bias.

Errors do not depend on the load of the machine, so pictures are kept under BUILD/error_time, Volley's
for as long as the add-on is the same. Times are medians of interleaved runs.
"""

import argparse
import hashlib
import json
import math
import pathlib
import statistics
import sys
import tempfile
from dataclasses import dataclass, field

import compare_cycles
import numpy as np
import scene_setups
from reporting import estimates

import compare  # found by compare_cycles' path
import flip

SCENES = ["example_motion", "robot_motion", "knight_motion", "conference_motion", "billiards"]
FIRST_SEED = 101
FIRST_REFERENCE_SEED = 1
MEASURES = ("mse", "rel_mse")


@dataclass(frozen=True)
class Configuration:
    """One curve: an engine and what is set in it."""

    name: str
    engine: str
    volley: dict = field(default_factory=dict)


def configurations(options):
    """Cycles first, then Volley with each sampler and number of light samples."""
    made = []
    if "CYCLES" in options.engines:
        made.append(Configuration("cycles", "CYCLES"))
    if "VOLLEY" in options.engines:
        for sampler in options.samplers:
            for count in options.light_samples:
                name = f"volley {sampler.lower()} l{count}"
                made.append(Configuration(name, "VOLLEY",
                                          {"sampler": sampler, "light_samples": count}))
    return made


# Pictures ----------------------------------------------------------------------------------------

def addon_key(build):
    """A hash of the staged add-on with its library."""
    digest = hashlib.sha256()
    for path in sorted((build / "blender").rglob("*")):
        if path.is_file() and path.suffix != ".pyc":
            digest.update(path.read_bytes())
    return digest.hexdigest()


def settings_of(options, configuration, samples, seed, scale=1):
    """The settings of one picture."""
    return {**scene_setups.DEFAULT_SETTINGS, "width": scale * options.width,
            "height": scale * options.height, "samples": samples, "seed": seed,
            "volley": configuration.volley}


def run_batch(blend, jobs, options):
    """Render (engine, settings, output) triples in one Blender; returns the seconds of each."""
    with tempfile.TemporaryDirectory() as folder:
        jobs_path, seconds_path = (pathlib.Path(folder) / name for name in ("jobs", "seconds"))
        jobs_path.write_text(json.dumps(
            [{"engine": engine, "frame": options.frame, "settings": settings, "output": str(output)}
             for engine, settings, output in jobs]))
        compare_cycles.run_blender(
            ["-t", options.threads, "--addons", "volley", blend, "--python-exit-code", 1, "-P",
             compare_cycles.SETUPS_FILE, "--", "batch", jobs_path, seconds_path], options)
        return json.loads(seconds_path.read_text())


def stack_path(key, configuration, samples, seeds, options):
    """Where the pictures of one point of a curve are kept."""
    identity = [key, options.frame, seeds, configuration.engine,
                settings_of(options, configuration, samples, 0),
                options.addon_key if configuration.engine == "VOLLEY" else options.blender_version]
    digest = hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:16]
    name = f"{options.scene}-{configuration.name.replace(' ', '-')}-{samples}spp-{digest}.npy"
    return options.build / "error_time" / name


def render_stacks(blend, key, configuration, points, options):
    """Pictures (seeds, height, width, 3) for each (samples, seeds) of ``points``, in their order."""
    paths = [stack_path(key, configuration, samples, seeds, options) for samples, seeds in points]
    missing = [(path, samples, seeds) for path, (samples, seeds) in zip(paths, points)
               if not path.exists()]
    with tempfile.TemporaryDirectory() as folder:
        def output(samples, seed):
            return pathlib.Path(folder) / f"{samples}-{seed}.exr"

        if missing:
            run_batch(blend, [(configuration.engine,
                               settings_of(options, configuration, samples, seed),
                               output(samples, seed))
                              for _path, samples, seeds in missing for seed in seeds], options)
        for path, samples, seeds in missing:
            path.parent.mkdir(parents=True, exist_ok=True)
            np.save(path, np.stack([compare.read_rgb(output(samples, seed)) for seed in seeds]))
    return [np.load(path) for path in paths]


# Errors ------------------------------------------------------------------------------------------

@dataclass
class Reference:
    """The best picture there is, and the variance of each of its values."""

    mean: np.ndarray
    variance: np.ndarray

    @classmethod
    def of_stack(cls, stack):
        """From independent pictures (seeds, height, width, 3)."""
        stack = stack.astype(np.float64)
        return cls(stack.mean(axis=0), stack.var(axis=0, ddof=1) / len(stack))

    def weights(self, measure):
        """What squared errors are multiplied with: 1, or 1 / (r + 0.01)^2 as in compare.rel_mse."""
        if measure == "mse":
            return np.ones_like(self.mean)
        return (np.maximum(self.mean, 0.0) + compare.RELATIVE_FLOOR) ** -2.0


def point_errors(stack, reference):
    """Errors of one point of a curve, each with the reference's own variance taken off.

    >>> flat = Reference(np.ones((1, 1, 3)), np.zeros((1, 1, 3)))
    >>> point = point_errors(np.array([2.0, 4.0]).reshape(2, 1, 1, 1) * np.ones((1, 1, 1, 3)), flat)
    >>> point["mse"], point["variance"], point["bias_squared"]
    (5.0, 2.0, 3.0)
    """
    stack = stack.astype(np.float64)
    errors = {}
    errors["seeds"] = {}
    for measure in MEASURES:
        weights = reference.weights(measure)
        per_seed = [float(np.mean(weights * (compare.squared_error(image, reference.mean)
                                             - reference.variance))) for image in stack]
        errors["seeds"][measure] = per_seed
        errors[measure] = statistics.mean(per_seed)
        errors[measure + "_error"] = statistics.stdev(per_seed) / math.sqrt(len(per_seed))
    errors["seeds"]["p999"] = [compare.error_percentile(image, reference.mean) for image in stack]
    errors["seeds"]["flip"] = [flip.mean_flip(image, reference.mean) for image in stack]
    for measure in ("p999", "flip"):
        errors[measure] = statistics.mean(errors["seeds"][measure])
    variance = stack.var(axis=0, ddof=1)
    errors["variance"] = float(variance.mean())
    errors["bias_squared"] = float(np.mean((stack.mean(axis=0) - reference.mean) ** 2
                                           - variance / len(stack) - reference.variance))
    errors["mean_ratios"] = compare.mean_ratios(stack.mean(axis=0), reference.mean).tolist()
    errors["non_finite_pixels"] = max(compare.non_finite_pixels(image) for image in stack)
    return errors


def reference_stack(blend, key, options):
    """Cycles' pictures that the reference is the mean of."""
    seeds = list(range(FIRST_REFERENCE_SEED, FIRST_REFERENCE_SEED + options.reference_seeds))
    return render_stacks(blend, key, Configuration("cycles", "CYCLES"),
                         [(options.reference_samples, seeds)], options)[0]


def scene_errors(blend, key, options):
    """{"reference": ..., "curves": {configuration: {samples: errors}}, "bias": ...} of one scene."""
    reference = Reference.of_stack(reference_stack(blend, key, options))
    seeds = list(range(FIRST_SEED, FIRST_SEED + options.seeds))
    report = {"reference": {"samples": options.reference_samples, "seeds": options.reference_seeds,
                            "variance": float(reference.variance.mean())},
              "curves": {}, "bias": {}}
    first_pictures, finest = {}, {}
    for configuration in options.configurations:
        stacks = render_stacks(blend, key, configuration,
                               [(samples, seeds) for samples in options.samples], options)
        report["curves"][configuration.name] = {
            samples: point_errors(stack, reference)
            for samples, stack in zip(options.samples, stacks)}
        first_pictures[configuration.name] = [stack[0] for stack in stacks]
        finest[configuration.name] = stacks[-1]
        if "cycles" in finest and configuration.name != "cycles":
            report["bias"][configuration.name] = compare.bias_test(finest["cycles"], stacks[-1])
    if options.pictures:
        write_sheets(first_pictures, reference.mean, options)
    return report


def write_sheets(pictures, reference, options):
    """One PNG for each configuration: its first seed at each number of samples, then the
    reference."""
    options.pictures.mkdir(parents=True, exist_ok=True)
    for name, images in pictures.items():
        path = options.pictures / f"{options.scene}-{name.replace(' ', '-')}.png"
        row = np.concatenate([*images, reference], axis=1)
        compare.write_png(path, row * 2.0 ** options.stops)


# Times -------------------------------------------------------------------------------------------

def scene_times(blend, options):
    """Median seconds of a render as F12 counts it, {configuration: {samples: seconds}}. All renders
    are of one process, which takes the configurations in turn."""
    made = options.configurations
    points = [(repeat, samples, configuration) for repeat in range(options.repeats)
              for samples in options.time_samples for configuration in made]
    # The first render of an engine pays for the pages it touches.
    warming = [(0, options.time_samples[0], configuration) for configuration in made]
    runs = {configuration.name: {samples: [] for samples in options.time_samples}
            for configuration in made}
    with tempfile.TemporaryDirectory() as folder:
        output = pathlib.Path(folder) / "timed.exr"
        seconds = run_batch(
            blend, [(configuration.engine,
                     settings_of(options, configuration, samples, FIRST_SEED + repeat,
                                 options.times_scale), output)
                    for repeat, samples, configuration in warming + points], options)
    for (_repeat, samples, configuration), value in zip(points, seconds[len(warming):]):
        runs[configuration.name][samples].append(value)
    return {name: {samples: {"seconds": statistics.median(values), "least": min(values),
                             "most": max(values), "runs": values}
                   for samples, values in timed.items()} for name, timed in runs.items()}


# Comparison of curves ----------------------------------------------------------------------------

def cost_ratios(base, other):
    """How much more the base costs at equal error: {the base's samples: ratio}, and their geometric
    mean. Each curve is (samples, costs, errors)."""
    ratios = {}
    for samples, cost, error in zip(*base):
        needed = estimates.cost_at(other[1], other[2], error)
        if needed:
            ratios[samples] = cost / needed
    if not ratios:
        return None
    mean = math.exp(statistics.mean(math.log(ratio) for ratio in ratios.values()))
    return {"at": ratios, "mean": mean}


def curve_of(points, times, measure):
    """(samples, costs, errors) of a curve; costs are samples without times."""
    samples = [count for count in points if not times or count in times]
    costs = [times[count]["seconds"] for count in samples] if times else samples
    return samples, costs, [points[count][measure] for count in samples]


def compare_curves(scene):
    """Ratios of every configuration to the first, by samples and, if measured, by time."""
    names = list(scene["curves"])
    base = names[0]
    report = {}
    for name in names:
        entry = {"slope": estimates.slope(*curve_of(scene["curves"][name], None, "mse")[1:])}
        for measure in MEASURES:
            for cost in ("samples", "seconds") if "times" in scene else ("samples",):
                sides = [curve_of(scene["curves"][each],
                                  scene["times"][each] if cost == "seconds" else None, measure)
                         for each in (base, name)]
                entry[f"{cost}_ratio_{measure}"] = cost_ratios(*sides)
        report[name] = entry
    return report


# Report ------------------------------------------------------------------------------------------

def format_ratio(entry, key):
    """The geometric mean of a ratio, or a dash."""
    ratio = entry.get(key)
    return f"{ratio['mean']:7.2f}" if ratio else "      -"


def print_scene(name, scene, options):
    """Tables for a reader."""
    reference = scene["reference"]
    print(f"\n{name}: {options.width}x{options.height}, frame {options.frame}, {options.seeds} seeds; "
          f"reference: {reference['seeds']} x {reference['samples']} samples of Cycles, "
          f"its MSE {reference['variance']:.2e}")
    for measure in MEASURES:
        print(f"{measure:22s}" + "".join(f"{samples:>12d}" for samples in options.samples))
        for configuration, points in scene["curves"].items():
            print(f"{configuration:22s}" + "".join(
                f"{point[measure]:12.3e}" for point in points.values()))
    if "times" in scene:
        print(f"{'seconds':22s}" + "".join(f"{samples:>12d}" for samples in options.time_samples))
        for configuration, points in scene["times"].items():
            print(f"{configuration:22s}" + "".join(
                f"{point['seconds']:12.3f}" for point in points.values()))
    print("at equal error, the first needs so many times the samples, and the time, of:\n"
          "                         slope   MSE    relMSE   time MSE  relMSE   "
          "at most samples: bias^2/variance, mean/reference (R G B), tiles biased")
    for configuration, entry in scene["comparison"].items():
        finest = scene["curves"][configuration][options.samples[-1]]
        bias = scene["bias"].get(configuration)
        steep = f"{entry['slope']:7.2f}" if entry["slope"] is not None else "      -"
        print(f"{configuration:22s} {steep} {format_ratio(entry, 'samples_ratio_mse')} "
              f"{format_ratio(entry, 'samples_ratio_rel_mse')} "
              f"{format_ratio(entry, 'seconds_ratio_mse')} "
              f"{format_ratio(entry, 'seconds_ratio_rel_mse')}   "
              f"{finest['bias_squared'] / max(finest['variance'], 1e-300):8.3f}  "
              + " ".join(f"{ratio:.4f}" for ratio in finest["mean_ratios"])
              + (f"   {bias['failed']} of {bias['tests']}" if bias else ""), flush=True)


# Program -----------------------------------------------------------------------------------------

def parse_arguments(arguments):
    """Command line to options."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scene", nargs="+", dest="scene_names", choices=scene_setups.SCENES,
                        default=SCENES, metavar="NAME")
    parser.add_argument("--scenes", type=pathlib.Path, default=pathlib.Path("."),
                        help="the folder of scenes")
    parser.add_argument("--width", type=int, help="of the pictures in pixels (the scene's own)")
    parser.add_argument("--height", type=int)
    parser.add_argument("--samples", type=int, nargs="+", default=[1, 4, 16, 64, 256])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--engines", nargs="+", default=["CYCLES", "VOLLEY"], type=str.upper)
    parser.add_argument("--light-samples", type=int, nargs="+", default=[1, 2, 4, 8])
    parser.add_argument("--samplers", nargs="+", default=["SOBOL"], type=str.upper)
    parser.add_argument("--reference-samples", type=int, default=1024)
    parser.add_argument("--reference-seeds", type=int, default=4)
    parser.add_argument("--times", action="store_true", help="measure times too")
    parser.add_argument("--time-samples", type=int, nargs="+",
                        help="what is timed of --samples (all)")
    parser.add_argument("--times-scale", type=int, default=2,
                        help="times are those of pictures so many times as wide and high")
    parser.add_argument("--repeats", type=int, default=3, help="of each timed render")
    parser.add_argument("--threads", type=int, default=0, help="0: all")
    parser.add_argument("--build", type=pathlib.Path, default=compare_cycles.PROJECT / "build")
    parser.add_argument("--out", type=pathlib.Path, help="the JSON (BUILD/error_time/report.json)")
    parser.add_argument("--pictures", type=pathlib.Path, help="a folder for pictures to look at")
    parser.add_argument("--blender", default="blender")
    options = parser.parse_args(arguments)
    if options.seeds < 2 or options.reference_seeds < 2:
        parser.error("variances need two seeds or more")
    options.samples = sorted(options.samples)
    options.time_samples = sorted(options.time_samples or options.samples)
    options.configurations = configurations(options)
    options.out = options.out or options.build / "error_time" / "report.json"
    return options


def scene_options(name, options):
    """The options for one scene, its own size and frame filled in."""
    known = scene_setups.SCENES[name]
    return argparse.Namespace(**{
        **vars(options), "scene": name, "file": None, "frame": known.frame, "stops": known.stops,
        "width": options.width or known.width, "height": options.height or known.height})


def measure_scene(name, options):
    """All that is asked for of one scene, as the JSON has it."""
    own = scene_options(name, options)
    blend, key, _name = compare_cycles.prepared_scene(own)
    scene = {"width": own.width, "height": own.height, "frame": own.frame, "seeds": own.seeds,
             **scene_errors(blend, key, own)}
    if options.times:
        scene["times"] = scene_times(blend, own)
        scene["times_scale"] = own.times_scale
    scene["comparison"] = compare_curves(scene)
    return scene


def identify(options):
    """Fill in what kept pictures are known by: the add-on and Blender's version."""
    options.addon_key = addon_key(options.build)
    options.blender_version = compare_cycles.blender_version(options)
    return options


def main(arguments=None):
    """Measure all scenes; print tables and write the JSON."""
    options = identify(parse_arguments(arguments))
    report = {}
    for name in options.scene_names:
        report[name] = measure_scene(name, options)
        print_scene(name, report[name], scene_options(name, options))
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(json.dumps(report, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
