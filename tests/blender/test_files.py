# SPDX-License-Identifier: Apache-2.0
"""Whole files beside Cycles, as they lie on the disk: one linked from a library, one with a movie on a wall, one lit
through a pattern and by an IES file. Other files, and windows: tests/beside_cycles.py."""

import blender as blender_support
import compare
import numpy as np
import pytest

SIZE, SAMPLES = 64, 256
MEAN_OFF, TILE_OFF = 0.01, 0.01  # beyond noise, of the mean

IES = """IESNA:LM-63-1995
TILT=NONE
1 1000 1 5 1 1 2 0 0 0
1 1 100
0 20 45 70 90
0
900 1500 700 200 0
"""


# The files, written inside Blender -----------------------------------------------------------------

def _library(folder):
    """A room whose objects, materials, light and world are linked from another file, some of them as an
    instanced collection and as an override."""
    import os
    import bpy
    import scenes
    scenes.empty()
    red = scenes.material("Red", "ShaderNodeBsdfPrincipled", Base_Color=(0.8, 0.1, 0.05), Roughness=0.3)
    tree = red.node_tree
    checker = tree.nodes.new("ShaderNodeTexChecker")
    tree.links.new(checker.outputs[0], scenes.shader_of(red).inputs["Base Color"])
    group = bpy.data.collections.new("Group")
    for made in (scenes.sphere("Ball", 0.6, material=red), scenes.light('POINT', (0.0, -2.0, 1.5), energy=60.0)):
        bpy.context.scene.collection.objects.unlink(made)
        group.objects.link(made)
    world = bpy.data.worlds.new("Sky")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.1, 0.2, 0.4, 1.0)
    path = os.path.join(folder, "assets.blend")
    bpy.data.libraries.write(path, {group, world, red})
    scene = scenes.empty()
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.collections, wanted.worlds, wanted.materials = ["Group"], ["Sky"], ["Red"]
    scene.world = wanted.worlds[0]
    scenes.camera()
    scenes.wall("Floor", 9.0, 2.0, material=wanted.materials[0])
    for x in (-1.2, 1.2):
        made = scenes.link(f"Instance {x}", None)
        made.instance_type, made.instance_collection = 'COLLECTION', wanted.collections[0]
        made.location.x = x
    scene.collection.children.link(wanted.collections[0])
    own = wanted.collections[0].override_hierarchy_create(scene, bpy.context.view_layer)
    own.objects["Ball"].location = (0.0, -0.5, 0.9)
    own.objects["Light"].location.x = 0.4  # of two in one place, rays of Cycles 3.4 find one


def _movie(folder):
    """A wall that shows the third of four frames of a movie, by the light of a lamp."""
    import os
    import bpy
    import scenes
    scene = scenes.empty(size=(32, 32), samples=1)
    scenes.camera()
    for number in range(3):
        scenes.wall(f"Stripe {number}", 1.2, 0.0, (1.2 * number - 1.2, 0.0),
                    scenes.emitter([float(number == k) for k in range(3)], f"Stripe {number}"))
        scene.objects[f"Stripe {number}"].rotation_euler.y = 0.3 * number
        scene.objects[f"Stripe {number}"].keyframe_insert("rotation_euler", frame=1)
        scene.objects[f"Stripe {number}"].rotation_euler.y = 1.0 - number
        scene.objects[f"Stripe {number}"].keyframe_insert("rotation_euler", frame=4)
    scene.frame_end = 4
    scenes.set_file_format(scene.render.image_settings, 'FFMPEG')
    scene.render.ffmpeg.format, scene.render.ffmpeg.codec = 'MPEG4', 'H264'
    scene.view_settings.view_transform = 'Standard'
    scene.render.filepath = os.path.join(folder, "movie")
    bpy.ops.render.render(animation=True)
    path = scene.render.frame_path(frame=1)
    scene = scenes.empty()
    scenes.camera()
    matt = scenes.material("Screen", "ShaderNodeBsdfDiffuse")
    node = matt.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.load(path)
    node.image_user.frame_duration, node.image_user.use_auto_refresh = 4, True
    matt.node_tree.links.new(node.outputs[0], scenes.shader_of(matt).inputs["Color"])
    scenes.wall("Screen", 4.0, 0.0, material=matt)
    scenes.light('AREA', location=(0.0, -4.0, 3.0), rotation=(0.8, 0.0, 0.0), energy=300.0, size=1.0)
    scene.frame_set(3)


def _pattern(folder):
    """A wall lit by a spot through an image, and by a point light of an IES file."""
    import os
    import bpy
    import scenes
    scenes.empty()
    scenes.camera()
    matt = scenes.material("Matt", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.8, 0.8))
    scenes.wall("Wall", 9.0, 1.0, material=matt)
    scenes.sphere("Ball", 0.5, (0.0, -0.5, 0.0), matt)
    image = bpy.data.images.new("Pattern", 32, 32)
    y, x = np.mgrid[0:32, 0:32]
    bright = ((x // 4 + y // 4) % 2).astype(np.float32)
    image.pixels.foreach_set(np.stack([bright, 0.5 * bright, 1.0 - bright, bright * 0 + 1], axis=-1).ravel())
    image.pack()
    path = os.path.join(folder, "lamp.ies")
    with open(path, "w", encoding="utf-8") as file:
        file.write(IES)
    for kind, node_type, place, turn in (('SPOT', "ShaderNodeTexImage", (-2.0, -4.0, 1.0), (1.4, 0.0, -0.35)),
                                         ('POINT', "ShaderNodeTexIES", (1.4, -0.4, 1.2), (0.0, 0.0, 0.0))):
        lamp = scenes.light(kind, place, turn, energy=300.0 if kind == 'SPOT' else 0.4, shadow_soft_size=0.05)
        lamp.data.use_nodes = True
        tree = lamp.data.node_tree
        emission = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
        node = tree.nodes.new(node_type)
        if kind == 'SPOT':
            node.image = image
            coordinates, split = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
            split.inputs["Scale"].default_value = (2.0, 2.0, 2.0)
            tree.links.new(coordinates.outputs["Normal"], split.inputs["Vector"])
            tree.links.new(split.outputs["Vector"], node.inputs["Vector"])
            tree.links.new(node.outputs["Color"], emission.inputs["Color"])
        else:
            node.mode, node.filepath = 'EXTERNAL', path
            tree.links.new(node.outputs[0], emission.inputs["Strength"])


FILES = {"library": _library, "movie": _movie, "pattern": _pattern}


def write(name, folder):
    """The path of a file."""
    import os
    import bpy
    FILES[name](folder)
    path = os.path.join(folder, f"{name}.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    return path


# Tests ---------------------------------------------------------------------------------------------

def inside_background(name, folder):
    import whole_files
    return whole_files.in_background(write(name, folder), SIZE, SAMPLES)


def _check(found):
    (ours, theirs), told = found
    ours, theirs = ours[..., :3], theirs[..., :3]
    assert told == []
    assert theirs.mean() > 0.02 and theirs.std() > 0.02
    mean, tile = compare.unexplained(ours, theirs)
    assert mean < MEAN_OFF * theirs.mean()
    assert tile < TILE_OFF * theirs.mean()


@pytest.mark.parametrize("name", FILES)
def test_in_the_background(blender, name, tmp_path):
    _check(blender.run(inside_background, name, str(tmp_path)))


def inside_failed_view(name, folder):
    """As a file in a window, of whose view drawing fails."""
    import whole_files
    from volley import viewport

    def draw(*_arguments):
        raise RuntimeError("spoiled on purpose")

    yield 0.1
    viewport.Viewport.draw = draw
    return (yield from whole_files.in_window(write(name, folder), SIZE, 1))


def test_a_failed_view_is_no_picture(window, tmp_path):
    with pytest.raises(blender_support.BlenderError, match="the view failed: .*spoiled on purpose"):
        window.run_in_window(inside_failed_view, "pattern", str(tmp_path))
