# SPDX-License-Identifier: Apache-2.0
"""Values beyond the range that is meant for them, which nodes may still give, beside Cycles."""

import pytest

OPERATIONS = 'SINE', 'COSINE', 'TANGENT'
ANGLES = 1e4, -1e6, 1e9, -1e20
CELL_PX = 4
SHIFT = 10.0  # which makes all that is shown positive


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


def test_large_angles(blender):
    """Sines of a million were off by .03, of more not numbers."""
    ours, theirs = (picture[CELL_PX // 2::CELL_PX, CELL_PX // 2::CELL_PX, 0] for picture in
                    blender.run(inside_angles))
    assert (theirs > 0.0).all() and theirs.std() > 0.3
    assert ours == pytest.approx(theirs, rel=1e-4)
