# SPDX-License-Identifier: Apache-2.0
"""Building blocks of scenes for comparing engines; runs inside Blender. Lengths are metres, powers
watts."""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
try:
    import bpy
    import scenes
    from mathutils import Vector
except ImportError:  # outside Blender only the table of scenes is of use
    bpy = Vector = scenes = None


def add_area_light(name, location, target, size, power, color=(1.0, 1.0, 1.0)):
    """A square area light of edge ``size``."""
    data = bpy.data.lights.new(name, "AREA")
    data.size, data.energy, data.color = size, power, color
    return place(bpy.data.objects.new(name, data), location, target)


def add_camera(location, target, lens_mm, fstop=None, focus=None):
    """The scene's camera; with ``fstop`` it focuses on the point ``focus`` or the target."""
    data = bpy.data.cameras.new("Camera")
    data.lens = lens_mm
    data.dof.use_dof = fstop is not None
    if fstop is not None:
        data.dof.aperture_fstop = fstop
        data.dof.focus_distance = (Vector(focus or target) - Vector(location)).length
    camera = place(bpy.data.objects.new("Camera", data), location, target)
    bpy.context.scene.camera = camera
    return camera


def place(added, location, target):
    """Link an object at ``location`` with its -Z towards ``target`` and Y up."""
    added.location = location
    direction = Vector(target) - Vector(location)
    added.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(added)
    return added


def add_floor(size, color, roughness):
    """A square Principled floor of edge ``size`` at z = 0."""
    half = 0.5 * size
    mesh = bpy.data.meshes.new("Floor")
    mesh.from_pydata([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [],
                     [(0, 1, 2, 3)])
    material = bpy.data.materials.new("Floor")
    material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    shader.inputs["Roughness"].default_value = roughness
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Floor", mesh))


def set_world(color):
    """A constant world."""
    world = bpy.data.worlds.new("Comparison world")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (*color, 1.0)
    bpy.context.scene.world = world


def pose_from_action(armature_name, action_name, frame):
    """Play one action on an armature, alone, and go to ``frame``."""
    armature = bpy.data.objects[armature_name]
    animation = armature.animation_data or armature.animation_data_create()
    animation.use_nla = False
    animation.action = bpy.data.actions[action_name]
    bpy.context.scene.frame_set(frame)


def open_blend(path):
    """Open a .blend file without its user interface."""
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)


def add_ball(name, location, radius, color):
    """A polished ball with a pale band, so that rolling shows."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24, radius=radius,
                                         location=location)
    ball = bpy.context.object
    ball.name = name
    bpy.ops.object.shade_smooth()
    for slot_color in (color, (0.8, 0.75, 0.65)):
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        shader = material.node_tree.nodes["Principled BSDF"]
        shader.inputs["Base Color"].default_value = (*slot_color, 1.0)
        shader.inputs["Roughness"].default_value = 0.15
        ball.data.materials.append(material)
    for polygon in ball.data.polygons:
        polygon.material_index = abs(polygon.center.y) < 0.3 * radius
    return ball


def animate(moved, path, offsets):
    """Key a property at frames, each ``offsets[frame]`` off its value, linear in between."""
    rest = getattr(moved, path).copy()
    for frame, offset in offsets.items():
        setattr(moved, path, tuple(r + o for r, o in zip(rest, offset)))
        moved.keyframe_insert(path, frame=frame)
    for curve in scenes.curves(moved):
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
