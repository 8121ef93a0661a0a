# SPDX-License-Identifier: Apache-2.0
"""The Point Info node beside Cycles: balls of a cloud that is turned and scaled, some instanced, which shine with what
the node says, before a wall that is no point."""

import numpy as np
import pytest

SIZE = (96, 64)
OUTPUTS = ("Position", "Radius", "Random")
TOLERANCE = 1e-3
SHARE = 0.02  # of pixels that may be off by more: those on outlines


# Inside Blender ------------------------------------------------------------------------------------

def inside_pictures():
    """{output: its value at each pixel by Volley and by Cycles}."""
    import bpy
    import scenes
    scenes.empty(size=SIZE, samples=1)
    scenes.camera(location=(0.0, -8.0, 0.0))
    scenes.sharpen()
    material = scenes.emitter((1.0, 1.0, 1.0))
    tree = material.node_tree
    node, shown = tree.nodes.new("ShaderNodePointInfo"), tree.nodes.new("ShaderNodeVectorMath")
    shown.operation = 'MULTIPLY_ADD'
    shown.inputs[1].default_value, shown.inputs[2].default_value = (0.2,) * 3, (1.0,) * 3  # above 0
    tree.links.new(shown.outputs[0], scenes.shader_of(material).inputs["Color"])
    rng = np.random.RandomState(3)
    cloud = scenes.mesh("Cloud", [tuple(place) for place in rng.uniform(-1.3, 1.3, (40, 3))], [])
    points, assign = scenes.geometry_nodes(cloud, "GeometryNodeMeshToPoints", "GeometryNodeSetMaterial")
    points.inputs["Radius"].default_value = 0.3
    assign.inputs["Material"].default_value = material
    cloud.location, cloud.rotation_euler, cloud.scale = (0.5, 1.0, 0.2), (0.3, 0.5, 0.7), (1.5, 0.8, 1.1)
    group = bpy.data.collections.new("Group")
    group.objects.link(cloud)
    maker = scenes.link("Maker", None)
    maker.instance_type, maker.instance_collection, maker.location = 'COLLECTION', group, (-1.8, 0.0, 0.4)
    maker.scale = (0.6, 0.6, 0.6)
    scenes.wall("Wall", size=20.0, y=6.0, material=material)
    found = {}
    for name in OUTPUTS:
        tree.links.new(node.outputs[name], shown.inputs[0])
        found[name] = [(picture[..., :3] - 1.0) * 5.0 for picture in scenes.by_both(1)]
    return found


# Comparison ----------------------------------------------------------------------------------------

def test_point_info(blender):
    for name, (ours, theirs) in blender.run(inside_pictures).items():
        off = (np.abs(ours - theirs) > TOLERANCE).any(axis=-1).mean()
        print(f"{name}: {off:.2%} of the pixels are off by more than {TOLERANCE}")
        assert off <= SHARE, name
        assert len(np.unique(theirs.reshape(-1, 3).round(3), axis=0)) >= (3 if name == "Radius" else 30), name
        assert (theirs == 0.0).mean() > 0.1, name  # the wall
