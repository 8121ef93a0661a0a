# SPDX-License-Identifier: Apache-2.0
"""Nodes that trace rays beside Cycles: Ambient Occlusion, Bevel, and Raycast from Blender 5.1 on, seen directly
as emission and in a mirror, and as what lights and colours surfaces. Means and tiles within 1 %, beyond what
noise explains. The table goes to results/tracing_nodes.txt of the build."""

import blender as blender_support
import compare
import pytest

SIZE = (64, 48)
SEEDS = (61, 62, 63, 64)
SAMPLES = 64
TOLERANCE = 0.01  # relative to the mean of the picture

# name: (node, settings, inputs, output that is shown, kind of the material). Inputs by name: a value, or the name of
# the Geometry node's output.
CASES = {
    "AO": ("AmbientOcclusion", {}, {}, "AO", "emission"),
    "AO near": ("AmbientOcclusion", {"samples": 3}, {"Distance": 0.4, "Color": (0.9, 0.5, 0.2, 1.0)}, "Color",
                "emission"),
    "AO of the world": ("AmbientOcclusion", {"samples": 1}, {"Distance": 0.0}, "AO", "emission"),
    "AO inside": ("AmbientOcclusion", {"inside": True}, {"Distance": 0.8}, "AO", "emission"),
    "AO local": ("AmbientOcclusion", {"only_local": True}, {"Distance": 2.0}, "AO", "emission"),
    "AO inside local": ("AmbientOcclusion", {"inside": True, "only_local": True, "samples": 40}, {"Distance": 0.5},
                        "AO", "emission"),
    "AO by a normal": ("AmbientOcclusion", {}, {"Normal": "Incoming"}, "AO", "emission"),
    "AO of points": ("AmbientOcclusion", {"samples": 8}, {"Distance": 0.6}, "AO", "points"),
    "AO as a colour": ("AmbientOcclusion", {"samples": 4}, {"Distance": 1.5}, "Color", "diffuse"),
    "bevel": ("Bevel", {}, {"Radius": 0.2}, "Normal", "normal"),
    "bevel wide": ("Bevel", {"samples": 9}, {"Radius": 0.6}, "Normal", "normal"),
    "bevel by a normal": ("Bevel", {}, {"Radius": 0.2, "Normal": "Incoming"}, "Normal", "normal"),
    "bevel of a mirror": ("Bevel", {"samples": 8}, {"Radius": 0.15}, "Normal", "mirror"),
    "bevel of matt": ("Bevel", {"samples": 8}, {"Radius": 0.25}, "Normal", "matt"),
    "hit": ("Raycast", {}, {"Direction": (0.4, 0.3, 0.9), "Length": 2.0}, "Is Hit", "emission"),
    "hit distance": ("Raycast", {}, {"Length": 4.0}, "Hit Distance", "emission"),
    "hit self": ("Raycast", {}, {"Direction": (0.4, 0.3, 0.9), "Length": 2.0}, "Self Hit", "emission"),
    "hit local": ("Raycast", {"only_local": True}, {"Direction": (1.0, 0.2, 0.1), "Length": 3.0}, "Hit Distance",
                  "emission"),
    "hit position": ("Raycast", {}, {"Direction": (0.5, 0.0, 1.0), "Length": 5.0}, "Hit Position", "normal"),
    "hit normal": ("Raycast", {}, {"Position": (0.3, -0.2, 4.0), "Direction": (0.0, 0.1, -1.0), "Length": 9.0},
                   "Hit Normal", "normal"),
}


# Inside Blender ------------------------------------------------------------------------------------

def _node_of(tree, kind, settings, inputs):
    node = tree.nodes.new(f"ShaderNode{kind}")
    for name, value in settings.items():
        setattr(node, name, value)
    for name, value in inputs.items():
        if isinstance(value, str):
            tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs[value], node.inputs[name])
        elif name in ("Position", "Direction"):  # whose values are not shown and do not count
            constant = tree.nodes.new("ShaderNodeCombineXYZ")
            for i in range(3):
                constant.inputs[i].default_value = value[i]
            tree.links.new(constant.outputs[0], node.inputs[name])
        else:
            node.inputs[name].default_value = value
    return node


def _material(kind, settings, inputs, output, shown):
    """A material that shows the output of a node: emission of it, of it as a normal, or a shader of it."""
    import scenes
    type_of = {"diffuse": "ShaderNodeBsdfDiffuse", "matt": "ShaderNodeBsdfDiffuse",
               "mirror": "ShaderNodeBsdfGlossy"}.get(shown, "ShaderNodeEmission")
    made = scenes.material("Shown", type_of)
    tree, shader = made.node_tree, scenes.shader_of(made)
    found = _node_of(tree, kind, settings, inputs).outputs[output]
    if shown == "normal":
        moved = tree.nodes.new("ShaderNodeVectorMath")
        moved.operation = 'MULTIPLY_ADD'
        moved.inputs[1].default_value, moved.inputs[2].default_value = (0.5,) * 3, (1.5,) * 3
        tree.links.new(found, moved.inputs[0])
        found = moved.outputs[0]
    if shown == "mirror":
        shader.inputs["Roughness"].default_value = 0.0
    tree.links.new(found, shader.inputs["Normal" if shown in ("mirror", "matt") else "Color"])
    return made


def build(kind, settings, inputs, output, shown):
    """Boxes that touch and a ball, or points in its place, on a floor, before a mirror, and a pane that lets
    shadow rays through. All but the last are of the material, the floor only if it shines: nothing shall be
    lit by what samples of lights find of it, which Cycles 5 traces rays for."""
    import bpy
    import scenes
    scene = scenes.empty(size=SIZE)
    scenes.camera(location=(0.5, -6.0, 3.2), rotation=(1.1, 0.0, 0.08))
    scenes.light_world((0.4, 0.5, 0.6))
    scene.world.light_settings.distance = 0.7
    scenes.light('POINT', location=(2.0, -3.0, 4.0), energy=300.0, shadow_soft_size=0.3)
    shown_by = _material(kind, settings, inputs, output, shown)
    grey = scenes.material("Grey", "ShaderNodeBsdfDiffuse", Color=(0.5, 0.5, 0.5))
    scenes.mesh("Floor", [(-6, -6, 0), (6, -6, 0), (6, 6, 0), (-6, 6, 0)], [(0, 1, 2, 3)],
                shown_by if shown in ("emission", "normal", "points") else grey)
    for size, place, turn in ((1.4, (-0.8, 0.0, 0.7), 0.3), (0.7, (-0.7, 0.0, 1.7), 0.9)):
        bpy.ops.mesh.primitive_cube_add(size=size, location=place, rotation=(0.0, 0.0, turn))
        bpy.context.object.data.materials.append(shown_by)
    bpy.context.object.scale.x = -1.4
    ball = scenes.sphere("Ball", 0.7, (1.0, -0.6, 0.7), shown_by)
    if shown == "points":
        nodes = scenes.geometry_nodes(ball, "GeometryNodeMeshToPoints", "GeometryNodeSetMaterial")
        nodes[0].inputs["Radius"].default_value, nodes[1].inputs["Material"].default_value = 0.1, shown_by
    tint = scenes.material("Tint", "ShaderNodeBsdfTransparent", Color=(0.9, 0.9, 0.9))
    scenes.mesh("Pane", [(0.4, -1.8, 0), (1.6, -1.8, 0), (1.6, -1.8, 1), (0.4, -1.8, 1)], [(0, 1, 2, 3)], tint)
    scenes.mesh("Mirror", [(-3, 1.6, 0), (3, 1.6, 0), (3, 1.6, 3), (-3, 1.6, 3)], [(0, 1, 2, 3)],
                scenes.material("Mirror", "ShaderNodeBsdfGlossy", Color=(0.8, 0.8, 0.8), Roughness=0.0))


def inside_pictures(names):
    """{case: (pictures by Volley, pictures by Cycles)}, one for each seed, of the nodes that there are."""
    import scenes
    pictures = {}
    for name in names:
        if not scenes.has_node(f"ShaderNode{CASES[name][0]}"):
            continue
        build(*CASES[name])
        pictures[name] = scenes.seeds_by_both(SAMPLES * len(SEEDS), SEEDS)
    return pictures


MET = {"Tint": ('FLOAT_COLOR', 'POINT', 4), "Heat": ('FLOAT', 'FACE', 1), "Flow": ('FLOAT_VECTOR', 'POINT', 3)}
SAMPLED = (('RGBA', "Tint"), ('FLOAT', "Tint"), ('FLOAT', "Heat"), ('VECTOR', "Flow"), ('RGBA', "Missing"))


def _bring_attributes():
    """The attributes of MET on the ball and the boxes; the floor has none."""
    import bpy
    import numpy as np
    random = np.random.RandomState(5)
    for made in bpy.data.objects:
        if made.type == 'MESH' and made.name not in ("Floor", "Pane", "Mirror"):
            for name, (kind, domain, width) in MET.items():
                data = made.data.attributes.new(name, kind, domain).data
                values = random.uniform(0.1, 1.0, len(data) * width)
                data.foreach_set({1: "value", 3: "vector", 4: "color"}[width], values)


def inside_attributes():
    """{socket: its pictures by Volley and by Cycles}: what all shine with is what their rays meet."""
    import bpy
    import scenes
    build("Raycast", {}, {"Direction": (0.3, -0.1, 0.9), "Length": 9.0}, "Is Hit", "emission")
    _bring_attributes()
    material = bpy.data.materials["Shown"]
    tree = material.node_tree
    node = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeRaycast")
    tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Position"], node.inputs["Position"])
    for kind, name in SAMPLED:
        node.sample_attribute_items.new(kind, f"Sampled {name}")
        field = [each for each in node.inputs if each.type == 'STRING'][-1]
        field.default_value = name
        # No socket of a shader's tree has text: what is linked to a name changes nothing.
        tree.links.new(tree.nodes.new("ShaderNodeValue").outputs[0], field)
    pictures = {}
    for socket in [each for each in node.outputs if each.identifier.startswith("Attribute_")]:
        tree.links.new(socket, scenes.shader_of(material).inputs["Color"])
        pictures[socket.identifier] = scenes.seeds_by_both(16 * len(SEEDS), SEEDS)
    return pictures


# Comparison ----------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def errors(blender_of_module):
    """The errors of all cases, from one Blender, and their table."""
    pictures = blender_of_module.run(inside_pictures, list(CASES), timeout=600)
    found, lines = compare.errors_of_cases(pictures)
    blender_support.write_result("tracing_nodes", lines, compare.largest_errors(found))
    return found


SINCE = (5, 1), "the Raycast node came with 5.1"


def _parameter(name):
    return pytest.param(name, marks=[pytest.mark.since(*SINCE)] if CASES[name][0] == "Raycast" else [])


@pytest.mark.parametrize("name", list(map(_parameter, CASES)))
def test_against_cycles(errors, name):
    if name not in errors:
        pytest.skip("this Blender has no such node")
    _mean, biased, tile = errors[name]
    assert biased < TOLERANCE
    assert tile < TOLERANCE


@pytest.mark.since(*SINCE)
def test_attributes_of_what_is_met(blender):
    if blender_support.version() < SINCE[0]:
        pytest.skip(SINCE[1])
    pictures = blender.run(inside_attributes)
    assert len(pictures) == len(SAMPLED) + 2  # with the alpha of colours
    found, _lines = compare.errors_of_cases(pictures)
    for name, (mean, biased, tile) in found.items():
        print(name, mean, biased, tile)
        assert biased < TOLERANCE and tile < TOLERANCE, name
