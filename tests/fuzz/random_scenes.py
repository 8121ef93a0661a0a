#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Random scenes by Volley and by Cycles without diffuse bounces: how far they are apart.

    random_scenes.py [--without PART]... [--keep DIR] FIRST COUNT

A line for each seed: errors of the picture and of light passes beyond noise, over the mean of the picture. A
seed is the same scene in each Blender that has its nodes. Each part draws its numbers from a generator of its
own, so that a scene without a part is mostly the same (without textures, normals or mixes other textures are
drawn): what is wrong is found by leaving parts out. Those of wide_parts.py are in seeds from 20000 on alone. Light
by kind must add up to the picture as it does in Cycles. --keep writes the scenes as .blend files and Volley |
Cycles | 8 times the difference beside them. Ends with 1 if a mean differs by 1 % or a tile by 3 %, light does not
add up, or a picture of Volley's is not finite. Takes a few seconds for each scene.
"""

import argparse
import math
import os
import pathlib
import random
import sys

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[1] / "support"), str(pathlib.Path(__file__).parent)]
import numpy as np  # noqa: E402  (the folders are on the path only now)
import wide_parts as wide  # noqa: E402

PARTS = ("textures", "normals", "mixes", "strands", "points", "instances", "motion", "deform", "shutter", "lens",
         "world", "lamps", "lamp_nodes", "film", "objects", "passes", "guides", "rough_glass", *wide.PARTS)
SIZE, SAMPLES = (64, 48), 512
MEAN_TOLERANCE, TILE_TOLERANCE = 0.01, 0.03
SUM_TOLERANCE = 0.002  # of the mean, by which light by kind may miss Combined by more than Cycles' does
DARKEST = 1e-4  # mean that errors are taken relative to
PASSES = {"use_pass_diffuse_direct": "DiffDir", "use_pass_glossy_direct": "GlossDir",
          "use_pass_glossy_indirect": "GlossInd", "use_pass_transmission_direct": "TransDir",
          "use_pass_transmission_indirect": "TransInd",
          "use_pass_emit": "Emit", "use_pass_environment": "Env", "use_pass_diffuse_color": "DiffCol",
          "use_pass_glossy_color": "GlossCol", "use_pass_transmission_color": "TransCol", "use_pass_mist": "Mist",
          "use_pass_normal": "Normal"}
GUIDES = ("Denoising Albedo", "Denoising Normal")
NO_LIGHT = (*GUIDES, "Normal", *wide.MORE_PASSES.values())  # their errors are over their own means


class Scene:
    """A random scene; ``rng(part)`` are that part's numbers, ``has(part)`` whether it is there."""

    def __init__(self, seed, without):
        self.seed, self.without = seed, without
        self.generators = {}

    def rng(self, part):
        if part not in self.generators:
            self.generators[part] = random.Random(f"{self.seed} {part}")
        return self.generators[part]

    def has(self, part, chance):
        if part in wide.PARTS and self.seed < wide.FIRST:
            return False
        drawn = self.rng(part + "?").random() < chance
        return drawn and part not in self.without


# Materials ---------------------------------------------------------------------------------------

SHADERS = ("ShaderNodeBsdfDiffuse", "ShaderNodeBsdfGlossy", "ShaderNodeBsdfPrincipled", "ShaderNodeBsdfGlass",
           "ShaderNodeBsdfRefraction", "ShaderNodeBsdfTranslucent", "ShaderNodeBsdfTransparent",
           "ShaderNodeBsdfSheen", "ShaderNodeBsdfToon", "ShaderNodeBsdfMetallic", "ShaderNodeEmission")
# After which no ray goes on: two others added may give more than they get, from bounce to bounce.
ENDING = {"ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTranslucent", "ShaderNodeBsdfSheen", "ShaderNodeEmission"}
HAIR_SHADERS = ("ShaderNodeBsdfHair", "ShaderNodeBsdfHairPrincipled", "ShaderNodeBsdfDiffuse",
                "ShaderNodeBsdfPrincipled", "ShaderNodeBsdfGlossy", "ShaderNodeBsdfTranslucent")
# Left as they are: what Volley does without, or what makes noise of all.
FIXED_INPUTS = ("Subsurface", "Emission", "Normal", "Tangent", "Weight", "Transmission", "Thin Film", "Coat Normal",
                "Thin Wall", "Radius")
# Without White Noise, which is what rounding makes of coordinates that are the same all over a face or a strand.
TEXTURES = ("ShaderNodeTexNoise", "ShaderNodeTexVoronoi", "ShaderNodeTexChecker", "ShaderNodeTexWave",
            "ShaderNodeTexGradient", "ShaderNodeTexMagic", "ShaderNodeTexBrick", "ShaderNodeTexGabor")
COORDINATES = ("Generated", "UV", "Object", "Normal", "Camera", "Window", "Reflection")


def new_node(tree, kinds, rng):
    """A node of one of the types that this Blender has."""
    while True:
        kind = rng.choice(kinds)
        try:
            return tree.nodes.new(kind)
        except RuntimeError:
            continue


def draw_inputs(node, rng):
    """Random values of a node's inputs."""
    for socket in node.inputs:
        value = rng.random(), rng.random(), rng.random(), rng.random()
        if socket.name.startswith(FIXED_INPUTS) or not hasattr(socket, "default_value"):
            continue
        if socket.type == 'RGBA':
            socket.default_value = (*value[:3], 1.0)
        elif socket.type == 'VALUE':
            low, high = {"IOR": (1.05, 2.0), "Roughness": (0.05, 1.0), "Scale": (1.0, 8.0), "Detail": (0.0, 4.0),
                         "Strength": (0.2, 1.0), "Smoothness": (0.01, 1.0),
                         "Exponent": (0.3, 1.0)}.get(socket.name, (0.0, 1.0))  # with less Cycles' Voronoi ends in NaN
            socket.default_value = low + (high - low) * value[0]


def draw_settings(node, rng):
    """Random choices of a node's menus but those that say how its sockets are laid out."""
    for setting in node.bl_rna.properties:
        drawn = rng.random()
        if setting.type == 'ENUM' and not setting.is_readonly and setting.identifier in (
                "distribution", "component", "model", "parametrization", "wave_type", "wave_profile", "bands_direction",
                "gradient_type", "feature", "distance", "noise_type", "blend_type", "gabor_type", "fresnel_type"):
            names = [name for name in setting.enum_items.keys() if name != 'BECKMANN']
            try:
                setattr(node, setting.identifier, names[int(drawn * len(names))])
            except TypeError:
                pass


def textured(scene, tree, socket):
    """A texture, mapped somehow, into a socket; heights of bumps without Window coordinates, along which those of
    Cycles 5 are turned."""
    import bpy
    output = other_output(scene, tree, socket)
    if output:
        tree.links.new(output, socket)
        return
    rng = scene.rng("textures")
    texture = new_node(tree, TEXTURES, rng)
    draw_settings(texture, rng)
    draw_inputs(texture, rng)
    if "Vector" in texture.inputs:
        coordinates = tree.nodes.new("ShaderNodeTexCoord")
        mapping = tree.nodes.new("ShaderNodeMapping")
        mapping.inputs["Location"].default_value = [rng.uniform(-1, 1) for _ in range(3)]
        mapping.inputs["Rotation"].default_value = [rng.uniform(-3, 3) for _ in range(3)]
        mapping.inputs["Scale"].default_value = [rng.uniform(0.5, 2) for _ in range(3)]
        place = rng.choice(COORDINATES)
        if place == "Window" and socket.name == "Height" and bpy.app.version >= (5, 0, 0):
            place = "Generated"
        tree.links.new(coordinates.outputs[place], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    # Positions are negative: Cycles lets negative light through what is transparent.
    outputs = [output for output in texture.outputs if output.enabled and output.name != "Position"]
    output = rng.choice(outputs)
    if scene.has("chains", 0.3):
        output = wide.chain(scene, tree, output)
    tree.links.new(output, socket)


def other_output(scene, tree, socket):
    """What a socket may be linked to instead of a pattern, None without; of surfaces alone."""
    if not any(node.bl_idname == "ShaderNodeOutputMaterial" for node in tree.nodes):
        return None
    if scene.has("images", 0.2):
        return wide.image_texture(scene, tree)
    if socket.name != "Height" and scene.has("sources", 0.25):
        return wide.source(scene, tree)
    return None


def shader_node(scene, tree, kinds, rng):
    """A shader of random settings. Without rough glass, which Cycles 4 and 5 have otherwise, glass is clear."""
    import bpy
    node = new_node(tree, kinds, rng)
    draw_settings(node, rng)
    draw_inputs(node, rng)
    if "rough_glass" in scene.without and node.bl_idname in {"ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction"}:
        node.inputs["Roughness"].default_value = 0.0
    if node.bl_idname == "ShaderNodeBsdfToon" and bpy.app.version < (4, 0, 0):
        node.inputs["Smooth"].default_value = 0.0  # Cycles samples it otherwise than it evaluates it
    if node.bl_idname == "ShaderNodeBsdfPrincipled" and rng.random() < 0.4 and "rough_glass" not in scene.without:
        node.inputs["Transmission Weight" if "Transmission Weight" in node.inputs else "Transmission"] \
            .default_value = rng.random()
        if bpy.app.version < (4, 0, 0):
            node.inputs["Sheen"].default_value = 0.0  # with which Cycles has no place left for the clearcoat
    if node.bl_idname == "ShaderNodeBsdfPrincipled" and rng.random() < 0.6:
        node.inputs["Alpha"].default_value = 1.0
    color = next((socket for socket in node.inputs if socket.type == 'RGBA' and socket.enabled), None)
    if color is not None and scene.has("textures", 0.7):
        textured(scene, tree, color)
    if node.bl_idname == "ShaderNodeBsdfPrincipled" and scene.has("emission", 0.15):
        wide.draw_emission(scene, node)
    for socket in node.inputs:
        is_clear = socket.name == "Roughness" and socket.default_value == 0.0
        if socket.name in wide.INPUTS and not is_clear and scene.has("inputs", 0.15):
            textured(scene, tree, socket)
    if "Normal" in node.inputs and scene.has("normal_maps", 0.15):
        tree.links.new(wide.normal_map(scene, tree, textured), node.inputs["Normal"])
    elif "Normal" in node.inputs and scene.has("normals", 0.4):
        bump = tree.nodes.new("ShaderNodeBump")
        bump.inputs["Strength"].default_value = scene.rng("normals").uniform(0.1, 0.6)
        bump.inputs["Distance"].default_value = 0.1
        textured(scene, tree, bump.inputs["Height"])
        tree.links.new(bump.outputs[0], node.inputs["Normal"])
    return node


def material(scene, kinds, rng):
    """A material of a shader or a mix of two."""
    import bpy
    made = bpy.data.materials.new("Material")
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    tree.nodes.new("ShaderNodeOutputMaterial").name = "Material Output"
    shader = shader_node(scene, tree, kinds, rng)
    if scene.has("mixes", 0.4):
        kind = scene.rng("mixes").choice(("ShaderNodeMixShader", "ShaderNodeAddShader"))
        other = shader_node(scene, tree, kinds, scene.rng("mixes"))
        if not ENDING.intersection((shader.bl_idname, other.bl_idname)):
            kind = "ShaderNodeMixShader"
        mix = tree.nodes.new(kind)
        for node, socket in zip((shader, other), list(mix.inputs)[-2:]):
            tree.links.new(node.outputs[0], socket)
        if "Fac" in mix.inputs:
            way = scene.rng("mixes").choice(("ShaderNodeFresnel", "ShaderNodeLayerWeight", None))
            if way:
                tree.links.new(tree.nodes.new(way).outputs[0], mix.inputs["Fac"])
        shader = mix
    tree.links.new(shader.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    if kinds == SHADERS and scene.has("displacement", 0.2):
        wide.add_displacement(scene, made, textured)
    return made


# What is seen ----------------------------------------------------------------------------------------

def add_objects(scene, rng):
    """Some meshes, curves and texts of random places, materials and modifiers."""
    import bpy
    made = []
    for _ in range(rng.randint(2, 4)):
        kind = rng.choice(("sphere", "cube", "torus", "monkey", "curve", "text", "ball"))
        place = rng.uniform(-1.6, 1.6), rng.uniform(-1.0, 1.5), rng.uniform(-1.0, 1.0)
        if kind == "sphere":
            bpy.ops.mesh.primitive_uv_sphere_add(segments=rng.choice((9, 32)), ring_count=12, location=place)
        elif kind == "cube":
            bpy.ops.mesh.primitive_cube_add(size=1.2, location=place)
        elif kind == "torus":
            bpy.ops.mesh.primitive_torus_add(location=place, major_segments=24, minor_segments=8)
        elif kind == "monkey":
            bpy.ops.mesh.primitive_monkey_add(location=place)
        elif kind == "curve":
            bpy.ops.curve.primitive_bezier_circle_add(location=place)
            bpy.context.object.data.bevel_depth = 0.15
        elif kind == "text":
            bpy.ops.object.text_add(location=place)
            bpy.context.object.data.extrude = 0.1
        else:
            bpy.ops.mesh.primitive_ico_sphere_add(location=place, subdivisions=3)
        one = bpy.context.object
        one.rotation_euler = [rng.uniform(-3, 3) for _ in range(3)]
        one.scale = [rng.uniform(0.4, 1.0)] * 3 if rng.random() < 0.6 else [rng.uniform(0.3, 1.0) for _ in range(3)]
        one.data.materials.append(material(scene, SHADERS, rng))
        if one.type == 'MESH':
            smooth = rng.random() < 0.5
            for polygon in one.data.polygons:
                polygon.use_smooth = smooth
            modifier = rng.choice((None, None, 'SUBSURF', 'BEVEL', 'ARRAY', 'SOLIDIFY', 'DECIMATE'))
            if modifier:
                one.modifiers.new("Modifier", modifier)
        if scene.seed >= wide.FIRST:
            wide.change_object(scene, one, lambda: material(scene, SHADERS, scene.rng("slots")))
        made.append(one)
    return made


def draw_visibility(rng, one):
    """What an object is to camera rays. What some rays meet and shadow rays do not, or the other way round,
    depends on how an engine shares light between both."""
    drawn = rng.random()
    if drawn < 0.1:
        one.is_holdout = True
    elif drawn < 0.2:
        one.visible_camera = False
    one.pass_index = rng.randint(0, 5)
    if rng.random() < 0.3:
        one.color = [rng.random() for _ in range(3)] + [1.0]


def add_strands(scene, rng, skin):
    """Particle hair on a mesh."""
    skin.modifiers.new("Hair", 'PARTICLE_SYSTEM')
    settings = skin.particle_systems[0].settings
    settings.type, settings.count = 'HAIR', rng.choice((20, 200))
    settings.hair_length = rng.uniform(0.2, 0.6)
    settings.use_advanced_hair = True
    settings.render_step = rng.randint(1, 4)
    settings.brownian_factor = rng.choice((0.0, 0.05))
    settings.object_align_factor = [rng.uniform(-0.1, 0.1) for _ in range(3)]
    settings.root_radius, settings.tip_radius = 1.0, rng.choice((0.0, 0.3, 1.0))
    settings.radius_scale = rng.choice((0.01, 0.03, 0.08))
    settings.use_close_tip = rng.random() < 0.5
    if rng.random() < 0.4:
        settings.child_type, settings.rendered_child_count = rng.choice(('SIMPLE', 'INTERPOLATED')), 5
        setattr(settings, "child_percent" if hasattr(settings, "child_percent") else "child_nbr", 5)
    skin.data.materials.append(material(scene, HAIR_SHADERS, rng))
    settings.material = len(skin.data.materials)
    skin.show_instancer_for_render = rng.random() < 0.8
    import bpy
    curves = bpy.context.scene.cycles_curves
    curves.shape, curves.subdivisions = rng.choice(('RIBBONS', 'THICK')), rng.randint(1, 3)


def add_points(scene, rng, skin):
    """A point cloud over a mesh."""
    import scenes
    distribute, set_material = scenes.geometry_nodes(skin, "GeometryNodeDistributePointsOnFaces",
                                                     "GeometryNodeSetMaterial")
    distribute.inputs["Density"].default_value = rng.choice((5.0, 40.0))
    skin = material(scene, SHADERS[:-1], rng)
    for node in skin.node_tree.nodes:  # without tangents Cycles' points are black
        for name in {"Anisotropy", "Anisotropic"} & set(node.inputs.keys()):
            node.inputs[name].default_value = 0.0
    set_material.inputs["Material"].default_value = skin


def add_instances(scene, rng, source):
    """Copies of an object by a collection."""
    import bpy
    collection = bpy.data.collections.new("Source")
    for other in list(source.users_collection):
        other.objects.unlink(source)
    collection.objects.link(source)
    for _ in range(rng.randint(2, 6)):
        placed = bpy.data.objects.new("Placed", None)
        placed.instance_type, placed.instance_collection = 'COLLECTION', collection
        placed.location = [rng.uniform(-1.2, 1.2) for _ in range(3)]
        placed.rotation_euler = [rng.uniform(-3, 3) for _ in range(3)]
        placed.scale = [rng.uniform(0.4, 1.1) for _ in range(3)]
        bpy.context.scene.collection.objects.link(placed)


def add_motion(rng, made):
    """Motion of objects within the shutter."""
    import bpy
    bpy.context.scene.render.use_motion_blur = True
    bpy.context.scene.render.motion_blur_shutter = rng.choice((0.5, 1.0))
    for one in made:
        drawn = [rng.uniform(-0.3, 0.3) for _ in range(6)]
        if rng.random() < 0.4:
            continue
        for frame, side in ((0, -1.0), (2, 1.0)):
            one.location = [x + side * d for x, d in zip(one.location, drawn[:3])]
            one.rotation_euler = [x + side * d for x, d in zip(one.rotation_euler, drawn[3:])]
            one.keyframe_insert("location", frame=frame)
            one.keyframe_insert("rotation_euler", frame=frame)


def animate(owner, path, values, index=-1):
    """Key frames before and after the picture's; owner: what has the property of that path."""
    for frame, value in zip((0, 2), values):
        setattr(owner, path, value)
        owner.keyframe_insert(path, index=index, frame=frame)


def add_shape_key(rng, one):
    """Move the points of a mesh or curve."""
    one.shape_key_add(name="Basis")
    bent = one.shape_key_add(name="Bent")
    bow, slant = rng.uniform(-0.5, 0.5), rng.uniform(-0.4, 0.4)
    for point in bent.data:
        x, y, z = point.co
        point.co = (1.2 * x + bow * z * z, 0.8 * y + slant * x, z)
    animate(bent, "value", (rng.uniform(0.0, 0.4), rng.uniform(0.5, 1.0)))


def add_modifier(rng, one):
    """A modifier that bends a mesh from frame to frame."""
    kind = rng.choice(('SIMPLE_DEFORM', 'WAVE', 'CAST', 'DISPLACE', 'SMOOTH'))
    modifier = one.modifiers.new("Moves", kind)
    if kind == 'SIMPLE_DEFORM':
        modifier.deform_method = rng.choice(('TWIST', 'BEND', 'TAPER', 'STRETCH'))
        path = "factor" if modifier.deform_method in {'TAPER', 'STRETCH'} else "angle"
        animate(modifier, path, (rng.uniform(-1.0, 0.0), rng.uniform(0.0, 1.0)))
    elif kind == 'WAVE':
        modifier.height, modifier.width, modifier.speed = 0.3, 0.6, rng.uniform(0.05, 0.3)
    elif kind == 'SMOOTH':
        modifier.iterations = 2
        animate(modifier, "factor", (0.0, 0.8))
    else:
        animate(modifier, "factor" if kind == 'CAST' else "strength", (0.0, rng.uniform(-0.5, 0.5)))


def add_deform(rng, made):
    """Shapes that change within the shutter, objects whose scale or parent does."""
    import bpy
    bpy.context.scene.render.use_motion_blur = True
    bpy.context.scene.render.motion_blur_shutter = rng.choice((0.5, 1.0))
    for one in made:
        kind = rng.choice(("still", "shape", "shape", "modifier", "scale", "parent"))
        if kind == "shape" and one.type in {'MESH', 'CURVE'}:
            add_shape_key(rng, one)
        elif kind == "modifier" and one.type == 'MESH':
            add_modifier(rng, one)
        elif kind == "scale":
            animate(one, "scale", [[x * rng.uniform(0.7, 1.4) for x in one.scale] for _ in range(2)])
        elif kind == "parent":
            parent = bpy.data.objects.new("Parent", None)
            bpy.context.scene.collection.objects.link(parent)
            one.parent = parent
            animate(parent, "rotation_euler", [[rng.uniform(-0.4, 0.4) for _ in range(3)] for _ in range(2)])
        one.cycles.motion_steps = rng.choice((1, 1, 1, 2, 3))
        one.cycles.use_deform_motion = rng.random() < 0.9
        one.cycles.use_motion_blur = rng.random() < 0.9


def set_shutter(rng):
    """The camera's motion, and how the shutter opens."""
    import bpy
    scene = bpy.context.scene
    scene.render.use_motion_blur = True
    scene.render.motion_blur_shutter = rng.choice((0.3, 1.0, 1.7))
    where = scene.render if hasattr(scene.render, "motion_blur_position") else scene.cycles
    where.motion_blur_position = rng.choice(('START', 'CENTER', 'END'))
    if rng.random() < 0.3:
        scene.cycles.rolling_shutter_type, scene.cycles.rolling_shutter_duration = 'TOP', rng.choice((0.1, 0.6))
    camera = scene.camera
    if rng.random() < 0.6:
        animate(camera, "location", [[x + rng.uniform(-0.2, 0.2) for x in camera.location] for _ in range(2)])
    if rng.random() < 0.3:
        animate(camera.data, "lens", [camera.data.lens * rng.uniform(0.9, 1.1) for _ in range(2)])
    if rng.random() < 0.4:
        curve = scene.render.motion_blur_shutter_curve
        curve.curves[0].points[0].location = (0.0, rng.uniform(0.0, 1.0))
        curve.update()


# Light and camera ------------------------------------------------------------------------------------

def add_lamps(scene, rng, made):
    import bpy
    import scenes
    for _ in range(rng.randint(1, 3)):
        kind = rng.choice(('POINT', 'SPOT', 'AREA', 'SUN'))
        place = [rng.uniform(-3, 3), rng.uniform(-4, -1), rng.uniform(1, 4)]
        lamp = scenes.light(kind, location=place)
        lamp.rotation_euler = [math.radians(rng.uniform(25, 65)), rng.uniform(-0.3, 0.3), rng.uniform(-0.6, 0.6)]
        data = lamp.data
        data.color = [rng.uniform(0.3, 1.0) for _ in range(3)]
        data.energy = rng.uniform(0.5, 2.0) * (1.0 if kind == 'SUN' else 150.0)
        size = rng.choice((0.0, 0.2, 0.8))
        if kind == 'SUN':
            data.angle = 0.3 * size
        elif kind == 'AREA':
            data.shape, data.size, data.size_y = rng.choice(('SQUARE', 'RECTANGLE', 'DISK', 'ELLIPSE')), 0.8, 0.3
            if hasattr(data, "spread"):
                data.spread = rng.choice((math.pi, math.radians(100.0), math.radians(30.0)))
        else:
            data.shadow_soft_size = size
        if kind == 'SPOT':
            data.spot_size, data.spot_blend = rng.uniform(0.6, 1.8), rng.random()
        if scene.has("lamp_nodes", 0.5):
            draw_lamp_nodes(scene, data)
        if rng.random() < 0.2:
            setattr(lamp, rng.choice(("visible_diffuse", "visible_glossy", "visible_transmission")), False)
        if rng.random() < 0.2:
            lamp.scale = [rng.uniform(0.5, 1.5) for _ in range(3)]
        wide.change_lamp(scene, lamp, made)
        bpy.context.view_layer.update()


def draw_lamp_nodes(scene, data):
    """A program of a lamp's light."""
    rng = scene.rng("lamp_nodes")
    data.use_nodes = True
    tree = data.node_tree
    emission = tree.nodes["Emission"]
    if rng.random() < 0.6:
        textured(scene, tree, emission.inputs["Color"])
    else:
        falloff = tree.nodes.new("ShaderNodeLightFalloff")
        falloff.inputs["Strength"].default_value = 1.0
        falloff.inputs["Smooth"].default_value = rng.choice((0.0, 1.0))
        output = rng.choice((0, 1))
        if data.type == 'SUN':  # Linear is endless light there, before Blender 5
            output = 0
        tree.links.new(falloff.outputs[output], emission.inputs["Strength"])


def set_world(scene, rng):
    import bpy
    world = bpy.context.scene.world
    world.use_nodes = True
    tree = world.node_tree
    background = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBackground")
    background.inputs["Color"].default_value = [rng.uniform(0.0, 0.6) for _ in range(3)] + [1.0]
    kind = rng.choice(("even", "texture", "sky"))
    if kind == "sky":
        sky = tree.nodes.new("ShaderNodeTexSky")
        sky.sun_elevation, sky.sun_rotation = rng.uniform(0.1, 1.2), rng.uniform(0, 6)
        sky.sun_disc = rng.random() < 0.5
        tree.links.new(sky.outputs[0], background.inputs["Color"])
        background.inputs["Strength"].default_value = 0.1
    elif kind == "texture":
        gradient = tree.nodes.new("ShaderNodeTexGradient")
        gradient.gradient_type = rng.choice(('LINEAR', 'SPHERICAL', 'EASING'))
        coordinates = tree.nodes.new("ShaderNodeTexCoord")
        tree.links.new(coordinates.outputs["Generated"], gradient.inputs["Vector"])
        tree.links.new(gradient.outputs[0], background.inputs["Strength"])


def add_camera(scene):
    import bpy
    import scenes
    made = scenes.camera((0.0, -6.0, 0.6), (math.radians(85.0), 0.0, 0.0))
    if scene.has("lens", 0.6):
        rng = scene.rng("lens")
        data = made.data
        kind = rng.choice(('PERSP', 'PERSP', 'ORTHO'))
        data.type, data.ortho_scale = kind, 4.5
        data.shift_x, data.shift_y = rng.uniform(-0.2, 0.2), rng.uniform(-0.1, 0.1)
        # Cycles 3.4 measures the focus of orthographic cameras from the start of the clip range.
        if rng.random() < 0.5 and (kind != 'ORTHO' or bpy.app.version >= (4, 0)):
            data.dof.use_dof, data.dof.focus_distance, data.dof.aperture_fstop = True, 5.5, 0.2
            data.dof.aperture_blades, data.dof.aperture_ratio = rng.choice((0, 5)), rng.choice((1.0, 2.0))
        data.clip_start = rng.choice((0.1, 5.5))
    if scene.has("panorama", 0.2):
        wide.change_camera(scene, made)


def set_film(rng):
    import bpy
    both = bpy.context.scene
    both.render.film_transparent = rng.random() < 0.5
    both.render.pixel_aspect_x = rng.choice((1.0, 1.5))
    exposure, width = rng.choice((1.0, 2.0)), rng.uniform(0.8, 2.5)
    kind = rng.choice(('BOX', 'GAUSSIAN', 'BLACKMAN_HARRIS'))
    width = 1.0 if kind == 'BOX' else width  # Cycles' has no other
    is_clear = rng.random() < 0.5
    for settings in (both.cycles, both.volley):
        settings.film_exposure, settings.pixel_filter_type, settings.filter_width = exposure, kind, width
        settings.film_transparent_glass = is_clear


def build(seed, without):
    """Make the scene of a seed; the names of the passes that are compared, and limits of Cycles'."""
    import bpy
    import scenes
    scene = Scene(seed, without)
    both = scenes.empty(size=SIZE, samples=SAMPLES)
    both.volley.clamp_indirect = both.cycles.sample_clamp_indirect = 0.0  # they clamp other samples
    if "rough_glass" in without:
        both.volley.filter_glossy = both.cycles.blur_glossy = 0.0  # which makes clear glass rough
    rng = scene.rng("objects")
    floor = scenes.mesh("Floor", [(-4, -3, -1.3), (4, -3, -1.3), (4, 5, -1.3), (-4, 5, -1.3)], [(0, 1, 2, 3)])
    floor.data.materials.append(material(scene, SHADERS[:1], rng))
    made = add_objects(scene, rng) if "objects" not in without else []
    meshes = [one for one in made if one.type == 'MESH']
    visibility = scene.rng("visibility")
    for one in made:
        draw_visibility(visibility, one)
    if meshes and scene.has("strands", 0.5):
        add_strands(scene, scene.rng("strands"), meshes[0])
    elif meshes and scene.has("points", 0.4):
        add_points(scene, scene.rng("points"), meshes[-1])
    if meshes and made[0] is not meshes[-1] and scene.has("instancers", 0.25):
        wide.add_instancer(scene, meshes[-1], made[0])
    if scene.has("curves", 0.2):
        wide.add_curves(scene, material(scene, HAIR_SHADERS, scene.rng("curves")))
    if scene.has("catchers", 0.2):
        floor.is_shadow_catcher = True
    if scene.has("deform", 0.4):
        add_deform(scene.rng("deform"), made)
    if scene.has("motion", 0.3):
        add_motion(scene.rng("motion"), made)
    elif meshes and scene.has("instances", 0.4):
        add_instances(scene, scene.rng("instances"), meshes[0])
    if scene.has("world", 0.6):
        set_world(scene, scene.rng("world"))
    if "lamps" not in without:
        add_lamps(scene, scene.rng("lamps"), made)
    add_camera(scene)
    if scene.has("shutter", 0.3):
        set_shutter(scene.rng("shutter"))
    if scene.has("film", 0.5):
        set_film(scene.rng("film"))
    names = ["Combined"]
    if scene.has("passes", 0.5):
        names += [PASSES[setting] for setting in scene.rng("passes").sample(sorted(PASSES), 3)]
    layer = bpy.context.view_layer
    scenes.show_light(layer)
    for setting, name in PASSES.items():
        if name in names:
            setattr(layer, setting, True)
    if scene.has("guides", 0.4):
        layer.volley.denoising_store_passes = layer.cycles.denoising_store_passes = True
        names += GUIDES
    names += wide.add_passes(scene)
    if floor.is_shadow_catcher:  # of which Cycles has twice in other passes
        names = ["Combined"]
    bpy.context.scene.frame_set(1)
    return names, wide.change_settings(scene)


def inside(seed, without, folder):
    """{pass: (Volley's pictures, Cycles')} of a seed, and the names of those that are compared."""
    import bpy
    import compare
    import scenes
    names, limits = build(seed, without)
    if folder:
        bpy.ops.wm.save_as_mainfile(filepath=os.path.join(folder, f"{seed:04d}.blend"))
    return scenes.passes_by_both(list(dict.fromkeys(names + compare.LIGHT_PASSES)), SAMPLES, cycles=limits), names


# Around Blender --------------------------------------------------------------------------------------

def unsummed(pictures, side):
    """The mean by which light by kind does not add up to Combined; side: 0 for Volley, 1 for Cycles."""
    import compare
    part = {name: np.nan_to_num(pictures[name][side][..., :3]) for name in ("Combined", *compare.LIGHT_PASSES)}
    return float(np.abs(compare.light_sum(part) - part["Combined"]).mean())


def measure(seed, options):
    """The largest errors of a seed, (mean, tile), printed."""
    import blender
    import compare
    started = blender.Blender()
    folder = os.path.abspath(options.keep) if options.keep else None
    try:
        pictures, names = started.run(inside, seed, options.without, folder, timeout=options.timeout)
    except blender.BlenderError as error:
        print(f"{seed:4d} FAILED: {str(error)[-1500:]}", flush=True)
        return 1.0, 1.0
    told = [line for line in started.output.splitlines() if line.startswith("Volley:")]
    worst = np.zeros(2)
    words = []
    scale = max(float(pictures["Combined"][1][..., :3].mean()), DARKEST)
    for name in names:
        ours, theirs = pictures[name]
        channels = {"Combined": 4, "Mist": 1}.get(name, 3)
        ours, theirs = ours[..., :channels], np.nan_to_num(theirs[..., :channels])
        if not np.isfinite(ours).all():
            print(f"{seed:4d} NOT FINITE: {name}", flush=True)
            return 1.0, 1.0
        over = max(float(np.abs(theirs).mean()), DARKEST) if name in NO_LIGHT else scale
        errors = np.array(compare.unexplained(ours, theirs)) / over
        worst = np.maximum(worst, errors)
        words.append(f"{name} {ours.mean():.4f} {theirs.mean():.4f} {errors[0]:.2%} {errors[1]:.2%}")
        if folder:
            shown = [np.broadcast_to(each.mean(axis=0)[::-1, :, :3], each.shape[1:3] + (3,))
                     for each in (ours, theirs)]
            pair = compare.side_by_side(*shown)
            compare.write_png(os.path.join(options.keep, f"{seed:04d}_{name}.png"), pair)
    rest, their_rest = (unsummed(pictures, side) / scale for side in (0, 1))
    if rest > (1.0 + SUM_TOLERANCE) * their_rest + SUM_TOLERANCE:
        words.append(f"light by kind does not add up: {rest:.2%} (Cycles {their_rest:.2%})")
        worst = np.maximum(worst, 1.0)
    is_off = bool((worst > (MEAN_TOLERANCE, TILE_TOLERANCE)).any())
    print(f"{seed:4d} {'OFF' if is_off else 'ok '} mean {scale:.4f}  {', '.join(words)}",
          *sorted(set(told)), sep="\n       ", flush=True)
    return worst


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("first", type=int)
    parser.add_argument("count", type=int)
    parser.add_argument("--without", action="append", default=[], choices=PARTS, help="leave a part out")
    parser.add_argument("--keep", metavar="DIR", help="write the scenes and pictures here")
    parser.add_argument("--timeout", type=float, default=300.0, help="seconds for a scene")
    options = parser.parse_args()
    if options.keep:
        os.makedirs(options.keep, exist_ok=True)
    errors = [measure(seed, options) for seed in range(options.first, options.first + options.count)]
    return int((np.array(errors) > (MEAN_TOLERANCE, TILE_TOLERANCE)).any())


if __name__ == "__main__":
    sys.exit(main())
