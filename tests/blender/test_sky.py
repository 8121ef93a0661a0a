# SPDX-License-Identifier: Apache-2.0
"""The Sky Texture against Cycles': what the camera sees of it, and what it lights."""

import math

import numpy as np
import pytest

TOLERANCE = 0.01  # at the steepest gradients, where samples lie 1e-2 pixels apart
FITTED = 0.02, 0.009  # of a pixel and of a mean, where coefficients are fits
DARKEST = 2e-3    # maximum of a sky that says something: those of Hosek and Wilkie are dark
SAMPLES = 256

_NISHITA = {"sky_type": 'NISHITA', "sun_disc": False, "sun_elevation": math.radians(15.0)}
_MULTIPLE = {**_NISHITA, "sky_type": 'MULTIPLE_SCATTERING'}
SKIES = {
    "Nishita": _NISHITA,
    "Nishita, low": {**_NISHITA, "sun_elevation": math.radians(1.0), "sun_rotation": 0.2},
    "Nishita, set": {**_NISHITA, "sun_elevation": math.radians(-3.0)},
    "Nishita, from above": {**_NISHITA, "altitude": 4000.0, "ozone_density": 4.0},
    "Nishita, hazy": {**_NISHITA, "air_density": 2.0, "dust_density": 5.0, "ozone_density": 0.0},
    "Nishita, sun": {**_NISHITA, "sun_disc": True, "sun_size": 0.2, "sun_intensity": 0.5},
    "Nishita, half a sun": {**_NISHITA, "sun_disc": True, "sun_size": 0.4, "sun_elevation": 0.1},
    "multiple": {**_MULTIPLE},
    "multiple, low": {**_MULTIPLE, "sun_elevation": math.radians(1.0), "sun_rotation": 0.2},
    "multiple, set": {**_MULTIPLE, "sun_elevation": math.radians(-3.0)},
    "multiple, from above": {**_MULTIPLE, "altitude": 4000.0, "ozone_density": 4.0},
    "multiple, hazy": {**_MULTIPLE, "air_density": 2.0, "dust_density": 5.0, "ozone_density": 0.0},
    "multiple, sun": {**_MULTIPLE, "sun_disc": True, "sun_size": 0.2, "sun_intensity": 0.5},
    "multiple, half a sun": {**_MULTIPLE, "sun_disc": True, "sun_size": 0.4, "sun_elevation": 0.1},
    "Preetham": {"sky_type": 'PREETHAM', "sun_direction": (0.2, 0.9, 0.3), "turbidity": 3.0},
    "Preetham, low": {"sky_type": 'PREETHAM', "sun_direction": (0.2, 0.9, 0.02), "turbidity": 8.0},
    "Hosek": {"sky_type": 'HOSEK_WILKIE', "sun_direction": (0.2, 0.9, 0.5)},
    "Hosek, hazy over snow": {"sky_type": 'HOSEK_WILKIE', "sun_direction": (0.2, 0.9, 1.5), "turbidity": 5.4,
                              "ground_albedo": 0.8},
    "Hosek, low": {"sky_type": 'HOSEK_WILKIE', "sun_direction": (0.2, 0.9, 0.02), "turbidity": 1.3},
    "Hosek, set": {"sky_type": 'HOSEK_WILKIE', "sun_direction": (0.2, 0.9, -0.2), "turbidity": 3.0},
}


def _sky(**settings):
    """The scene's world made of a sky."""
    import bpy
    world = bpy.context.scene.world
    world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    sky = tree.nodes.new("ShaderNodeTexSky")
    has_multiple = _has_multiple(sky)
    if has_multiple and settings["sky_type"] == 'NISHITA':
        settings["sky_type"] = 'SINGLE_SCATTERING'
    for name, value in settings.items():
        setattr(sky, "aerosol_density" if has_multiple and name == "dust_density" else name, value)
    background = tree.nodes.new("ShaderNodeBackground")
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(sky.outputs[0], background.inputs["Color"])
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    return background


def _has_multiple(sky):
    """Whether a sky node's models are those of 5.0 and later."""
    return 'MULTIPLE_SCATTERING' in sky.bl_rna.properties["sky_type"].enum_items


def inside_skies():
    """{name: [Volley's picture, Cycles']} of each sky by one sharp sample a pixel."""
    import bpy
    import scenes
    scenes.empty(size=(64, 48), samples=1)
    scenes.camera(rotation=(math.radians(105.0), 0.0, 0.0), angle=math.radians(120.0))
    scenes.sharpen()
    pictures, kind = {}, bpy.types.ShaderNodeTexSky
    for name, settings in SKIES.items():
        if settings["sky_type"] == 'MULTIPLE_SCATTERING' and not _has_multiple(kind):
            continue
        _sky(**settings)
        pictures[name] = []
        for engine in ('VOLLEY', 'CYCLES'):
            scenes.set_engine(engine, 1)
            pictures[name].append(scenes.render()[..., :3])
    return pictures


@pytest.fixture(scope="module")
def pictures(blender_of_module):
    return blender_of_module.run(inside_skies)


@pytest.mark.parametrize("name", SKIES)
def test_against_cycles(pictures, name):
    if name not in pictures:
        pytest.skip("this Blender has no such sky")
    ours, theirs = pictures[name]
    assert theirs.max() > DARKEST
    error = np.abs(ours - theirs) / (theirs.max(axis=-1, keepdims=True) + 1e-2 * theirs.max())
    tolerance, mean_tolerance = FITTED if SKIES[name]["sky_type"] == 'HOSEK_WILKIE' else (TOLERANCE, 2e-3)
    assert (error > tolerance).any(axis=-1).mean() < 0.005, f"{error.max():.2e}"
    assert ours.mean(axis=(0, 1)) == pytest.approx(theirs.mean(axis=(0, 1)), rel=mean_tolerance)


def inside_light():
    """Things under skies with a sun of its usual size: {name: [by Volley, by Cycles]}."""
    import scenes
    scenes.empty(size=(48, 32))
    scenes.camera(location=(0.0, -8.0, 4.0), rotation=(math.radians(65.0), 0.0, 0.0))
    grey = scenes.material("Grey", "ShaderNodeBsdfDiffuse", Color=(0.6, 0.6, 0.6, 1.0))
    scenes.mesh("Floor", [(-9, -9, -1), (9, -9, -1), (9, 9, -1), (-9, 9, -1)], [(0, 1, 2, 3)], grey)
    scenes.sphere("Ball", 1.0, material=grey)
    shiny = scenes.material("Shiny", "ShaderNodeBsdfGlossy", Color=(0.8, 0.8, 0.8, 1.0), Roughness=0.3)
    scenes.sphere("Shiny", 0.8, (2.2, 0.0, 0.0), shiny)
    pictures = {}
    for name, settings in {
            "high": {"sun_elevation": 0.8, "sun_rotation": 1.0},
            "low": {"sun_elevation": 0.1, "sun_rotation": 2.5, "sun_size": 0.05},
            "scaled": {"sun_elevation": 0.5, "sun_rotation": -2.0, "sun_intensity": 0.3}}.items():
        background = _sky(sky_type='NISHITA', sun_disc=True, **settings)
        background.inputs["Strength"].default_value = 0.1
        pictures[name] = []
        for engine in ('VOLLEY', 'CYCLES'):
            scenes.set_engine(engine, SAMPLES)
            pictures[name].append(scenes.render()[..., :3])
    return pictures


def test_light(blender):
    for name, (ours, theirs) in blender.run(inside_light).items():
        assert ours.mean(axis=(0, 1)) == pytest.approx(theirs.mean(axis=(0, 1)), rel=0.01), name
        halves = [picture.reshape(4, 8, 6, 8, 3).mean(axis=(1, 3)) for picture in (ours, theirs)]
        assert halves[0] == pytest.approx(halves[1], rel=0.06, abs=0.01 * theirs.max()), name
