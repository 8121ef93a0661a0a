# SPDX-License-Identifier: Apache-2.0
"""What an edit costs in a final render with persistent data, beside Cycles.

    BLENDER_USER_SCRIPTS=$PWD/build/blender blender -b --factory-startup --addons volley,cycles \\
        --python tests/bench/final_edits.py -- [--objects N...] [--repeats N] [--json FILE]

Fields of objects, each of a mesh of its own of 200 triangles, are rendered again after each edit of
edit_kinds.py, after none and on a frame on which one object has moved: small pictures of one sample. Times
are medians in milliseconds: sync is Python and the copies it makes, commit builds trees and tables, whole is
the operator with Blender's own evaluation, cycles the same by Cycles.
"""

import argparse
import contextlib
import json
import pathlib
import statistics
import sys
import time

import bpy

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "support"), str(HERE)]
import edit_kinds  # noqa: E402  (found by the line above)
import scenes  # noqa: E402
import viewport_scenes  # noqa: E402

CELLS = 10  # quads along a side of each object's grid
PICTURE = (96, 54)
COLUMNS = ("sync_ms", "commit_ms", "whole_ms", "cycles_ms")


def nothing(_step):
    """The same again."""


def frame(_step):
    """On the next frame one object is elsewhere."""
    bpy.context.scene.frame_set(bpy.context.scene.frame_current + 1)


def blurred_frame(step):
    """The same with motion blur, which stays on."""
    render = bpy.context.scene.render
    if not render.use_motion_blur:  # being set names the scene
        render.use_motion_blur = True
    frame(step)


EDITS = (nothing, frame, *edit_kinds.ALL, blurred_frame)


class Clock:
    """Milliseconds of the steps that Volley names, while it is open."""

    def __init__(self):
        from volley import session
        self._job, self._timed = session.job, session.job.timed
        self.spent = {}
        self._job.timed = self._note

    @contextlib.contextmanager
    def _note(self, kind):
        start = time.perf_counter()
        with self._timed(kind):
            yield
        self.spent[kind] = self.spent.get(kind, 0.0) + 1e3 * (time.perf_counter() - start)

    def close(self):
        self._job.timed = self._timed


def fill(count):
    """The field, of which one object moves in time."""
    scene = scenes.empty(size=PICTURE, samples=1)
    viewport_scenes.fill_field(CELLS, count)
    scene.render.use_persistent_data = True
    moving = bpy.data.objects["Object7"]
    scene.frame_end = 10000
    for number, height in ((1, 0.0), (scene.frame_end, 100.0)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=number)


def render_ms():
    """Milliseconds of a final render."""
    start = time.perf_counter()
    bpy.ops.render.render()
    return 1e3 * (time.perf_counter() - start)


def measure(edit, repeats, clock):
    """The median times of several edits of a kind."""
    rows = []
    for step in range(repeats):
        edit(step)
        clock.spent.clear()
        whole = render_ms()
        rows.append({"sync_ms": clock.spent.get("sync", 0.0), "commit_ms": clock.spent.get("build", 0.0),
                     "whole_ms": whole})
    return {key: statistics.median(row[key] for row in rows) for key in rows[0]}


def by_engine(count, engine, repeats):
    """{edit: times} of the field by an engine, the first render apart."""
    fill(count)
    scenes.set_engine(engine, 1)
    bpy.context.scene.render.use_persistent_data = True
    clock = Clock()
    render_ms()
    found = {edit.__name__: measure(edit, repeats, clock) for edit in EDITS}
    clock.close()
    return found


def run(count, repeats):
    """The rows of a field of so many objects."""
    ours, theirs = (by_engine(count, engine, repeats) for engine in ('VOLLEY', 'CYCLES'))
    rows = [{"objects": count, "edit": name, **times, "cycles_ms": theirs[name]["whole_ms"]}
            for name, times in ours.items()]
    for row in rows:
        print(f"{row['objects']:6} {row['edit']:15}" + "".join(f"{row[key]:10.2f}" for key in COLUMNS), flush=True)
    return rows


def main():
    parser = argparse.ArgumentParser(prog="final_edits.py")
    parser.add_argument("--objects", type=int, nargs="+", default=(1000, 10000), help="of each field")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", help="write the rows there, one object per line")
    arguments = parser.parse_args(sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else [])
    print(f"{'edit, ms':22}" + "".join(f"{key[:-3]:>10}" for key in COLUMNS))
    rows = [row for count in arguments.objects for row in run(count, arguments.repeats)]
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            file.writelines(json.dumps(row) + "\n" for row in rows)


main()
