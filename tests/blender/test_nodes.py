# SPDX-License-Identifier: Apache-2.0
"""Node trees become flat lists: groups, reroutes, muted nodes and links, conversions, fallbacks."""

import pytest


def _flat(tree, warnings=None):
    from volley.log import Warnings
    from volley.sync import flatten
    collected = warnings or Warnings()
    flat = flatten.flatten(tree, "Tree", collected)
    listed = [(node.type, node.mode, node.name, [
        (source, output, tuple(round(v, 5) for v in value)) for source, output, value in node.inputs])
        for node in flat.nodes]
    return {"surface": flat.surface, "nodes": listed, "warnings": collected.take(),
            "uv": sorted(flat.uv_names), "colors": sorted(flat.color_names)}


def _new_tree():
    import bpy
    material = bpy.data.materials.new("Material")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    return tree, tree.nodes.new("ShaderNodeOutputMaterial")


def inside_group():
    import bpy
    tree, output = _new_tree()
    inner = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    if hasattr(inner, "interface"):
        inner.interface.new_socket("Color", in_out='INPUT', socket_type='NodeSocketColor')
        inner.interface.new_socket("Rough", in_out='INPUT', socket_type='NodeSocketFloat')
        inner.interface.new_socket("Shader", in_out='OUTPUT', socket_type='NodeSocketShader')
    else:
        inner.inputs.new("NodeSocketColor", "Color")
        inner.inputs.new("NodeSocketFloat", "Rough")
        inner.outputs.new("NodeSocketShader", "Shader")
    start, end = inner.nodes.new("NodeGroupInput"), inner.nodes.new("NodeGroupOutput")
    other = inner.nodes.new("NodeGroupOutput")  # which the active output stands for
    inner.links.new(inner.nodes.new("ShaderNodeEmission").outputs[0], end.inputs["Shader"])
    end.is_active_output, other.is_active_output, end = False, True, other
    diffuse = inner.nodes.new("ShaderNodeBsdfDiffuse")
    inner.links.new(start.outputs["Color"], diffuse.inputs["Color"])
    inner.links.new(start.outputs["Rough"], diffuse.inputs["Roughness"])
    inner.links.new(diffuse.outputs[0], end.inputs["Shader"])

    first, second = tree.nodes.new("ShaderNodeGroup"), tree.nodes.new("ShaderNodeGroup")
    first.node_tree = second.node_tree = inner
    first.inputs["Color"].default_value = (0.1, 0.2, 0.3, 1.0)
    first.inputs["Rough"].default_value = 0.25
    rgb = tree.nodes.new("ShaderNodeRGB")
    rgb.outputs[0].default_value = (0.5, 0.6, 0.7, 1.0)
    tree.links.new(rgb.outputs[0], second.inputs["Color"])
    mix, reroute = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("NodeReroute")
    tree.links.new(first.outputs[0], reroute.inputs[0])
    tree.links.new(reroute.outputs[0], mix.inputs[1])
    tree.links.new(second.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    return _flat(tree)


def test_groups_and_reroutes(blender):
    flat = blender.run(inside_group)
    assert flat["warnings"] == []
    kinds = [kind for kind, *_ in flat["nodes"]]
    assert kinds == [1, 1, 9] and flat["surface"] == 2
    assert flat["nodes"][0][3] == [(-1, 0, (0.1, 0.2, 0.3)), (-1, 0, (0.25, 0, 0)), (-2, 0, (0, 0, 0))]
    assert flat["nodes"][1][3][0] == (-1, 0, (0.5, 0.6, 0.7))
    assert flat["nodes"][2][3] == [(-1, 0, (0.5, 0, 0)), (0, 0, (0, 0, 0)), (1, 0, (0, 0, 0))]


def inside_muted():
    tree, output = _new_tree()
    diffuse, invert = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeInvert")
    rgb = tree.nodes.new("ShaderNodeRGB")
    rgb.outputs[0].default_value = (0.5, 0.6, 0.7, 1.0)
    tree.links.new(rgb.outputs[0], invert.inputs["Color"])
    link = tree.links.new(invert.outputs[0], diffuse.inputs["Color"])
    tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    working = _flat(tree)
    invert.mute = True
    muted_node = _flat(tree)
    invert.mute = False
    link.is_muted = True
    return working, muted_node, _flat(tree)


def test_muted_nodes_and_links(blender):
    working, muted_node, muted_link = blender.run(inside_muted)
    assert [kind for kind, *_ in working["nodes"]] == [77, 1]
    assert muted_node["nodes"][-1][3][0] == (-1, 0, (0.5, 0.6, 0.7)) and len(muted_node["nodes"]) == 1
    assert muted_link["nodes"][-1][3][0] == (-1, 0, (0.8, 0.8, 0.8)) and len(muted_link["nodes"]) == 1


def inside_conversions():
    tree, output = _new_tree()
    geometry, diffuse = tree.nodes.new("ShaderNodeNewGeometry"), tree.nodes.new("ShaderNodeBsdfDiffuse")
    gamma, emission = tree.nodes.new("ShaderNodeGamma"), tree.nodes.new("ShaderNodeEmission")
    tree.links.new(geometry.outputs["Backfacing"], gamma.inputs["Color"])       # number to colour
    tree.links.new(gamma.outputs["Color"], diffuse.inputs["Roughness"])         # colour to number
    tree.links.new(geometry.outputs["Position"], emission.inputs["Strength"])   # vector to number
    tree.links.new(geometry.outputs["Normal"], emission.inputs["Color"])        # vector to colour
    mix = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(diffuse.outputs[0], mix.inputs[0])
    tree.links.new(emission.outputs[0], mix.inputs[1])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    added = _flat(tree)
    tree.links.new(gamma.outputs["Color"], output.inputs["Surface"])            # colour to shader
    return added, _flat(tree)


def test_link_conversions(blender):
    added, shining = blender.run(inside_conversions)
    kinds = [kind for kind, *_ in added["nodes"]]
    assert kinds == [75, 83, 78, 89, 1, 88, 7, 10]
    combine, gamma, to_number, diffuse, dot, emission = added["nodes"][1:7]
    assert combine[3] == [(0, 6, (0, 0, 0))] * 3
    assert gamma[3][0] == (1, 0, (0, 0, 0)) and to_number[3][0][0] == 2 and diffuse[3][1][0] == 3
    assert dot[1] == 8 and dot[3][0][:2] == (0, 0) and dot[3][1][2] == (0.33333,) * 3
    assert emission[3] == [(0, 1, (0, 0, 0)), (5, 1, (0, 0, 0))]
    assert shining["nodes"][shining["surface"]][0] == 7


def inside_fallbacks():
    tree, output = _new_tree()
    unknown = tree.nodes.new("ShaderNodeVolumeInfo")
    velvet = tree.nodes.new("ShaderNodeBsdfTranslucent")
    scattering = tree.nodes.new("ShaderNodeSubsurfaceScattering")
    scattering.inputs["Color"].default_value = (0.2, 0.4, 0.6, 1.0)
    mix = tree.nodes.new("ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.125
    tree.links.new(unknown.outputs["Density"], mix.inputs[0])
    tree.links.new(scattering.outputs[0], mix.inputs[1])
    tree.links.new(velvet.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    scatter = tree.nodes.new("ShaderNodeVolumeScatter")
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    return _flat(tree), unknown.bl_label


def test_unsupported_nodes_fall_back_and_are_named(blender):
    flat, unknown = blender.run(inside_fallbacks)
    kinds = [kind for kind, *_ in flat["nodes"]]
    assert kinds == [1, 6, 9]
    assert flat["nodes"][0][3][0] == (-1, 0, (0.2, 0.4, 0.6))
    assert flat["nodes"][2][3][0] == (-1, 0, (0.125, 0, 0))
    assert flat["nodes"][1][3][1] == (-2, 0, (0, 0, 0))
    text = "\n".join(flat["warnings"])
    for name in (unknown, "Subsurface Scattering", "volume"):
        assert text.count(name) == 1, text


def inside_loop():
    tree, output = _new_tree()
    nodes = [tree.nodes.new("ShaderNodeGamma") for _ in range(200)]
    for before, after in zip(nodes, nodes[1:]):
        tree.links.new(before.outputs[0], after.inputs[0])
    tree.links.new(nodes[-1].outputs[0], output.inputs["Surface"])
    deep = _flat(tree)
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    first, second = tree.nodes.new("ShaderNodeGamma"), tree.nodes.new("ShaderNodeGamma")
    tree.links.new(first.outputs[0], second.inputs[0])
    tree.links.new(second.outputs[0], first.inputs[0])
    tree.links.new(second.outputs[0], output.inputs["Surface"])
    loop = _flat(tree)
    tree.nodes.clear()
    return deep, loop, _flat(tree)


def test_deep_and_looped_trees_end(blender):
    deep, loop, empty = blender.run(inside_loop)
    assert not deep["warnings"] and len(deep["nodes"]) > 200
    assert loop["nodes"][loop["surface"]][0] == 7
    assert empty["surface"] == -1 and empty["nodes"] == []


def inside_bent_blends():
    """The warnings of mixes by a factor that is not clamped."""
    told = {}
    for blend in ('MIX', 'BURN'):
        tree, output = _new_tree()
        mix = tree.nodes.new("ShaderNodeMix")
        mix.data_type, mix.blend_type, mix.clamp_factor = 'RGBA', blend, False
        mix.inputs["Factor"].default_value = 0.5
        tree.links.new(next(each for each in mix.outputs if each.enabled), output.inputs["Surface"])
        told[f"{blend}, .5"] = _flat(tree)["warnings"]
        tree.links.new(tree.nodes.new("ShaderNodeObjectInfo").outputs["Random"], mix.inputs["Factor"])
        told[blend] = _flat(tree)["warnings"]
    return told


def test_blends_not_linear_in_their_factor_are_named(blender):
    told = blender.run(inside_bent_blends)
    assert not told["MIX"] and not told["MIX, .5"] and not told["BURN, .5"]
    assert len(told["BURN"]) == 1 and "clamped" in told["BURN"][0]


def inside_textures():
    tree, output = _new_tree()
    emission, color = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeMixRGB")
    image, uv = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeUVMap")
    uv.uv_map = "Second"
    vertex = tree.nodes.new("ShaderNodeVertexColor")
    vertex.layer_name = "Paint"
    plain = tree.nodes.new("ShaderNodeTexImage")
    tree.links.new(uv.outputs[0], image.inputs["Vector"])
    tree.links.new(image.outputs["Color"], color.inputs[1])
    tree.links.new(vertex.outputs["Color"], color.inputs[2])
    tree.links.new(plain.outputs["Alpha"], color.inputs[0])
    tree.links.new(color.outputs[0], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    image.interpolation, image.extension = 'Closest', 'CLIP'
    return _flat(tree)


def test_textures_ask_for_attributes(blender):
    flat = blender.run(inside_textures)
    assert flat["uv"] == ["", "Second"] and flat["colors"] == ["Paint"]
    named = [node for node in flat["nodes"] if node[0] == 64 and node[1] == 1 | 2 << 2]
    assert len(named) == 1
    assert [node[2] for node in flat["nodes"] if node[0] in (66, 67)] == ["Second", "Paint"]


def inside_lights():
    import bpy
    from volley.log import Warnings
    from volley.sync import flatten
    light = bpy.data.lights.new("Light", 'POINT')
    light.use_nodes = True
    tree = light.node_tree
    emission = tree.nodes["Emission"]
    emission.inputs["Color"].default_value = (1.0, 0.5, 0.25, 1.0)
    emission.inputs["Strength"].default_value = 4.0
    falloff = tree.nodes.new("ShaderNodeLightFalloff")
    falloff.inputs["Strength"].default_value = 3.0
    warnings, flats = Warnings(), []
    for output in ("Quadratic", "Linear", "Constant"):
        tree.links.new(falloff.outputs[output], emission.inputs["Strength"])
        flat = flatten.flatten(tree, "Light", warnings)
        flats.append([int(node.type) for node in flat.nodes])
    return flats, warnings.take()


def test_light_nodes(blender):
    (quadratic, linear, constant), loud = blender.run(inside_lights)
    assert loud == []
    # Light Path first, Emission last; the library drops what an output does not need.
    assert quadratic == linear == constant and quadratic[0] == 74 and quadratic[-1] == 7


def inside_unrolled():
    """Two walls by Volley and by Cycles: of a repeat zone's number, and of a menu's colour in a group."""
    import bpy
    import scenes
    scenes.empty(size=(32, 16))
    scenes.camera()
    scenes.sharpen()
    walls = []
    for name, x in (("Repeated", -1.5), ("Chosen", 1.5)):
        material = scenes.emitter((0.2, 0.4, 0.6), name)
        scenes.wall(name, 2.9, 0.0, (x, 0.0), material)
        walls.append(material.node_tree)
    tree = walls[0]
    begin, end = (tree.nodes.new(f"GeometryNodeRepeat{side}put") for side in ("In", "Out"))
    begin.pair_with_output(end)
    end.repeat_items.new('FLOAT', "Sum")
    begin.inputs["Iterations"].default_value = 3
    add = tree.nodes.new("ShaderNodeMath")
    add.inputs[1].default_value = 0.25
    tree.links.new(begin.outputs["Sum"], add.inputs[0])
    tree.links.new(add.outputs[0], end.inputs["Sum"])
    tree.links.new(end.outputs["Sum"], tree.nodes["Emission"].inputs["Strength"])
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    group.interface.new_socket("Color", in_out='OUTPUT', socket_type='NodeSocketColor')
    switch = group.nodes.new("GeometryNodeMenuSwitch")
    switch.data_type = 'RGBA'
    switch.inputs["Menu"].default_value = "B"
    switch.inputs["B"].default_value = (0.8, 0.3, 0.1, 1.0)
    group.links.new(switch.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    outer = walls[1].nodes.new("ShaderNodeGroup")
    outer.node_tree = group
    walls[1].links.new(outer.outputs[0], walls[1].nodes["Emission"].inputs["Color"])
    return scenes.by_both(4)


@pytest.mark.since((5, 0), "repeat zones and menus came to shaders with 5.0")
def test_what_blender_unrolls(blender):
    import blender as blender_support
    if blender_support.version() < (5, 0):
        pytest.skip("there is nothing of it")
    ours, theirs = blender.run(inside_unrolled)
    assert ours[8, 8, :3] == pytest.approx((0.15, 0.3, 0.45), rel=1e-5)
    assert ours[8, 24, :3] == pytest.approx((0.8, 0.3, 0.1), rel=1e-5)
    for x in (8, 24):
        assert abs(ours - theirs)[5:11, x - 3:x + 3].max() < 1e-5


def _for_each_engine(material):
    """Give Eevee an output of its own, black, and what there is to Cycles: its tree."""
    tree = material.node_tree
    tree.nodes["Material Output"].target = 'CYCLES'
    other = tree.nodes.new("ShaderNodeOutputMaterial")
    other.target = 'EEVEE'
    tree.links.new(tree.nodes.new("ShaderNodeEmission").outputs[0], other.inputs["Surface"])
    other.is_active_output = True
    return tree


def inside_outputs_by_engine():
    """A wall whose tree has a node of an add-on that is gone, by Volley and by Cycles, what Volley warns of a tree
    with a repeat zone, and whether one with such a node and an output for all engines is unrolled."""
    import bpy
    import scenes
    from volley.sync import flatten, inlined

    class Gone(bpy.types.Node):
        """A node of an add-on."""

        bl_idname, bl_label = "GoneNode", "Gone"

    scenes.empty(size=(16, 16))
    scenes.camera()
    material = scenes.emitter((0.2, 0.4, 0.6))
    scenes.wall("Wall", 6.0, 0.0, material=material)
    bpy.utils.register_class(Gone)
    _for_each_engine(material).nodes.new(Gone.bl_idname)
    plain = scenes.emitter((0.2, 0.4, 0.6), "Plain")
    plain.node_tree.nodes.new(Gone.bl_idname)
    bpy.utils.unregister_class(Gone)
    with inlined.shader_tree(plain) as (_, is_unrolled):
        pass
    pictures = scenes.by_both(4)
    told = set()
    if bpy.app.version >= (5, 0, 0):
        tree = _for_each_engine(scenes.emitter((0.2, 0.4, 0.6), "Repeated"))
        begin, end = (tree.nodes.new(f"GeometryNodeRepeat{side}put") for side in ("In", "Out"))
        begin.pair_with_output(end)
        end.repeat_items.new('FLOAT', "Sum")
        tree.links.new(end.outputs["Sum"], tree.nodes["Emission"].inputs["Strength"])
        with inlined.shader_tree(bpy.data.materials["Repeated"]) as (read, _):
            flatten.flatten(read, "Repeated", told)
    return pictures, sorted(told), is_unrolled


def test_outputs_by_engine(blender):
    """Blender's inlined trees lack outputs for one engine alone: the wall was black. They also lack nodes of add-ons,
    which are to be warned of."""
    import blender as blender_support
    (ours, theirs), told, is_unrolled = blender.run(inside_outputs_by_engine)
    assert ours[8, 8, :3] == pytest.approx((0.2, 0.4, 0.6), rel=1e-5)
    assert abs(ours - theirs).max() < 1e-5
    assert [line for line in told if "Repeat" in line] or blender_support.version() < (5, 0)
    assert not is_unrolled
