# SPDX-License-Identifier: Apache-2.0
"""Looks for large losses: ratios of one quick run against the committed baseline's.

Only ratios of things that ran in turn in one run are compared, never absolute times. A ratio that
fell below the threshold is measured twice more, and lost only if it is low every time. Ratios that the
baseline does not have, as for another instruction set, are not looked at.
"""

import json
import pathlib

from . import curves, estimates, frames, kernels

BASELINE = pathlib.Path(__file__).resolve().parents[1] / "report" / "baseline.json"
LARGE_LOSS = 0.6     # of the baseline: beyond what the load of a shared machine does to ratios
FURTHER_RUNS = 2
# Of each part that is measured again: what its ratios begin with.
PARTS = {"kernels": kernels, "frames": frames}


def ratios(results):
    """{name: ratio} of all that a run tells; more is better."""
    found = {}
    found.update(kernel_ratios(results["kernels"]))
    found.update(frame_ratios(results["frames"]))
    found.update(curve_ratios(results.get("curves", {})))
    return found


def kernel_ratios(rows):
    """Rays per second over Embree's, by instruction set and kind of ray."""
    return {f"kernels {row['isa']} {kernels.label(row)} x{row['threads']}":
            row["embree_default"]["ratio"] for row in kernels.races(rows)}


def frame_ratios(groups):
    """Rays per second of the integrators over ray casting's, and what threads bring."""
    found = {}
    rates = {name: estimates.spread(frames.mrays_per_second(rows))["median"]
             for name, rows in groups["integrators"].items()}
    for name, rate in rates.items():
        stage, integrator = name.split()
        if integrator != "raycast":
            found[f"frames {stage} {integrator} over raycast"] = rate / rates[f"{stage} raycast"]
    for stage in sorted({name.split()[0] for name in rates}):
        runs = {kind: estimates.spread(frames.seconds(groups["effects"][f"{stage} {kind}"]))["median"]
                for kind in ("raycast", "nothing")}
        found[f"frames {stage} nothing to distribute"] = runs["raycast"] / runs["nothing"]
    return found


def curve_ratios(scenes):
    """Time at equal error over Cycles, by scene and configuration."""
    found = {}
    for scene, result in scenes.items():
        for name, entry in result["comparison"].items():
            if name != curves.BASE and entry["time_ratio_mse"]:
                found[f"curves {scene} {name}"] = entry["time_ratio_mse"]["ratio"]
    return found


def losses(found, baseline):
    """Names of the ratios that fell far.

    >>> losses({"a": 1.0, "b": 0.5, "new": 1.0}, {"a": 1.1, "b": 1.0, "gone": 3.0})
    ['b']
    """
    return [name for name, ratio in found.items()
            if name in baseline and ratio < LARGE_LOSS * baseline[name]]


def check(results, options):
    """0, or 1 if a ratio is far below the baseline in every run."""
    if not BASELINE.exists():
        print("gate: there is no baseline")
        return 0
    baseline = json.loads(BASELINE.read_text(encoding="utf-8"))
    found = ratios(results)
    low = losses(found, baseline)
    for _run in range(FURTHER_RUNS):
        if not low:
            break
        print("gate: low, measured again: " + ", ".join(low), flush=True)
        again = ratios(measure_again(low, results, options))
        low = [name for name in losses(again, baseline) if name in low]
    for name in low:
        print(f"gate: LOST {name}: {found[name]:.2f}, baseline {baseline[name]:.2f}")
    compared = sum(name in baseline for name in found)
    print(f"gate: {compared} ratios compared, {len(low)} lost")
    return 1 if low else 0


def measure_again(low, results, options):
    """New results of the parts that low ratios are of."""
    parts = {name.split()[0] for name in low}
    renewed = dict(results)
    for part, module in PARTS.items():
        if part in parts:
            renewed[part] = module.measure(options, options.scope)
    if "curves" in parts:
        renewed["curves"] = curves.measure(options, options.scope, options.out / "pictures")
    return renewed


def write_baseline(results):
    """Keep the ratios of a run as what later ones are compared with."""
    BASELINE.parent.mkdir(parents=True, exist_ok=True)
    found = {name: round(ratio, 3) for name, ratio in sorted(ratios(results).items())}
    BASELINE.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    print(f"baseline: {BASELINE}")
