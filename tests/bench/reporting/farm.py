# SPDX-License-Identifier: Apache-2.0
"""What the steps of a farm's work cost, and how much sooner two nodes are done than one.

A node is one processor of this machine, by taskset. Times are seconds of the processor, of a command and all that
it started: they hold on a machine that does other things as well. Two nodes run side by side.
"""

import dataclasses
import json
import os
import pathlib
import statistics
import subprocess
import tempfile
import time

import compare_cycles

from . import farm_model

MAIN = "import volley.farm.command as c; c.main()"
# Summaries have seconds of the processor then.
PROCESSOR_CLOCK = ("import time, types, volley.farm.job as job; "
                   "job.time = types.SimpleNamespace(monotonic=time.process_time); ")
SETTINGS = ("import bpy; s = bpy.context.scene; r = s.render; s.frame_set(1); r.engine = 'VOLLEY'; "
            "r.use_motion_blur = False; r.resolution_x, r.resolution_y, r.resolution_percentage = {width}, {height}, 100; "
            "r.image_settings.file_format = 'OPEN_EXR_MULTILAYER'; s.volley.samples = {samples}; "
            "bpy.ops.wm.save_as_mainfile(filepath={path!r})")
WIDTH, HEIGHT, SAMPLES = 480, 270, 64
FRAMES = 6
PART_COUNTS = (2, 16)      # of merges that tell what a part costs
SAMPLE_COUNTS = (8, 64)    # of renders that tell what a sample costs


def measure(options, scope):
    """{"repeats": rows of seconds of each measured command, "sizes": bytes}; empty where the scope leaves it out."""
    if not scope.farm:
        return {}
    with tempfile.TemporaryDirectory() as folder:
        bench = _Bench(pathlib.Path(folder), options)
        return {"repeats": [bench.repeat() for _repeat in range(scope.repeats)], "sizes": bench.sizes(),
                "pixels": WIDTH * HEIGHT, "samples": SAMPLES, "frames": FRAMES}


class _Bench:
    """The example's character, and commands on it."""

    def __init__(self, folder, options):
        self._folder, self._options = folder, options
        self._file, self._count = folder / "scene.blend", 0
        made = folder / "made.blend"
        script = compare_cycles.PROJECT / "examples" / "make_character.py"
        compare_cycles.run_blender(["--python-exit-code", 1, "--python", script, "--", made], options)
        setting = SETTINGS.format(width=WIDTH, height=HEIGHT, samples=SAMPLES, path=str(self._file))
        compare_cycles.run_blender(["--addons", "volley", made, "--python-exit-code", 1, "--python-expr", setting],
                                   options)

    def repeat(self):
        """Each measured once, in turn."""
        found = {"start": self._seconds([self._node(0, "pass")])}
        for count in SAMPLE_COUNTS:
            found[f"samples {count}"] = self._seconds([self._render(0, self._new_parts(), "--samples", f"0:{count}")])
        everything = f"1-{FRAMES}"
        found["frames, one node"] = self._seconds([self._pictures(0, everything)])
        found["frames, two nodes"] = self._seconds([
            self._pictures(node, ",".join(str(frame) for frame in range(1 + node, FRAMES + 1, 2))) for node in (0, 1)])
        found["frame, one node"] = self._seconds([self._pictures(0, "1")])
        halves = self._new_parts()
        found["frame, two nodes"] = self._seconds([self._render(node, halves, "--blocks", f"{node}/2")
                                                   for node in (0, 1)])
        for count in PART_COUNTS:
            parts = self._new_parts()
            self._seconds([self._render(0, parts, "--blocks", f"0-{count - 1}/{count}")])
            found[f"merge {count}"] = self._seconds([self._merge(0, parts)])
        found["stages"] = self._stages()
        return found

    def _new_parts(self):
        self._count += 1
        return self._folder / f"parts{self._count}"

    def _node(self, node, expression, *arguments):
        return ["taskset", "-c", str(node), self._options.blender, "-b", "-t", "1", "--factory-startup", "--addons",
                "volley", str(self._file), "--python-exit-code", "1", "--python-expr", expression,
                *(["--", *map(str, arguments)] if arguments else [])]

    def _render(self, node, parts, *arguments):
        return self._node(node, PROCESSOR_CLOCK + MAIN, "render", "--threads", 1, "--parts", parts, "--summary",
                          self._folder / "summary.json", *arguments)

    def _pictures(self, node, frames):
        return self._node(node, MAIN, "render", "--threads", 1, "--frames", frames, "--output",
                          self._folder / "picture_####")

    def _merge(self, node, parts):
        return self._node(node, MAIN, "merge", parts, "--output", self._folder / "merged_####")

    def _seconds(self, lines):
        """{"cpu": seconds of the processor of each command, "wall": of each}, side by side."""
        environment = {**os.environ, "BLENDER_USER_SCRIPTS": str(self._options.build.resolve() / "blender")}
        begin, cpu, wall = time.perf_counter(), {}, {}
        started = [subprocess.Popen(line, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
                   for line in lines]
        places = {process.pid: place for place, process in enumerate(started)}
        for _process in started:
            pid, status, usage = os.wait3(0)
            process = started[places[pid]]
            process.returncode = os.waitstatus_to_exitcode(status)  # or Popen would wait for it, too
            if process.returncode:
                raise RuntimeError(f"{lines[places[pid]]} ended with {process.returncode}")
            cpu[places[pid]] = usage.ru_utime + usage.ru_stime
            wall[places[pid]] = time.perf_counter() - begin
        return {"cpu": [cpu[place] for place in sorted(cpu)], "wall": [wall[place] for place in sorted(wall)]}

    def _stages(self):
        """Seconds of sync and build: of all renders so far the least, as of a frame that is read anew."""
        rows = [json.loads(line) for line in (self._folder / "summary.json").read_text("utf-8").splitlines()]
        return {stage: min(row[f"{stage}_seconds"] for row in rows if len(row["outputs"]) == 1)
                for stage in ("sync", "build")}

    def sizes(self):
        """Bytes of the file, a part and a picture."""
        return {"file": self._file.stat().st_size,
                "part": max(path.stat().st_size for path in self._folder.glob("parts*/*.exr")),
                "picture": (self._folder / "merged_0001.exr").stat().st_size}


# What comes of it --------------------------------------------------------------------------------

def _seconds_of(row, name):
    """Of a measured command, seconds of the slower node's processor."""
    return max(row[name]["cpu"])


def median_seconds(result, name):
    """The same, of all repeats."""
    return statistics.median(_seconds_of(row, name) for row in result["repeats"])


def costs(result):
    """farm_model.Costs of the measured frame: medians of what each repeat, in which all took turns, says."""
    sizes = result["sizes"]
    made = [_costs_of(row, sizes) for row in result["repeats"]]
    return farm_model.Costs(*(statistics.median(values) for values in zip(*map(dataclasses.astuple, made))))


def _costs_of(row, sizes):
    def line(name, counts):
        """What each of what is counted costs, and what all else does."""
        low, high = (_seconds_of(row, f"{name} {count}") for count in counts)
        each = (high - low) / (counts[1] - counts[0])
        return each, low - counts[0] * each
    start = _seconds_of(row, "start")
    sample, fixed = line("samples", SAMPLE_COUNTS)
    merge_part, merge = line("merge", PART_COUNTS)
    return farm_model.Costs(start, max(fixed - start, sum(row["stages"].values())), sample, merge, merge_part,
                            sizes["file"], sizes["part"], sizes["picture"])
