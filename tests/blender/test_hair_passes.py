# SPDX-License-Identifier: Apache-2.0
"""Passes of light, colour and features that hair has, against Cycles'."""

import blender as blender_support
import compare
import numpy as np

SAMPLES = 64
COLORS = {'COLOR': {"Color": (0.05, 0.2, 0.4), "Roughness": 0.6}, 'MELANIN': {"Melanin": 0.5}}
# Beyond the noise that the seeds show, of pictures' means and of tiles'.
OFF = 2e-3, 0.02
NORMAL_OFF = 5e-4, 0.01
SUM_TOLERANCE = 1e-5


def inside_hair():
    """{(model, parametrization, light): {pass: both}} of a ball of Principled Hair before a lamp, or an even world,
    of which rays that go on find the most."""
    import bpy
    import compare
    import scenes
    found = {}
    for model in ('CHIANG', 'HUANG'):
        settings = {"model": model}
        if not scenes.has_node("ShaderNodeBsdfHairPrincipled", settings=settings):
            if model == 'HUANG':
                continue
            settings = {}
        for parametrization, inputs in COLORS.items():
            for light in ("lamp", "world"):
                scene = scenes.empty(size=(32, 24))
                scenes.camera()
                if light == "world":
                    scenes.world_color(scene.world, (0.5, 0.6, 0.7))
                scenes.sphere(material=scenes.material("Hair", "ShaderNodeBsdfHairPrincipled",
                                                       {**settings, "parametrization": parametrization}, **inputs))
                if light == "lamp":
                    scenes.light(energy=500.0)
                layer = bpy.context.view_layer
                scenes.show_light(layer)
                layer.volley.denoising_store_passes = layer.cycles.denoising_store_passes = True
                found[model, parametrization, light] = scenes.passes_by_both(
                    ["Combined", "Denoising Normal", *compare.LIGHT_PASSES], SAMPLES)
    return found


def _agree(both, case, name, off=OFF):
    ours, theirs = (picture[..., :3] for picture in both)
    assert theirs.any(), (case, name)
    assert all(a <= b for a, b in zip(compare.unexplained(ours, theirs), off)), (case, name)


def test_hair(blender):
    """All light that fibres scatter is reflection. Blender 3.4 has its colour in the passes of transmission, too, and
    tilts scales in another way."""
    for case, both in blender.run(inside_hair, timeout=600).items():
        _agree(both["GlossCol"], case, "GlossCol")
        _agree(both["Denoising Normal"], case, "Denoising Normal", NORMAL_OFF)
        if blender_support.version() >= (4, 0):
            for name in ("GlossDir", "GlossInd"):
                _agree(both[name], case, name)
        ours = {name: pictures[0][..., :3] for name, pictures in both.items()}  # by seed
        assert np.abs(compare.light_sum(ours) - ours["Combined"]).max() <= SUM_TOLERANCE, case
