# SPDX-License-Identifier: Apache-2.0
"""POV-Ray and Volley on the same triangles, mirrors and sun: time, and error against Cycles.

POV-Ray (https://www.povray.org) is the classic ray tracer of Whitted's and distribution ray tracing.
Its time is its own trace time with parsing and building, Volley's all of a render as F12 counts it.
Both supersample every pixel with a box filter of one pixel.
"""

import pathlib
import re
import shutil
import statistics
import subprocess
import tempfile

import compare
import compare_cycles
import error_time
import numpy as np
import scene_setups

EXPORT = pathlib.Path(compare_cycles.SETUPS_FILE).with_name("povray_export.py")
# Samples along a side of a pixel; Volley takes their square.
SIDES = (1, 2, 3, 4)
TRACE_TIME = re.compile(r"(Parse|Photon|Radiosity|Trace) Time:.*?\(([\d.]+) seconds\)")
BASE_SEED = 101


def measure(options, scope, pictures):
    """{scene: rows of both programs}; {} where POV-Ray is not installed."""
    if shutil.which("povray") is None:
        return {}
    return {name: measure_scene(name, options, scope, pictures) for name in scope.classic_scenes}


def measure_scene(name, options, scope, pictures):
    """Times and errors of both at each number of samples, interleaved."""
    own = scene_options(name, options, scope)
    blend, _key, _name = compare_cycles.prepared_scene(own)
    reference = error_time.Reference.of_stack(reference_stack(blend, scope, own))
    rows = {(program, side): {"seconds": [], "mse": [], "rel_mse": []}
            for program in ("povray", "volley") for side in SIDES}
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        pov = export(blend, folder / "scene.pov", own)
        for repeat in range(scope.repeats):
            seconds = render_volley(blend, folder, repeat, own)
            for side in SIDES:
                take(rows["volley", side], seconds[side], folder / f"volley-{side}.exr", reference)
                spent = render_povray(pov, folder / f"povray-{side}.exr", side, own)
                take(rows["povray", side], spent, folder / f"povray-{side}.exr", reference)
        show(name, folder, reference, pictures)
    return {"width": own.width, "height": own.height, "reference_mse": float(reference.variance.mean()),
            "rows": [{"program": program, "samples": side * side, **row}
                     for (program, side), row in rows.items()]}


def scene_options(name, options, scope):
    """Options of error_time with the box filter and this size."""
    own = error_time.identify(error_time.parse_arguments(
        ["--build", str(options.build), "--threads", str(options.threads), "--blender",
         options.blender, "--engines", "CYCLES", "--width", str(scope.classic_width), "--height",
         str(scope.classic_width * 9 // 16)]))
    return error_time.scene_options(name, own)


def box_settings(own, samples, seed):
    """Both engines' settings with POV-Ray's pixel."""
    return {**scene_setups.DEFAULT_SETTINGS, "width": own.width, "height": own.height,
            "samples": samples, "seed": seed, "filter": "BOX", "filter_width_px": 1.0,
            "volley": {"pixel_filter_type": "BOX", "filter_width": 1.0, "light_samples": 1}}


def reference_stack(blend, scope, own):
    """Pictures of Cycles with many samples."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [pathlib.Path(folder) / f"{seed}.exr" for seed in range(scope.reference_seeds)]
        error_time.run_batch(blend, [("CYCLES", box_settings(own, scope.reference_samples // 4, seed),
                                      path) for seed, path in enumerate(paths)], own)
        return np.stack([compare.read_rgb(path) for path in paths])


def render_volley(blend, folder, repeat, own):
    """{side: seconds}; the first picture of the process is not counted."""
    jobs = [("VOLLEY", box_settings(own, side * side, BASE_SEED + repeat),
             folder / f"volley-{side}.exr") for side in (SIDES[0], *SIDES)]
    return dict(zip(SIDES, error_time.run_batch(blend, jobs, own)[1:]))


def export(blend, path, own):
    """The scene as POV-Ray reads it."""
    # The size of the frame sets the aspect; it is in the settings of no scene.
    size = (f"import bpy; r = bpy.context.scene.render; r.resolution_x, r.resolution_y = "
            f"{own.width}, {own.height}")
    compare_cycles.run_blender([blend, "--python-exit-code", 1, "--python-expr", size, "-P", EXPORT,
                                "--", path], own)
    return path


def render_povray(scene, output, side, own):
    """Seconds that POV-Ray says it took: parsing and tracing."""
    sampling = ["+A0.0", "+AM1", f"+R{side}", "+J0.5"] if side > 1 else ["-A"]
    threads = [f"+WT{own.threads}"] if own.threads else []
    done = subprocess.run(
        ["povray", f"+I{scene}", f"+O{output}", f"+W{own.width}", f"+H{own.height}", "+FE", "-D",
         "-P", "+Q9", *sampling, *threads], capture_output=True, text=True, errors="replace",
        check=False)
    if done.returncode != 0:
        raise RuntimeError("POV-Ray failed:\n" + done.stderr[-3000:])
    return sum(float(seconds) for _what, seconds in TRACE_TIME.findall(done.stderr))


def take(row, seconds, path, reference):
    """Add a picture's time and errors to its row."""
    image = compare.read_rgb(path)
    row["seconds"].append(seconds)
    for measure_name in error_time.MEASURES:
        weights = reference.weights(measure_name)
        squared = compare.squared_error(image, reference.mean) - reference.variance
        row[measure_name].append(float(np.mean(weights * squared)))


def show(name, folder, reference, pictures):
    """One PNG: POV-Ray, Volley, Cycles."""
    pictures.mkdir(parents=True, exist_ok=True)
    images = [compare.read_rgb(folder / f"{program}-{SIDES[-1]}.exr")
              for program in ("povray", "volley")]
    compare.write_png(pictures / f"{name}-povray.png",
                      np.concatenate([*images, reference.mean], axis=1))


def medians(row):
    """(seconds, relative MSE) of a row."""
    return statistics.median(row["seconds"]), statistics.median(row["rel_mse"])
