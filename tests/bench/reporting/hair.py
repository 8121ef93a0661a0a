# SPDX-License-Identifier: Apache-2.0
"""Hair, fur and grass: a first F12, in which Blender grows the strands, too."""

import statistics

from . import elsewhere, whole_renders
from .tables import digits, ratio, table, words

SIZE_PX = 240, 180
# As users render, where growing, sync and build are a smaller part; timed alone, as references would take an hour.
LARGE_SIZE_PX, LARGE_REPEATS = (768, 432), 2
LARGE = "large_seconds"


def measure(options, scope, pictures):
    """As whole_renders.measure(), and LARGE: seconds at LARGE_SIZE_PX; PNGs of both into a folder."""
    made = whole_renders.measure(dict.fromkeys(scope.hair_scenes, pictures), SIZE_PX, options, scope)
    for name, engines in made.items():
        for engine, seconds in whole_renders.seconds_of(name, LARGE_SIZE_PX, options, LARGE_REPEATS).items():
            engines[engine][LARGE] = seconds
    return made


def headlines(results):
    """The least and the most gain at each size beside each Blender's Cycles."""
    lines = []
    for cycles, made in elsewhere.beside(results, "hair"):
        at = [f"{_span(ratios)} times as long at {width}×{height}"
              + f" ({len(ratios)} of them)" * (len(ratios) < len(made))
              for (width, height), ratios in ((size, [gain["ratio"] for _name, gain in whole_renders.gains(made, key)])
                                              for size, key in ((SIZE_PX, "seconds"), (LARGE_SIZE_PX, LARGE))) if ratios]
        scenes = "one scene" if len(made) == 1 else f"{len(made)} scenes"
        lines.append(f"With {scenes} of hair, a first F12 of {whole_renders.SAMPLES} samples takes {cycles} "
                     f"{', '.join(at)}.")
    return lines


def _span(ratios):
    """The least and the most of sorted ratios."""
    ends = digits(ratios[0], 2), digits(ratios[-1], 2)
    return " to ".join(dict.fromkeys(ends))


def losses(results):
    """Scenes in which Cycles is done sooner, or has the smaller error."""
    lines = []
    for cycles, made in elsewhere.beside(results, "hair"):
        lines += whole_renders.losses(made, cycles)
        lines += [f"{words(name)}, {LARGE_SIZE_PX[0]}×{LARGE_SIZE_PX[1]}: F12 of {cycles} over Volley's {ratio(gain)}"
                  for name, gain in whole_renders.gains(made, LARGE) if gain["ratio"] < 1.0]
    return lines


def section(results):
    """Seconds and errors of each scene, tables for each Blender."""
    tables = [f"{cycles}:\n\n{_tables(made)}" for cycles, made in elsewhere.beside(results, "hair")]
    if not tables:
        return ""
    return "\n\n".join([
        "## Hair",
        f"A first F12 in a new Blender at {SIZE_PX[0]}×{SIZE_PX[1]} and {whole_renders.SAMPLES} samples, none extra: "
        "Blender's growing of the strands, sync, build and rays. Errors are against a Cycles picture of more samples, "
        "the same for both.", *tables])


def _tables(results):
    """Those of one Blender."""
    engines = whole_renders.ENGINES
    large = [[words(name), *(digits(statistics.median(results[name][engine][LARGE])) for engine in engines),
              ratio(gain)] for name, gain in whole_renders.gains(results, LARGE)]
    return "\n\n".join([
        whole_renders.section_table(results),
        *([f"The same at {LARGE_SIZE_PX[0]}×{LARGE_SIZE_PX[1]}, its time alone:",
           table(whole_renders.COLUMNS[:4], large)] if large else [])])
