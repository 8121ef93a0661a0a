# SPDX-License-Identifier: Apache-2.0
"""What an edit costs in the viewport, without drawing: what was sent and rebuilt, and how long it took.

    BLENDER_USER_SCRIPTS=$PWD/build/blender blender -b --factory-startup --addons volley \\
        --python tests/bench/viewport.py -- [--large] [--repeats N] [--json FILE]

First a table of edits of a scene of 1,000 objects, each of a mesh of its own, of 200,000 triangles
(2 million with --large). Then a pose of a skinned character of 60,000 triangles under an area light, over
a reflecting floor, and of one of 200,000. Times are medians in milliseconds, beyond Blender's own
evaluation (but for normals, which it takes when they are asked for): sync is Python and the copies it
makes; commit builds trees and tables, trees is the part of it for BLASes and the TLAS; first is the first
complete picture, one sample per pixel and 1 / divisor of 960x540 as the viewport chooses it; full is the
same with all pixels.
"""

import argparse
import json
import pathlib
import statistics
import sys
import time
from collections import Counter

import bpy

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "support"), str(HERE)]
import edit_kinds  # noqa: E402  (found by the line above)
import scenes  # noqa: E402
import viewport_scenes  # noqa: E402

SMALL_CELLS, LARGE_CELLS = 10, 32  # quads along a side of each object's grid
FINE_RINGS = 1000  # of the character with 100,100 vertices
PICTURE = (960, 540)


def view(_step):
    """The view's own camera moves: nothing of the scene does."""


EDITS = (*edit_kinds.ALL, view)


# Measuring -------------------------------------------------------------------------------------

class Follower:
    """Does what a viewport does, one step after the other, and keeps the times."""

    def __init__(self):
        from volley.sync import SceneSync
        from volley.sync.changes import Changes
        self._changes = Changes.everything()
        self._sync = SceneSync(is_final=False, thread_count=0, will_resync=True)
        self._calls = Counter()
        self._edit = self._sync.scene._edit
        self._sync.scene._edit = self._count
        self._camera_offset = 0.0
        self._full_seconds = 0.0  # of the last full picture
        bpy.app.handlers.depsgraph_update_post.append(self._mark)

    def _count(self, name, *arguments):
        self._calls[name.replace("trc_", "")] += 1
        self._edit(name, *arguments)

    def _mark(self, _scene, depsgraph):
        from volley.sync.changes import Changes
        self._changes.follow(depsgraph)

    def close(self):
        bpy.app.handlers.depsgraph_update_post.remove(self._mark)
        self._sync.destroy()

    def follow(self, moves_view=False):
        """Sync, commit and render a first picture: a row of the table."""
        from volley import native, viewport
        from volley.sync import Source
        from volley.sync.changes import Changes
        depsgraph = bpy.context.evaluated_depsgraph_get()
        self._calls.clear()
        changes, self._changes = self._changes, Changes()
        start = time.perf_counter()
        if changes.any():
            self._sync.update(Source(depsgraph, changes))
        self._look(depsgraph, moves_view)
        synced = time.perf_counter()
        self._sync.scene.commit()
        committed = time.perf_counter()
        divisor = viewport.first_divisor(self._full_seconds)
        self._render(depsgraph.scene_eval, divisor)
        shown = time.perf_counter()
        progress = self._render(depsgraph.scene_eval)
        full_ms = 1e3 * (time.perf_counter() - shown)
        self._full_seconds = progress.seconds
        stats = self._sync.scene.stats()
        return {"sent": dict(self._calls), "built": stats.built_count, "refitted": stats.refitted_count,
                "sync_ms": 1e3 * (synced - start), "commit_ms": 1e3 * (committed - synced),
                "tree_ms": 1e3 * stats.build_seconds, "first_ms": 1e3 * (shown - committed),
                "divisor": divisor, "picture_ms": full_ms, "rays": native.ray_count(progress)}

    def _look(self, depsgraph, moves_view):
        from volley.sync import camera
        from volley.sync.matrix import rows12
        scene = depsgraph.scene_eval
        is_first = self._sync.scene.revision and not self._camera_offset
        if not (moves_view or is_first):
            return
        self._camera_offset += 0.01
        lens = camera.lens_of(scene.camera, self._sync.warnings)
        transform = rows12(scene.camera.matrix_world)
        transform[3] += self._camera_offset
        window = camera.window(lens, camera.frame_of(scene.render))
        self._sync.set_camera(camera.CameraKeys(lens, [transform], [window]))

    def _render(self, scene, divisor=1):
        """A picture of 1 / divisor the size; what its render took."""
        from volley import abi, passes, viewport
        from volley.session import render_fields
        from volley.sync import camera
        fields = render_fields(scene, camera.frame_of(scene.render), (0, 0) + PICTURE,
                               [passes.COMBINED], is_preview=True)
        fields.update(sample_count=1, progressive=1, sampler=abi.SamplerType['BLUE_NOISE'])
        render = self._sync.scene.start_render(**viewport.divided(fields, divisor))
        render.wait(-1.0)
        passes.read_combined(render)
        progress = render.poll()
        render.destroy()
        return progress


def measure(follower, edit, repeats):
    """The median row of several edits of a kind."""
    rows = []
    for step in range(repeats):
        edit(step)
        bpy.context.view_layer.update()
        rows.append(follower.follow(moves_view=edit is view))
    row = {key: statistics.median(each[key] for each in rows) for key in rows[0] if key != "sent"}
    return {"edit": edit.__name__, "sent": rows[-1]["sent"], **row}


COLUMNS = (("sync", "sync_ms"), ("commit", "commit_ms"), ("trees", "tree_ms"), ("first", "first_ms"),
           ("full", "picture_ms"), ("divisor", "divisor"), ("built", "built"), ("refit", "refitted"))


def report(row):
    sent = ", ".join(f"{name} {count}" for name, count in sorted(row["sent"].items())) or "nothing"
    numbers = [f"{row[key]:8.2f}" if key.endswith("_ms") else f"{row[key]:8.0f}" for _, key in COLUMNS]
    print(f"{row['edit']:15}{''.join(numbers)}  {sent[:80]}")


def report_pose(row, fine_row, vertex_count):
    """What poses of the character and of the finer one take, in the terms of what is wanted of them."""
    prepared = row["sync_ms"] + row["commit_ms"]
    first, full = prepared + row["first_ms"], prepared + row["picture_ms"]
    print(f"character at {PICTURE[0]}x{PICTURE[1]}: pose to first picture {first:.1f} ms (1/{row['divisor']:.0f}"
          f" size, {1e3 / first:.0f} a second), to a full one {full:.1f} ms; sync {row['sync_ms']:.2f} ms, "
          f"of {vertex_count:,} moved vertices {fine_row['sync_ms']:.2f} ms; refit and TLAS "
          f"{row['tree_ms']:.2f} ms; {row['rays'] / row['picture_ms'] * 1e-3:.1f} Mrays/s")


def parse_arguments():
    parser = argparse.ArgumentParser(prog="viewport.py")
    parser.add_argument("--large", action="store_true", help="2 million triangles")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", help="write the rows there, one object per line")
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else [])


def run(scene_name, edits, repeats):
    """The rows of a scene, with its first sync in front."""
    bpy.context.view_layer.update()
    follower = Follower()
    rows = [{"edit": "first sync", **follower.follow()}]
    report(rows[0])
    for edit in edits:
        rows.append(measure(follower, edit, repeats))
        report(rows[-1])
    follower.close()
    return [{"scene": scene_name, **row} for row in rows]


def main():
    arguments = parse_arguments()
    print(f"{'edit, ms':15}{''.join(f'{title:>8}' for title, _ in COLUMNS)}  sent")
    scenes.empty(size=PICTURE)
    viewport_scenes.fill_field(LARGE_CELLS if arguments.large else SMALL_CELLS)
    rows = run("field", EDITS, arguments.repeats)
    scenes.empty(size=PICTURE)
    viewport_scenes.fill_character()
    posed = run("character", (viewport_scenes.pose, edit_kinds.light, view), arguments.repeats)
    scenes.empty(size=PICTURE)
    viewport_scenes.fill_character(FINE_RINGS)
    fine = run("fine character", (viewport_scenes.pose,), arguments.repeats)
    report_pose(posed[1], fine[1], len(bpy.data.objects["Character"].data.vertices))
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            file.writelines(json.dumps(row) + "\n" for row in rows + posed + fine)


main()
