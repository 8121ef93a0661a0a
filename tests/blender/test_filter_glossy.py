# SPDX-License-Identifier: Apache-2.0
"""Filter Glossy beside Cycles: what a rough floor reflects of balls whose facets it widens, mirrors and clear glass
too, and the balls of the floor. Facets of Cycles 4 keep the energy that they have without, so that they are darker;
light that scatters more than once in Cycles 3.4 is that of the wider ones."""

import compare
import pytest

SAMPLES = 512
OFF = 0.01, 0.03  # of the pass, in the mean and in a tile
# Clear glass that is made rough is rough glass, which Cycles 4 and 5 have brighter under lamps.
GLASS_OFF = 0.05, 0.3
FILTERS = {"as by default": 1.0, "strong": 10.0}
BALLS = {
    "glossy": ("ShaderNodeBsdfGlossy", {"Color": (0.9, 0.8, 0.7), "Roughness": 0.2}, {"distribution": 'MULTI_GGX'}),
    "single": ("ShaderNodeBsdfGlossy", {"Color": (0.9, 0.8, 0.7), "Roughness": 0.2}, {"distribution": 'GGX'}),
    "metal": ("ShaderNodeBsdfPrincipled", {"Base Color": (0.9, 0.6, 0.3), "Metallic": 1.0, "Roughness": 0.25}, {}),
    "mirror": ("ShaderNodeBsdfGlossy", {"Color": (0.9, 0.8, 0.7), "Roughness": 0.0}, {}),
    "glass": ("ShaderNodeBsdfGlass", {"Color": (0.9, 0.8, 0.7), "Roughness": 0.0}, {}),
    "plastic": ("ShaderNodeBsdfPrincipled", {"Base Color": (0.3, 0.2, 0.1), "Roughness": 0.3}, {}),
    "varnish": ("ShaderNodeBsdfPrincipled", {"Base Color": (0.0, 0.0, 0.0), "IOR": 2.0, "Roughness": 0.25}, {}),
}


# Inside Blender ------------------------------------------------------------------------------------

def _build(ball, strength):
    import bpy
    import scenes
    scene = scenes.empty()
    scene.cycles.blur_glossy = scene.volley.filter_glossy = strength
    scene.cycles.sample_clamp_indirect = scene.volley.clamp_indirect = 0.0
    bpy.context.view_layer.use_pass_glossy_indirect = True
    scenes.camera(location=(0.0, -5.0, 1.6), rotation=(1.3, 0.0, 0.0))
    for x, turn in ((-3.0, -0.6), (3.5, 0.8)):
        scenes.light('AREA', location=(x, -2.0, 4.0), rotation=(0.5, turn, 0.0), energy=300.0, size=2.0)
    floor = scenes.material("Floor", "ShaderNodeBsdfGlossy", {"distribution": 'GGX'}, Color=(0.8, 0.8, 0.8),
                            Roughness=0.6)
    scenes.mesh("Floor", [(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)], [(0, 1, 2, 3)], floor)
    kind, inputs, settings = BALLS[ball]
    material = scenes.material("Ball", kind, settings, **inputs)
    for x in (-1.2, 0.2, 1.4):
        scenes.sphere("Ball", 0.6, (x, 0.3 * x, 0.65), material)


def inside_balls():
    """{(ball, filter): pictures of Glossy Indirect by both engines}"""
    import scenes
    found = {}
    for ball in BALLS:
        for name, strength in FILTERS.items():
            _build(ball, strength)
            found[ball, name] = scenes.passes_by_both(["GlossInd"], SAMPLES)["GlossInd"]
    return found


# Comparison ----------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def pictures(blender_of_module):
    return blender_of_module.run(inside_balls, timeout=600)


@pytest.mark.parametrize("strength", FILTERS)
@pytest.mark.parametrize("ball", BALLS)
def test_against_cycles(pictures, ball, strength):
    ours, theirs = (side[..., :3] for side in pictures[ball, strength])
    mean, tile = compare.unexplained(ours, theirs)
    print(f"{ball}, {strength}: {mean / theirs.mean():.4f} of the mean, {tile / theirs.mean():.4f} in a tile, "
          f"{ours.mean() / theirs.mean():.4f}")
    off = GLASS_OFF if ball == "glass" else OFF
    assert mean < off[0] * theirs.mean() and tile < off[1] * theirs.mean()
