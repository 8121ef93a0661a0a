# SPDX-License-Identifier: GPL-3.0-or-later
"""What the command line asks of the engine, and what it learns of it. One job in a Blender."""

import contextlib
import json
import sys
import time

PROGRESS_SECONDS = 5.0  # between two lines of progress


class _Job:
    """State of the command line; without one, nothing is written."""

    is_on = False
    parts_folder = ""     # where the engine writes parts, "" for nowhere
    is_stopped = False    # by a signal
    failures = []
    warnings = []
    counts = {}           # of the frame: what the summary says
    part_paths = []       # written for the frame
    block = 0, 1          # of the samples: the one rendered, and how many there are
    next_line = 0.0


def begin_frame():
    """Forget the last frame."""
    _Job.is_on = True
    _Job.failures, _Job.warnings, _Job.part_paths, _Job.block = [], [], [], (0, 1)
    _Job.counts = {"sync_seconds": 0.0, "build_seconds": 0.0, "render_seconds": 0.0, "rays": 0,
                   "dropped_samples": 0, "peak_memory_bytes": 0}


def job():
    return _Job


def add_failure(message):
    _Job.failures.append(message)


def add_warning(message):
    _Job.warnings.append(message)


@contextlib.contextmanager
def timed(kind):
    """Around a step of a render: "sync" or "build"."""
    start = time.monotonic()
    try:
        yield
    finally:
        if _Job.is_on:
            _Job.counts[f"{kind}_seconds"] += time.monotonic() - start


def add_render(progress, rays):
    """A render of a layer has ended."""
    if not _Job.is_on:
        return
    counts = _Job.counts
    counts["render_seconds"] += progress.seconds
    counts["rays"] += rays
    counts["dropped_samples"] += progress.dropped_samples
    counts["peak_memory_bytes"] = max(counts["peak_memory_bytes"], progress.peak_memory_bytes)


def say_progress(frame, fraction, text):
    """A line that farm managers can parse, now and then. fraction: of the block of samples."""
    now = time.monotonic()
    index, count = _Job.block
    fraction = (index + fraction) / count
    if not _Job.is_on or (now < _Job.next_line and fraction < 1.0):
        return
    _Job.next_line = now + PROGRESS_SECONDS
    block = f" | Block {index + 1}/{count}" if count > 1 else ""
    say(f"frame {frame} progress {100.0 * fraction:.1f}% {text}{block}")


def say(text):
    """A line on the console, at once."""
    print(f"Volley: {text}", flush=True)


def say_summary(values, path):
    """A frame's summary as one line of JSON, on the console and at the end of a file."""
    line = json.dumps(values, sort_keys=True)
    say(f"summary {line}")
    if path:
        with open(path, "a", encoding="utf-8") as file:
            file.write(line + "\n")
    sys.stdout.flush()
