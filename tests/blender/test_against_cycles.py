# SPDX-License-Identifier: Apache-2.0
"""The same scene by Cycles without diffuse bounces and by Volley: tiles of pixels where nothing is random but
the film, lens and time, channel means where light is sampled."""

import compare
import numpy as np
import pytest

FILM_SAMPLES = 64
LIGHT_SAMPLES = 128
MEAN_TOLERANCE = 0.01
# Beyond the noise that the seeds show; 6e-4 were seen, where few samples cross a rim and the noise is known badly.
OFF = 2e-3


def _both(samples):
    """The current scene by both engines."""
    import scenes
    return scenes.by_both(samples)


def _seeds(samples=FILM_SAMPLES):
    """The current scene by both engines, with several seeds."""
    import scenes
    return scenes.seeds_by_both(samples)


def _walls():
    import scenes
    scenes.wall("Red", 2.0, 0.0, (-1.0, 0.0), scenes.emitter((1.0, 0.1, 0.05), "Red"))
    scenes.wall("Green", 2.0, 2.0, (1.2, 0.5), scenes.emitter((0.1, 0.8, 0.2), "Green"))
    scenes.wall("Blue", 9.0, 5.0, (0.5, -0.6), scenes.emitter((0.05, 0.2, 0.9), "Blue"))


# Geometry and camera: plain colours, so that pixels agree -----------------------------------------

def inside_cameras():
    import scenes
    scene = scenes.empty(size=(72, 48))
    made = scenes.camera()
    _walls()
    pairs = {}

    def look(name, **settings):
        for key, value in settings.items():
            setattr(made.data, key, value)
        pairs[name] = _seeds()

    look("perspective")
    look("shifted", shift_x=0.2, shift_y=-0.1, sensor_fit='VERTICAL', sensor_height=30.0)
    look("orthographic", type='ORTHO', ortho_scale=5.0, sensor_fit='AUTO')
    look("clipped", type='PERSP', shift_x=0.0, shift_y=0.0, clip_start=6.5, clip_end=10.0)
    made.data.clip_start, made.data.clip_end = 0.1, 100.0
    scene.render.pixel_aspect_x = 2.0
    scene.render.resolution_x, scene.render.resolution_y = 40, 72
    look("tall, wide pixels")
    return pairs


def inside_geometry():
    """Modifiers, text, curves, metaballs, instances, mirrored objects, hidden ones."""
    import bpy
    import scenes
    scenes.empty(size=(96, 64))
    scenes.camera(location=(0, -12, 0))
    red, green = scenes.emitter((1, 0.1, 0.05), "Red"), scenes.emitter((0.1, 0.8, 0.2), "Green")
    blue = scenes.emitter((0.05, 0.2, 0.9), "Blue")
    scenes.wall("Back", 14.0, 6.0, (0, 0), scenes.emitter((0.2, 0.2, 0.2), "Grey"))
    bpy.ops.mesh.primitive_monkey_add(location=(-3, 0, 1.5), size=1.6)
    monkey = bpy.context.object
    monkey.data.materials.append(red)
    monkey.data.materials.append(green)
    for polygon in monkey.data.polygons:
        polygon.material_index = polygon.index % 3 == 0
    monkey.modifiers.new("Subdivision", 'SUBSURF')
    monkey.scale = (-1, 1, 1)
    monkey.rotation_euler = (1.2, 0.3, 0.4)
    for operator, location in ((bpy.ops.object.text_add, (-1.5, 0, 1)),
                               (bpy.ops.object.metaball_add, (1, 0, 2)),
                               (bpy.ops.curve.primitive_bezier_circle_add, (3, 0, 1.5)),
                               (bpy.ops.surface.primitive_nurbs_surface_torus_add, (3, 0, -1.5))):
        operator(location=location)
        made = bpy.context.object
        made.rotation_euler = (1.5, 0, 0)
        made.data.materials.append(blue)
        if made.type == 'CURVE':
            made.data.bevel_depth = 0.3
    collection = bpy.data.collections.new("Group")
    source = scenes.wall("Source", 0.4, 0.0, (0, -1.5), red)
    collection.objects.link(source)
    for i in range(4):
        instancer = scenes.link(f"Instancer{i}", None)
        instancer.instance_type, instancer.instance_collection = 'COLLECTION', collection
        instancer.location = (-3.5 + i, 0, 0.3 * i)
        instancer.rotation_euler = (0, 0.3 * i, 0)
    scenes.wall("Hidden", 3.0, -2.0, material=green).hide_render = True
    scenes.wall("Unseen", 3.0, -2.0, material=green).visible_camera = False
    return _seeds()


def _close(ours, theirs, name, off=OFF):
    """Means of the picture and of its tiles are as far apart as noise explains, and that much more."""
    assert max(compare.unexplained(ours, theirs)) <= off, name


def test_cameras(blender):
    for name, (ours, theirs) in blender.run(inside_cameras).items():
        assert theirs[..., :3].max() > 0.5, name
        _close(ours, theirs, name)


def test_geometry(blender):
    _close(*blender.run(inside_geometry), "geometry")


# Flat objects: scaled to nothing along one axis -----------------------------------------------------

def inside_flat():
    """Solid objects and a square that are flat: in plain colours, by their normal, by coordinates, lit,
    with shadows; one that is flat in the middle of the shutter, and one that moves and is flat."""
    import bpy
    import scenes
    scene = scenes.empty(size=(96, 64))
    scenes.camera(location=(0.0, -9.0, 4.5), rotation=(1.2, 0.0, 0.0))
    pairs = {}

    def shown(output, node_type="ShaderNodeNewGeometry"):
        material = scenes.material(output, "ShaderNodeEmission")
        tree = material.node_tree
        absolute, known = (tree.nodes.new("ShaderNodeVectorMath") for _ in range(2))
        absolute.operation = 'ABSOLUTE'  # which of two sides in one place is met is anyone's guess
        known.operation = 'MULTIPLY'     # and so is a coordinate that was lost
        known.inputs[1].default_value = (1.0, 1.0, 1.0 if output == "Normal" else 0.0)
        tree.links.new(tree.nodes.new(node_type).outputs[output], absolute.inputs[0])
        tree.links.new(absolute.outputs[0], known.inputs[0])
        tree.links.new(known.outputs[0], tree.nodes["Emission"].inputs["Color"])
        return material

    def made(operator, x, scale, rotation, material):
        operator(location=(x, 0.0, 1.5), rotation=rotation)
        flat = bpy.context.object
        flat.scale = scale
        flat.data.materials.append(material)
        return flat

    add = bpy.ops.mesh
    normal, coordinates = shown("Normal"), shown("Object", "ShaderNodeTexCoord")
    made(add.primitive_monkey_add, -3.0, (1, 0, 1), (0.0, 0.0, 0.3), scenes.emitter((1.0, 0.3, 0.1)))
    made(add.primitive_cube_add, 0.0, (0.8, 0.8, 0), (1.2, 0.4, 0.3), normal)
    made(add.primitive_plane_add, 3.0, (1, 1, 0), (1.1, 0.2, -0.4), coordinates)
    pairs["colors"] = _seeds()
    lit = scenes.material("Lit", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.6, 0.4))
    for each in bpy.data.objects:
        if each.type == 'MESH':
            each.data.materials[0] = lit
    # Cycles has sides in one place shadow each other: only squares are lit as they should be.
    bpy.data.objects.remove(bpy.data.objects["Suzanne"])
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    made(add.primitive_plane_add, -2.0, (1.2, 0.7, 0), (0.9, -0.3, 0.5), lit)
    scenes.mesh("Floor", [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [(0, 1, 2, 3)], lit)
    scenes.light('SUN', rotation=(0.6, 0.3, 0.0), energy=3.0, angle=0.0)
    pairs["lit"] = _seeds()
    for each in list(bpy.data.objects):
        if each.type == 'MESH':
            bpy.data.objects.remove(each)
    pulsing = made(add.primitive_cube_add, -2.0, (1, 1, 1), (0.3, 0.2, 0.4), scenes.emitter((1.0, 0.3, 0.1)))
    sliding = made(add.primitive_plane_add, 2.0, (1, 1, 0), (1.1, 0.2, -0.4), coordinates)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 2.0
    pairs["motion"] = []
    for engine, least in (('VOLLEY', 0.0), ('CYCLES', 1e-3)):  # Cycles' rays have no direction in flat ones
        for frame, height, x in ((0, 1.0, 1.0), (1, least, 2.0), (2, 1.0, 3.0)):
            pulsing.scale.z, sliding.scale.z, sliding.location.x = height, least, x
            pulsing.keyframe_insert("scale", frame=frame)
            sliding.keyframe_insert("location", frame=frame)
        for moving in (pulsing, sliding):
            for curve in scenes.curves(moving):
                for key in curve.keyframe_points:
                    key.interpolation = 'LINEAR'
        scene.frame_set(1)
        pairs["motion"].append(scenes.seeds_by(engine, LIGHT_SAMPLES))
    return pairs


def test_flat_objects(blender):
    for name, (ours, theirs) in blender.run(inside_flat).items():
        assert (theirs[..., :3].max(axis=-1) > 0.1).mean() > 0.1, name
        _close(ours, theirs, name)


# Blur ----------------------------------------------------------------------------------------------

def inside_blur():
    import bpy
    import scenes
    scene = scenes.empty(size=(72, 48))
    made = scenes.camera()
    _walls()
    pairs = {}
    dof = made.data.dof
    dof.use_dof, dof.aperture_fstop, dof.focus_distance = True, 0.05, 6.0
    dof.aperture_blades, dof.aperture_ratio = 5, 1.5
    pairs["lens"] = _seeds(LIGHT_SAMPLES)
    dof.use_dof = False
    moving = bpy.data.objects["Red"]
    for frame, x in ((0, -2.0), (4, 6.0)):
        moving.location.x = x
        moving.rotation_euler.y = 0.3 * frame
        moving.keyframe_insert("location", frame=frame)
        moving.keyframe_insert("rotation_euler", frame=frame)
    for frame, z in ((0, 0.0), (4, 2.0)):
        made.location.z = z
        made.keyframe_insert("location", frame=frame)
    growing = bpy.data.objects["Green"]
    growing.shape_key_add(name="Basis")
    key = growing.shape_key_add(name="Wide")
    for point in key.data:
        point.co.x *= 2.0
    for frame, value in ((0, 0.0), (4, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    scene.frame_set(2)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 0.8
    pairs["motion"] = _seeds(LIGHT_SAMPLES)
    return pairs


def test_blur(blender):
    for kind, (ours, theirs) in blender.run(inside_blur).items():
        _close(ours, theirs, kind)


# Values ----------------------------------------------------------------------------------------------

def _shown(node_type, output, color=False, **settings):
    """A wall that shines with a node's output, times a half plus a half unless it is a colour; the node
    and its tree."""
    import bpy
    import scenes
    material = scenes.material("Shown", "ShaderNodeEmission")
    tree = material.node_tree
    node = tree.nodes.new(node_type)
    for name, value in settings.items():
        setattr(node, name, value)
    scale = tree.nodes.new("ShaderNodeVectorMath")
    scale.operation = 'MULTIPLY_ADD'
    scale.inputs[1].default_value = (1.0,) * 3 if color else (0.5,) * 3
    scale.inputs[2].default_value = (0.0,) * 3 if color else (0.5,) * 3
    tree.links.new(node.outputs[output], scale.inputs[0])
    tree.links.new(scale.outputs[0], tree.nodes["Emission"].inputs["Color"])
    bpy.data.objects["Wall"].data.materials.clear()
    bpy.data.objects["Wall"].data.materials.append(material)
    return node, tree


def inside_values():
    """Node outputs as the colour of a wall, by both engines."""
    import bpy
    import scenes
    scene = scenes.empty(size=(48, 48))
    made = scenes.camera()
    wall = scenes.wall("Wall", 2.6, 0.0)
    wall.rotation_euler = (0.3, 0.2, 0.4)
    pairs = {}
    ramp, tree = _shown("ShaderNodeValToRGB", "Color", color=True)
    tree.links.new(tree.nodes.new("ShaderNodeUVMap").outputs[0], ramp.inputs[0])
    ramp.color_ramp.interpolation = 'CONSTANT'
    ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (1, 0, 0, 1), (0, 0, 1, 1)
    ramp.color_ramp.elements.new(0.4).color = (0, 1, 0, 1)
    pairs["constant ramp"] = _seeds(8 * FILM_SAMPLES)  # an edge through the middle
    for space in ('OBJECT', 'WORLD', 'BLENDER_OBJECT', 'BLENDER_WORLD'):
        node, _ = _shown("ShaderNodeNormalMap", "Normal", space=space)
        node.inputs["Color"].default_value = (0.7, 0.2, 0.3, 1.0)
        pairs[space] = _seeds()
    for mode in ('HSV', 'HSL'):
        node, _ = _shown("ShaderNodeCombineColor", "Color", color=True, mode=mode)
        for socket, value in zip(node.inputs, (0.6, 0.7, 0.4)):
            socket.default_value = value
        pairs[mode] = _seeds()
    image = bpy.data.images.new("Image", 2, 2, alpha=True)
    image.pixels.foreach_set([0.8, 0.5, 0.3, 0.25] * 4)
    image.filepath_raw, image.file_format = bpy.app.tempdir + "sheer.png", 'PNG'
    image.save()
    for space in ("sRGB", "Non-Color"):
        for name in ("file", "generated"):
            node, _ = _shown("ShaderNodeTexImage", "Color", color=True)
            node.image = bpy.data.images.load(image.filepath_raw, check_existing=False) \
                if name == "file" else image
            node.image.colorspace_settings.name = space
            pairs[f"{space} {name}"] = _seeds()
    node, _ = _shown("ShaderNodeLightPath", "Ray Length")
    made.data.clip_start = 3.0
    pairs["ray length"] = _seeds()
    made.location.x = -1.0
    made.keyframe_insert("location", frame=0)
    made.rotation_euler.z = -0.2
    made.keyframe_insert("rotation_euler", frame=0)
    made.location.x = 1.0
    made.keyframe_insert("location", frame=2)
    made.rotation_euler.z = 0.2
    made.keyframe_insert("rotation_euler", frame=2)
    scene.render.use_motion_blur = True
    scene.frame_set(1)
    pairs["ray length in motion"] = _seeds()
    return pairs


@pytest.fixture(scope="module")
def value_pairs(blender_of_module):
    """All values, from one Blender."""
    return blender_of_module.run(inside_values, timeout=300)


@pytest.mark.parametrize("name", (
    "constant ramp", "OBJECT", "WORLD", "BLENDER_OBJECT", "BLENDER_WORLD", "HSV", "HSL", "sRGB file",
    "sRGB generated", "Non-Color file", "Non-Color generated", "ray length", "ray length in motion"))
def test_values(value_pairs, name):
    ours, theirs = value_pairs[name]
    assert np.array_equal(ours[:, 24, 24, :3] == 0.0, theirs[:, 24, 24, :3] == 0.0)
    _close(ours, theirs, name)


# Generated coordinates of a posed mesh -------------------------------------------------------------

def _posed_column(material):
    """A column of a rest pose along Z whose upper half an armature bends aside."""
    import bpy
    import scenes
    rows = [(x, y, 0.25 * z) for z in range(-6, 7) for x, y in ((-.5, -.5), (.5, -.5), (.5, .5), (-.5, .5))]
    faces = [(4 * z + k, 4 * z + (k + 1) % 4, 4 * z + 4 + (k + 1) % 4, 4 * z + 4 + k)
             for z in range(12) for k in range(4)]
    column = scenes.mesh("Column", rows, faces, material)
    armature = scenes.link("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode='EDIT')
    for name, low, high in (("Lower", -1.5, 0.0), ("Upper", 0.0, 1.5)):
        bone = armature.data.edit_bones.new(name)
        bone.head, bone.tail = (0, 0, low), (0, 0, high)
    bpy.ops.object.mode_set(mode='OBJECT')
    for name, vertices in (("Lower", range(0, 28)), ("Upper", range(28, 52))):
        column.vertex_groups.new(name=name).add(list(vertices), 1.0, 'REPLACE')
    column.modifiers.new("Armature", 'ARMATURE').object = armature
    pose = armature.pose.bones["Upper"]
    pose.rotation_mode = 'XYZ'
    pose.rotation_euler = (0.3, 0.0, 0.9)  # forwards too: no two faces lie in one plane
    return column


def _generated():
    """A material that shines with its Generated coordinates."""
    import scenes
    material = scenes.material("Generated", "ShaderNodeEmission")
    tree = material.node_tree
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"],
                   tree.nodes["Emission"].inputs["Color"])
    return material


def inside_generated():
    """Generated coordinates as colours: of the pose, with a subdivision behind it, with a texture space
    of the mesh's own; and what the viewport's sync takes for them."""
    import bpy
    import scenes
    from volley.sync import mesh
    scenes.empty(size=(64, 64))
    scenes.camera(location=(0.5, -6.0, 0.5))
    column = _posed_column(_generated())
    pairs = {"posed": _seeds()}
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = column.evaluated_get(depsgraph)
    viewport = mesh.generated_coordinates(evaluated, evaluated.data, mesh.read_positions(evaluated.data))
    column.data.use_auto_texspace = False
    column.data.texspace_size = (0.5, 1.0, 3.0)
    pairs["own space"] = _seeds()
    column.modifiers.new("Subdivision", 'SUBSURF').render_levels = 1
    pairs["subdivided"] = _seeds()
    return pairs, viewport


def test_generated_coordinates(blender):
    pairs, viewport = blender.run(inside_generated)
    for name, (ours, theirs) in pairs.items():
        assert theirs[..., :3].max() > 0.5, name
        _close(ours, theirs, name)
    assert viewport[:, 2].reshape(13, 4) == pytest.approx(np.repeat(np.linspace(0, 1, 13), 4).reshape(13, 4))


MODIFIERS = ('ARRAY', 'SUBSURF', 'BEVEL', 'MIRROR', 'SOLIDIFY', 'REMESH', 'CAST', 'SCREW')


def inside_generated_modifiers():
    """Generated coordinates as colours of a cone that modifiers change, by both engines, two seeds of each."""
    import bpy
    import scenes
    found = {}
    for kind in MODIFIERS:
        scenes.empty(size=(48, 48))
        scenes.camera(location=(0.9, -6.0, 0.0))
        bpy.ops.mesh.primitive_cone_add(vertices=9, rotation=(0.7, 0.4, 0.3))
        bpy.context.object.data.materials.append(_generated())
        bpy.context.object.modifiers.new(kind, kind)
        found[kind] = _seeds()
    return found


def test_generated_coordinates_of_modifiers(blender):
    for kind, (ours, theirs) in blender.run(inside_generated_modifiers).items():
        assert theirs[..., :3].max() > 0.5, kind
        _close(ours, theirs, kind)


TEXTURES = ("Noise", "Musgrave", "Voronoi", "Wave", "Magic", "Gradient", "Checker", "Brick", "Gabor")


def inside_unlinked_textures():
    """A posed column that shines with a texture to which no coordinates are linked, by both engines, two seeds of
    each; of those textures that this Blender has."""
    import scenes
    found = {}
    for name in TEXTURES:
        scenes.empty(size=(64, 64))
        scenes.camera(location=(0.5, -6.0, 0.5))
        if scenes.has_node("ShaderNodeTex" + name):
            material = scenes.material(name, "ShaderNodeEmission")
            tree = material.node_tree
            texture = tree.nodes.new("ShaderNodeTex" + name)
            if "Scale" in texture.inputs:
                texture.inputs["Scale"].default_value = 2.0  # no finer than the pixels
            tree.links.new(texture.outputs["Color" if "Color" in texture.outputs else 0],
                           tree.nodes["Emission"].inputs["Color"])
            _posed_column(material)
            found[name] = _seeds()
    return found


def test_unlinked_textures_have_generated_coordinates(blender):
    """Those of the undeformed mesh: in the box around the posed one, tiles were off by .09 to .68."""
    found = blender.run(inside_unlinked_textures)
    assert len(found) >= len(TEXTURES) - 1
    for name, (ours, theirs) in found.items():
        _close(ours, theirs, name)


def inside_shutter():
    """Rows of a picture that an edge crosses while the shutter is open, by both engines, for a box and
    for a shutter that opens slowly; a pixel is the share of the light that it saw the wall in."""
    import bpy
    import scenes
    scene = scenes.empty(size=(128, 4))
    scenes.camera(type='ORTHO', ortho_scale=4.0)
    moving = scenes.wall("Wall", 8.0, 0.0, (-4.0, 0.0), scenes.emitter((1.0, 1.0, 1.0)))
    for frame, x in ((0, -3.6), (2, 3.6)):
        moving.location.x = x
        moving.keyframe_insert("location", frame=frame)
    for key in scenes.curves(moving)[0].keyframe_points:
        key.interpolation = 'LINEAR'
    scene.frame_set(1)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    box = _both(4096)
    mapping = scene.render.motion_blur_shutter_curve
    mapping.curves[0].points[0].location = (0.0, 0.1)
    mapping.update()
    return {"box": box, "opening": _both(4096)}, bpy.app.version


def test_shutter(blender):
    pairs, version = blender.run(inside_shutter)
    for shape, (ours, theirs) in pairs.items():
        # How 4.3 makes its table of times is known for a box; of a curve a quarter entry is not.
        slack = 3.0 if version >= (4, 0, 0) and shape == "opening" else 1.0
        rows = [picture[..., 0].mean(axis=0) for picture in (ours, theirs)]
        assert rows[1][3] > 0.99 and rows[1][-3] < 0.01, shape
        assert np.abs(rows[0] - rows[1]).max() < slack * 2e-3, shape
        assert rows[0].mean() == pytest.approx(rows[1].mean(), abs=slack * 4e-4), shape


def inside_remapped():
    """A wall that moves while time is stretched to twice its length, by both engines, and the frame that the scene is
    at in the end."""
    import scenes
    scene = scenes.empty(size=(64, 16))
    scenes.camera(type='ORTHO', ortho_scale=4.0)
    moving = scenes.wall("Wall", 1.0, 0.0, material=scenes.emitter((1.0, 1.0, 1.0)))
    for frame, x in ((0, -2.0), (8, 6.0)):
        moving.location.x = x
        moving.keyframe_insert("location", frame=frame)
    for key in scenes.curves(moving)[0].keyframe_points:
        key.interpolation = 'LINEAR'
    scene.render.frame_map_old, scene.render.frame_map_new = 100, 200
    scenes.set_shutter(scene, length=1.0)
    scene.frame_set(4)
    pictures = _seeds()
    return pictures, scene.frame_current


def test_blur_of_remapped_time(blender):
    """Mapped twice, frame 4 showed the scene of 1 instead of 2, and was written by the name of 2."""
    pictures, frame = blender.run(inside_remapped)
    assert frame == 4
    assert pictures[1][..., :3].max() > 0.5
    _close(*pictures, "remapped")


def inside_dawn(start):
    """An even world that brightens, by both engines; start: of the time of the keys."""
    import scenes
    scene = scenes.empty(size=(16, 16))
    scenes.camera()
    scenes.light_world((1.0, 1.0, 1.0))
    tree = scene.world.node_tree
    strength = next(node for node in tree.nodes if node.type == 'BACKGROUND').inputs["Strength"]
    for frame, strength.default_value in ((start, 0.0), (start + 2, 2.0)):
        strength.keyframe_insert("default_value", frame=frame)
    scenes.set_shutter(scene, length=1.0)
    scene.frame_set(1)
    return _seeds()


@pytest.mark.parametrize("start", (0, 1))
def test_worlds_are_those_of_the_middle(blender, start):
    """Those of the end were brighter by .69, and by .31 where they begin to brighten."""
    ours, theirs = blender.run(inside_dawn, start)
    assert theirs[..., :3].mean() == pytest.approx(1.0 - start, abs=1e-3)
    _close(ours, theirs, "dawn")


def inside_turning():
    """A shining bar that makes a third of a turn while it grows, before a camera that rolls; by Volley once
    more, flat along the axis that it has no extent in."""
    import math
    import scenes
    scene = scenes.empty(size=(64, 48))
    made = scenes.camera()
    bar = scenes.mesh("Bar", [(-2, 0, -0.3), (2, 0, -0.3), (2, 0, 0.3), (-2, 0, 0.3)], [(0, 1, 2, 3)],
                      scenes.emitter((1.0, 0.5, 0.2)))
    for moving, turn in ((bar, 60.0), (made, 15.0)):
        for frame, sign in ((0, -1), (2, 1)):
            moving.rotation_euler.y = sign * math.radians(turn)
            moving.keyframe_insert("rotation_euler", frame=frame)
            moving.scale.x = 1.0 + 0.2 * sign
            if moving is bar:
                moving.keyframe_insert("scale", frame=frame)
    scene.frame_set(1)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    pictures = _both(512)
    for key in scenes.curves(bar).find("scale", index=1).keyframe_points:
        key.co.y = key.handle_left.y = key.handle_right.y = 0.0
    scene.frame_set(1)
    scenes.set_engine('VOLLEY', 512)
    assert bar.scale.y == 0.0
    return pictures + [scenes.render()]


def test_turning_does_not_shrink(blender):
    ours, theirs, flat = [picture.reshape(6, 8, 8, 8, 4).mean(axis=(1, 3))
                          for picture in blender.run(inside_turning)]
    assert theirs[..., 0].max() > 0.5
    for blocks in (ours, flat):
        assert np.abs(blocks - theirs).max() < 4e-3


# Light ---------------------------------------------------------------------------------------------

def _stage():
    """A floor and a sphere, seen from above."""
    import scenes
    scenes.camera(location=(0.0, -5.0, 3.0), rotation=(1.05, 0.0, 0.0))
    floor = scenes.mesh("Floor", [(-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0)], [(0, 1, 2, 3)],
                        scenes.material("Floor", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.6, 0.4)))
    return floor, scenes.sphere(location=(0, 0, 1), material=scenes.material(
        "Ball", "ShaderNodeBsdfDiffuse", Color=(0.3, 0.5, 0.8)))


def _shine(kind):
    import math
    import scenes
    if kind in {'WORLD', 'PORTAL'}:
        import bpy
        scenes.world_color(bpy.context.scene.world, (0.5, 0.6, 0.8))
        if kind == 'WORLD':
            return
    settings = {
        'POINT': {"energy": 500.0, "shadow_soft_size": 0.5},
        'SPOT': {"energy": 900.0, "shadow_soft_size": 0.2, "spot_size": 1.2, "spot_blend": 0.4},
        'SUN': {"energy": 3.0, "angle": 0.2},
        'RECTANGLE': {"energy": 300.0, "shape": 'RECTANGLE', "size": 2.0, "size_y": 0.5},
        'ELLIPSE': {"energy": 300.0, "shape": 'ELLIPSE', "size": 2.0, "size_y": 0.7, "spread": 1.5},
        'PORTAL': {"energy": 300.0, "size": 3.0},
    }[kind]
    blender_kind = kind if kind in {'POINT', 'SPOT', 'SUN'} else 'AREA'
    made = scenes.light(blender_kind, location=(2.0, -2.0, 4.0), **settings)
    made.rotation_euler = (math.atan2(math.hypot(2, 2), 3.2), 0.0, math.pi / 4)
    if kind == 'PORTAL':
        made.data.cycles.is_portal = True


_LIGHTS = ('POINT', 'SPOT', 'SUN', 'RECTANGLE', 'ELLIPSE', 'WORLD', 'PORTAL')

_MATERIALS = {
    "glossy": ("ShaderNodeBsdfGlossy", {"Color": (0.9, 0.7, 0.5), "Roughness": 0.3}),
    "glass": ("ShaderNodeBsdfGlass", {"Color": (0.9, 0.95, 1.0), "Roughness": 0.0, "IOR": 1.45}),
    "principled": ("ShaderNodeBsdfPrincipled", {"Base Color": (0.8, 0.3, 0.2), "Roughness": 0.4}),
    "metal": ("ShaderNodeBsdfPrincipled",
              {"Base Color": (0.8, 0.6, 0.2), "Metallic": 1.0, "Roughness": 0.25}),
    "transparent": ("ShaderNodeBsdfTransparent", {"Color": (0.5, 0.7, 0.9)}),
    "velvet": ("ShaderNodeBsdfVelvet", {"Color": (0.9, 0.7, 0.5), "Sigma": 0.6}),
    # Without a fading edge: there Cycles' samples weigh more than its evaluation says.
    "toon": ("ShaderNodeBsdfToon", {"Color": (0.9, 0.7, 0.5), "Size": 0.4, "Smooth": 0.0}),
    "glossy toon": ("ShaderNodeBsdfToon", {"Color": (0.9, 0.7, 0.5), "Size": 0.3, "Smooth": 0.0},
                    {"component": 'GLOSSY'}),
    "translucent": ("ShaderNodeBsdfTranslucent", {"Color": (0.5, 0.7, 0.9)}),
}

_PRINCIPLED = "ShaderNodeBsdfPrincipled"
# Shaders and sockets that came with Blender 4.
_LATER_MATERIALS = {
    "later glossy": ("ShaderNodeBsdfAnisotropic", {"Color": (0.9, 0.7, 0.5), "Roughness": 0.6}),
    "later glossy GGX": ("ShaderNodeBsdfAnisotropic", {"Color": (0.9, 0.7, 0.5), "Roughness": 0.8},
                         {"distribution": 'GGX'}),
    "rough diffuse": ("ShaderNodeBsdfDiffuse", {"Color": (0.9, 0.7, 0.5), "Roughness": 0.8}),
    "sheen": ("ShaderNodeBsdfSheen", {"Color": (0.9, 0.7, 0.5), "Roughness": 0.5}),
    "metallic": ("ShaderNodeBsdfMetallic", {"Base Color": (0.9, 0.7, 0.5), "Edge Tint": (0.5, 0.7, 0.9),
                                            "Roughness": 0.4}, {"fresnel_type": 'F82'}),
    "conductor": ("ShaderNodeBsdfMetallic", {"Roughness": 0.4}, {"fresnel_type": 'PHYSICAL_CONDUCTOR'}),
    "layers": (_PRINCIPLED, {"Base Color": (0.8, 0.8, 0.8), "Specular IOR Level": 0.5}),
    "specular tint": (_PRINCIPLED, {"Base Color": (0.3, 0.3, 0.8), "Roughness": 0.2,
                                    "Specular IOR Level": 0.9, "Specular Tint": (1.0, 0.5, 0.2)}),
    "large ior": (_PRINCIPLED, {"Base Color": (0.3, 0.3, 0.8), "IOR": 2.0, "Specular IOR Level": 0.5},
                  {"distribution": 'GGX'}),
    "rough metal": (_PRINCIPLED, {"Base Color": (0.8, 0.6, 0.2), "Metallic": 1.0, "Roughness": 0.8,
                                  "Specular IOR Level": 0.5, "Specular Tint": (0.3, 0.6, 1.0)}),
    "brushed metal": (_PRINCIPLED, {"Base Color": (0.8, 0.6, 0.2), "Metallic": 1.0,
                                    "Anisotropic": 0.8, "Specular IOR Level": 0.5}),
    "coat": (_PRINCIPLED, {"Base Color": (0.8, 0.3, 0.2), "Coat Weight": 1.0, "Coat Roughness": 0.1,
                           "Coat Tint": (0.3, 0.8, 0.9)}),
    "rough coat": (_PRINCIPLED, {"Base Color": (0.8, 0.3, 0.2), "Coat Weight": 0.7,
                                 "Coat Roughness": 0.6, "Coat IOR": 1.9}),
    "velvety": (_PRINCIPLED, {"Base Color": (0.1, 0.1, 0.1), "Sheen Weight": 1.0, "Sheen Roughness": 0.4,
                              "Sheen Tint": (0.3, 0.8, 0.9)}),
    "rough base": (_PRINCIPLED, {"Base Color": (0.8, 0.3, 0.2), "Diffuse Roughness": 0.8}),
    "coated emission": (_PRINCIPLED, {"Base Color": (0.1, 0.1, 0.1), "Emission Color": (0.5, 0.2, 0.1),
                                      "Emission Strength": 0.2, "Coat Weight": 1.0,
                                      "Coat Tint": (0.5, 0.5, 0.9)}),
}
_MATERIALS.update(_LATER_MATERIALS)


def inside_light(names):
    """Channel means of both engines for each kind of light and each material."""
    import bpy
    import scenes
    means = {}
    for name in names:
        scenes.empty(size=(64, 48))
        _, ball = _stage()
        if name in _MATERIALS:
            node_type, inputs, *settings = _MATERIALS[name]
            settings = settings[0] if settings else {}
            if not scenes.has_node(node_type, inputs, settings):
                continue
            tried = scenes.material("Tried", node_type,
                                    **{k.replace(" ", "_"): v for k, v in inputs.items()})
            for key, value in settings.items():
                setattr(scenes.shader_of(tried), key, value)
            ball.data.materials[0] = tried
            _shine('RECTANGLE')
            _shine('WORLD')
        else:
            _shine(name)
        means[name] = [scenes.channel_means(picture) for picture in _both(LIGHT_SAMPLES)]
    return means


@pytest.fixture(scope="module")
def light_means(blender_of_module):
    """The means of all kinds, from one Blender."""
    return blender_of_module.run(inside_light, _LIGHTS + tuple(_MATERIALS), timeout=300)


@pytest.mark.parametrize("kind", _LIGHTS + tuple(_MATERIALS))
def test_light(light_means, kind):
    if kind not in light_means:
        pytest.skip("this Blender has no such node")
    ours, theirs = light_means[kind]
    assert ours == pytest.approx(theirs, rel=MEAN_TOLERANCE)


def inside_no_material():
    """A floor without slots for materials, a ball whose slot is empty."""
    import scenes
    scene = scenes.empty(size=(64, 48))
    floor, ball = _stage()
    floor.data.materials.clear()
    ball.data.materials[0] = None
    assert len(ball.material_slots) == 1
    _shine('SUN')
    scenes.world_color(scene.world, (0.5, 0.6, 0.8))
    return _seeds(LIGHT_SAMPLES)


def test_no_material(blender):
    ours, theirs = (np.asarray(side)[..., :3] for side in blender.run(inside_no_material))
    mean, tile = compare.unexplained(ours, theirs)
    assert mean < 1e-3 * theirs.mean() and tile < 5e-3 * theirs.mean()


# Ambient occlusion -----------------------------------------------------------------------------------

def inside_ambient():
    """Pictures by both engines with Cycles' Fast GI Approximation. For Replace the world is not a light
    that is sampled: where it is, Cycles takes part of its light from samples that anything blocks. And
    no gloss is beside a diffuse lobe: there, Cycles scales a part of it too."""
    import bpy
    import scenes
    pictures = {}
    for method, sampling in (('ADD', 'AUTOMATIC'), ('REPLACE', 'NONE')):
        scene = scenes.empty(size=(96, 64))
        _, ball = _stage()
        ball.location.x = -1.1
        sheer = scenes.material("Sheer", "ShaderNodeBsdfPrincipled", Base_Color=(0.8, 0.3, 0.2),
                                Sheen=0.5, Alpha=0.6, Specular=0.5 if method == 'ADD' else 0.0)
        scenes.sphere("Sheer", location=(1.1, 0, 1), material=sheer)
        scenes.wall("Mirror", 6.0, 2.5, (0, 2), scenes.material(
            "Mirror", "ShaderNodeBsdfGlossy", Color=(0.9, 0.9, 0.9), Roughness=0.0))
        scenes.light('POINT', location=(2.0, -3.0, 4.0), energy=200.0, shadow_soft_size=0.5)
        scenes.world_color(scene.world, (0.5, 0.6, 0.8))
        scene.world.cycles.sampling_method = sampling
        settings = scene.world.light_settings
        settings.ao_factor, settings.distance = 0.7, 1.5
        plain = scenes.render()
        scene.volley.use_ambient_occlusion, scene.volley.ao_method = True, method
        scene.cycles.use_fast_gi, scene.cycles.fast_gi_method = True, method
        scene.cycles.ao_bounces_render = 1
        pictures[method] = _both(2 * LIGHT_SAMPLES) + [plain]
    return pictures


def test_ambient_occlusion(blender):
    for method, (ours, theirs, plain) in blender.run(inside_ambient, timeout=300).items():
        means = [picture[..., :3].mean(axis=(0, 1)) for picture in (ours, theirs, plain)]
        assert means[0] == pytest.approx(means[1], rel=MEAN_TOLERANCE), method
        assert np.abs(means[0] / means[2] - 1.0).min() > 0.05, method
        # Blocks of 16 x 16 pixels too: the light is where Cycles has it.
        blocks = [picture.reshape(4, 16, 6, 16, 4).mean(axis=(1, 3)) for picture in (ours, theirs)]
        assert np.abs(blocks[0] - blocks[1]).max() < 0.02, method


# Whitted ---------------------------------------------------------------------------------------------

def inside_whitted():
    """A mirror and a glass ball under a point without size: every bounce is ideal, so Cycles, which
    picks one branch at random, has the tree of rays for its mean."""
    import bpy
    import scenes
    scenes.empty(size=(96, 64))
    _, ball = _stage()
    ball.location.x = -1.2
    ball.data.materials[0] = scenes.material("Mirror", "ShaderNodeBsdfGlossy",
                                             Color=(0.9, 0.8, 0.6), Roughness=0.0)
    scenes.sphere("Glass", location=(1.2, 0, 1), material=scenes.material(
        "Glass", "ShaderNodeBsdfGlass", Color=(0.9, 0.95, 1.0), Roughness=0.0, IOR=1.5))
    scenes.wall("Back", 12.0, 4.0, (0, 2), scenes.emitter((0.2, 0.3, 0.5), "Sky"))
    scenes.light('POINT', location=(2.0, -3.0, 4.0), energy=400.0, shadow_soft_size=0.0)
    pictures = {}
    for integrator in ('WHITTED', 'DISTRIBUTION'):
        scenes.set_engine('VOLLEY', LIGHT_SAMPLES)
        bpy.context.scene.volley.integrator = integrator
        pictures[integrator] = scenes.render()
    scenes.set_engine('CYCLES', 16 * LIGHT_SAMPLES)
    pictures['CYCLES'] = scenes.render()
    return pictures


def test_whitted(blender):
    pictures = blender.run(inside_whitted, timeout=300)
    for integrator in ('WHITTED', 'DISTRIBUTION'):
        difference = np.abs(pictures[integrator] - pictures['CYCLES'])[..., :3].max(axis=-1)
        assert (difference > 0.1).mean() < 0.01, integrator
        assert pictures[integrator][..., :3].mean(axis=(0, 1)) == pytest.approx(
            pictures['CYCLES'][..., :3].mean(axis=(0, 1)), rel=MEAN_TOLERANCE), integrator
