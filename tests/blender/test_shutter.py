# SPDX-License-Identifier: Apache-2.0
"""What counts of a frame whose shutter opens or closes at it, beside Cycles: objects and the settings of lights are
those about the middle of the shutter, materials, the world and the nodes of lights those of the frame."""

import compare
import pytest

TOLERANCE = 0.005  # of the mean
TEXT_OFF = 2e-3  # of pictures about as bright as 1; without the blur .12 in a tile
FRAMES = 2, 3, 4


def _by_image(material, folder):
    """Have a material's colour from a sequence of images, a brighter one for each frame."""
    import os

    import bpy
    for frame in range(1, FRAMES[-1] + 1):
        image = bpy.data.images.new("Even", 4, 4, float_buffer=True)
        image.pixels = [0.2 * frame, 0.1, 0.3, 1.0] * 16
        image.filepath_raw, image.file_format = os.path.join(folder, f"even{frame:04d}.exr"), 'OPEN_EXR'
        image.save()
        bpy.data.images.remove(image)
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.load(os.path.join(folder, "even0001.exr"))
    node.image.source = 'SEQUENCE'
    node.image_user.frame_duration, node.image_user.use_auto_refresh = FRAMES[-1], True
    shader = material.node_tree.nodes["Emission"]
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Color"])


def inside_changing(position, is_kept, folder):
    """Frames of walls that brighten as one moves, before a world and with lamps that do so too, by both engines.
    is_kept: with Persistent Data."""
    import bpy
    import scenes
    scene = scenes.empty(size=(48, 32))
    scenes.camera()
    shining, shown, cut = (scenes.emitter((1.0, 0.2, 0.1), name) for name in ("Shining", "Shown", "Cut"))
    _by_image(shown, folder)
    wall = scenes.wall(material=shining)
    scenes.wall("Screen", 1.0, -0.5, center=(-2.0, 0.8), material=shown)
    clear = cut.node_tree.nodes.new("ShaderNodeBsdfTransparent")
    mix = cut.node_tree.nodes.new("ShaderNodeMixShader")
    cut.node_tree.links.new(scenes.shader_of(cut).outputs[0], mix.inputs[1])
    cut.node_tree.links.new(clear.outputs[0], mix.inputs[2])
    cut.node_tree.links.new(mix.outputs[0], cut.node_tree.nodes["Material Output"].inputs["Surface"])
    scenes.wall("Hole", 1.0, -0.5, center=(-2.0, -0.8), material=cut).is_holdout = True
    lamp, noded = scenes.light('POINT', (0.0, -2.0, 2.5)), scenes.light('POINT', (2.0, -2.0, -2.5), energy=100.0)
    noded.data.use_nodes = True
    grey = scenes.material("Grey", "ShaderNodeBsdfDiffuse")
    scenes.sphere("Ball", 0.7, (0.0, -1.0, 0.7), grey)
    scenes.sphere("Ball", 0.7, (1.0, -1.0, -0.7), grey)
    scenes.light_world((0.1, 0.2, 0.3))
    strengths = [scenes.shader_of(shining), noded.data.node_tree.nodes["Emission"],
                 next(node for node in scene.world.node_tree.nodes if node.type == 'BACKGROUND')]
    for frame, value in zip((1, *FRAMES), (0.0, 1.0, 2.5, 3.0)):
        wall.location.x = value
        wall.keyframe_insert("location", frame=frame)
        lamp.data.energy = 100.0 * value
        lamp.data.keyframe_insert("energy", frame=frame)
        mix.inputs[0].default_value = 0.3 * value
        mix.inputs[0].keyframe_insert("default_value", frame=frame)
        for owner in strengths:
            owner.inputs["Strength"].default_value = value
            owner.inputs["Strength"].keyframe_insert("default_value", frame=frame)
    scene.render.use_persistent_data = is_kept
    scenes.set_shutter(scene, position, 1.0)
    sides = []
    for engine in ('VOLLEY', 'CYCLES'):
        sides.append([])
        for frame in FRAMES:
            scene.frame_set(frame)
            sides[-1].append(scenes.seeds_by(engine, 64 * len(scenes.SEEDS)))
    return list(zip(*sides))


@pytest.mark.parametrize("is_kept", (False, True), ids=("anew", "kept"))
@pytest.mark.parametrize("position", ('START', 'CENTER', 'END'))
def test_shaders_are_those_of_the_frame(blender, tmp_path, position, is_kept):
    """Those of the middle were off by up to .7 of the mean."""
    frames = blender.run(inside_changing, position, is_kept, str(tmp_path))
    for ours, theirs in frames:
        scale = theirs[..., :3].mean()
        beyond, tile = compare.unexplained(ours, theirs)
        assert beyond < TOLERANCE * scale and tile < 4.0 * TOLERANCE * scale


def inside_other_topology():
    """A wall that a shape key moves within the shutter, at whose end its array has one copy more, by both engines."""
    import scenes
    scene = scenes.empty(size=(48, 32))
    scenes.camera()
    wall = scenes.wall(material=scenes.emitter((1.0, 0.6, 0.2)))
    wall.shape_key_add(name="Basis")
    moved = wall.shape_key_add(name="Moved")
    for point in moved.data:
        point.co.x += 1.5
    array = wall.modifiers.new("Array", 'ARRAY')
    array.use_relative_offset, array.use_constant_offset = False, True
    array.constant_offset_displace = (0.0, 0.0, -20.0)
    for frame, value in ((1, 0.0), (3, 1.0)):
        moved.value = value
        moved.keyframe_insert("value", frame=frame)
    for frame, count in ((1, 1), (2.4, 2)):
        array.count = count
        array.keyframe_insert("count", frame=frame)
    for owner, interpolation in ((wall.data.shape_keys, 'LINEAR'), (wall, 'CONSTANT')):
        for curve in scenes.curves(owner):
            for point in curve.keyframe_points:
                point.interpolation = interpolation
    scene.frame_set(2)
    scenes.set_shutter(scene, 'CENTER', 1.0)
    return scenes.seeds_by_both(64)


def test_shapes_of_another_topology_stand_still(blender):
    ours, theirs = blender.run(inside_other_topology)
    mean = theirs[..., :3].mean()
    assert all(error < TOLERANCE * mean for error in compare.unexplained(ours[..., :3], theirs[..., :3]))


def inside_blurred_text():
    """Text that leans over, and whether Blender fills it with other faces at other times."""
    import bpy
    import scenes
    scene = scenes.empty(size=(72, 48))
    scenes.camera()
    scenes.light_world((0.3, 0.35, 0.4))
    scenes.light('SUN', rotation=(0.6, 0.3, 0.0), energy=3.0)
    text = bpy.data.curves.new("Text", 'FONT')
    text.body, text.size, text.extrude, text.bevel_depth = "Ab", 3.0, 0.1, 0.02
    text.materials.append(scenes.material("Matt", "ShaderNodeBsdfDiffuse"))
    shown = scenes.link("Text", text)
    shown.location, shown.rotation_euler = (-1.8, 0.0, -1.0), (1.3, 0.0, 0.2)
    corners = []
    for frame, shear in ((0, -0.8), (4, 0.8)):
        text.shear = shear
        text.keyframe_insert("shear", frame=frame)
        bpy.context.view_layer.update()
        made = shown.to_mesh()
        corners.append([loop.vertex_index for loop in made.loops])
        shown.to_mesh_clear()
    scene.frame_set(2)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    return scenes.seeds_by_both(128), corners[0] != corners[1] or bpy.app.version < (5, 0)


def test_blurred_text(blender):
    """In Blender 5 it was not blurred as soon as its faces were others."""
    (ours, theirs), has_other_faces = blender.run(inside_blurred_text)
    assert has_other_faces
    assert max(compare.unexplained(ours, theirs)) <= TEXT_OFF
