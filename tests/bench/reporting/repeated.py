# SPDX-License-Identifier: Apache-2.0
"""A second run beside the first: whether its ratios are within the spread that the first one states."""

import math

from . import curves, elsewhere, estimates, kernels
from .tables import digits, table


def spreads(results):
    """{part: {name: [ratio, low, high]}} of a run: what it says of time at equal error and of rays per
    second, and how sure it is. A ratio of rates may be that of any two of their repeats."""
    found = {"time at equal error": curve_spreads(results.get("curves", {}))}
    for run in elsewhere.of_part(results, "curves"):
        found[f"time at equal error, {run['blender']}"] = curve_spreads(run["made"])
    found["rays per second"] = kernel_spreads(results.get("kernels", []))
    for run in elsewhere.of_part(results, "kernels"):
        found[f"rays per second, {elsewhere.embree_name(run)}"] = kernel_spreads(run["made"])
    return found


def kernel_spreads(rows):
    """{name: [ratio, low, high]} of rays per second."""
    found = {}
    for row in kernels.races(rows):
        own, peer = row["volley_mrays_s"], row["embree_default"]
        best = peer[peer["best"]]
        found[f"{kernels.label(row)}, {row['isa']} x{row['threads']}"] = [
            peer["ratio"], own["min"] / best["max"], own["max"] / best["min"]]
    return found


def curve_spreads(scenes):
    """{name: [ratio, low, high]} of time at equal MSE."""
    found = {}
    for scene, result in scenes.items():
        for name, entry in result["comparison"].items():
            made = entry.get("time_ratio_mse") if name != curves.BASE else None
            if made:
                found[f"{scene}, {name}"] = [made["ratio"], *made["interval"]]
    return found


def compare(first, second):
    """Of two runs' {name: [ratio, low, high]}: how many overlap, and by what factor ratios differ.

    >>> made = compare({"a": [2.0, 1.5, 2.5], "b": [1.0, 0.9, 1.1]}, {"a": [1.0, 0.5, 1.6],
    ...                                                              "b": [2.0, 1.9, 2.1], "c": [1, 1, 1]})
    >>> made["count"], made["overlap"], made["outside"], round(made["largest"], 6)
    (2, 1, ['b'], 2.0)
    """
    names = [name for name in first if name in second]
    outside = [name for name in names
               if first[name][1] > second[name][2] or second[name][1] > first[name][2]]
    factors = [math.exp(abs(math.log(second[name][0] / first[name][0]))) for name in names]
    return {"count": len(names), "overlap": len(names) - len(outside), "outside": outside,
            "middle": estimates.spread(factors)["median"] if factors else 1.0,
            "largest": max(factors, default=1.0)}


def section(results):
    """The second run, part by part; what does not overlap by name."""
    first, second = spreads(results), results["again"]["spreads"]
    made = {part: compare(first[part], second.get(part, {})) for part in first}
    rows = [[part, str(each["count"]), str(each["overlap"]), f"{each['middle']:.2f}",
             f"{each['largest']:.2f}"] for part, each in made.items() if each["count"]]
    lines = ["## A second run",
             f"The same once more, {results['again']['date']}. *Overlap* counts the ratios whose spreads "
             "(95 % intervals of time at equal error, least and most of the repeats of rays per second) "
             "have a part in common; *factor* is by how much the ratios themselves differ.",
             table(["ratios of", "number", "overlap", "factor: middle", "largest"], rows)]
    lines += [f"- {name}: {digits(first[part][name][0])}, then {digits(second[part][name][0])}"
              for part, each in made.items() for name in each["outside"]]
    return "\n\n".join(lines[:3] + (["\n".join(lines[3:])] if lines[3:] else []))
