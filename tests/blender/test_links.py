# SPDX-License-Identifier: Apache-2.0
"""What comes through muted nodes, reroutes and groups, and out of long chains and large mixes beside Cycles, on a
wall that shines before a grey world. Means and tiles within 1 %, beyond what noise explains. The table goes to
results/links.txt of the build."""

import blender as blender_support
import compare
import pytest

SIZE = (32, 24)
SEEDS = (71, 72)
SAMPLES = 32
TOLERANCE = 0.01  # relative to the mean of the picture
COLOR = (0.2, 0.4, 0.8, 1.0)


# Inside Blender ------------------------------------------------------------------------------------

class Wall:
    """The tree of a wall that shines, with short names for what builds it."""

    def __init__(self):
        import scenes
        scenes.empty(size=SIZE)
        scenes.camera()
        scenes.light_world((0.2, 0.2, 0.2))
        material = scenes.emitter((0.9, 0.7, 0.5))
        scenes.wall(size=2.6, material=material)
        self.tree, self.emission = material.node_tree, scenes.shader_of(material)
        self.output = self.tree.nodes["Material Output"]

    def add(self, kind, *values, tree=None, **settings):
        """A node whose first inputs have those values, None for one that keeps its own."""
        node = (tree or self.tree).nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        for socket, value in zip(node.inputs, values):
            if value is not None:
                socket.default_value = value
        return node

    def constant(self, number):
        """A Value node of that number."""
        node = self.add("ShaderNodeValue")
        node.outputs[0].default_value = number
        return node

    def link(self, output, socket):
        """Link two sockets of one tree; returns the node that is linked to."""
        socket.id_data.links.new(output, socket)
        return socket.node

    def show(self, node):
        """Shine with a node's first output."""
        self.link(node.outputs[0], self.emission.inputs["Color"])


    def group(self, inputs, output='Color'):
        """A group in the tree with inputs {name: kind of socket} and one output: its node, and the nodes in it that
        stand for its inputs and for its output."""
        import bpy
        made = bpy.data.node_groups.new("Group", "ShaderNodeTree")
        for name, kind, side in [(*each, 'INPUT') for each in inputs.items()] + [("Shown", output, 'OUTPUT')]:
            if hasattr(made, "interface"):
                made.interface.new_socket(name, in_out=side, socket_type=f"NodeSocket{kind}")
            else:
                getattr(made, side.lower() + "s").new(f"NodeSocket{kind}", name)
        node = self.add("ShaderNodeGroup", node_tree=made)
        return node, self.add("NodeGroupInput", tree=made), self.add("NodeGroupOutput", tree=made)


def _hide_value(tree):
    """Hide the value of a group's first input, as its user may."""
    if hasattr(tree, "interface"):
        next(each for each in tree.interface.items_tree if each.in_out == 'INPUT').hide_value = True
    else:
        tree.inputs[0].hide_value = True


def _muted(kind, *values):
    """Shine with a muted node."""
    def build(wall):
        wall.show(wall.add(kind, *values, mute=True))
    return build


def _into(kind, *values, number, through):
    """Shine with a node to whose input of that number nodes are linked that pass on nothing."""
    def build(wall):
        node = wall.add(kind, *values)
        first, *others = [wall.add(each, mute=each != "NodeReroute") for each in through]
        for each in others:
            first = wall.link(first.outputs[0], each.inputs[0])
        wall.show(wall.link(first.outputs[0], node.inputs[number]))
    return build


def _factor(wall):
    """A reroute that nothing is linked to, as the factor between two shaders."""
    mix = wall.add("ShaderNodeMixShader", 0.25)
    other = wall.add("ShaderNodeEmission", (0.1, 0.9, 0.3, 1.0))
    wall.link(wall.add("NodeReroute").outputs[0], mix.inputs[0])
    wall.link(wall.emission.outputs[0], mix.inputs[1])
    wall.link(other.outputs[0], mix.inputs[2])
    wall.link(mix.outputs[0], wall.output.inputs["Surface"])


def _bent(wall):
    """A muted vector for the normal of a matt wall under a sun."""
    import scenes
    scenes.light('SUN', energy=2.0)
    diffuse = wall.add("ShaderNodeBsdfDiffuse")
    wall.link(wall.add("ShaderNodeVectorMath", mute=True).outputs[0], diffuse.inputs["Normal"])
    wall.link(diffuse.outputs[0], wall.output.inputs["Surface"])


def _within(kind, *values, name, value=(0.3, 0.6, 0.9), socket='Vector', is_hidden=False):
    """A group's input, to which nothing is linked, feeds the input of that name of a node in the group."""
    def build(wall):
        node, begin, end = wall.group({"Given": socket})
        if is_hidden:
            _hide_value(node.node_tree)
        node.inputs[0].default_value = value
        inner = wall.add(kind, *values, tree=node.node_tree)
        wall.link(begin.outputs[0], inner.inputs[name])
        wall.link(inner.outputs[0], end.inputs[0])
        wall.show(node)
    return build


def _nested(wall):
    """As _within of a texture, in a group within a group."""
    outer, outer_begin, outer_end = wall.group({"Given": 'Vector'})
    inner, inner_begin, inner_end = wall.group({"Given": 'Vector'})
    moved = wall.add("ShaderNodeGroup", tree=outer.node_tree, node_tree=inner.node_tree)
    wall.tree.nodes.remove(inner)
    noise = wall.add("ShaderNodeTexNoise", tree=moved.node_tree)
    wall.link(inner_begin.outputs[0], noise.inputs["Vector"])
    wall.link(noise.outputs[0], inner_end.inputs[0])
    wall.link(outer_begin.outputs[0], moved.inputs[0])
    wall.link(moved.outputs[0], outer_end.inputs[0])
    wall.show(outer)


def _ending(kind, *values, name):
    """A group's output, to which nothing is linked in it, feeds the input of that name of a node."""
    def build(wall):
        group, _begin, end = wall.group({}, 'Vector')
        end.inputs[0].default_value = (0.3, 0.6, 0.9)
        node = wall.add(kind, *values)
        wall.link(group.outputs[0], node.inputs[name])
        wall.show(node)
    return build


def _converted(number, socket, output='Color'):
    """A number goes into a group by a socket of one kind and out of it by one of another, and three eighths of it are
    added to two."""
    def build(wall):
        group, begin, end = wall.group({"Given": socket}, output)
        wall.link(begin.outputs[0], end.inputs[0])
        if isinstance(number, bool):
            group.inputs[0].default_value = number
        else:
            given = number(wall) if callable(number) else wall.constant(number)
            wall.link(given.outputs[0], group.inputs[0])
        shown = wall.add("ShaderNodeMath", None, 0.375, 2.0, operation='MULTIPLY_ADD')
        wall.show(wall.link(group.outputs[0], shown.inputs[0]))
    return build


def _coordinate(scale, offset):
    """The first UV coordinate, scaled and moved."""
    def build(wall):
        parts = wall.add("ShaderNodeSeparateXYZ")
        wall.link(wall.add("ShaderNodeTexCoord").outputs["UV"], parts.inputs[0])
        moved = wall.add("ShaderNodeMath", None, scale, offset, operation='MULTIPLY_ADD')
        return wall.link(parts.outputs[0], moved.inputs[0])
    return build


def _color(wall):
    """A colour whose grey is between 1 and 2, and its mean between 2 and 3."""
    node = wall.add("ShaderNodeRGB")
    node.outputs[0].default_value = (0.5, 0.9, 7.0, 1.0)
    return node


def _vector(wall):
    return wall.add("ShaderNodeCombineXYZ", 0.5, 0.9, 7.0)


def _with_output(wall, color, socket="Surface"):
    """A group that nothing is linked to, with an output of its own: its node, and that output."""
    group, _begin, _end = wall.group({})
    end = wall.add("ShaderNodeOutputMaterial", tree=group.node_tree)
    wall.link(wall.add("ShaderNodeEmission", color, tree=group.node_tree).outputs[0], end.inputs[socket])
    return group, end


def _output_in_group(wall):
    _with_output(wall, COLOR)
    wall.tree.nodes.remove(wall.output)


def _output_in_nested(wall):
    """An output in a group of a group."""
    inner, _end = _with_output(wall, COLOR)
    outer, _begin, _end = wall.group({})
    wall.add("ShaderNodeGroup", tree=outer.node_tree, node_tree=inner.node_tree)
    wall.tree.nodes.remove(inner)
    wall.tree.nodes.remove(wall.output)


def _outputs_in_groups(wall):
    for color in (COLOR, (0.9, 0.1, 0.3, 1.0)):
        _with_output(wall, color)
    wall.tree.nodes.remove(wall.output)


def _output_in_muted(wall):
    group, _end = _with_output(wall, COLOR)
    group.mute = True


def _muted_output_in_group(wall):
    _group, end = _with_output(wall, COLOR)
    end.mute = True


def _muted_output(wall):
    wall.output.mute = True


def _empty_output(wall):
    """An output in a group, and one outside that nothing is linked to."""
    _with_output(wall, COLOR)
    wall.tree.links.remove(wall.output.inputs["Surface"].links[0])


def _chain(wall, value, kinds, settings=()):
    """A number that goes through nodes of those kinds, by their first inputs."""
    for kind, node_settings in zip(kinds, settings or [((), {})] * len(kinds)):
        values, named = node_settings
        node = wall.add(kind, None, *values, **named)
        wall.tree.links.new(value.outputs[0], node.inputs[0])  # reroutes have other sockets then
        value = node
    return value


def _long_chain(wall):
    """A thousand Math nodes, half of which add what the others take away but for a thousandth."""
    steps = [((0.001,), {"operation": 'ADD'}), ((0.9995,), {"operation": 'MULTIPLY'})] * 500
    wall.show(_chain(wall, _coordinate(1.0, 0.0)(wall), ["ShaderNodeMath"] * len(steps), steps))


def _long_mixes(wall):
    """Three hundred mixes of colours, each of which is the factor and a colour of the next."""
    color = wall.add("ShaderNodeTexCoord").outputs["UV"]
    for number in range(300):
        mix = wall.add("ShaderNodeMixRGB", None, None, (0.9 - 0.002 * number, 0.3, 0.002 * number, 1.0),
                       blend_type='SCREEN' if number % 2 else 'MULTIPLY')
        wall.link(color, mix.inputs[0])
        wall.link(color, mix.inputs[1])
        color = mix.outputs[0]
    wall.link(color, wall.emission.inputs["Color"])


def _long_reroutes(wall):
    wall.show(_chain(wall, _coordinate(1.0, 0.0)(wall), ["NodeReroute"] * 600))


def _deep_groups(wall):
    """Fifty groups in each other, each of which adds to what the one in it makes."""
    inner = None
    for number in range(50):
        group, begin, end = wall.group({"Given": 'Float'}, 'Float')
        tree = group.node_tree
        value = begin
        if inner is not None:
            value = wall.add("ShaderNodeGroup", tree=tree, node_tree=inner.node_tree)
            wall.link(begin.outputs[0], value.inputs[0])
            wall.tree.nodes.remove(inner)
        added = wall.add("ShaderNodeMath", None, 0.01 + 0.0001 * number, tree=tree)
        wall.link(value.outputs[0], added.inputs[0])
        wall.link(added.outputs[0], end.inputs[0])
        inner = group
    wall.link(_coordinate(1.0, 0.0)(wall).outputs[0], inner.inputs[0])
    wall.show(inner)


def _many_shaders(kinds, count=64, **values):
    """Under a sun, a mix of shaders of colours of their own, about as much of each."""
    def build(wall):
        import scenes
        scenes.light('SUN', rotation=(1.2, 0.3, 0.0), energy=3.0)
        noise = wall.add("ShaderNodeTexNoise", None, None, 3.0)
        coordinate = _coordinate(1.0, 0.0)(wall)
        shown = None
        for number in range(count):
            shader = wall.add(kinds[number % len(kinds)])
            for name, value in values.items():
                if name in shader.inputs:
                    shader.inputs[name].default_value = value
            tinted = wall.add("ShaderNodeMixRGB", 0.5, None,
                              (0.9 - 0.01 * number, number % 3 / 3, 0.01 * number, 1.0))
            wall.link(noise.outputs["Color"], tinted.inputs[1])
            wall.link(tinted.outputs[0], shader.inputs[0])
            if shown is None:
                shown = shader
                continue
            factor = wall.add("ShaderNodeMath", None, 0.8 / (number + 1), 0.6 / (number + 1), operation='MULTIPLY_ADD')
            wall.link(coordinate.outputs[0], factor.inputs[0])
            mix = wall.add("ShaderNodeMixShader")
            wall.link(factor.outputs[0], mix.inputs[0])
            wall.link(shown.outputs[0], mix.inputs[1])
            wall.link(shader.outputs[0], mix.inputs[2])
            shown = mix
        wall.link(shown.outputs[0], wall.output.inputs["Surface"])
    return build


LOOSE = {
    "muted mix": _muted("ShaderNodeMixRGB", None, COLOR, COLOR),
    "muted number": _muted("ShaderNodeMath", 0.3),
    "muted colour": _muted("ShaderNodeRGB"),
    "muted noise": _muted("ShaderNodeTexNoise"),
    "muted mapping": _into("ShaderNodeTexNoise", number=0, through=("ShaderNodeMapping",)),
    "muted number to a texture": _into("ShaderNodeTexNoise", number=0, through=("ShaderNodeMath",)),
    "muted colour to a reroute": _into("ShaderNodeMath", 0.7, 0.2, number=0, through=("ShaderNodeRGB", "NodeReroute")),
    "muted normal": _bent,
    "reroute to a texture": _into("ShaderNodeTexNoise", number=0, through=("NodeReroute",)),
    "reroutes to a texture": _into("ShaderNodeTexNoise", number=0, through=("NodeReroute", "NodeReroute")),
    "reroute to a number": _into("ShaderNodeMath", 0.7, 0.2, number=0, through=("NodeReroute",)),
    "reroute to a vector": _into("ShaderNodeVectorRotate", (0.9, 0.3, 0.1), number=0, through=("NodeReroute",)),
    "reroute to a factor": _factor,
}
GROUPS = {
    "group's vector to a texture": _within("ShaderNodeTexNoise", name="Vector"),
    "group's hidden vector to a texture": _within("ShaderNodeTexNoise", name="Vector", is_hidden=True),
    "group's number to a texture": _within("ShaderNodeTexNoise", name="Vector", value=0.7, socket='Float'),
    "group's hidden vector to a sum": _within("ShaderNodeVectorMath", None, (0.1, 0.2, 0.05), name=0, is_hidden=True),
    "group's vector to a turn": _within("ShaderNodeVectorRotate", name="Vector"),
    "group's vector to white noise": _within("ShaderNodeTexWhiteNoise", name="Vector"),
    "group's vector in a group": _nested,
    "group's own output to a texture": _ending("ShaderNodeTexNoise", name="Vector"),
    "group's own output to a sum": _ending("ShaderNodeVectorMath", None, (0.1, 0.2, 0.05), name=0),
}
KINDS = {
    "whole number": _converted(2.7, 'Int'),
    "whole number below 0": _converted(-2.7, 'Int'),
    "whole number of a coordinate": _converted(_coordinate(6.0, -3.0), 'Int'),
    "whole number of a colour": _converted(_color, 'Int'),
    "whole number of a vector": _converted(_vector, 'Int'),
    "whole number at the output": _converted(2.7, 'Float', 'Int'),
    "switch by a fraction": _converted(0.3, 'Bool'),
    "switch by a number below 0": _converted(-1.3, 'Bool'),
    "switch by a coordinate": _converted(_coordinate(6.0, -3.0), 'Bool'),
    "switch that is on": _converted(True, 'Bool'),
    "switch at the output": _converted(2.7, 'Float', 'Bool'),
}
OUTPUTS = {
    "output in a group": _output_in_group,
    "output in a nested group": _output_in_nested,
    "outputs in groups": _outputs_in_groups,
    "output in a group and outside": lambda wall: _with_output(wall, COLOR),
    "output in a group and an empty one": _empty_output,
    "output in a muted group": _output_in_muted,
    "muted output": _muted_output,
    "muted output in a group": _muted_output_in_group,
}
# Chains of more than 119 nodes were cut, mixes of more than 16 shaders had the default material: off by up to all of
# the picture.
LARGE = {
    "a thousand numbers": _long_chain,
    "three hundred mixes": _long_mixes,
    "six hundred reroutes": _long_reroutes,
    "fifty groups in each other": _deep_groups,
    "64 diffuse shaders": _many_shaders(["ShaderNodeBsdfDiffuse"]),
    "64 shaders": _many_shaders(["ShaderNodeBsdfDiffuse", "ShaderNodeBsdfGlossy", "ShaderNodeBsdfTranslucent",
                                 "ShaderNodeEmission"], Roughness=0.6),
}
CASES = {**LOOSE, **GROUPS, **KINDS, **OUTPUTS, **LARGE}


def inside_pictures(names):
    """{case: (pictures by Volley, pictures by Cycles)}, one for each seed."""
    import scenes
    pictures = {}
    for name in names:
        CASES[name](Wall())
        pictures[name] = scenes.seeds_by_both(SAMPLES * len(SEEDS), SEEDS)
    return pictures


# Comparison ----------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def errors(blender_of_module):
    """The errors of all cases, from one Blender, and their table."""
    pictures = blender_of_module.run(inside_pictures, list(CASES), timeout=600)
    found, lines = compare.errors_of_cases(pictures)
    blender_support.write_result("links", lines, compare.largest_errors(found))
    return found


@pytest.mark.parametrize("name", list(CASES))
def test_against_cycles(errors, name):
    _mean, biased, tile = errors[name]
    assert biased < TOLERANCE
    assert tile < TOLERANCE
