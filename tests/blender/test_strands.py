# SPDX-License-Identifier: Apache-2.0
"""Hair, curves and points against Cycles': where they are, how thick, what they are made of."""

import math

import numpy as np
import pytest

SAMPLES = 64


def _both(samples=SAMPLES):
    import scenes
    return [picture[..., :3] for picture in scenes.by_both(samples)]


def _haired(**settings):
    """A ball with hair of the second of its materials; the first is dark."""
    import bpy
    import scenes
    ball = scenes.sphere("Ball", 0.8, material=scenes.emitter((0.05, 0.05, 0.05), "Skin"))
    ball.data.materials.append(scenes.material("Hair", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.5, 0.2)))
    ball.modifiers.new("Hair", 'PARTICLE_SYSTEM')
    hair = ball.particle_systems[0].settings
    hair.type, hair.count, hair.material = 'HAIR', 150, 2
    hair.hair_length, hair.render_step = 0.8, 3
    hair.root_radius, hair.tip_radius, hair.radius_scale = 1.0, 0.4, 0.06
    for name, value in settings.items():
        setattr(hair, name, value)
    return ball, hair


def inside_hair():
    """{name: [by Volley, by Cycles]}"""
    import bpy
    import scenes
    scenes.empty(size=(64, 48))
    scenes.camera(location=(0.0, -7.0, 0.0))
    scenes.light('SUN', energy=3.0, angle=0.2, rotation=(0.9, 0.3, 0.2))
    scenes.wall("Back", 20.0, 4.0, material=scenes.emitter((0.3, 0.3, 0.4), "Grey"))
    ball, hair = _haired()
    pictures = {"plain": _both()}
    hair.shape, hair.use_close_tip = 0.5, False
    hair.child_type, hair.rendered_child_count = 'SIMPLE', 3
    ball.location, ball.scale = (0.3, 0.0, 0.2), (1.2, 0.8, 1.0)
    ball.rotation_euler = (0.3, 0.4, 0.5)
    pictures["children of a moved ball"] = _both()
    ball.show_instancer_for_render = False
    pictures["without the ball"] = _both()
    ball.show_instancer_for_render = True
    tree = bpy.data.materials["Hair"].node_tree
    info = tree.nodes.new("ShaderNodeHairInfo")
    emission = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(emission.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    for name in ("Intercept", "Random", "Is Strand"):
        tree.links.new(info.outputs[name], emission.inputs["Color"])
        pictures[name] = _both()
    _paint(ball.data)
    for kind, layer, name, output in (("ShaderNodeUVMap", "uv_map", "Second", "UV"),
                                      ("ShaderNodeVertexColor", "layer_name", "Second Color", "Color")):
        node = tree.nodes.new(kind)
        setattr(node, layer, name)
        tree.links.new(node.outputs[output], emission.inputs["Color"])
        pictures[f"{output} of the roots"] = _both()
        hair.child_type = 'NONE'
        pictures[f"{output} of the roots without children"] = _both()
        hair.child_type = 'SIMPLE'
    _name_more_layers_than_meshes_have(ball.data)
    tree.links.new(info.outputs["Intercept"], emission.inputs["Color"])
    pictures["Intercept beside nine layers"] = _both()
    return pictures


def _name_more_layers_than_meshes_have(mesh):
    """The ball's material reads nine colours more, and takes none of each."""
    tree = mesh.materials[0].node_tree
    emission = next(node for node in tree.nodes if node.type == 'EMISSION')
    before = tree.nodes.new("ShaderNodeRGB").outputs[0]
    for i in range(9):
        mesh.color_attributes.new(f"Layer {i}", 'BYTE_COLOR', 'CORNER')
        color, add = tree.nodes.new("ShaderNodeVertexColor"), tree.nodes.new("ShaderNodeVectorMath")
        color.layer_name, add.operation = f"Layer {i}", 'MULTIPLY_ADD'
        add.inputs[1].default_value = (0.0, 0.0, 0.0)
        tree.links.new(color.outputs["Color"], add.inputs[0])
        tree.links.new(before, add.inputs[2])
        before = add.outputs[0]
    tree.links.new(before, emission.inputs["Color"])


def _paint(mesh):
    """Two UV maps and two colours, of which the second run with the place."""
    corners = np.array([mesh.vertices[loop.vertex_index].co for loop in mesh.loops]) / 1.6 + 0.5
    for name, scale in (("First", 0.0), ("Second", 1.0)):
        layer = mesh.uv_layers.new(name=name)
        layer.data.foreach_set("uv", (scale * corners[:, ::2]).astype(np.float32).reshape(-1))
        colors = mesh.color_attributes.new(f"{name} Color", 'BYTE_COLOR', 'CORNER')
        rgba = np.concatenate((scale * corners, np.ones((len(corners), 1))), axis=1)
        colors.data.foreach_set("color", rgba.astype(np.float32).reshape(-1))


def inside_points():
    """Curves and points that nodes make, lit and by themselves."""
    import bpy
    import scenes
    scenes.empty(size=(64, 48))
    scenes.camera(location=(0.0, -7.0, 0.0))
    scenes.light('SUN', energy=3.0, angle=0.2, rotation=(0.9, 0.3, 0.2))
    scenes.wall("Back", 20.0, 4.0, material=scenes.emitter((0.3, 0.3, 0.4), "Grey"))
    grey = scenes.material("White", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.8, 0.8))
    pictures = {}
    data = bpy.data.hair_curves.new("Curves")
    if hasattr(data, "add_curves"):
        data.add_curves([5] * 12)
        random = np.random.default_rng(3)
        places = np.cumsum(random.uniform(-0.5, 0.7, (12, 5, 3)), axis=1) + (-0.5, 0.0, -1.2)
        data.position_data.foreach_set("vector", places.astype(np.float32).reshape(-1))
        radius = data.attributes.get("radius") or data.attributes.new("radius", 'FLOAT', 'POINT')
        radius.data.foreach_set("value", np.linspace(0.12, 0.02, 60).astype(np.float32))
        data.materials.append(grey)
        made = scenes.link("Curves", data)
        pictures["curves"] = _both()
        bpy.data.objects.remove(made)
    made = scenes.sphere("Cloud", 1.5, material=grey)
    group = bpy.data.node_groups.new("Points", 'GeometryNodeTree')
    if hasattr(group, "interface"):
        group.interface.new_socket("Geometry", in_out='INPUT', socket_type='NodeSocketGeometry')
        group.interface.new_socket("Geometry", in_out='OUTPUT', socket_type='NodeSocketGeometry')
    else:
        group.inputs.new('NodeSocketGeometry', "Geometry")
        group.outputs.new('NodeSocketGeometry', "Geometry")
    nodes = [group.nodes.new(kind) for kind in (
        "NodeGroupInput", "GeometryNodeMeshToPoints", "GeometryNodeSetMaterial", "NodeGroupOutput")]
    nodes[1].inputs["Radius"].default_value = 0.12
    nodes[2].inputs["Material"].default_value = grey
    for a, b in zip(nodes, nodes[1:]):
        group.links.new(a.outputs[0], b.inputs[0])
    made.modifiers.new("Points", 'NODES').node_group = group
    pictures["points"] = _both()
    return pictures


def _blocks(picture):
    return picture.reshape(6, 8, 8, 8, 3).mean(axis=(1, 3))


def _agree(pictures):
    for name, (ours, theirs) in pictures.items():
        assert theirs.std() > 0.02, f"{name}: the picture shows nothing"
        assert ours.mean(axis=(0, 1)) == pytest.approx(theirs.mean(axis=(0, 1)), rel=0.015), name
        assert np.abs(_blocks(ours) - _blocks(theirs)).max() < 0.08 * theirs.max(), name


def test_hair(blender):
    _agree(blender.run(inside_hair))


def test_curves_and_points(blender):
    _agree(blender.run(inside_points))
