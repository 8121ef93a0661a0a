# SPDX-License-Identifier: Apache-2.0
"""Joins the sections of a report to report.md."""

import json

from . import (denoise_section, elsewhere, error_sections, farm_section, files, frame_sections, hair,
               repeated, scope as scopes)
from .machine import names
from .tables import table


def load(out):
    """{part: JSON} of a report's folder."""
    return {path.stem: json.loads(path.read_text(encoding="utf-8"))
            for path in sorted((out / "data").glob("*.json"))}


def write(results, out):
    """Write report.md beside its data."""
    (out / "report.md").write_text(text(results, out), encoding="utf-8")


def text(results, out):
    """The whole report."""
    parts = [head(results), error_sections.headline(results),
             error_sections.losing_cases(results)]
    if results.get("curves"):
        parts.append(error_sections.equal_error(results["curves"]))
    parts += [error_sections.equal_error_elsewhere(run) for run in elsewhere.of_part(results, "curves")]
    if results.get("curves"):
        parts.append(error_sections.curves_and_bias(results["curves"]))
    parts += [denoise_section.section(results), hair.section(results), files.section(results)]
    if results.get("kernels"):
        parts.append(error_sections.kernels_beside_embree(results["kernels"]))
    parts += [error_sections.kernels_elsewhere(run) for run in elsewhere.of_part(results, "kernels")]
    if results.get("povray"):
        parts.append(error_sections.beside_povray(results["povray"]))
    if results.get("frames"):
        parts.append(frame_sections.papers_tables(results["frames"]))
        parts.append(frame_sections.papers_figures())
        parts.append(frame_sections.assemblies(results["frames"]["assemblies"]))
        parts.append(frame_sections.effects(results["frames"]))
        parts.append(frame_sections.growth(results["frames"]))
    if results.get("blender"):
        parts.append(frame_sections.blender(results["blender"]))
    if results.get("farm"):
        parts.append(farm_section.text(results["farm"]))
    if results.get("again"):
        parts.append(repeated.section(results))
    parts += [pictures(out), versions(results["machine"]["parts"])]
    return "\n\n".join(part for part in parts if part) + "\n"


def head(results):
    """What it was measured with."""
    machine = results["machine"]
    scope = scopes.SCOPES[machine["scope"]]
    rows = [
        ["scope", f"{scope.name}: {scope.seeds} seeds, {scope.samples[0]} to {scope.samples[-1]} "
                  f"samples, {scope.repeats} repeats of times"],
        ["machine", f"{'; '.join(names(machine))}; {machine['memory_gib']} GiB"],
        ["load before", str(machine["load_before"])],
        ["system", machine["system"]],
        ["compiler", machine["compiler"]],
        ["Volley", period(machine["parts"])],
        ["against", ", ".join(filter(None, (
            f"{machine['blender']} with Cycles",
            *(f"{run['blender']} with Cycles" for run in elsewhere.of_part(results, "curves")),
            machine["embree"] and f"Embree {machine['embree']}",
            *(elsewhere.embree_name(run) for run in elsewhere.of_part(results, "kernels")),
            machine["povray"] and f"POV-Ray {machine['povray']}")))],
    ]
    return ("# Speed against error\n\n"
            "Written by `bash tests/bench/report.sh`, which repeats it. Times are medians of runs that "
            "took turns; brackets hold least and most of the repeats, or, where a ratio is given, its "
            "95 % bootstrap interval over seeds and repeats. Losing cases come first, and bold.\n\n"
            + table(["", ""], rows))


def period(parts):
    """The commits of all parts: one, or how many of what time."""
    commits = {made["commit"] for made in parts.values()}
    dates = sorted(made["date"][:len("2000-01-01")] for made in parts.values())
    return (", ".join(commits) if len(commits) < 2 else
            f"{len(commits)} commits of {dates[0]} to {dates[-1]}, [listed by part](#commits)")


def versions(parts):
    """What each part was measured with, the latest first; nothing where all were measured with one."""
    made_of = {}
    for part, made in parts.items():
        made_of.setdefault((made["date"][:len("2000-01-01 00:00")], made["commit"], made["machine"]), []).append(part)
    if len(made_of) < 2:
        return ""
    return "## Commits\n\nWhat the parts of this report were measured with:\n\n" + table(
        ["date, UTC", "commit", "machine", "parts, or their scenes"],
        [[*version, "; ".join(made)] for version, made in sorted(made_of.items(), reverse=True)])


def pictures(out):
    """The pictures that were compared."""
    names = sorted(path.name for path in (out / "pictures").glob("*.png"))
    if not names:
        return ""
    lines = ["## Pictures",
             "Cycles above Volley: 1 sample per pixel, 16 and the reference. POV-Ray: its picture, "
             "Volley's, the reference, 16 samples each. Hair and whole files: Cycles, Volley, 64 samples each, "
             "the reference."]
    lines += [f"{name[:-4]}:\n\n![{name[:-4]}](pictures/{name})" for name in names]
    return "\n\n".join(lines)
