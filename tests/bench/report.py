#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Speed against error, measured and reported; report.sh says how it is called.

Each part is measured into a JSON file of its own in DIR/data as soon as it is done; the report is drawn
from those files alone.
"""

import argparse
import json
import pathlib
import sys
import time

import compare_cycles
from reporting import (blender_costs, curves, denoise, document, elsewhere, farm, files, frames, gate, hair, kernels,
                       machine, povray, readme, repeated, scope as scopes)


def parse_arguments(arguments):
    """Command line to options."""
    parser = argparse.ArgumentParser(prog="report.sh", description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_const", const="quick", dest="scope")
    parser.add_argument("--full", action="store_const", const="full", dest="scope")
    parser.add_argument("--next", action="store_const", const="next", dest="scope",
                        help="as tests/blender_next.sh calls it")
    parser.add_argument("--out", type=pathlib.Path, help="folder of the report (BUILD/report)")
    parser.add_argument("--draw", action="store_true", help="draw from the JSON that is there")
    parser.add_argument("--measure", action="store_true", help="draw nothing; needs no matplotlib")
    parser.add_argument("--again", type=pathlib.Path, metavar="DIR",
                        help="put a second run's report beside this one; for --draw")
    parser.add_argument("--baseline", action="store_true", help="write the baseline of the gate")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS),
                        help="measure these alone; the others stay as they are")
    parser.add_argument("--only", nargs="+", metavar="SCENE",
                        help="of parts with results by scene these scenes alone; the others stay as they are")
    parser.add_argument("--scenes", type=pathlib.Path, help="the folder of scenes that are not made here")
    parser.add_argument("--threads", type=int, default=0, help="0: all")
    parser.add_argument("--build", type=pathlib.Path, default=compare_cycles.PROJECT / "build")
    parser.add_argument("--blender", default="blender")
    options = parser.parse_args(arguments)
    if options.baseline and options.scope != "quick":
        parser.error("the baseline is that of --quick")
    if options.only and not set(options.parts) <= SCENE_PARTS:
        parser.error(f"--only is for the parts {', '.join(sorted(SCENE_PARTS))}")
    options.scope = scopes.SCOPES[options.scope or "medium"]
    options.out = options.out or options.build / "report"
    return options


PARTS = {
    "kernels": lambda options: kernels.measure(options, options.scope),
    "frames": lambda options: frames.measure(options, options.scope),
    "blender": lambda options: blender_costs.measure(options, options.scope),
    "povray": lambda options: povray.measure(options, options.scope, options.out / "pictures"),
    "curves": lambda options: curves.measure(options, options.scope, options.out / "pictures"),
    "denoise": lambda options: denoise.measure(options, options.scope, options.out / "pictures"),
    "farm": lambda options: farm.measure(options, options.scope),
    "hair": lambda options: hair.measure(options, options.scope, options.out / "pictures"),
    "files": lambda options: files.measure(options, options.scope, options.out / "pictures"),
    "curves_trixie": lambda options: elsewhere.measure(options, "trixie", "curves"),
    "denoise_trixie": lambda options: elsewhere.measure(options, "trixie", "denoise"),
    "hair_trixie": lambda options: elsewhere.measure(options, "trixie", "hair"),
    "files_trixie": lambda options: elsewhere.measure(options, "trixie", "files"),
    "curves_sid": lambda options: elsewhere.measure(options, "sid", "curves"),
    "denoise_sid": lambda options: elsewhere.measure(options, "sid", "denoise"),
    "hair_sid": lambda options: elsewhere.measure(options, "sid", "hair"),
    "files_sid": lambda options: elsewhere.measure(options, "sid", "files"),
    "kernels_sid": lambda options: elsewhere.measure(options, "sid", "kernels"),
}
SCENE_PARTS = {name for name in PARTS if name.split("_")[0] in ("hair", "files", "curves", "denoise")}  # by scene


def measure(options):
    """Measure all parts into DIR/data."""
    data = options.out / "data"
    data.mkdir(parents=True, exist_ok=True)
    described = machine.describe(options, options.scope)
    described["parts"] = machine.read_parts(data / "machine.json")
    for name in options.parts:
        print(f"== {name}", flush=True)
        start = time.perf_counter()
        made = PARTS[name](options)
        if options.only:
            path = data / f"{name}.json"
            made = with_scenes(json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}, made)
        write(data / f"{name}.json", made)
        described["parts"] = with_measured(described["parts"], name, options.only, machine.of_part(described))
        write(data / "machine.json", described)
        print(f"   {time.perf_counter() - start:.0f} s", flush=True)


def with_scenes(known, made):
    """A part's results with those of some scenes in place of what was known of them; Denoise has several tables by
    scene.

    >>> with_scenes({"fur": 1, "head": 1}, {"fur": 2})
    {'fur': 2, 'head': 1}
    >>> with_scenes({"scenes": {"glass": 1, "gloss": 1}, "costs": 1}, {"scenes": {"gloss": 2}})
    {'scenes': {'glass': 1, 'gloss': 2}, 'costs': 1}
    >>> with_scenes({"blender": "5.2", "made": {"fur": 1}}, {"blender": "5.2", "made": {"head": 2}})
    {'blender': '5.2', 'made': {'fur': 1, 'head': 2}}
    >>> with_scenes({"blender": "5.2", "made": {"fur": 1}}, {"blender": "5.3", "made": {"head": 2}})
    {'blender': '5.3', 'made': {'head': 2}}
    """
    if "made" in made:
        same = known.get("blender") == made["blender"]
        return {**made, "made": with_scenes(known["made"] if same else {}, made["made"])}
    tables = {key: {**known.get(key, {}), **made[key]} for key in denoise.TABLES if key in made}
    return {**known, **made, **tables}


def with_measured(parts, part, only, made):
    """When parts were measured, with a further one, or scenes of it, in place of what was said of those.

    >>> with_measured({"files": 1, "hair": 1}, "files", ["foliage"], 2)
    {'files': 1, 'hair': 1, 'files, foliage': 2}
    >>> with_measured({"files": 1, "hair": 1, "files, foliage": 2}, "files", None, 3)
    {'hair': 1, 'files': 3}
    """
    if only:
        return {**parts, **{f"{part}, {scene}": made for scene in only}}
    others = {name: value for name, value in parts.items() if name.split(", ")[0] != part}
    return {**others, part: made}


def write(path, value):
    """One JSON file, small numbers of digits."""
    path.write_text(json.dumps(rounded(value), indent=None, separators=(",", ":")) + "\n",
                    encoding="utf-8")


def rounded(value):
    """Six digits are more than any of this is good for."""
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, dict):
        return {str(key): rounded(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(each) for each in value]
    return value


def draw(options):
    """Plots and text from the JSON that is there, which is returned."""
    from reporting import plots  # matplotlib is for this alone
    if options.again:
        second = document.load(options.again)
        write(options.out / "data" / "again.json",
              {"date": second["machine"]["date"], "spreads": repeated.spreads(second)})
    results = document.load(options.out)
    plots.draw(results, options.out)
    document.write(results, options.out)
    print(f"report: {options.out / 'report.md'}")
    if options.out.resolve() == readme.COMMITTED:
        readme.write()
    return results


def main(arguments=None):
    """Measure, draw, and in the quick scope look for losses."""
    options = parse_arguments(arguments)
    if not options.draw:
        measure(options)
    if options.measure:
        return 0
    results = draw(options)
    if options.baseline:
        gate.write_baseline(results)
        return 0
    if options.scope.name == "quick" and not options.draw:
        return gate.check(results, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
