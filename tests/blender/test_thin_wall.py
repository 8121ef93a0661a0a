# SPDX-License-Identifier: Apache-2.0
"""Principled's Thin Wall of Blender 5.2 beside Cycles: panes and a ball of it before a patterned wall and over
a floor that they shade, and in a mirror. Means and tiles within 1 %, beyond what noise explains. The table goes
to results/thin_wall.txt of the build."""

import blender as blender_support
import compare
import pytest

SINCE = (5, 2), "Thin Wall came with 5.2"
SIZE = (64, 48)
SEEDS = (71, 72, 73, 74)
SAMPLES = 64
TOLERANCE = 0.01  # relative to the mean of the picture

_GLASS = {"Transmission Weight": 1.0, "Base Color": (1.0, 1.0, 1.0, 1.0), "Roughness": 0.0}
CASES = {
    "clear": _GLASS,
    "coloured": {**_GLASS, "Base Color": (0.9, 0.6, 0.2, 1.0)},
    "dense": {**_GLASS, "IOR": 2.2, "Specular Tint": (0.9, 0.6, 0.5, 1.0)},
    "rough": {**_GLASS, "Roughness": 0.4, "Base Color": (0.5, 0.8, 0.9, 1.0)},
    "very rough": {**_GLASS, "Roughness": 0.8, "IOR": 1.8},
    "film": {**_GLASS, "Thin Film Thickness": 350.0, "Thin Film IOR": 1.8},
    "half": {**_GLASS, "Transmission Weight": 0.5, "Base Color": (0.8, 0.4, 0.3, 1.0), "Roughness": 0.3},
    "in part": {**_GLASS, "Alpha": 0.6, "Coat Weight": 0.5, "Roughness": 0.2},
    "not glass": {"Base Color": (0.8, 0.4, 0.3, 1.0)},
}


# Inside Blender ------------------------------------------------------------------------------------

def build(inputs):
    import scenes
    scene = scenes.empty(size=SIZE)
    scenes.camera(location=(0.0, -7.0, 2.0), rotation=(1.4, 0.0, 0.0))
    scenes.light_world((0.3, 0.35, 0.4))
    scenes.light('POINT', location=(2.0, -3.5, 4.0), energy=500.0, shadow_soft_size=0.4)
    glass = scenes.material("Glass", "ShaderNodeBsdfPrincipled")
    shader = scenes.shader_of(glass)
    shader.inputs["Thin Wall"].default_value = True
    for name, value in inputs.items():
        shader.inputs[name].default_value = value
    grey = scenes.material("Grey", "ShaderNodeBsdfDiffuse", Color=(0.6, 0.5, 0.4))
    scenes.mesh("Floor", [(-6, -6, 0), (6, -6, 0), (6, 6, 0), (-6, 6, 0)], [(0, 1, 2, 3)], grey)
    for i in range(5):
        scenes.wall(f"Stripe {i}", size=0.5, y=2.5, center=(1.2 * i - 2.4, 1.5),
                    material=scenes.emitter((0.2 + 0.2 * i, 0.8, 1.0 - 0.2 * i)))
    scenes.mesh("Mirror", [(-3, 3, 0), (3, 3, 0), (3, 3, 4), (-3, 3, 4)], [(0, 1, 2, 3)],
                scenes.material("Mirror", "ShaderNodeBsdfGlossy", Color=(0.8, 0.8, 0.8), Roughness=0.0))
    for x, turn in ((-1.6, 0.5), (0.0, -0.2)):
        pane = scenes.wall("Pane", size=1.5, y=0.0, center=(0.0, 1.0), material=glass)
        pane.location.x, pane.rotation_euler = x, (0.15, 0.0, turn)
    scenes.sphere("Ball", 0.8, (1.7, 0.0, 0.9), glass)


def inside_pictures(names):
    """{case: (pictures by Volley, pictures by Cycles)}, one for each seed."""
    import scenes
    pictures = {}
    for name in names:
        build(CASES[name])
        pictures[name] = scenes.seeds_by_both(SAMPLES * len(SEEDS), SEEDS)
    return pictures


def inside_linked():
    """What a render says of a Thin Wall that something is linked to."""
    import scenes
    import volley.session
    told = []
    volley.session.report_warning = lambda _engine, message: told.append(message)
    scenes.empty(size=(16, 16))
    scenes.camera()
    glass = scenes.material("Glass", "ShaderNodeBsdfPrincipled")
    tree = glass.node_tree
    tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"],
                   scenes.shader_of(glass).inputs["Thin Wall"])
    scenes.wall(material=glass)
    scenes.render()
    return told


# Comparison ----------------------------------------------------------------------------------------

pytestmark = pytest.mark.since(*SINCE)


@pytest.fixture(scope="module")
def errors(blender_of_module):
    """The errors of all cases, from one Blender, and their table."""
    if blender_support.version() < SINCE[0]:
        pytest.skip(SINCE[1])
    found, lines = compare.errors_of_cases(blender_of_module.run(inside_pictures, list(CASES), timeout=600))
    blender_support.write_result("thin_wall", lines, compare.largest_errors(found))
    return found


@pytest.mark.parametrize("name", CASES)
def test_against_cycles(errors, name):
    _mean, biased, tile = errors[name]
    assert biased < TOLERANCE
    assert tile < TOLERANCE


def test_linked_ones_are_named(blender):
    if blender_support.version() < SINCE[0]:
        pytest.skip(SINCE[1])
    assert any("Thin Wall that is linked" in each for each in blender.run(inside_linked))
