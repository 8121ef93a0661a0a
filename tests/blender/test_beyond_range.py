# SPDX-License-Identifier: Apache-2.0
"""Values beyond the range that is meant for them, which nodes may still give, beside Cycles."""

import blender as blender_support
import numpy as np
import pytest

IS_OLD = blender_support.version() < (4, 0)  # later Cycles take anisotropy below 0 for none
OPERATIONS = 'SINE', 'COSINE', 'TANGENT'
ANGLES = 1e4, -1e6, 1e9, -1e20
CELL_PX = 4
SHIFT = 10.0  # which makes all that is shown positive
COLORS = (-0.5, 0.5, 0.5), (-0.5, -0.5, 0.5), (-0.2, -0.2, -0.2), (-2.0, 0.5, 0.5)
ANISOTROPIES = -3.0, -1.0
SAMPLES, LIT_SAMPLES = 64, 256


def _given(tree, kind, values):
    """What a node of that kind gives, which takes numbers."""
    node = tree.nodes.new(kind)
    for socket, value in zip(node.inputs, values):
        socket.default_value = value
    return node.outputs[0]


def inside_angles():
    """The picture of cells by both, by operation and angle: rows of constants, then of what each object gives."""
    import scenes
    scenes.empty(size=(CELL_PX * len(ANGLES), CELL_PX * 2 * len(OPERATIONS)))
    scenes.camera(type='ORTHO', ortho_scale=float(2 * len(OPERATIONS)))
    scenes.sharpen()
    for row in range(2 * len(OPERATIONS)):
        for column, angle in enumerate(ANGLES):
            made = scenes.emitter((0.0, 0.0, 0.0))
            tree = made.node_tree
            node, shown = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeMath")
            node.operation, node.inputs[0].default_value = OPERATIONS[row // 2], angle
            if row % 2:
                scaled = tree.nodes.new("ShaderNodeMath")
                scaled.operation, scaled.inputs[1].default_value = 'MULTIPLY', angle
                index = scenes.socket(tree.nodes.new("ShaderNodeObjectInfo").outputs, "Object Index")
                tree.links.new(index, scaled.inputs[0])
                tree.links.new(scaled.outputs[0], node.inputs[0])
            shown.inputs[1].default_value = SHIFT
            tree.links.new(node.outputs[0], shown.inputs[0])
            tree.links.new(shown.outputs[0], scenes.shader_of(made).inputs["Color"])
            place = column - 0.5 * (len(ANGLES) - 1), row - 0.5 * (2 * len(OPERATIONS) - 1)
            scenes.wall(f"Cell {row} {column}", 1.0, center=place, material=made).pass_index = 1
    return scenes.by_both(1)


def _lit(samples):
    """Mean colours by both of what is lit by a lamp and an even world."""
    import scenes
    scenes.camera(location=(0.0, -5.0, 0.0), type='ORTHO', ortho_scale=2.5)
    scenes.light('AREA', location=(1.0, -3.0, 2.0), rotation=(0.8, 0.2, 0.2), energy=200.0)
    scenes.light_world((0.3, 0.4, 0.5))
    return [picture[..., :3].mean(axis=(0, 1)) for picture in scenes.by_both(samples)]


def inside_panes():
    """{colour: both} of a matt wall behind a transparent pane of that colour."""
    import scenes
    found = {}
    for color in COLORS:
        scenes.empty(size=(24, 24))
        clear = scenes.material("Clear", "ShaderNodeBsdfTransparent")
        linked = _given(clear.node_tree, "ShaderNodeCombineXYZ", color)
        clear.node_tree.links.new(linked, scenes.shader_of(clear).inputs["Color"])
        scenes.wall("Pane", 2.0, -1.0, material=clear)
        scenes.wall("Wall", 3.0, 1.0, material=scenes.material("Matt", "ShaderNodeBsdfDiffuse"))
        found[color] = _lit(SAMPLES)
    return found


def inside_anisotropies():
    """{anisotropy: both} of balls of metal."""
    import scenes
    found = {}
    for anisotropy in ANISOTROPIES:
        scenes.empty(size=(24, 24))
        metal = scenes.material("Metal", "ShaderNodeBsdfPrincipled", Roughness=0.4, Metallic=1.0)
        value = metal.node_tree.nodes.new("ShaderNodeValue")
        value.outputs[0].default_value = anisotropy
        metal.node_tree.links.new(value.outputs[0], scenes.shader_of(metal).inputs["Anisotropic"])
        scenes.sphere(material=metal)
        found[anisotropy] = _lit(LIT_SAMPLES)
    return found


def test_large_angles(blender):
    """Sines of a million were off by .03, of more not numbers."""
    ours, theirs = (picture[CELL_PX // 2::CELL_PX, CELL_PX // 2::CELL_PX, 0] for picture in
                    blender.run(inside_angles))
    assert (theirs > 0.0).all() and theirs.std() > 0.3
    assert ours == pytest.approx(theirs, rel=1e-4)


def test_transparent_colors_below_zero(blender):
    """They were 0: behind one of -.5 there was four times the light."""
    for color, (ours, theirs) in blender.run(inside_panes).items():
        assert ours == pytest.approx(theirs, abs=0.005), color


def test_anisotropy_below_zero(blender):
    """It was none beside Cycles 3.4, too: at -3 there was 2.8 % more light."""
    found = blender.run(inside_anisotropies)
    assert not IS_OLD or np.ptp([theirs.mean() for _, theirs in found.values()]) > 0.005
    for anisotropy, (ours, theirs) in found.items():
        assert ours == pytest.approx(theirs, rel=0.008), anisotropy
