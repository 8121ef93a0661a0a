# SPDX-License-Identifier: Apache-2.0
"""What Light Path says of rays behind chains of mirrors, glass and transparent surfaces, beside Cycles: to what they
meet, a surface, a lamp or the world, and to the world where it lights what is matt there."""

import blender as blender_support
import compare
import pytest

OUTPUTS = ["Ray Depth", "Glossy Depth", "Transmission Depth", "Transparent Depth", "Ray Length", "Is Camera Ray",
           "Is Glossy Ray", "Is Singular Ray", "Is Reflection Ray", "Is Transmission Ray", "Diffuse Depth"]
OUTPUTS += ["Portal Depth"] if blender_support.version() >= (5, 0) else []
CHAINS = ("", "M", "MM", "MMM", "MMMM", "R", "RR", "RRR", "RRRR", "T", "TTT", "MR", "RM", "TM", "MT", "MTRT")
SIZE = 6  # pixels a chain
# Of the mean, by output: light of the world passes the transparent panels as well, which no sample counts.
MATT_OFF = {"Ray Depth": (0.003, 0.01), "Glossy Depth": (0.003, 0.01), "Transmission Depth": (0.003, 0.01),
            "Transparent Depth": (0.015, 0.01), "Diffuse Depth": (0.003, 0.01)}
VARIED_OFF = 0.05, 0.2  # both engines have densities of their own for light samples


# Inside Blender ------------------------------------------------------------------------------------

def _panel(kind, location, tilt):
    import bpy
    import scenes
    nodes = {"M": ("ShaderNodeBsdfGlossy", {"Roughness": 0.0}), "T": ("ShaderNodeBsdfTransparent", {}),
             "R": ("ShaderNodeBsdfRefraction", {"Roughness": 0.0, "IOR": 1.3}), "D": ("ShaderNodeBsdfDiffuse", {})}
    node_type, inputs = nodes[kind]
    made = bpy.data.materials.get(kind) or scenes.material(kind, node_type, Color=(1.0, 1.0, 1.0, 1.0), **inputs)
    panel = scenes.wall(kind, size=1.6, material=made)
    panel.scale.x = 0.6
    panel.location, panel.rotation_euler.x = location, tilt


def _chains(end=""):
    """A chain of panels in each column of the picture: rays go up the stairs of mirrors, each of which turns them from
    +Y to +Z or back."""
    import math

    import scenes
    for column, chain in enumerate(CHAINS):
        y = z = 0.0
        is_up = False
        for kind in chain + end:
            if is_up:
                z += 2.0
            else:
                y += 2.0
            turn = math.pi / 2 if is_up else 0.0
            _panel(kind, (column - 0.5 * (len(CHAINS) - 1), y, z), -math.pi / 4 if kind == "M" else turn)
            is_up ^= kind == "M"
    scenes.camera(type='ORTHO', ortho_scale=float(len(CHAINS)))
    scenes.sharpen()


def _shown(tree, emission):
    """Have an emission be an output of Light Path, chosen by what comes back: 1 and a quarter of it, up to 9, as
    light behind two bounces is clamped."""
    node, scale, limit = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("LightPath", "Math", "Math"))
    scale.operation, limit.operation = 'MULTIPLY_ADD', 'MINIMUM'
    scale.inputs[1].default_value, scale.inputs[2].default_value, limit.inputs[1].default_value = 0.25, 1.0, 9.0
    tree.links.new(scale.outputs[0], limit.inputs[0])
    tree.links.new(limit.outputs[0], emission.inputs["Color"])
    return lambda name: tree.links.new(node.outputs[name], scale.inputs[0])


def _shine(where):
    """What rays end at: choose(output)."""
    import math

    import scenes
    if where == "world":
        scenes.light_world((1.0, 1.0, 1.0))
        tree = scenes.bpy.context.scene.world.node_tree
        return _shown(tree, next(node for node in tree.nodes if node.type == 'BACKGROUND'))
    if where == "surface":
        material = scenes.emitter((1.0, 1.0, 1.0))
        scenes.wall("Behind", 200.0, 40.0, material=material)
        scenes.wall("Above", 200.0, material=material).rotation_euler.x = math.pi / 2
        scenes.bpy.data.objects["Above"].location = 0.0, 0.0, 40.0
        return _shown(material.node_tree, scenes.shader_of(material))
    data = scenes.light('AREA', (0.0, 40.0, 0.0), (math.pi / 2, 0.0, 0.0), shape='SQUARE', size=79.0,
                        energy=4.0 * 79.0 ** 2).data
    scenes.link("Above", data).location.z = 40.0
    data.use_nodes = True
    return _shown(data.node_tree, data.node_tree.nodes["Emission"])


def inside_chains(where):
    """{output: pictures by both} of one sample."""
    import scenes
    scenes.empty(size=(SIZE * len(CHAINS), SIZE), samples=1)
    _chains()
    choose, found = _shine(where), {}
    for name in OUTPUTS:
        choose(name)
        found[name] = [(picture[..., :3] - 1.0) * 4.0 for picture in scenes.by_both(1)]
    return found


def inside_matt(is_varied):
    """{output: pictures by both} of matt surfaces at the ends of the chains, in an even world or one that is
    brighter on one side."""
    import scenes
    scenes.empty(size=(SIZE * len(CHAINS), SIZE))
    _chains("D")
    choose, found = _shine("world"), {}
    if is_varied:
        tree = scenes.bpy.context.scene.world.node_tree
        place, gradient = (tree.nodes.new(f"ShaderNode{name}") for name in ("TexCoord", "TexGradient"))
        tree.links.new(place.outputs["Generated"], gradient.inputs["Vector"])
        background = next(node for node in tree.nodes if node.type == 'BACKGROUND')
        tree.links.new(gradient.outputs["Color"], background.inputs["Strength"])
    for name in MATT_OFF:
        choose(name)
        found[name] = [seeds[..., :3] for seeds in scenes.seeds_by_both(256)]
    return found


# Comparison ----------------------------------------------------------------------------------------

def _columns(picture):
    """The value in the middle of each column."""
    return picture[SIZE // 2, SIZE // 2::SIZE, 0]


@pytest.mark.parametrize("where", ("surface", "lamp", "world"))
def test_chains(blender, where):
    """In worlds Ray Depth was 2 behind every chain, and the other depths were 0; in lamps these were."""
    found = blender.run(inside_chains, where)
    for name, pictures in found.items():
        ours, theirs = (_columns(picture) for picture in pictures)
        assert abs(ours - theirs).max() <= 1e-3 * max(abs(theirs).max(), 1.0), (name, ours.tolist(), theirs.tolist())


@pytest.mark.parametrize("is_varied", (False, True), ids=("even", "varied"))
def test_matt_surfaces(blender, is_varied):
    """Depths of an even world were off by a seventh to a third of the mean, those of one that varies by as much."""
    for name, (ours, theirs) in blender.run(inside_matt, is_varied).items():
        errors = compare.unexplained(ours, theirs)
        off = VARIED_OFF if is_varied else MATT_OFF[name]
        assert all(error <= limit * theirs.mean() for error, limit in zip(errors, off)), (name, errors, theirs.mean())
