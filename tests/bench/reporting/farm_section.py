# SPDX-License-Identifier: Apache-2.0
"""The section about farms: measured costs, two nodes beside one, and the model up to 10,000 nodes."""

import dataclasses
import functools
import math
import statistics

from . import farm, farm_model
from .farm_model import Work
from .tables import digits, table

NODES = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000)
SHOWN_NODES = (1, 2, 10, 100, 1000, 10_000)
PIXELS = 1920 * 1080
LARGE_FILE_BYTES = 1e9
FRAMES = {"240 frames": 240, "14,400 frames": 14_400}
FRAME_SAMPLES = (64, 1024, 16_384)
IDEAL = farm_model.Farm(bytes_per_second=math.inf, starts_per_second=math.inf, spread=0.0, losses_per_hour=0.0)


@functools.lru_cache(maxsize=None)
def _curve(costs, work, is_parted):
    """Speed-ups over NODES."""
    found = []
    for nodes in NODES:
        tasks = min(nodes, farm_model.best_task_count(costs, work)) if is_parted else 1
        found.append(farm_model.speed_up(costs, farm_model.Farm(), dataclasses.replace(work, tasks=tasks), nodes))
    return found


def curves(result):
    """{"frames" or "one frame": {name: speed-ups over NODES}}, of pictures in HD."""
    costs = farm.costs(result).of_pixels(PIXELS / result["pixels"])
    large = dataclasses.replace(costs, file_bytes=LARGE_FILE_BYTES)
    samples = result["samples"]
    frames = {name: _curve(costs, Work(count, samples), False) for name, count in FRAMES.items()}
    frames["14,400 frames, 1 GB to load"] = _curve(large, Work(FRAMES["14,400 frames"], samples), False)
    return {"frames": frames,
            "one frame": {f"{count:,} samples": _curve(costs, Work(1, count), True) for count in FRAME_SAMPLES}}


def text(result):
    """The whole section."""
    costs, made = farm.costs(result), farm_model.Farm()
    rows = [[name, *(digits(speeds[NODES.index(nodes)]) for nodes in SHOWN_NODES)]
            for group, lines in curves(result).items()
            for name, speeds in ((f"{group}: {name}" if group == "one frame" else name, speeds)
                                 for name, speeds in lines.items())]
    stages = {stage: statistics.median(row["stages"][stage] for row in result["repeats"])
              for stage in ("sync", "build")}
    large = costs.of_pixels(PIXELS / result["pixels"])
    best = farm_model.best_task_count(large, Work(1, FRAME_SAMPLES[-1]))
    return "\n\n".join([
        "## On a farm",
        f"The example's character at 480×270, {result['samples']} samples, through the command line of farms. A node "
        "is one processor of this machine; seconds are those of the processor, of a command with all that it "
        f"started, medians of {len(result['repeats'])} runs that took turns, as the machine did other things, too: "
        "by the clock, commands took "
        f"{digits(_clock_over_processor(result))} times as long. What the steps cost:",
        table(["step", "seconds", "bytes"], [
            ["start of Blender with the file", digits(costs.start), f"{result['sizes']['file']:,} read"],
            [f"a frame besides its samples (sync {digits(stages['sync'])}, build {digits(stages['build'])} of it)",
             digits(costs.frame), ""],
            ["a sample of all pixels", digits(costs.sample), ""],
            ["a part", "", f"{result['sizes']['part']:,} written"],
            ["a merge besides its parts", digits(costs.merge), f"{result['sizes']['picture']:,} written"],
            ["each part of a merge", digits(costs.merge_part), f"{result['sizes']['part']:,} read"]]),
        "Two nodes beside one, and the model's word for it (the slower node; for one frame the merge is in it):",
        table(["", "one node, s", "two nodes, s", "speed-up", "model"], _measured(result, costs)),
        "The model: a scheduler that starts "
        f"{made.starts_per_second:.0f} tasks in a second, one file server of "
        f"{made.bytes_per_second / 1e9:g} GB/s, tasks whose times spread by {100.0 * made.spread:.0f} %, one loss "
        f"of a node in {1.0 / made.losses_per_hour:,.0f} hours, noticed after {made.seconds_to_notice:.0f} s. These "
        "are assumptions; the costs above are measured, for pictures of 1920×1080 in proportion to pixels. Each "
        "task starts Blender anew; one node alone starts it once, so a farm of one is slower than that. A frame is "
        "split into as many tasks as there are nodes, up to the number that is best. Speed-up over one node:",
        table(["nodes", *(f"{nodes:,}" for nodes in SHOWN_NODES)], rows),
        "![Speed-up against nodes](plots/farm.svg)",
        "Limits. *Frames*: there are no more tasks than frames, and the last round is as long as its slowest task (so is a frame of as many parts as nodes); "
        f"the scheduler gives {made.starts_per_second:.0f} tasks a second, and the server "
        f"{made.bytes_per_second / LARGE_FILE_BYTES:g} files of 1 GB: beyond that more nodes only wait. "
        f"*One frame*: start and build ({digits(large.start + large.frame)} s) and the merge's start "
        f"({digits(large.merge)} s) are not divided, and each part costs the merge {digits(large.merge_part)} s; best "
        "are as many tasks as the root of the frame's seconds over that: "
        f"{best} for {FRAME_SAMPLES[-1]:,} samples. A frame that one node renders in less than a minute is not worth "
        "a farm; frames are better split by number than by samples wherever there are many."])


def _measured(result, costs):
    half = Work(result["frames"] // 2, result["samples"])
    whole, single = Work(result["frames"], result["samples"]), Work(1, result["samples"])
    merge = farm.median_seconds(result, "merge 2")
    rows = []
    for name, added, model in (
            ("frames", 0.0, farm_model.alone(costs, whole) / farm_model.alone(costs, half)),
            ("frame", merge, farm_model.alone(costs, single)
             / farm_model.simulate(costs, IDEAL, dataclasses.replace(single, tasks=2), 2))):
        one = farm.median_seconds(result, f"{name}, one node")
        two = farm.median_seconds(result, f"{name}, two nodes") + added
        label = f"{result['frames']} frames" if name == "frames" else "one frame in two parts"
        rows.append([label, digits(one), digits(two), digits(one / two), digits(model)])
    return rows


def _clock_over_processor(result):
    return statistics.median(wall / cpu for row in result["repeats"] for name, each in row.items()
                             if name != "stages" for wall, cpu in zip(each["wall"], each["cpu"]))
