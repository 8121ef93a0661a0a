# SPDX-License-Identifier: Apache-2.0
"""What is in a light's way tells kinds of rays apart, beside Cycles: light samples send shadow rays; what of the
world's light Cycles finds by rays of lobes goes by what is seen by these."""

import compare
import numpy as np
import pytest

SAMPLES = 64
LIGHTS = ("sun", "area", "point", "even world", "sky", "sky without samples")
# Means over those of Cycles, less 1; skies by the densities of two samplings. Before, Ray Length was in parts of the
# way to the light, Ray Depth 0 and the world's light a shadow ray's: off by up to all of the light.
OFF = {"sky": 0.02}
SWITCH_NAMES = ("visible_shadow", "visible_diffuse", "visible_glossy")
SWITCHES = ((), ("visible_shadow",), ("visible_diffuse",), ("visible_glossy",), ("visible_shadow", "visible_diffuse"))
# In Cycles 3.4 what is opaque to shadows alone blocks some rays and others not, at random.
BROKEN_3 = ("sun", "area", "point", "sky")
TILE_OFF = 0.01  # of the mean; before, up to .4
OUTPUTS = ("Is Shadow Ray", "Is Camera Ray", "Is Diffuse Ray", "Is Reflection Ray", "Ray Length", "Ray Depth",
           "Diffuse Depth", "Transparent Depth")


# Inside Blender ------------------------------------------------------------------------------------

def _lit_by(kind):
    """An empty scene that one light lights, and a floor of that material below the camera."""
    import scenes
    scenes.empty(size=(32, 32))
    scenes.camera(location=(0.0, -5.0, 3.0), rotation=(1.05, 0.0, 0.0))
    if "world" in kind or "sky" in kind:
        _world(kind)
    else:
        scenes.light(kind.upper(), (0.0, 0.0, 4.0), (0.0, 0.0, 0.0), energy=5.0 if kind == "sun" else 300.0)


def _world(kind):
    import bpy
    world = bpy.context.scene.world
    world.use_nodes = True
    tree = world.node_tree
    background = tree.nodes["Background"]
    background.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    if kind == "even world":
        return
    gradient, place = tree.nodes.new("ShaderNodeTexGradient"), tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(place.outputs["Generated"], gradient.inputs["Vector"])
    tree.links.new(gradient.outputs["Color"], background.inputs["Color"])
    world.cycles.sampling_method = 'NONE' if "without" in kind else 'AUTOMATIC'


def _floor(node_type, **inputs):
    import scenes
    scenes.mesh("Floor", [(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)], [(0, 1, 2, 3)],
                scenes.material("Floor", node_type, **inputs))


def inside_light_path():
    """{light: {output: pictures by both engines}} of a floor below two panes that let through what an output says."""
    import scenes
    found = {kind: {} for kind in LIGHTS}
    for kind in LIGHTS:
        _lit_by(kind)
        _floor("ShaderNodeBsdfDiffuse", Color=(0.8, 0.8, 0.8))
        pane = scenes.material("Pane", "ShaderNodeBsdfTransparent")
        tree = pane.node_tree
        path, part = tree.nodes.new("ShaderNodeLightPath"), tree.nodes.new("ShaderNodeVectorMath")
        part.operation = 'MULTIPLY_ADD'
        part.inputs[1].default_value, part.inputs[2].default_value = (0.2,) * 3, (0.3,) * 3
        tree.links.new(part.outputs[0], tree.nodes["Transparent BSDF"].inputs["Color"])
        for z in (0.5, 1.2):  # below the camera, so that it sees the floor past none
            made = scenes.mesh(f"Pane{z}", [(-40, -40, z), (40, -40, z), (40, 40, z), (-40, 40, z)], [(0, 1, 2, 3)], pane)
            made.visible_camera = False
        for output in OUTPUTS:
            tree.links.new(path.outputs[output], part.inputs[0])
            found[kind][output] = [pictures[..., :3] for pictures in scenes.seeds_by_both(SAMPLES)]
    return found


def inside_switches():
    """{(world, floor, switches): pictures by both engines} of a ball that those rays do not see."""
    import scenes
    found = {}
    for kind in LIGHTS[3:]:
        for floor, inputs in (("ShaderNodeBsdfDiffuse", {}), ("ShaderNodeBsdfGlossy", {"Roughness": 0.5})):
            _lit_by(kind)
            _floor(floor, Color=(0.8, 0.8, 0.8), **inputs)
            ball = scenes.sphere("Ball", 0.7, (0.0, 0.0, 0.71))
            for switches in SWITCHES:
                for switch in SWITCH_NAMES:
                    setattr(ball, switch, switch not in switches)
                found[kind, floor, switches] = [pictures[..., :3] for pictures in scenes.seeds_by_both(4 * SAMPLES)]
    return found


def inside_opaque_shadows():
    """{light: pictures by both engines} of a floor below a half-clear pane without Transparent Shadows."""
    import scenes
    found = {}
    for kind in LIGHTS:
        _lit_by(kind)
        _floor("ShaderNodeBsdfDiffuse", Color=(0.8, 0.8, 0.8))
        pane = scenes.material("Pane", "ShaderNodeBsdfTransparent", Color=(0.5, 0.5, 0.5))
        owner = pane if hasattr(pane, "use_transparent_shadow") else pane.cycles
        owner.use_transparent_shadow = False
        scenes.mesh("Pane", [(-1, -1, 0.5), (2, -1, 0.5), (2, 1, 0.5), (-1, 1, 0.5)], [(0, 1, 2, 3)], pane)
        found[kind] = [pictures[..., :3] for pictures in scenes.seeds_by_both(4 * SAMPLES)]
    return found


def inside_shadowless_lamps():
    """{lamp: pictures by both engines} of a floor near a wide lamp that casts no shadows, above a plate."""
    import scenes
    found = {}
    for kind, settings in (("POINT", {"shadow_soft_size": 1.2}), ("SPOT", {"shadow_soft_size": 0.8}),
                           ("AREA", {"size": 3.0}), ("SUN", {"angle": 1.0})):
        scenes.empty(size=(32, 32))
        scenes.camera(location=(0.0, -5.0, 3.0), rotation=(1.05, 0.0, 0.0))
        _floor("ShaderNodeBsdfDiffuse", Color=(0.8, 0.8, 0.8))
        scenes.mesh("Plate", [(-1, -0.5, 0.3), (1, -0.5, 0.3), (1, 1.5, 0.3), (-1, 1.5, 0.3)], [(0, 1, 2, 3)],
                    scenes.material("Plate", "ShaderNodeBsdfDiffuse", Color=(0.5, 0.5, 0.5)))
        lamp = scenes.light(kind, (0.0, 0.5, 2.5), (0.0, 0.0, 0.0), energy=5.0 if kind == "SUN" else 300.0, **settings)
        owner = lamp.data.cycles if hasattr(lamp.data.cycles, "cast_shadow") else lamp.data  # before 4.2
        setattr(owner, "cast_shadow" if owner is not lamp.data else "use_shadow", False)
        found[kind] = [pictures[..., :3] for pictures in scenes.seeds_by_both(8 * SAMPLES)]
    return found


# Comparison ----------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def through_panes(blender_of_module):
    return blender_of_module.run(inside_light_path, timeout=600)


@pytest.mark.parametrize("kind", LIGHTS)
def test_light_path(through_panes, kind):
    for output, (ours, theirs) in through_panes[kind].items():
        ratio = ours.mean() / theirs.mean()
        print(f"{kind}, {output}: {ratio - 1.0:+.4f}")
        noise = 4.0 * np.hypot(*(side.mean(axis=(1, 2, 3)).std(ddof=1) / np.sqrt(len(side))
                                 for side in (ours, theirs))) / theirs.mean()
        assert abs(ratio - 1.0) < OFF.get(kind, 0.003) + noise, output


def test_opaque_shadows(blender):
    """The even world's light, whose samples stopped at the pane as those of lamps do, was .07 of the mean off, .28
    in a tile."""
    import blender as blender_support
    for kind, (ours, theirs) in blender.run(inside_opaque_shadows, timeout=600).items():
        mean, tile = compare.unexplained(ours, theirs)
        print(kind, mean / theirs.mean(), tile / theirs.mean())
        if blender_support.version() >= (4, 0) or kind not in BROKEN_3:
            assert tile < (TILE_OFF + OFF.get(kind, 0.0)) * theirs.mean(), kind


def test_shadowless_lamps(blender):
    """What Cycles finds of a lamp by rays is blocked: the floor below the plate was too bright by .6 % of the mean, 4.5 % in a
    tile."""
    for kind, (ours, theirs) in blender.run(inside_shadowless_lamps, timeout=600).items():
        mean, tile = compare.unexplained(ours, theirs)
        print(kind, mean / theirs.mean(), tile / theirs.mean(), ours.mean() / theirs.mean())
        assert tile < 2 * TILE_OFF * theirs.mean(), kind


def test_ray_visibility(blender):
    for case, (ours, theirs) in blender.run(inside_switches, timeout=600).items():
        mean, tile = compare.unexplained(ours, theirs)
        print(case, mean / theirs.mean(), tile / theirs.mean())
        assert tile < TILE_OFF * theirs.mean(), case
