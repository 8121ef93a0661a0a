# SPDX-License-Identifier: Apache-2.0
"""Scenes of many things, made by rule, and a city read from its file; runs inside Blender.

Lengths are metres, powers watts.
"""

import math
import pathlib
import random
import tempfile
import zipfile

from effect_scenes import COLORS, add_box, add_sphere, diffuse, empty, glass, glossy
from scene_blocks import add_area_light, add_camera, add_floor, animate, bpy, place, Vector

OBJECT_COUNT = 10_000
OBJECT_MESHES = 20
LIGHT_COUNT = 1_000
PLANT_COUNT = 3_000
LEAF_EDGE_PX = 64
WAVING_BALLS, BALL_SEGMENTS, BALL_RINGS = 8, 256, 245  # a million triangles


# Building blocks -------------------------------------------------------------------------------

def lamps(height=9.0):
    """Two area lights from either side."""
    add_area_light("Key", (-6.0, -7.0, height), (0.0, 0.0, 0.0), 3.0, 2200.0, (1.0, 0.94, 0.86))
    add_area_light("Fill", (7.0, -4.0, 0.7 * height), (0.0, 0.0, 0.5), 4.0, 700.0, (0.75, 0.86, 1.0))


def link(name, data, location, turn=(0.0, 0.0, 0.0), scale=1.0):
    """An object that shares its data."""
    made = bpy.data.objects.new(name, data)
    made.location, made.rotation_euler, made.scale = location, turn, (scale,) * 3
    bpy.context.scene.collection.objects.link(made)
    return made


def meshes_of(objects):
    """Their meshes, without the objects."""
    data = [each.data for each in objects]
    for each in objects:
        bpy.data.objects.remove(each)
    return data


# Generated -------------------------------------------------------------------------------------

def prepare_many_objects(_source, _folder):
    """Ten thousand small balls and boxes, rough and polished, of twenty meshes."""
    empty((0.10, 0.12, 0.15))
    add_floor(60.0, (0.3, 0.3, 0.3), 0.4)
    materials = [diffuse(color) for color in COLORS] + [glossy(COLORS[i], 0.2) for i in range(4)]
    made = []
    for i in range(OBJECT_MESHES):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8, radius=0.12) if i % 2 else \
            bpy.ops.mesh.primitive_cube_add(size=0.2)
        bpy.context.object.data.materials.append(materials[i % len(materials)])
        made.append(bpy.context.object)
    data = meshes_of(made)
    rng = random.Random(11)
    for i in range(OBJECT_COUNT):
        link("Piece", data[i % OBJECT_MESHES], (0.25 * (i % 100) - 12.5, 0.25 * (i // 100) - 5.0,
                                                rng.uniform(0.1, 0.9)),
             [rng.uniform(0.0, math.tau) for _axis in range(3)], rng.uniform(0.5, 1.0))
    lamps()
    add_camera((0.0, -11.0, 5.0), (0.0, 0.0, 0.3), 32.0)


def prepare_many_lights(_source, _folder):
    """A thousand lamps of many colours over a hall of boxes and balls."""
    empty()
    add_floor(60.0, (0.4, 0.4, 0.4), 0.3)
    rng = random.Random(5)
    for i in range(30):
        at = rng.uniform(-9.0, 9.0), rng.uniform(-4.0, 12.0)
        if i % 2:
            add_sphere((*at, 0.6), 0.6, diffuse(COLORS[i % 6]))
        else:
            height = 1.8 + 0.01 * i  # boxes that overlap have no face in common
            add_box((*at, 0.5 * height), (0.8, 0.8, height), diffuse(COLORS[i % 6]), rng.uniform(0.0, 1.5))
    data = []
    for color in COLORS:
        lamp = bpy.data.lights.new("Lamp", "POINT")
        lamp.energy, lamp.shadow_soft_size, lamp.color = 6.0, 0.05, color
        data.append(lamp)
    for i in range(LIGHT_COUNT):
        link("Lamp", data[i % len(data)], (rng.uniform(-12.0, 12.0), rng.uniform(-6.0, 16.0),
                                           rng.uniform(1.2, 3.2)))
    add_camera((0.0, -12.0, 4.5), (0.0, 1.0, 0.6), 35.0)


def prepare_many_glasses(_source, _folder):
    """Rows of glass balls, clear and frosted, on a glossy floor."""
    empty((0.25, 0.28, 0.32))
    add_floor(40.0, (0.45, 0.40, 0.35), 0.25)
    materials = [glass(), glass(0.1), glass(0.3)]
    for i in range(42):
        add_sphere((1.3 * (i % 7) - 3.9, 1.3 * (i // 7) - 2.0, 0.6), 0.6, materials[i % 3])
    lamps(7.0)
    add_camera((0.0, -8.0, 3.6), (0.0, 0.6, 0.5), 40.0)


def leaf_material():
    """A leaf cut out of a square by its picture's alpha."""
    edge = LEAF_EDGE_PX
    pixels = []
    for y in range(edge):
        for x in range(edge):
            u, v = (x + 0.5) / edge, (y + 0.5) / edge
            is_leaf = abs(u - 0.5) < 0.4 * math.sin(math.pi * v) * (0.8 + 0.2 * math.cos(40.0 * v))
            pixels += [0.10 + 0.1 * v, 0.35 + 0.2 * u, 0.06, float(is_leaf)]
    image = bpy.data.images.new("Leaf", edge, edge, alpha=True)
    image.pixels = pixels
    image.pack()
    material = bpy.data.materials.new("Leaf")
    material.use_nodes = True
    tree = material.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    shader = tree.nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = 0.6
    tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    tree.links.new(texture.outputs["Alpha"], shader.inputs["Alpha"])
    return material


def plant(rng, leaf_count, material):
    """Leaves around a stem, each a square."""
    points, faces, corners = [], [], ((0.0, -1.0), (1.0, -1.0), (1.0, 1.0), (0.0, 1.0))
    for i in range(leaf_count):
        turn, lift, base = 2.4 * i, rng.uniform(0.3, 1.1), 0.5 * i / leaf_count
        along = Vector((math.cos(turn) * math.cos(lift), math.sin(turn) * math.cos(lift), math.sin(lift)))
        side = Vector((-math.sin(turn), math.cos(turn), 0.0))
        points += [tuple(Vector((0.0, 0.0, base)) + 0.35 * u * along + 0.12 * v * side) for u, v in corners]
        faces.append(tuple(range(4 * i, 4 * i + 4)))
    mesh = bpy.data.meshes.new("Plant")
    mesh.from_pydata(points, [], faces)
    layer = mesh.uv_layers.new()
    for i, loop in enumerate(layer.data):
        loop.uv = ((0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0))[i % 4]
    mesh.materials.append(material)
    return mesh


def prepare_foliage(_source, _folder):
    """Three thousand plants of leaves cut out by alpha, under a sun and a sky."""
    empty((0.35, 0.42, 0.55))
    add_floor(60.0, (0.20, 0.14, 0.08), 0.8)
    rng, material = random.Random(17), leaf_material()
    data = [plant(rng, 24, material) for _kind in range(8)]
    for i in range(PLANT_COUNT):
        link("Plant", data[i % len(data)], (rng.uniform(-7.0, 7.0), rng.uniform(-4.0, 12.0), 0.0),
             (0.0, 0.0, rng.uniform(0.0, math.tau)), rng.uniform(0.7, 1.5))
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = 3.0, math.radians(2.0)
    place(bpy.data.objects.new("Sun", sun), (0.0, 0.0, 10.0), (3.0, 4.0, 0.0))
    add_camera((0.0, -8.0, 2.8), (0.0, 0.0, 0.5), 38.0)


def prepare_million_moving(_source, _folder):
    """A million triangles that change their shape while the shutter is open."""
    empty((0.12, 0.14, 0.17))
    add_floor(30.0, (0.35, 0.33, 0.30), 0.2)
    for i in range(WAVING_BALLS):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=BALL_SEGMENTS, ring_count=BALL_RINGS, radius=0.75,
                                             location=(1.7 * (i % 4) - 2.55, 1.8 * (i // 4) - 0.5, 0.9))
        ball = bpy.context.object
        bpy.ops.object.shade_smooth()
        ball.data.materials.append(glossy(COLORS[i % 6], 0.3) if i % 2 else diffuse(COLORS[i % 6]))
        ball.shape_key_add(name="Basis")
        waved = ball.shape_key_add(name="Waved")
        for point, vertex in zip(waved.data, ball.data.vertices):
            point.co = vertex.co * (1.0 + 0.08 * math.sin(12.0 * vertex.co.z + i)) + Vector((0.2, 0.0, 0.1))
        for frame, value in ((0, 0.0), (2, 1.0)):
            waved.value = value
            waved.keyframe_insert("value", frame=frame)
    animate(bpy.data.objects["Floor"], "location", {0: (0.0, 0.0, 0.0), 2: (0.0, 0.0, 0.0)})
    lamps(7.0)
    add_camera((0.0, -8.0, 3.0), (0.0, 0.3, 0.7), 40.0)


# Read from a file ------------------------------------------------------------------------------

def prepare_lost_empire(source, _folder):
    """M. McGuire's city of blocks by daylight."""
    empty((0.30, 0.36, 0.45))
    with tempfile.TemporaryDirectory() as folder:
        with zipfile.ZipFile(source) as archive:
            archive.extractall(folder)
        obj = str(next(pathlib.Path(folder).rglob("lost_empire.obj")))
        bpy.ops.wm.obj_import(filepath=obj)
        bpy.ops.file.pack_all()
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = 3.0, math.radians(1.0)
    place(bpy.data.objects.new("Sun", sun), (0.0, 0.0, 90.0), (15.0, 20.0, 0.0))
    # Not at a whole height, in the plane of leaves: whether they hide it were left to rounding.
    add_area_light("Lamp", (0.0, 0.0, 34.5), (0.0, 0.0, 0.0), 8.0, 8000.0, (1.0, 0.85, 0.6))
    add_camera((-20.0, 0.0, 40.0), (10.0, 20.0, 8.0), 20.0)


# Name: (how it is made, shutter in frames, its file in the folder of scenes).
SCENES = {
    "many_objects": (prepare_many_objects, 0.0, None),
    "many_lights": (prepare_many_lights, 0.0, None),
    "many_glasses": (prepare_many_glasses, 0.0, None),
    "foliage": (prepare_foliage, 0.0, None),
    "million_moving": (prepare_million_moving, 0.5, None),
    "lost_empire": (prepare_lost_empire, 0.0, "04_lost_empire/lost-empire.zip"),
}
