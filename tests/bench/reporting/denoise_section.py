# SPDX-License-Identifier: Apache-2.0
"""The section about Denoise."""

from . import curves, denoise, elsewhere
from .tables import digits, table, words

PEER_SAMPLES = (64, 256)   # of Cycles' plain pictures
TIMED = ("rel_mse", "flip")
MEASURES = ("mse", "rel_mse", "flip")
PIXEL_BYTES = 172          # halves 48, clean Combined 32, features 28 and their passes' sums 56, estimates 8
PASS_BYTES = 24            # three doubles
MAX_RATIO, MAX_TILE = 1.05, 1.5  # of an error with Denoise to that without it; what is above is marked
MAX_FLICKER = 1.0          # of that of plain pictures of 4 times the samples


def section(results):
    """Errors, times, flicker and costs, those of each Blender after the other."""
    parts = [f"{cycles}:\n\n{_tables(made, cycles)}" for cycles, made in elsewhere.beside(results, "denoise")]
    return "\n\n".join(["## Denoise", *parts]) if parts else ""


def _tables(made, cycles):
    """Those of one Blender."""
    scenes, samples = made["scenes"], list(next(iter(made["worst_tiles"].values())))
    parts = []
    for measure in MEASURES:
        rows = [(name, [denoise.error_ratio(scene, measure, count) for count in samples])
                for name, scene in scenes.items()]
        parts += [f"{curves.MEASURES[measure]} with Denoise over that without, by samples:",
                  _ratios(rows, samples, MAX_RATIO)]
    parts += ["The largest such relMSE of tiles of 32 x 32 pixels:",
              _ratios([(name, list(tiles.values())) for name, tiles in made["worst_tiles"].items()], samples, MAX_TILE),
              f"Time of {cycles}' plain picture over that of Volley for the same error, the filter's time included; – where "
              "the errors measured do not reach that one.", _times(scenes), _flicker(made["flicker"]), _costs(made.get("costs"))]
    return "\n\n".join(filter(None, parts))


def headline(made, sizes, cycles="Cycles"):
    """One sentence: times, of pictures of those sizes, for the errors of Cycles' plain ones of PEER_SAMPLES[0] samples."""
    said = []
    for measure in TIMED:
        clean, plain = ([denoise.time_ratio(scene, name, measure, PEER_SAMPLES[0]) for scene in made["scenes"].values()]
                        for name in (denoise.DENOISED, denoise.PLAIN))
        known = [value for value in clean if value is not None]
        if known:
            said.append(f"{digits(denoise.middle(known), 2)} times as long for the same {curves.MEASURES[measure]} "
                        f"({digits(min(known), 2)} to {digits(max(known), 2)} in {len(known)} scenes; "
                        f"without Denoise {digits(denoise.middle(plain), 2)})")
    return (f"Beside Volley with Denoise, {cycles}' plain pictures of {PEER_SAMPLES[0]} samples take "
            f"{', '.join(said)}: medians at {sizes}.") if said else ""


def losses(results):
    """Errors, tiles and flicker that Denoise makes worse than it may, the worst number of samples of each scene."""
    lines = _losses(results["denoise"]) if results.get("denoise") else []
    return lines + [f"{run['blender']}, {line}" for run in elsewhere.of_part(results, "denoise")
                    for line in _losses(run["made"])]


def _losses(made):
    """Those of one Blender."""
    lines = []
    for measure in MEASURES:
        lines += _above(((name, {count: denoise.error_ratio(scene, measure, count) for count in scene["curves"][denoise.PLAIN]})
                         for name, scene in made["scenes"].items()),
                        f"{curves.MEASURES[measure]} with Denoise over that without", MAX_RATIO)
    lines += _above(made["worst_tiles"].items(), "relMSE of the worst tile with Denoise over that without", MAX_TILE)
    return lines + [f"{words(name)}: flicker with Denoise at {denoise.FLICKER_SAMPLES} samples over that of 4 times the "
                    f"samples without **{digits(row['with'])}**"
                    for name, row in made["flicker"].items() if row["with"] > MAX_FLICKER]


def _above(scenes, what, most):
    """A line for each (scene, {samples: ratio}) of which a ratio is above the most."""
    worst = ((name, *max(ratios.items(), key=lambda row: row[1])) for name, ratios in scenes)
    return [f"{words(name)}, {count} samples: {what} **{digits(value)}**" for name, count, value in worst if value > most]


def _ratios(rows, samples, most):
    """A table, the worst scene first, what is above the most in bold."""
    return table(["scene", *samples], [
        [words(name), *(f"**{digits(value)}**" if value > most else digits(value) for value in values)]
        for name, values in sorted(rows, key=lambda row: -max(row[1]))])


def _times(scenes):
    columns = [(name, measure, samples) for measure in TIMED for samples in PEER_SAMPLES
               for name in (denoise.DENOISED, denoise.PLAIN)]
    found = {name: [denoise.time_ratio(scene, *column) for column in columns] for name, scene in scenes.items()}
    rows = [[words(name), *map(digits, values)] for name, values in sorted(found.items(), key=lambda row: row[1][0] or 0.0)]
    heads = [f"{curves.MEASURES[measure]}, {count} samples, {kind}" for measure in TIMED for count in PEER_SAMPLES
             for kind in ("Denoise", "plain")]
    return table(["scene", *heads], [*rows, ["median", *(digits(denoise.middle(column)) for column in zip(*found.values()))]])


def _flicker(scenes):
    """How much less or more the error changes from frame to frame than without the filter; "" of no scenes."""
    if not scenes:
        return ""
    return "\n\n".join([
        f"Flicker over {denoise.FLICKER_FRAMES} frames at {denoise.FLICKER_SAMPLES} samples, each frame with another seed: the "
        "relative square by which a pixel's error changes from one frame to the next, over that of plain pictures of 4 times "
        "the samples and no extra ones:",
        table(["scene", "with Denoise", "without"],
              [[words(name), digits(row["with"]), digits(row["without"])] for name, row in scenes.items()])])


def _costs(rows):
    """What the filter costs, by threads; "" where that was not measured."""
    if not rows:
        return ""
    said = "; ".join(f"{row['threads']} thread{'s' * (row['threads'] > 1)}: {digits(denoise.middle(row['seconds']))} s a "
                     f"megapixel ({digits(min(row['seconds']))} to {digits(max(row['seconds']))})" for row in rows)
    same = "the same bits" if all(row["same_bits"] for row in rows) else "**other bits**"
    return (f"What it costs, differences of the times of whole renders: {said}, and {same} by each; {PIXEL_BYTES} bytes a "
            f"pixel, {PASS_BYTES} more for each pass of light beside Combined.")
