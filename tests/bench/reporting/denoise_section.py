# SPDX-License-Identifier: Apache-2.0
"""The section about Denoise: errors with it over those without, and its time to Cycles' plain errors."""

import statistics

from . import curves, estimates
from .tables import digits, table, words

PEER_SAMPLES = (64, 256)   # of Cycles' plain pictures
MEASURES = ("rel_mse", "flip")
PIXEL_BYTES = 172          # halves 48, clean Combined 32, features 28 and their passes' sums 56, estimates 8
PASS_BYTES = 24            # three doubles
MAX_RATIO = 1.05           # of an error with Denoise to that without it; what is above is marked


def text(scenes):
    """The whole section; empty where Denoise was not measured."""
    made = {name: scene for name, scene in scenes.items() if curves.DENOISED in scene["curves"]}
    if not made:
        return ""
    samples = list(next(iter(made.values()))["curves"][curves.DENOISED])
    ratios = sorted(((name, [error_ratio(scene, count) for count in samples]) for name, scene in made.items()),
                    key=lambda row: -max(row[1]))
    return "\n\n".join([
        "## Denoise",
        "relMSE with Denoise over that without, by samples:",
        table(["scene", *samples], [[words(name), *map(_ratio, values)] for name, values in ratios]),
        "Time of Cycles' plain picture over that of Volley for the same error, the filter's time included; – where "
        "the errors measured do not reach that one. Bias is in the table above.",
        table(["scene", *(f"{curves.MEASURES[measure]}, {count} samples, {kind}" for measure in MEASURES
                          for count in PEER_SAMPLES for kind in ("Denoise", "plain"))], _time_rows(made)),
        f"What it costs: seconds a megapixel with all threads, differences of the times of whole renders, and "
        f"{PIXEL_BYTES} bytes a pixel, {PASS_BYTES} more for each pass of light beside Combined.",
        table(["scene", *samples], [[words(name), *map(digits, filter_seconds(scene, samples))]
                                    for name, scene in made.items()])])


def error_ratio(scene, samples):
    """relMSE with Denoise over that without."""
    return scene["curves"][curves.DENOISED][samples]["rel_mse"] / scene["curves"][curves.DEFAULT][samples]["rel_mse"]


def filter_seconds(scene, samples):
    """Seconds a megapixel that Denoise adds to a render, by samples; at few of them noise is as large."""
    megapixels = scene["width"] * scene["height"] * scene["times_scale"] ** 2 / 1e6
    clean, plain = (dict(zip(scene["curves"][name], curves.curve(scene, name, "mse")[0]))
                    for name in (curves.DENOISED, curves.DEFAULT))
    return [(clean[count] - plain[count]) / megapixels for count in samples]


def time_ratio(scene, name, measure, samples):
    """Seconds of Cycles at so many samples over those of a configuration at its error; None outside the curve."""
    seconds, errors = curves.curve(scene, curves.BASE, measure)
    index = list(scene["curves"][curves.BASE]).index(str(samples))
    needed = estimates.cost_at(*curves.curve(scene, name, measure), errors[index])
    return seconds[index] / needed if needed else None


def _time_rows(scenes):
    columns = [(name, measure, samples) for measure in MEASURES for samples in PEER_SAMPLES
               for name in (curves.DENOISED, curves.DEFAULT)]
    found = {scene_name: [time_ratio(scene, *column) if str(column[2]) in scene["curves"][curves.BASE] else None
                          for column in columns] for scene_name, scene in scenes.items()}
    rows = [[words(name), *map(digits, values)]
            for name, values in sorted(found.items(), key=lambda row: row[1][0] or 0.0)]
    medians = [statistics.median(known) if (known := [value for value in column if value is not None]) else None
               for column in zip(*found.values())]
    return [*rows, ["median", *map(digits, medians)]]


def _ratio(value):
    return f"**{digits(value)}**" if value > MAX_RATIO else digits(value)
