# SPDX-License-Identifier: Apache-2.0
"""Balls of point clouds beside Cycles: in clouds that are stretched, lit, mirrored and in the shadow of each other, and
such that light goes through, each of which shadow rays meet once. The table goes to results/balls.txt of the
build."""

import blender as blender_support
import compare
import pytest

SIZE, SAMPLES = (64, 48), 64
MEAN, TILE = 2e-3, 0.01  # of the picture's mean; .015 and .12 in 5.2 by the normals of ellipsoids alone
GREY = (0.6, 0.5, 0.4)
CASES = {  # shader, inputs, the cloud's scale, radius of the balls
    "lit": ("ShaderNodeBsdfDiffuse", {"Color": GREY}, (1.0, 0.5, 0.7), 0.5),
    "rough": ("ShaderNodeBsdfGlossy", {"Color": GREY, "Roughness": 0.5}, (0.5, 1.0, 0.8), 0.5),
    "clear": ("ShaderNodeBsdfTransparent", {"Color": GREY}, (1.0, 1.0, 1.0), 0.5),
    "half clear": ("ShaderNodeBsdfPrincipled", {"Base Color": GREY, "Alpha": 0.5}, (0.8, 0.8, 0.8), 0.5),
}


# Inside Blender ------------------------------------------------------------------------------------

def inside_pictures():
    """{case: (pictures by Volley, by Cycles)}."""
    import numpy as np
    import scenes
    pictures = {}
    for name, (shader, inputs, scale, radius) in CASES.items():
        scenes.empty(size=SIZE, samples=SAMPLES)
        scenes.camera(location=(0.0, -8.0, 0.0))
        white = scenes.material("White", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.8, 0.8))
        scenes.wall("Wall", size=12.0, y=3.0, material=white)
        rng = np.random.RandomState(5)
        cloud = scenes.mesh("Cloud", [tuple(place) for place in rng.uniform(-1.3, 1.3, (12, 3))], [])
        points, assign = scenes.geometry_nodes(cloud, "GeometryNodeMeshToPoints", "GeometryNodeSetMaterial")
        points.inputs["Radius"].default_value = radius
        assign.inputs["Material"].default_value = scenes.material("Ball", shader, **inputs)
        cloud.rotation_euler, cloud.scale = (0.3, 0.5, 0.7), scale
        scenes.light('SUN', rotation=(1.1, 0.3, 0.2), energy=3.0).data.angle = 0.02
        pictures[name] = scenes.seeds_by_both(SAMPLES)
    return pictures


# Comparison ----------------------------------------------------------------------------------------

@pytest.mark.skipif(blender_support.version() < (5, 0), reason="balls as Cycles has had them from 5.0 on")
def test_balls_like_cycles(blender):
    found, lines = compare.errors_of_cases(blender.run(inside_pictures))
    print("\n".join(lines))
    blender_support.write_result("balls", lines, compare.largest_errors(found))
    for name, (mean, biased, tile) in found.items():
        assert biased <= MEAN and tile <= TILE, f"{name}: {mean:.2%} {biased:.2%} {tile:.2%}"
