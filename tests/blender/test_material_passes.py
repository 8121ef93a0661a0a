# SPDX-License-Identifier: Apache-2.0
"""Colours of single materials, in passes and for denoisers, against Cycles'."""

import compare
import numpy as np
import pytest

SAMPLES = 64
OFF = 3e-3, 8e-3
PASSES = "DiffCol", "TransCol", "Denoising Albedo"
BASE = (0.8, 0.5, 0.2)
# ShaderNodeBsdf..., settings and inputs. Multiscatter glass of Blender 3.4 is one closure, all transmission and, of
# Principled, white: with its lobes' colours instead it was 50 % darker, in the albedo of Glass 13 %. Its sheen was 20
# times as bright in the albedo, which has it by the angle.
MATERIALS = {
    "glass": ("Glass", {"distribution": 'MULTI_GGX'}, {"Color": BASE, "Roughness": 0.6}),
    "principled glass": ("Principled", {"distribution": 'MULTI_GGX'}, {
        "Base Color": BASE, "Roughness": 0.6, "Transmission": 1.0}),
    "sheen": ("Principled", {}, {"Base Color": BASE, "Specular": 0.0, "Roughness": 0.6, "Sheen": 1.0})}


def inside(material):
    """{pass: pictures by both} of a ball in the dark."""
    import bpy
    import scenes
    node, settings, inputs = material
    scenes.empty(size=(32, 24))
    scenes.camera()
    scenes.sphere(material=scenes.material("Seen", f"ShaderNodeBsdf{node}", settings, **inputs))
    layer = bpy.context.view_layer
    layer.use_pass_diffuse_color = layer.use_pass_transmission_color = True
    layer.volley.denoising_store_passes = layer.cycles.denoising_store_passes = True
    return scenes.passes_by_both(PASSES, SAMPLES)


@pytest.mark.parametrize("material", MATERIALS)
def test_colours(blender, material):
    for name, (ours, theirs) in blender.run(inside, MATERIALS[material]).items():
        ours, theirs = ours[..., :3], theirs[..., :3]
        assert np.all(compare.unexplained(ours, theirs) <= np.array(OFF)), name
