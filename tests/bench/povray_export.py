# SPDX-License-Identifier: Apache-2.0
"""Writes the open scene for POV-Ray; runs inside Blender.

    blender -b FILE.blend -P povray_export.py -- OUT.pov

Only what effect_scenes.py's "classic" scenes have: meshes whose materials have the property
"classic", one sun, a perspective camera without shift, a black world. The same triangles, with the
same normals. POV-Ray multiplies light and pigment without Blender's 1 / pi.
"""

import math
import pathlib
import sys

import bpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import effect_scenes  # noqa: E402  (the folder is on the path only now)

SUN_DISTANCE = 1e4   # metres: POV-Ray's lights of extent are somewhere
SUN_CELLS = 4        # lights along a side of the sun, jittered; pixels are supersampled besides


def vector(values):
    """POV-Ray's vectors; it is left-handed, so the camera turns its right around instead."""
    return "<" + ", ".join(f"{value:.9g}" for value in values) + ">"


def camera(scene):
    """A camera with the field of view of the frame's width."""
    placed = scene.camera
    matrix = placed.matrix_world
    aspect = scene.render.resolution_x / scene.render.resolution_y
    half = math.tan(0.5 * placed.data.angle_x)
    right, up, back = (matrix.col[i].xyz for i in range(3))
    return (f"camera {{ perspective location {vector(matrix.translation)}\n"
            f"  right {vector(right * 2.0 * half)} up {vector(up * 2.0 * half / aspect)}\n"
            f"  direction {vector(-back)} }}\n")


def sun(light):
    """A parallel light, or a round one of the sun's angle far away."""
    matrix, data = light.matrix_world, light.data
    direction = matrix.col[2].xyz.normalized()
    color = vector(data.energy / math.pi * channel for channel in data.color)
    at = vector(direction * SUN_DISTANCE)
    if data.angle == 0.0:
        return f"light_source {{ {at} color rgb {color} parallel point_at <0, 0, 0> }}\n"
    size = 2.0 * math.tan(0.5 * data.angle) * SUN_DISTANCE
    x, y = (matrix.col[i].xyz.normalized() * size for i in range(2))
    return (f"light_source {{ {at} color rgb {color} area_light {vector(x)}, {vector(y)}, "
            f"{SUN_CELLS}, {SUN_CELLS} adaptive 1 jitter circular orient }}\n")


def mesh(placed, depsgraph):
    """All triangles of an object, in world space, with the normals of their corners."""
    evaluated = placed.evaluated_get(depsgraph)
    data = evaluated.to_mesh()
    data.calc_normals_split()
    data.calc_loop_triangles()
    matrix = evaluated.matrix_world
    turn = matrix.to_3x3().inverted().transposed()
    lines = ["mesh {"]
    for triangle in data.loop_triangles:
        corners = [matrix @ data.vertices[v].co for v in triangle.vertices]
        normals = [(turn @ data.loops[loop].normal).normalized() for loop in triangle.loops]
        lines.append("smooth_triangle { " + ", ".join(
            f"{vector(p)}, {vector(n)}" for p, n in zip(corners, normals)) + " }")
    red, green, blue, reflection = placed.material_slots[0].material[effect_scenes.CLASSIC_PROPERTY]
    lines.append(f"pigment {{ color rgb {vector((red, green, blue))} }} "
                 f"finish {{ ambient 0 diffuse 1 reflection {{ {reflection:.9g} }} }} }}\n")
    evaluated.to_mesh_clear()
    return "\n".join(lines)


def main():
    """Write the file that is named after ``--``."""
    output = pathlib.Path(sys.argv[sys.argv.index("--") + 1])
    scene, depsgraph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
    parts = ["#version 3.7;\nglobal_settings { assumed_gamma 1.0 max_trace_level 50 }\n"
             "background { color rgb <0, 0, 0> }\n", camera(scene)]
    for placed in scene.objects:
        if placed.type == "LIGHT":
            parts.append(sun(placed))
        elif placed.type == "MESH":
            parts.append(mesh(placed, depsgraph))
    output.write_text("".join(parts), encoding="utf-8")


main()
