# SPDX-License-Identifier: Apache-2.0
"""Scenes of hair, fur and grass, made by script; runs inside Blender.

All strands are particle hair, which Blender 3.4 to 5 read alike. Lengths are metres, powers watts.
"""

import math
import random

from scene_blocks import add_area_light, add_camera, add_floor, bpy, scenes, set_world, Vector

KEY_STEPS = 3  # 9 keys a strand
HEAD_PARENTS, HEAD_CHILDREN = 1000, 100
FUR_PARENTS, FUR_CHILDREN = 2000, 40
PATCH_BLADES, PATCH_EDGE = 1500, 1.0
FIELD_EDGE = 24        # patches along a side
STRIDE = 0.55          # radians that legs swing to each side within two frames


def prepare_head(_source, _folder):
    """A head with 100,000 waved strands of melanin between two lamps."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    set_world((0.08, 0.09, 0.11))
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24, radius=1.0)
    head = bpy.context.object
    head.scale = (0.78, 0.92, 1.05)
    bpy.ops.object.shade_smooth()
    hair = add_hair(head, plain((0.55, 0.36, 0.27)), strand_material(melanin=0.55), HEAD_PARENTS)
    group = head.vertex_groups.new(name="Scalp")
    group.add([v.index for v in head.data.vertices if v.co.z > -0.35 and v.co.z - 0.9 * v.co.y > -0.15], 1.0,
              'REPLACE')
    head.particle_systems[0].vertex_group_density = "Scalp"
    settings = hair.settings
    settings.hair_length, settings.tangent_factor, settings.object_align_factor = 0.9, 0.15, (0.0, 0.1, -0.3)
    settings.child_type, settings.rendered_child_count = 'INTERPOLATED', HEAD_CHILDREN
    settings.clump_factor, settings.roughness_2 = 0.3, 0.04
    settings.kink, settings.kink_amplitude, settings.kink_frequency = 'WAVE', 0.06, 3.0
    settings.root_radius, settings.tip_radius, settings.radius_scale = 1.0, 0.3, 0.006
    add_area_light("Key", (-2.5, -3.5, 3.0), (0.0, 0.0, 0.0), 1.2, 260.0, (1.0, 0.94, 0.86))
    add_area_light("Rim", (2.5, 3.0, 2.0), (0.0, 0.0, 0.2), 1.0, 320.0, (0.75, 0.87, 1.0))
    add_camera((0.8, -7.6, 0.7), (0.0, 0.0, -0.35), 50.0)


def prepare_fur(_source, _folder):
    """An animal that runs, furred all over; its legs swing while the shutter is open."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    set_world((0.25, 0.28, 0.32))
    add_floor(20.0, (0.30, 0.27, 0.22), 0.6)
    animal = add_animal()
    settings = add_hair(animal, plain((0.25, 0.16, 0.10)), strand_material(melanin=0.35), FUR_PARENTS).settings
    settings.hair_length, settings.object_align_factor = 0.16, (-0.05, 0.0, -0.03)
    settings.child_type, settings.rendered_child_count = 'INTERPOLATED', FUR_CHILDREN
    settings.clump_factor, settings.roughness_2 = 0.5, 0.03
    settings.root_radius, settings.tip_radius, settings.radius_scale = 1.0, 0.2, 0.008
    add_area_light("Key", (-2.0, -4.0, 4.5), (0.0, 0.0, 0.9), 1.6, 500.0, (1.0, 0.94, 0.86))
    add_area_light("Rim", (3.0, 3.0, 3.5), (0.0, 0.0, 0.9), 1.2, 380.0, (0.75, 0.87, 1.0))
    add_camera((1.6, -5.6, 1.7), (0.1, 0.0, 0.85), 50.0)


def prepare_grass(_source, _folder):
    """A meadow under a low sun: one patch of blades, instanced, turned and scaled."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    set_world((0.30, 0.38, 0.50))
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=4, y_subdivisions=4, size=PATCH_EDGE)
    patch = bpy.context.object
    blades = two_sided((0.16, 0.30, 0.05), (0.20, 0.34, 0.04))
    settings = add_hair(patch, plain((0.10, 0.08, 0.05)), blades, PATCH_BLADES).settings
    settings.hair_length, settings.length_random, settings.factor_random = 0.35, 0.4, 0.05
    settings.object_align_factor = (0.03, 0.02, 0.0)
    settings.root_radius, settings.tip_radius, settings.radius_scale = 1.0, 0.1, 0.012
    group = bpy.data.collections.new("Patch")
    group.objects.link(patch)
    bpy.context.scene.collection.objects.unlink(patch)
    rng = random.Random(5)
    for i in range(FIELD_EDGE * FIELD_EDGE):
        x, y = i % FIELD_EDGE - 0.5 * FIELD_EDGE, i // FIELD_EDGE - 2.0
        placed = bpy.data.objects.new("Patch", None)
        placed.instance_type, placed.instance_collection = 'COLLECTION', group
        placed.location = (PATCH_EDGE * x, PATCH_EDGE * y, 0.3 * math.sin(0.5 * x) * math.sin(0.4 * y))
        placed.rotation_euler.z = 0.5 * math.pi * rng.randrange(4)
        placed.scale.z = rng.uniform(0.7, 1.3)
        bpy.context.scene.collection.objects.link(placed)
    data = bpy.data.lights.new("Sun", "SUN")
    data.energy, data.angle = 3.0, math.radians(2.0)
    sun = bpy.data.objects.new("Sun", data)
    sun.rotation_euler = Vector((0.7, 0.3, -0.6)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(sun)
    add_camera((0.0, -4.5, 1.6), (0.0, 3.0, 0.0), 40.0)


# Parts ------------------------------------------------------------------------------------------

def add_hair(skin, skin_material, hair_material, parents):
    """Straight hair on an object; returns its particle system."""
    skin.data.materials.append(skin_material)
    skin.data.materials.append(hair_material)
    skin.modifiers.new("Hair", 'PARTICLE_SYSTEM')
    hair = skin.particle_systems[0]
    settings = hair.settings
    settings.type, settings.count, settings.material = 'HAIR', parents, 2
    settings.use_advanced_hair = True
    settings.render_step = KEY_STEPS
    return hair


def material_of(name, node_type):
    """A material of one shader: itself and its shader."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new(node_type)
    tree.links.new(shader.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return made, shader


def plain(color):
    made, shader = material_of("Skin", "ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*color, 1.0)
    return made


def strand_material(melanin):
    """Principled Hair by its melanin; Chiang's where there are several models."""
    made, shader = material_of("Hair", "ShaderNodeBsdfHairPrincipled")
    if hasattr(shader, "model"):
        shader.model = 'CHIANG'
    shader.parametrization = 'MELANIN'
    shader.inputs["Melanin"].default_value = melanin
    shader.inputs["Random Color"].default_value = 0.15
    return made


def two_sided(reflected, through):
    """Leaves: diffuse, and as much light from behind."""
    made, mix = material_of("Blades", "ShaderNodeMixShader")
    for node_type, color, socket in (("ShaderNodeBsdfDiffuse", reflected, 1),
                                     ("ShaderNodeBsdfTranslucent", through, 2)):
        shader = made.node_tree.nodes.new(node_type)
        shader.inputs["Color"].default_value = (*color, 1.0)
        made.node_tree.links.new(shader.outputs[0], mix.inputs[socket])
    return made


def add_animal():
    """A four-legged body in one mesh, running along +X from frame 0 to 2."""
    data = bpy.data.metaballs.new("Animal")
    data.resolution = data.render_resolution = 0.07
    parts = [((0.0, 0.0, 1.0), 0.50), ((-0.45, 0.0, 1.0), 0.46), ((0.45, 0.0, 1.02), 0.48),
             ((0.85, 0.0, 1.35), 0.34), ((1.05, 0.0, 1.55), 0.36), ((1.30, 0.0, 1.50), 0.24),
             ((-0.85, 0.0, 1.15), 0.22), ((-1.05, 0.0, 1.35), 0.18),
             ((1.0, -0.16, 1.78), 0.16), ((1.0, 0.16, 1.78), 0.16)]
    parts += [((0.5 * x, 0.22 * y, 0.12 * step + 0.12), 0.2) for x in (-1, 1) for y in (-1, 1) for step in range(6)]
    for place, radius in parts:
        ball = data.elements.new()
        ball.co, ball.radius = place, radius
    made = bpy.data.objects.new("Animal", data)
    bpy.context.scene.collection.objects.link(made)
    bpy.context.view_layer.objects.active = made
    made.select_set(True)
    bpy.ops.object.convert(target='MESH')
    made = bpy.context.object
    bpy.ops.object.shade_smooth()
    swing(made)
    return made


def swing(animal):
    """Legs that swing about the hips and a body that goes forwards."""
    animal.shape_key_add(name="Basis")
    key = animal.shape_key_add(name="Stride")
    for vertex, point in zip(animal.data.vertices, key.data):
        x, y, z = vertex.co
        down = min(max((1.0 - z) / 0.9, 0.0), 1.0)
        angle = STRIDE * down * math.copysign(1.0, x * y)
        hip = math.copysign(0.5, x)
        point.co = (hip + (x - hip) * math.cos(angle) - (z - 1.0) * math.sin(angle) + 0.12, y,
                    1.0 + (z - 1.0) * math.cos(angle) + (x - hip) * math.sin(angle))
    key.slider_min = -1.0
    for frame, value in ((0, -1.0), (2, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    for curve in scenes.curves(animal.data.shape_keys):
        for point in curve.keyframe_points:
            point.interpolation = 'LINEAR'


# Name: (how it is made, shutter in frames).
SCENES = {
    "hair_head": (prepare_head, 0.0),
    "hair_fur": (prepare_fur, 0.5),
    "hair_grass": (prepare_grass, 0.0),
}
