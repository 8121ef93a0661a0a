# SPDX-License-Identifier: Apache-2.0
"""Small scenes made by script, each with one effect alone, and one that joins them all; runs inside
Blender.

What is not the effect is kept without noise: colours that shine by themselves or a sun without
extent, a pinhole camera, nothing that moves. Every scene has the edges of its objects, which are the
effect of "edges" alone. Lengths are metres, powers watts.
"""

import math
import random

from scene_blocks import (add_area_light, add_ball, add_camera, add_floor, animate, bpy, set_world,
                          Vector)

COLORS = ((0.75, 0.30, 0.12), (0.12, 0.45, 0.60), (0.70, 0.62, 0.20), (0.35, 0.55, 0.22),
          (0.55, 0.18, 0.35), (0.70, 0.70, 0.68))
BACKDROP = (0.12, 0.14, 0.17)  # where everything else shines too
SKY_WIDTH, SKY_HEIGHT = 256, 128


# Building blocks -------------------------------------------------------------------------------

def keep_from_sampling(material):
    """Leave its light to the rays that find it; the setting was another before 3.5."""
    if hasattr(material.cycles, "emission_sampling"):
        material.cycles.emission_sampling = 'NONE'
    else:
        material.cycles.sample_as_light = False


def empty(world=(0.0, 0.0, 0.0)):
    """Nothing, under a world of one colour."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    set_world(world)


def shader(name, node_type, **inputs):
    """A material of one shader; keywords are its inputs with underscores for spaces."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    node = tree.nodes.new(node_type)
    for key, value in inputs.items():
        socket = node.inputs[key.replace("_", " ")]
        socket.default_value = (*value, 1.0) if isinstance(value, tuple) else value
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def diffuse(color):
    return shader("Diffuse", "ShaderNodeBsdfDiffuse", Color=color)


def emission(color, strength=1.0):
    return shader("Emission", "ShaderNodeEmission", Color=color, Strength=strength)


def glossy(color, roughness):
    return shader("Glossy", "ShaderNodeBsdfGlossy", Color=color, Roughness=roughness)


def glass(roughness=0.0):
    return shader("Glass", "ShaderNodeBsdfGlass", Color=(0.95, 0.97, 1.0), Roughness=roughness, IOR=1.45)


def add_sun(degrees=0.0, strength=2.5):
    """A sun from the upper left front that mirrors do not show, as POV-Ray's lights."""
    data = bpy.data.lights.new("Sun", "SUN")
    data.energy, data.angle = strength, math.radians(degrees)
    sun = bpy.data.objects.new("Sun", data)
    sun.visible_glossy = False
    sun.rotation_euler = Vector((0.5, 0.7, -1.0)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(sun)


def add_sphere(location, radius, material):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=radius, location=location)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(material)
    return bpy.context.object


def add_box(location, scale, material, turn=0.0):
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=location, rotation=(0.0, 0.0, turn))
    bpy.context.object.scale = scale
    bpy.context.object.data.materials.append(material)
    return bpy.context.object


def add_table(material):
    """A floor of that material."""
    add_floor(12.0, (0.5, 0.5, 0.5), 0.5)
    bpy.data.objects["Floor"].data.materials[0] = material


def look(**lens):
    """The camera that most of the scenes have."""
    add_camera((0.0, -7.0, 2.6), (0.0, 0.0, 0.8), 45.0, **lens)


def add_things(materials):
    """Five spheres and three boxes, each with the next of the materials."""
    for i in range(5):
        add_sphere((1.4 * i - 2.8, 0.3 * (i % 2), 0.6), 0.6, materials[i % len(materials)])
    for i in range(3):
        add_box((2.2 * i - 2.2, 2.0, 0.9), (0.9, 0.6, 1.8), materials[(i + 5) % len(materials)],
                0.4 * i)


# One effect each -------------------------------------------------------------------------------

def prepare_edges(_source, _folder):
    """Thin slats, near and far, in colours that shine: only the pixel filter is sampled."""
    empty(BACKDROP)
    rng = random.Random(7)
    for i in range(90):
        at = (rng.uniform(-3.5, 3.5), rng.uniform(-2.0, 6.0), rng.uniform(-0.6, 2.4))
        slat = add_box(at, (rng.uniform(0.8, 2.5), 0.02, 0.03), emission(COLORS[i % 6]))
        slat.rotation_euler = (rng.uniform(-1.0, 1.0), rng.uniform(-1.5, 1.5), rng.uniform(-1.0, 1.0))
    look()


def prepare_defocus(_source, _folder):
    """Small bright balls before, in and behind the focus of a wide lens, and a striped floor."""
    empty(BACKDROP)
    rng = random.Random(3)
    for i in range(60):
        at = (rng.uniform(-4.0, 4.0), rng.uniform(-3.5, 8.0), rng.uniform(0.1, 2.6))
        add_sphere(at, rng.uniform(0.05, 0.25), emission(COLORS[i % 6], rng.choice((0.5, 1.0, 4.0))))
    for i in range(12):
        add_box((0.0, 1.2 * i - 4.0, -0.05), (12.0, 0.6, 0.1), emission(COLORS[i % 6], 0.3))
    look(fstop=0.12)


def prepare_motion(_source, _folder):
    """Balls that fly and boxes that turn while the shutter is open."""
    empty(BACKDROP)
    for i in range(6):
        ball = add_sphere((1.1 * i - 2.75, 0.0, 0.5 + 0.25 * i), 0.45, emission(COLORS[i]))
        animate(ball, "location", {0: Vector((-0.3, 0.0, -0.2 * (i % 3))),
                                   2: Vector((0.3, 0.0, 0.2 * (i % 3)))})
    for i in range(4):
        box = add_box((1.8 * i - 2.7, 1.8, 1.2), (1.4, 0.15, 0.3), emission(COLORS[(i + 2) % 6]))
        animate(box, "rotation_euler", {0: (0.0, -0.5 - 0.2 * i, 0.0), 2: (0.0, 0.5 + 0.2 * i, 0.0)})
    add_box((0.0, 4.0, 1.0), (14.0, 0.1, 6.0), emission((0.10, 0.12, 0.15)))
    look()


def prepare_area_light(_source, _folder):
    """Diffuse things under two square lamps: soft shadows."""
    empty()
    add_table(diffuse((0.6, 0.6, 0.58)))
    add_things([diffuse(color) for color in COLORS])
    add_area_light("Key", (-3.0, -2.5, 4.0), (0, 0, 0.5), 1.8, 420.0, (1.0, 0.93, 0.85))
    add_area_light("Rim", (3.5, 2.0, 3.0), (0, 0, 0.5), 1.0, 150.0, (0.7, 0.85, 1.0))
    look()


def prepare_gloss(_source, _folder):
    """Plates and balls of rising roughness that mirror bright stripes: no lamp is sampled."""
    empty((0.05, 0.06, 0.08))
    add_table(glossy((0.6, 0.6, 0.6), 0.12))
    add_things([glossy((0.8, 0.8, 0.8), roughness) for roughness in (0.05, 0.12, 0.2, 0.3, 0.4)])
    for i in range(9):
        stripe = emission(COLORS[i % 6], 1.5 if i % 2 else 0.2)
        keep_from_sampling(stripe)
        add_box((2.2 * i - 8.8, 6.0, 2.5), (2.2, 0.1, 6.0), stripe)
    look()


def prepare_glass(_source, _folder):
    """Balls and boxes of clear and of ground glass before bright stripes."""
    empty((0.15, 0.18, 0.22))
    add_things([glass(), glass(0.15), glass(), glass(0.3)])
    for i in range(12):
        stripe = emission(COLORS[i % 6], 1.0 if i % 2 else 0.2)
        keep_from_sampling(stripe)
        add_box((1.2 * i - 6.6, 5.0, 1.5), (1.2, 0.1, 6.0), stripe)
    look()


def sky_image():
    """A sky of a soft gradient with one small, bright sun, as an equirectangular image."""
    image = bpy.data.images.new("Sky", SKY_WIDTH, SKY_HEIGHT, float_buffer=True)
    pixels = []
    for row in range(SKY_HEIGHT):
        up = (row + 0.5) / SKY_HEIGHT
        for column in range(SKY_WIDTH):
            around = (column + 0.5) / SKY_WIDTH
            far = math.hypot((around - 0.70) * SKY_WIDTH, (up - 0.75) * SKY_HEIGHT)
            sun = 300.0 if far < 2.5 else 0.0
            blue = 0.15 + 0.5 * up
            pixels += [0.6 * blue + sun, 0.75 * blue + 0.9 * sun, blue + 0.75 * sun, 1.0]
    image.pixels.foreach_set(pixels)
    image.pack()
    return image


def prepare_environment(_source, _folder):
    """Diffuse things under an image of a sky with a small sun."""
    empty()
    tree = bpy.context.scene.world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = sky_image()
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    add_table(diffuse((0.55, 0.55, 0.55)))
    add_things([diffuse(color) for color in COLORS])
    look()


def textured(scale, node_type, base="ShaderNodeEmission"):
    """A shader whose colour is a procedural texture over the object's coordinates."""
    material = shader("Textured", base)
    tree = material.node_tree
    texture = tree.nodes.new(node_type)
    texture.inputs["Scale"].default_value = scale
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Object"], texture.inputs["Vector"])
    target = next(node for node in tree.nodes if node.bl_idname == base)
    tree.links.new(texture.outputs["Color"], target.inputs["Color"])
    return material


def prepare_texture(_source, _folder):
    """Checkers and noise finer than pixels towards the horizon, in colours that shine."""
    empty(BACKDROP)
    add_table(textured(6.0, "ShaderNodeTexChecker"))
    add_things([textured(8.0, "ShaderNodeTexChecker"), textured(12.0, "ShaderNodeTexNoise")])
    look()


# All of them -----------------------------------------------------------------------------------

def prepare_gallery(_source, _folder):
    """Glass, gloss, textures, area lights, a lens and motion in one room."""
    empty((0.06, 0.07, 0.09))
    add_floor(14.0, (0.30, 0.26, 0.22), 0.18)
    add_things([diffuse(COLORS[0]), glass(), glossy((0.8, 0.75, 0.7), 0.15),
                textured(8.0, "ShaderNodeTexChecker", "ShaderNodeBsdfDiffuse"), glass(0.15)])
    ball = add_ball("Ball", (0.9, -1.6, 0.3), 0.3, COLORS[1])
    animate(ball, "location", {0: Vector((-0.3, -0.1, 0.0)), 2: Vector((0.3, 0.1, 0.0))})
    animate(ball, "rotation_euler", {0: Vector((0.0, -1.0, 0.0)), 2: Vector((0.0, 1.0, 0.0))})
    add_box((0.0, 4.5, 2.0), (14.0, 0.1, 4.0), diffuse((0.5, 0.48, 0.45)))
    add_area_light("Key", (-3.0, -3.0, 4.2), (0, 0, 0.5), 1.6, 450.0, (1.0, 0.93, 0.85))
    add_area_light("Rim", (3.5, 2.5, 3.4), (0, 0, 0.5), 1.2, 260.0, (0.7, 0.85, 1.0))
    look(fstop=0.5, focus=(0.0, -0.4, 0.6))


# Compared with POV-Ray too ---------------------------------------------------------------------

# Materials and light that both programs have alike: a diffuse colour, a mirror beside it, one sun.
CLASSIC_PROPERTY = "classic"  # of a material: [red, green, blue, reflection]


def classic_material(color, reflection):
    """Diffuse, and an ideal mirror of that strength added."""
    material = shader("Classic", "ShaderNodeAddShader")
    tree = material.node_tree
    add = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeAddShader")
    body = tree.nodes.new("ShaderNodeBsdfDiffuse")
    body.inputs["Color"].default_value = (*color, 1.0)
    tree.links.new(body.outputs[0], add.inputs[0])
    if reflection > 0.0:
        mirror = tree.nodes.new("ShaderNodeBsdfGlossy")
        mirror.inputs["Color"].default_value = (reflection,) * 3 + (1.0,)
        mirror.inputs["Roughness"].default_value = 0.0
        tree.links.new(mirror.outputs[0], add.inputs[1])
    material[CLASSIC_PROPERTY] = [*color, reflection]
    return material


def make_classic(sun_degrees):
    empty()
    add_table(classic_material((0.5, 0.5, 0.5), 0.1))
    add_things([classic_material(color, 0.0 if i % 2 else 0.3) for i, color in enumerate(COLORS)])
    add_sun(sun_degrees)
    look()


def prepare_classic(_source, _folder):
    """Mirrors and hard shadows: what Whitted's ray tracing has."""
    make_classic(0.0)


def prepare_classic_soft(_source, _folder):
    """The same under a sun of some extent: soft shadows."""
    make_classic(6.0)


# Name: (how it is made, shutter in frames).
SCENES = {
    "edges": (prepare_edges, 0.0),
    "defocus": (prepare_defocus, 0.0),
    "motion": (prepare_motion, 1.0),
    "area_light": (prepare_area_light, 0.0),
    "gloss": (prepare_gloss, 0.0),
    "glass": (prepare_glass, 0.0),
    "environment": (prepare_environment, 0.0),
    "texture": (prepare_texture, 0.0),
    "gallery": (prepare_gallery, 0.6),
    "classic": (prepare_classic, 0.0),
    "classic_soft": (prepare_classic_soft, 0.0),
}
