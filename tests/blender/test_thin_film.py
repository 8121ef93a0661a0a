# SPDX-License-Identifier: Apache-2.0
"""Thin films beside Cycles: spheres in a white world, whose pixels show what a film reflects at every
angle."""

import blender as blender_support
import numpy as np
import pytest

_SMOOTH = {"Base Color": (0.0, 0.0, 0.0), "Roughness": 0.0, "Thin Film IOR": 1.33}
_PRINCIPLED = "ShaderNodeBsdfPrincipled"
_GOLD = {"Thin Film Thickness": 350.0, "Thin Film IOR": 1.8, "Base Color": (1.0, 0.6, 0.2)}
_FILMS = {
    "20 nm": {**_SMOOTH, "Thin Film Thickness": 20.0},
    "120 nm": {**_SMOOTH, "Thin Film Thickness": 120.0},
    "350 nm": {**_SMOOTH, "Thin Film Thickness": 350.0},
    "350 nm, index 2": {**_SMOOTH, "Thin Film Thickness": 350.0, "Thin Film IOR": 2.0},
    "800 nm on index 2": {**_SMOOTH, "Thin Film Thickness": 800.0, "IOR": 2.0},
    "rough": {**_SMOOTH, "Thin Film Thickness": 350.0, "Thin Film IOR": 1.8, "Roughness": 0.5},
    "over a base": {**_SMOOTH, "Thin Film Thickness": 350.0, "Thin Film IOR": 1.8,
                    "Base Color": (0.8, 0.5, 0.2)},
    "tinted": {**_SMOOTH, "Thin Film Thickness": 350.0, "Specular Tint": (1.0, 0.3, 0.1),
               "Specular IOR Level": 0.8},
    "glass": {**_SMOOTH, "Thin Film Thickness": 350.0, "Thin Film IOR": 1.8, "Transmission Weight": 1.0,
              "Base Color": (0.2, 0.5, 0.9)},
}
# Of Blender 5; the metal of Principled has the film that its own node has.
_LATER = {
    "glass node": ("ShaderNodeBsdfGlass", {
        "Color": (1.0, 1.0, 1.0), "Roughness": 0.0, "Thin Film Thickness": 350.0, "Thin Film IOR": 1.8}),
    "metal": ("ShaderNodeBsdfMetallic", {**_GOLD, "Roughness": 0.0, "Edge Tint": (0.5, 0.8, 1.0)}),
    "metal, thin": ("ShaderNodeBsdfMetallic", {**_GOLD, "Roughness": 0.0, "Thin Film Thickness": 60.0}),
    "metal, rough": ("ShaderNodeBsdfMetallic", {**_GOLD, "Roughness": 0.5, "Thin Film IOR": 1.33}),
}
_CASES = {**{name: (_PRINCIPLED, inputs) for name, inputs in _FILMS.items()}, **_LATER}
_OF_SPACES = ("120 nm", "over a base", "tinted", "glass node", "metal", "metal, rough")
TOLERANCE, GLASS_TOLERANCE = 0.02, 0.03  # of glass .016 are noise: what is seen is reflected or refracted by chance
SAMPLES = 256
SIZE = (48, 48)


def inside_films(films, space=None):
    """{name: pictures by both engines and, by Volley, without the film}; space: the working space."""
    import bpy
    import scenes
    pictures = {}
    if space is not None:
        bpy.ops.wm.set_working_color_space(working_space=space)
    for name, (node, inputs) in films.items():
        scene = scenes.empty(size=SIZE)
        if not scenes.has_node(node, inputs):
            continue
        scenes.light_world((1.0, 1.0, 1.0))
        scenes.camera(location=(0.0, -5.0, 0.0), type='ORTHO', ortho_scale=2.2)
        made = scenes.material("Film", node, **{key.replace(" ", "_"): value for key, value in inputs.items()})
        scenes.sphere(material=made)
        if node == "ShaderNodeBsdfGlass":  # in a world without shadow it shows nothing
            scenes.wall(size=8.0, y=1.5, material=scenes.emitter((0.0, 0.0, 0.0)))
        both = scenes.by_both(SAMPLES)
        scenes.shader_of(made).inputs["Thin Film Thickness"].default_value = 0.0
        scenes.set_engine('VOLLEY', SAMPLES)
        pictures[name] = both + [scenes.render()]
    return pictures


@pytest.fixture(scope="module")
def films(blender_of_module):
    return blender_of_module.run(inside_films, _CASES, timeout=300)


@pytest.mark.parametrize("name", _CASES)
def test_film(films, name):
    if name not in films:
        pytest.skip("this Blender has no thin film")
    _compare(name, films[name])


@pytest.mark.since((5, 0), "working spaces came with 5.0")
@pytest.mark.parametrize("space", ("Linear Rec.2020", "ACEScg"))
def test_working_spaces(blender, space):
    if blender_support.version() < (5, 0):
        pytest.skip("working spaces came with 5.0")
    for name, pictures in blender.run(inside_films, {name: _CASES[name] for name in _OF_SPACES}, space).items():
        _compare(f"{name}, {space}", pictures)


def _compare(name, pictures):
    """Hold pictures by both engines and without the film to the tolerance."""
    # Means of 4 x 4 pixels: what rounds off the triangles and the noise of rough ones.
    ours, theirs, bare = (picture[..., :3].reshape(12, 4, 12, 4, 3).mean(axis=(1, 3))
                          for picture in pictures)
    off, shift = np.abs(ours - theirs), np.abs(theirs - bare).max()
    worst = off.max()
    print(f"{name:20} off by at most {worst:.4f}, mean {off.mean():.5f}; the film makes {shift:.3f}")
    assert worst < (GLASS_TOLERANCE if "glass" in name else TOLERANCE)
    assert shift > 2.0 * worst
