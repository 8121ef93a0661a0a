# SPDX-License-Identifier: Apache-2.0
"""What an edit costs in the viewport, without drawing: what was sent and rebuilt, and how long it took.

    BLENDER_USER_SCRIPTS=$PWD/build/blender blender -b --factory-startup --addons volley \\
        --python tests/bench/viewport.py -- [--large] [--repeats N] [--json FILE]

First a table of edits of a scene of 1,000 objects, each of a mesh of its own, of 200,000 triangles
(2 million with --large). Then how long a pose of a skinned character of 60,000 triangles under an area
light, over a reflecting floor, takes to its first complete picture of one sample per pixel at 960x540.
Times are medians in milliseconds, beyond Blender's own evaluation: sync is Python and the copies it
makes, commit builds trees and tables, picture renders.
"""

import argparse
import json
import math
import pathlib
import statistics
import sys
import time
from collections import Counter

import bpy
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import scenes  # noqa: E402  (found by the line above)

SIDE = 32                # objects in a row
OBJECT_COUNT = 1000
SMALL_CELLS, LARGE_CELLS = 10, 32  # quads along a side of each object's grid
PICTURE = (960, 540)
CHARACTER_RINGS, CHARACTER_SIDES, CHARACTER_BONES = 300, 100, 10


# Scenes ----------------------------------------------------------------------------------------

def grid(name, cells, material):
    """A bumpy square of cells * cells quads."""
    line = np.linspace(-0.4, 0.4, cells + 1)
    x, y = np.meshgrid(line, line)
    z = 0.05 * np.sin(20.0 * x) * np.cos(20.0 * y)
    corner = np.arange(cells * (cells + 1)).reshape(cells, cells + 1)[:, :-1].ravel()
    faces = np.stack([corner, corner + 1, corner + cells + 2, corner + cells + 1], axis=1)
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    return scenes.mesh(name, points.tolist(), faces.tolist(), material, smooth=True)


def make_field(cells):
    """OBJECT_COUNT objects; the first is posed by a bone."""
    scene = scenes.empty(size=PICTURE)
    scene.world.use_nodes = True
    materials = [scenes.material(f"Material{i}", "ShaderNodeBsdfDiffuse") for i in range(10)]
    for i in range(OBJECT_COUNT):
        made = grid(f"Object{i}", cells, materials[i % len(materials)])
        made.location = (i % SIDE - SIDE / 2, i // SIDE - SIDE / 2, 0.0)
    add_rig(bpy.data.objects["Object0"], 1, 1.0)
    scenes.light('AREA', (0.0, 0.0, 20.0), (0.0, 0.0, 0.0), energy=2000.0, size=4.0)
    scenes.camera((0.0, -28.0, 20.0), (math.radians(55), 0.0, 0.0))
    return scene


def add_rig(skinned, bone_count, height):
    """A chain of bones along Z that moves an object; vertices follow the bone beside them."""
    rig = scenes.link("Rig", bpy.data.armatures.new("Rig"))
    rig.location = skinned.location
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode='EDIT')
    parent, length = None, height / bone_count
    for i in range(bone_count):
        bone = rig.data.edit_bones.new(f"Bone{i}")
        bone.head, bone.tail, bone.parent = (0, 0, i * length), (0, 0, (i + 1) * length), parent
        parent = bone
    bpy.ops.object.mode_set(mode='OBJECT')
    skinned.modifiers.new("Rig", 'ARMATURE').object = rig
    groups = [skinned.vertex_groups.new(name=f"Bone{i}") for i in range(bone_count)]
    heights = np.array([vertex.co.z for vertex in skinned.data.vertices])
    owners = (heights / length).astype(int).clip(0, bone_count - 1)
    for i, group in enumerate(groups):
        group.add(np.flatnonzero(owners == i).tolist(), 1.0, 'REPLACE')


def make_character():
    """A skinned column of 60,000 triangles under an area light, over a reflecting floor."""
    scene = scenes.empty(size=PICTURE)
    turn = np.linspace(0.0, 2.0 * math.pi, CHARACTER_SIDES, endpoint=False)
    z = np.linspace(0.0, 3.0, CHARACTER_RINGS + 1)[:, None]
    radius = 0.5 + 0.1 * np.sin(5.0 * z)
    points = np.stack(np.broadcast_arrays(radius * np.cos(turn), radius * np.sin(turn), z), axis=-1)
    faces = [(r * CHARACTER_SIDES + s, r * CHARACTER_SIDES + (s + 1) % CHARACTER_SIDES,
              (r + 1) * CHARACTER_SIDES + (s + 1) % CHARACTER_SIDES, (r + 1) * CHARACTER_SIDES + s)
             for r in range(CHARACTER_RINGS) for s in range(CHARACTER_SIDES)]
    skin = scenes.material("Skin", "ShaderNodeBsdfDiffuse", Color=(0.7, 0.4, 0.3))
    character = scenes.mesh("Character", points.reshape(-1, 3).tolist(), faces, skin, smooth=True)
    add_rig(character, CHARACTER_BONES, 3.0)
    floor = scenes.material("Floor", "ShaderNodeBsdfPrincipled", Roughness=0.15)
    scenes.mesh("Floor", [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [(0, 1, 2, 3)], floor)
    scenes.light('AREA', (2.0, -3.0, 5.0), (0.5, 0.3, 0.0), energy=500.0, size=1.5)
    scenes.camera((0.0, -7.0, 2.5), (math.radians(80), 0.0, 0.0))
    return scene


# Edits -----------------------------------------------------------------------------------------

def pose(step):
    bone = bpy.data.objects["Rig"].pose.bones[-1]
    bone.rotation_mode = 'XYZ'
    bone.rotation_euler.x = 0.3 * math.sin(step + 1.0)


def transform(step):
    bpy.data.objects["Object500"].location.z = 0.1 * (step + 1)


def material(step):
    tree = bpy.data.materials["Material1"].node_tree
    tree.nodes["Diffuse BSDF"].inputs["Color"].default_value = (0.1 * (step % 9), 0.5, 0.5, 1.0)


def node_link(_step):
    tree = bpy.data.materials["Material1"].node_tree
    color = tree.nodes["Diffuse BSDF"].inputs["Color"]
    if color.is_linked:
        tree.links.remove(color.links[0])
        return
    value = tree.nodes.get("RGB") or tree.nodes.new("ShaderNodeRGB")
    tree.links.new(value.outputs[0], color)


def light(step):
    bpy.data.objects["Light"].data.energy = 1000.0 + step


def world(step):
    tree = bpy.context.scene.world.node_tree
    tree.nodes["Background"].inputs["Strength"].default_value = 0.1 * (step + 1)


def ray_visibility(step):
    bpy.data.objects["Object500"].visible_shadow = bool(step % 2)


def mesh_edit(step):
    data = bpy.data.objects["Object500"].data
    data.vertices[0].co.z = 0.1 * (step + 1)
    data.update()


def duplicate(step):
    copy = scenes.link("Copy", bpy.data.objects["Object500"].data)
    copy.location.z = 1.0 + step


def delete(_step):
    bpy.data.objects.remove(next(o for o in bpy.data.objects if o.name.startswith("Copy")))


def hide(_step):
    each = bpy.data.objects["Object500"]
    each.hide_viewport = not each.hide_viewport


def settings(step):
    bpy.context.scene.volley.film_exposure = 1.0 + 0.1 * (step + 1)


def view(_step):
    """The view's own camera moves: nothing of the scene does."""


EDITS = (pose, transform, material, node_link, light, world, ray_visibility, mesh_edit, duplicate,
         delete, hide, settings, view)


# Measuring -------------------------------------------------------------------------------------

class Follower:
    """Does what a viewport does, one step after the other, and keeps the times."""

    def __init__(self):
        from volley import native
        from volley.sync import SceneSync
        from volley.sync.changes import Changes
        self._changes = Changes.everything()
        self._sync = SceneSync(is_final=False, thread_count=0, will_resync=True)
        self._calls = Counter()
        self._edit = self._sync.scene._edit
        self._sync.scene._edit = self._count
        self._camera_offset = 0.0
        bpy.app.handlers.depsgraph_update_post.append(self._mark)

    def _count(self, name, *arguments):
        self._calls[name.replace("trc_", "")] += 1
        self._edit(name, *arguments)

    def _mark(self, _scene, depsgraph):
        from volley.sync.changes import Changes
        self._changes.merge(Changes.of_depsgraph(depsgraph))

    def close(self):
        bpy.app.handlers.depsgraph_update_post.remove(self._mark)
        self._sync.destroy()

    def follow(self, moves_view=False):
        """Sync, commit and render a first picture: a row of the table."""
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
        rays = self._render(depsgraph.scene_eval)
        rendered = time.perf_counter()
        stats = self._sync.scene.stats()
        return {"sent": dict(self._calls), "built": stats.built_count, "refitted": stats.refitted_count,
                "sync_ms": 1e3 * (synced - start), "commit_ms": 1e3 * (committed - synced),
                "tree_ms": 1e3 * stats.build_seconds, "picture_ms": 1e3 * (rendered - committed),
                "rays": rays}

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

    def _render(self, scene):
        from volley import native, passes
        from volley.session import render_fields
        from volley.sync import camera
        fields = render_fields(scene, camera.frame_of(scene.render), (0, 0) + PICTURE,
                               [passes.COMBINED], is_preview=True)
        fields.update(sample_count=1, progressive=1, sampler=native.SAMPLERS['BLUE_NOISE'])
        render = self._sync.scene.start_render(**fields)
        render.wait(-1.0)
        passes.read_combined(render)
        rays = render.poll().ray_count
        render.destroy()
        return rays


def measure(follower, edit, repeats):
    """The median row of several edits of a kind."""
    rows = []
    for step in range(repeats):
        edit(step)
        bpy.context.view_layer.update()
        rows.append(follower.follow(moves_view=edit is view))
    row = {key: statistics.median(each[key] for each in rows) for key in rows[0] if key != "sent"}
    return {"edit": edit.__name__, "sent": rows[-1]["sent"], **row}


def report(row):
    sent = ", ".join(f"{name} {count}" for name, count in sorted(row["sent"].items())) or "nothing"
    print(f"{row['edit']:15} {row['sync_ms']:9.2f} {row['commit_ms']:9.2f} {row['tree_ms']:9.2f} "
          f"{row['picture_ms']:10.2f} {row['built']:6.0f} {row['refitted']:6.0f}  {sent[:80]}")


def parse_arguments():
    parser = argparse.ArgumentParser(prog="viewport.py")
    parser.add_argument("--large", action="store_true", help="2 million triangles")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", help="write the rows there, one object per line")
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else [])


def main():
    arguments = parse_arguments()
    print(f"{'edit':15} {'sync ms':>9} {'commit ms':>9} {'trees ms':>9} {'picture ms':>10} "
          f"{'built':>6} {'refit':>6}  sent")
    rows = []
    for make, edits in ((lambda: make_field(LARGE_CELLS if arguments.large else SMALL_CELLS), EDITS),
                        (make_character, (pose, light, view))):
        make()
        bpy.context.view_layer.update()
        follower = Follower()
        rows.append({"edit": "first sync", **follower.follow()})
        report(rows[-1])
        for edit in edits:
            rows.append(measure(follower, edit, arguments.repeats))
            report(rows[-1])
        follower.close()
    posed = rows[-3]
    total = posed["sync_ms"] + posed["commit_ms"] + posed["picture_ms"]
    rate = posed["rays"] / posed["picture_ms"] * 1e-3
    print(f"character: pose to first picture {total:.1f} ms at {PICTURE[0]}x{PICTURE[1]}, "
          f"{rate:.1f} Mrays/s")
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            file.writelines(json.dumps(row) + "\n" for row in rows)


main()
