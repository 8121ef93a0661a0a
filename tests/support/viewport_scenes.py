# SPDX-License-Identifier: Apache-2.0
"""Scenes to pose and edit in a viewport: a field of objects, and a skinned character."""

import math

import bpy
import numpy as np

import scenes

SIDE = 32                # objects in a row of the field
OBJECT_COUNT = 1000
CHARACTER_RINGS, CHARACTER_SIDES, CHARACTER_BONES = 300, 100, 10
POSED_BONE = 4           # whose turn moves the upper half of the character
SWING = 0.3              # radians


def grid(name, cells, material):
    """A bumpy square of cells * cells quads."""
    line = np.linspace(-0.4, 0.4, cells + 1)
    x, y = np.meshgrid(line, line)
    z = 0.05 * np.sin(20.0 * x) * np.cos(20.0 * y)
    corner = np.arange(cells * (cells + 1)).reshape(cells, cells + 1)[:, :-1].ravel()
    faces = np.stack([corner, corner + 1, corner + cells + 2, corner + cells + 1], axis=1)
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    return scenes.mesh(name, points.tolist(), faces.tolist(), material, smooth=True)


def fill_field(cells, count=OBJECT_COUNT):
    """So many grids of cells * cells quads; a bone poses the first."""
    bpy.context.scene.world.use_nodes = True
    materials = [scenes.material(f"Material{i}", "ShaderNodeBsdfDiffuse") for i in range(10)]
    for i in range(count):
        made = grid(f"Object{i}", cells, materials[i % len(materials)])
        made.location = (i % SIDE - SIDE / 2, i // SIDE - SIDE / 2, 0.0)
    add_rig(bpy.data.objects["Object0"], 1, 1.0)
    scenes.light('AREA', (0.0, 0.0, 20.0), (0.0, 0.0, 0.0), energy=2000.0, size=4.0)
    scenes.camera((0.0, -28.0, 20.0), (math.radians(55), 0.0, 0.0))


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


def fill_character(rings=CHARACTER_RINGS):
    """A skinned column of 60,000 triangles, or of rings times 200, under an area light, over a reflecting
    floor."""
    turn = np.linspace(0.0, 2.0 * math.pi, CHARACTER_SIDES, endpoint=False)
    z = np.linspace(0.0, 3.0, rings + 1)[:, None]
    radius = 0.5 + 0.1 * np.sin(5.0 * z)
    points = np.stack(np.broadcast_arrays(radius * np.cos(turn), radius * np.sin(turn), z), axis=-1)
    faces = [(r * CHARACTER_SIDES + s, r * CHARACTER_SIDES + (s + 1) % CHARACTER_SIDES,
              (r + 1) * CHARACTER_SIDES + (s + 1) % CHARACTER_SIDES, (r + 1) * CHARACTER_SIDES + s)
             for r in range(rings) for s in range(CHARACTER_SIDES)]
    skin = scenes.material("Skin", "ShaderNodeBsdfDiffuse", Color=(0.7, 0.4, 0.3))
    character = scenes.mesh("Character", points.reshape(-1, 3).tolist(), faces, skin, smooth=True)
    add_rig(character, CHARACTER_BONES, 3.0)
    floor = scenes.material("Floor", "ShaderNodeBsdfPrincipled", Roughness=0.15)
    scenes.mesh("Floor", [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [(0, 1, 2, 3)], floor)
    scenes.light('AREA', (2.0, -3.0, 5.0), (0.5, 0.3, 0.0), energy=500.0, size=1.5)
    scenes.camera((0.0, -7.0, 2.5), (math.radians(80), 0.0, 0.0))


def pose(step):
    """Turn the rig's bone to the pose of that number; no two in a row are alike."""
    bones = bpy.data.objects["Rig"].pose.bones
    bone = bones[min(POSED_BONE, len(bones) - 1)]
    bone.rotation_mode = 'XYZ'
    bone.rotation_euler.z = SWING * math.sin(step + 1.0)
