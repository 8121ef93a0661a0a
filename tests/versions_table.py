#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes tests/versions_table.md: how far shaders, nodes, lights and passes are from Cycles', in each Blender.

    python3 tests/versions_table.py [FOLDER]...

FOLDERs have what the tests of one Blender left; without any they are those of ``tests/run.sh --blender-next``
or of ``tests/versions_table.sh``, build/results and build/results/next_*.
"""

import json
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
LISTED = 0.01  # cases further off than that are named

# name of the results: (what it is, what the error is of)
_OF_PICTURE = "picture's mean or worst tile"
TABLES = {
    "shaders": ("shaders, over a grid of their parameters", "ball's mean or worst tile"),
    "thin_wall": ("Principled's Thin Wall", _OF_PICTURE),
    "textures": ("outputs of texture and value nodes", "panel, mean of pixels"),
    "tracing_nodes": ("nodes that trace: Ambient Occlusion, Bevel, Raycast", _OF_PICTURE),
    "links": ("muted nodes, reroutes and groups", _OF_PICTURE),
    "light_nodes": ("input nodes in lights", "worst pixel, over the brightest"),
    "light_webs": ("IES profiles", "worst pixel, over the brightest"),
    "light_patterns": ("nodes in soft lights", _OF_PICTURE),
    "lights": ("kinds and settings of lights", _OF_PICTURE),
    "linking": ("light and shadow linking", _OF_PICTURE),
    "shading_offsets": ("the terminator's offsets", _OF_PICTURE),
    "passes": ("passes", "pass's mean beyond noise; of Depth to IndexMA the share of pixels"),
    "clamps": ("passes under the clamps", "pass's mean beyond noise"),
}


def read(folder):
    """The Blender that a folder's results are of, and {table: {case: error}}."""
    found, blenders = {}, set()
    for name in TABLES:
        path = folder / f"{name}.json"
        if path.is_file():
            result = json.loads(path.read_text())
            found[name] = result["errors"]
            blenders.add(result["blender"])
    if len(blenders) != 1:
        raise SystemExit(f"{folder} has results of {len(blenders)} Blenders")
    return blenders.pop(), found


def percent(error):
    """Two digits of it.

    >>> percent(0.01234), percent(2.5e-6), percent(None)
    ('1.2 %', '0.00025 %', '–')
    """
    return "–" if error is None else f"{100.0 * error:.2g} %" if error >= 1e-6 else "0 %"


def summary(errors):
    """A cell: how many cases there are and the largest error of them."""
    return f"{len(errors)}: {percent(max(errors.values()))}" if errors else "–"


def lines_of(measured):
    """The document for {Blender: {table: {case: error}}}."""
    heads = " | ".join(measured)
    columns = list(measured.values())
    lines = ["# How far Volley is from Cycles, in each Blender", "",
             "Written by `tests/versions_table.py` from what `tests/blender` measures with diffuse bounces 0; each",
             "Blender beside its own Cycles. Cells: the number of cases, and the largest error among them, of tiles",
             "what is beyond noise, of means with it. The limits and their reasons stand in the tests.", "",
             f"| what | error of | {heads} |", "|---|---|" + "---|" * len(columns)]
    for name, (what, measure) in TABLES.items():
        cells = " | ".join(summary(column.get(name)) for column in columns)
        lines.append(f"| {what} | {measure} | {cells} |")
    lines += ["", f"Cases further off than {percent(LISTED)}:", "",
              f"| case | {heads} |", "|---|" + "---|" * len(columns)]
    for name in TABLES:
        cases = dict.fromkeys(case for column in columns for case in column.get(name, ()))
        for case in cases:
            errors = [column.get(name, {}).get(case) for column in columns]
            if max(error or 0.0 for error in errors) > LISTED:
                lines.append(f"| {name.replace('_', ' ')}: {case} | {' | '.join(map(percent, errors))} |")
    return lines


def main(arguments):
    results = HERE.parent / "build" / "results"
    folders = list(map(pathlib.Path, arguments)) or [results, *sorted(p for p in results.glob("next_*") if p.is_dir())]
    measured = sorted(map(read, folders), key=lambda pair: tuple(map(int, pair[0].split("."))))
    (HERE / "versions_table.md").write_text("\n".join(lines_of(dict(measured))) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
