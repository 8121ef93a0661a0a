# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees to flat node lists.

Walks a tree from its output: groups are entered, reroutes and muted nodes and links are followed as
Blender does, values are converted between colour, vector and number where a link does so. What single
nodes mean is in ``nodes.py``. Works on any node tree and keeps nothing of it.

Fallbacks: a node that is not supported leaves the input it feeds at that socket's own value; a shader
that is not supported becomes a diffuse of its colour. Each is named once in the warnings.
"""

import math

from ..abi import DisplacementMethod, MathOperation as Math, NodeType, VectorOperation as Vector
from ..compat import BUMP_FILTER_WIDTH, HAS_BOOLEAN_SOCKETS, INLINES_GROUPS, aov_name
from . import nodes, tree_links, working_space
from .node_list import input_number, output, takes_generated
from .tree_links import MAX_GROUPS
from .values import CONSTANT, DEFAULT, NO_SHADER, Value

_KINDS = {'VALUE': 'f', 'INT': 'f', 'BOOLEAN': 'f', 'RGBA': 'c', 'VECTOR': 'v', 'ROTATION': 'v',
          'SHADER': 's'}
# What Blender 5 computes where all inputs are constants.
_FOLDED = {NodeType.MATH, NodeType.VECTOR_MATH, NodeType.COMBINE, NodeType.SEPARATE, NodeType.MIX_COLOR, NodeType.CLAMP,
           NodeType.MAP_RANGE, NodeType.RGB_TO_BW}

# Inputs whose value is hidden though it counts: nothing stands in for it.
_WITHOUT_DEFAULT = {
    ("ShaderNodeVectorRotate", "Vector"), ("ShaderNodeMapRange", "Vector"), ("ShaderNodeTexWhiteNoise", "Vector"),
    ("ShaderNodeBsdfRayPortal", "Direction"), ("ShaderNodeOutputMaterial", "Displacement")}
# Python's own stack ends at about a thousand calls, which a link takes up to ten of.
_MAX_LINKS = 30    # in a chain that is walked at once; longer ones are walked from their far ends, piece by piece


class FlatNode:
    """One node of the list, with the fields native.Scene.create_material reads."""

    __slots__ = ("type", "mode", "inputs", "image", "name", "table")

    def __init__(self, node_type, inputs, mode=0, image=0, name="", table=None):
        self.type, self.inputs, self.mode = node_type, inputs, mode
        self.image, self.name, self.table = image, name, table

    def signature(self):
        """Equal for nodes that mean the same."""
        table = None if self.table is None else self.table.tobytes()
        return self.type, self.mode, tuple(self.inputs), self.image, self.name, table


# What the light of a shader is a product of.
_EMISSIONS = {NodeType.EMISSION: ("color", "strength"), NodeType.PRINCIPLED: ("emission", "emission_strength"),
              NodeType.LAYERED_PRINCIPLED: ("emission_color", "emission_strength")}


def _may_exceed_zero(node_input):
    node, _output, constant = node_input
    return node != CONSTANT or any(constant)


class FlatTree:
    """A flattened tree: nodes, the index of the output shader, the mesh attributes it reads."""

    def __init__(self):
        self.nodes = []
        self.surface = -1
        self.uv_names = set()     # "" is the default UV map
        self.color_names = set()  # "" is the active colour attribute
        self.needs_generated = False  # coordinates of the undeformed mesh
        self.needs_instancer = False  # what made the instance, see instance.instancer_values
        self.instance_attributes = set()  # (type, name), see attributes.Attributes
        self.film_colors = None   # of thin films: working_space.from_rec709_matrix, None in Rec.709
        self.sun = None           # sky_texture.Sun that the tree shows
        self.follows_scene = False  # it reads where other objects are, or properties of the view layer
        self.has_volume = False   # something is linked to the output's Volume

    def moves_vertices(self):
        """Whether its displacement does."""
        moving = DisplacementMethod.TRUE | DisplacementMethod.BOTH
        return any(node.type == NodeType.DISPLACEMENT_OUTPUT and node.mode & moving for node in self.nodes)

    def emits(self):
        """Whether one of its shaders may emit light."""
        return any(all(_may_exceed_zero(node.inputs[input_number(node.type, name)]) for name in _EMISSIONS[node.type])
                   for node in self.nodes if node.type in _EMISSIONS)

    def ask_nothing(self):
        """Have no mesh and no instance bring anything: lights and worlds are read without."""
        self.uv_names, self.color_names, self.instance_attributes = set(), set(), set()
        self.needs_generated = self.needs_instancer = False

    def signature(self):
        """Equal for trees that mean the same."""
        return self.surface, self.film_colors, tuple(node.signature() for node in self.nodes)


def flatten(tree, label, warnings, images=None, aovs=None, attributes=None, displacement=None,
            is_of_world=False):
    """The surface of a material or world tree as a FlatTree.

    label names the owner in messages; images: image.Images, without which all are missing; aovs:
    {name: (type, number)} of those that are asked for; attributes: attributes.Attributes, without which
    those of meshes alone are read; displacement: the mode of a DISPLACEMENT_OUTPUT, None where there is
    none."""
    walker = Walker(label, warnings, images, attributes)
    walker.is_of_world = is_of_world
    sockets = _end_sockets(_ends(tree), walker.links)
    if "Volume" in sockets:
        warnings.add(f"{label}: volume is not supported and is left out")
    walker.is_displaced = displacement is not None and "Displacement" in sockets
    try:
        value = walker.input_value(*sockets["Surface"]) if "Surface" in sockets else NO_SHADER
        if walker.is_displaced:
            walker.emit_displacement(*sockets["Displacement"], displacement)
        if aovs:
            walker.emit_aovs(tree, aovs, ())
    except RecursionError:
        warnings.add(f"{label}: the node tree is too deep and is left out")
        return FlatTree()
    if value.kind == 's' and value.node >= 0:
        walker.flat.surface = value.node
    walker.flat.has_volume = "Volume" in sockets
    return walker.flat


def _ends(tree, path=()):
    """The outputs of a tree and of the groups in it that count, those first that have their way, each with its
    path."""
    inner = [each for node in tree.nodes if _is_entered(node, path)
             for each in _ends(node.node_tree, path + (node,))]
    end = tree.get_output_node('CYCLES')
    own = [] if end is None or end.mute and not INLINES_GROUPS else [(end, path)]
    if INLINES_GROUPS:
        return sorted(own + inner, key=lambda each: each[0].target != 'CYCLES')[:1]
    return inner + own


def output_socket(tree, name):
    """The socket of that name whose link is followed, be its output in a group; where none is linked, that of an
    output that counts, None without any."""
    ends = _ends(tree)
    linked = _end_sockets(ends, tree_links.TreeLinks()).get(name)
    if linked is not None:
        return linked[0]
    return next((socket for end, _ in reversed(ends) for socket in end.inputs if socket.identifier == name), None)


def _is_entered(node, path):
    """Whether a node on a path is a group in which nodes work by themselves, not by what is linked to it."""
    return node.type == 'GROUP' and not node.mute and node.node_tree is not None and len(path) < MAX_GROUPS


def _end_sockets(ends, links):
    """{identifier: (socket, path)} of what is linked to outputs: each socket of the first where it is."""
    return {socket.identifier: (socket, path) for end, path in reversed(ends) for socket in end.inputs
            if links.source(socket) is not None}


class Walker:
    """Walks one tree. A path is the tuple of group nodes that were entered on the way."""

    def __init__(self, label, warnings, images=None, attributes=None):
        self.flat = FlatTree()
        self.label, self.attributes = label, attributes
        self.links = tree_links.TreeLinks()
        self.is_displaced = False  # the material has a displacement
        self.is_of_world = False
        self._warnings = warnings
        self._images = images
        self._done = {}       # (path names, node name) -> {output identifier: Value}
        self._active = set()  # the nodes being walked, to notice loops
        self._passed = {}     # (path names, node name, output identifier) -> Value, of what passes values on
        self._heights = {}    # the same key -> links below it, of outputs at the end of long chains
        self._depth = 0       # links on the way to what is being walked

    def warn(self, text):
        """Add a message about this tree."""
        self._warnings.add(f"{self.label}: {text}")

    def image_of(self, node):
        """The library's id of an image node's image, 0 for a missing one."""
        return self._images.id_of(node) if self._images else 0

    def tiles_of(self, node):
        """The tiles of an image node's tiled image: (column, row, library's id) of each."""
        return self._images.tiles_of(node) if self._images else []

    def table_image(self, name, make, *arguments):
        """The library's id of a table of colours, make(*arguments)."""
        return self._images.id_of_table(name, make, *arguments) if self._images else 0

    def emit(self, node_type, values, mode=0, image=0, name="", table=None):
        """Append a node; values: its inputs as Values in the library's order. Returns its index."""
        inputs = [(value.node, value.output, value.constant) for value in values]
        self.flat.needs_generated |= takes_generated(node_type, values)
        self.flat.nodes.append(FlatNode(node_type, inputs, mode, image, name, table))
        return len(self.flat.nodes) - 1

    def depends_on(self, value, node_type, name):
        """Whether an output of that name of a node of that type is among what a value is made of."""
        waiting, seen = [value.node], set()
        while waiting:
            index = waiting.pop()
            if index < 0 or index in seen:
                continue
            seen.add(index)
            for source, number, _constant in self.flat.nodes[index].inputs:
                if source >= 0 and self.flat.nodes[source].type == node_type:
                    if output(source, node_type, name).output == number:
                        return True
                waiting.append(source)
        return False

    def emit_displacement(self, socket, path, mode):
        """Append the output for what comes to a socket of a tree's end."""
        vector = self.convert(self.input_value(socket, path), 'v')
        width = Value('f', CONSTANT, 0, (BUMP_FILTER_WIDTH, 0.0, 0.0))
        self.emit(NodeType.DISPLACEMENT_OUTPUT, (vector, width), mode)

    def emit_aovs(self, tree, aovs, path):
        """Append the AOV outputs of a tree and of the groups in it, wherever they stand."""
        for node in tree.nodes:
            if _is_entered(node, path):
                self.emit_aovs(node.node_tree, aovs, path + (node,))
            elif node.type == 'OUTPUT_AOV' and not node.mute and aov_name(node) in aovs:
                aov_type, number = aovs[aov_name(node)]
                socket = node.inputs["Value" if aov_type == 'VALUE' else "Color"]
                node_type = NodeType.AOV_VALUE if aov_type == 'VALUE' else NodeType.AOV_COLOR
                self.emit(node_type, (self.input_value(socket, path),), mode=number)

    # Inputs

    def input_value(self, socket, path):
        """What an input socket holds, in the socket's own kind."""
        source = self.links.source(socket)
        value = None if source is None else self._output_value(source, path)
        if value is None or value.is_loose and _has_default(socket):
            return _unlinked(socket)
        return self._held_by(socket, value)._replace(is_loose=False)

    def is_linked(self, socket):
        """Whether a link that counts ends at the socket."""
        return self.links.source(socket) is not None

    # Outputs

    def _output_value(self, socket, path):
        """The value of an output socket, None where nothing is supported behind it."""
        if self._depth == _MAX_LINKS:
            self._walk_below(socket, path)
        self._depth += 1
        if tree_links.passes_on(socket.node):
            key = tree_links.key_of(socket, path)
            if key not in self._passed:
                self._passed[key] = self._value_passed_on(socket, path)
            value = self._passed[key]
        else:
            value = self._node_outputs(socket.node, path).get(socket.identifier)
        self._depth -= 1
        return value

    def _walk_below(self, socket, path):
        """Have the values along the chains that end at an output, from their far ends, as often as keeps the way
        from one to the next short."""
        waiting, depth = [(socket, path, False)], self._depth
        while waiting:
            socket, path, is_below_known = waiting.pop()
            key = tree_links.key_of(socket, path)
            if is_below_known:
                self._heights[key] = 1 + max(
                    (self._heights[tree_links.key_of(*each)] for each in self.links.sources(socket, path)), default=0)
                if self._heights[key] % _MAX_LINKS == 0:
                    self._depth = 0
                    self._output_value(socket, path)
            elif key not in self._heights:
                self._heights[key] = 0  # until it is known, and in a loop
                waiting.append((socket, path, True))
                waiting.extend((*each, False) for each in self.links.sources(socket, path))
        self._depth = depth

    def _value_passed_on(self, socket, path):
        node = socket.node
        if node.mute:
            return self._through_muted(node, socket, path)
        if node.type == 'REROUTE':
            return self._passed_on(node.inputs[0], socket, path, _nothing(socket))
        if node.type == 'GROUP':
            return self._into_group(node, socket, path)
        return self._out_of_group(socket, path)

    def _through_muted(self, node, socket, path):
        inside = tree_links.muted_input(node, socket)
        return None if inside is None else self._passed_on(inside, socket, path, _nothing(socket))

    def _passed_on(self, socket, end, path, otherwise):
        """What comes to a socket and leaves at an output, end; otherwise, where nothing comes."""
        if end.type == 'BOOLEAN' and not HAS_BOOLEAN_SOCKETS:
            return None
        source = self.links.source(socket)
        value = None if source is None else self._output_value(source, path)
        if value is None:
            return otherwise
        return self._held_by(end, value) if self._converts_on_the_way(value) else value

    def _into_group(self, node, socket, path):
        tree = node.node_tree
        if tree is None:
            return _nothing(socket)
        if tree_links.is_too_deep(tree, path):
            self.warn(f"group '{tree.name}' contains itself, its value is left out")
            return None
        active = tree_links.active_output(tree)
        if active is None:
            return _nothing(socket)
        inside = tree_links.same(active.inputs, socket)
        return None if inside is None else self._passed_on(inside, socket, path + (node,), _held(inside))

    def _out_of_group(self, socket, path):
        outside = tree_links.same(path[-1].inputs, socket) if path else None
        return None if outside is None else self._passed_on(outside, socket, path[:-1], _held(outside))

    def _node_outputs(self, node, path):
        key = (tree_links.names(path), node.name)
        if key in self._done:
            return self._done[key]
        if key in self._active:
            self.warn(f"node '{node.name}' is in a loop, its value is left out")
            return {}
        self._active.add(key)
        outputs = nodes.translate(self, node, path)
        self._active.discard(key)
        self._done[key] = outputs
        return outputs

    # Conversions

    def _converts_on_the_way(self, value):
        """Whether a value takes on the kind of each socket that it comes through, not that of the last alone."""
        is_rgb = value.kind == 'c' and value.node == CONSTANT  # RGB nodes stay, Value nodes do not
        return not INLINES_GROUPS or (self._is_folded(value.node) and not is_rgb)

    def _is_folded(self, index):
        """Whether Blender makes a constant of a node when it inlines groups."""
        waiting, seen = [index], {CONSTANT}
        while waiting:
            index = waiting.pop()
            if index in seen:
                continue
            if index < 0 or self.flat.nodes[index].type not in _FOLDED:
                return False
            seen.add(index)
            waiting.extend(source for source, _output, _constant in self.flat.nodes[index].inputs)
        return True

    def _held_by(self, socket, value):
        """What a socket holds of a value that comes to it."""
        value = self.convert(value, _kind(socket))
        if socket.type == 'BOOLEAN' and INLINES_GROUPS:  # before, they were whole numbers
            return self._math(Math.GREATER_THAN, value, lambda number: float(number > 0.0))
        return self._math(Math.TRUNC, value, math.trunc) if socket.type in {'INT', 'BOOLEAN'} else value

    def _math(self, operation, value, function):
        """The result of a Math node whose other inputs are 0, at once where the value is a constant."""
        if value.node == CONSTANT:
            return value._replace(constant=(float(function(value.constant[0])), 0.0, 0.0))
        zero = Value('f', CONSTANT, 0)
        return Value('f', self.emit(NodeType.MATH, (value, zero, zero), operation), 0)

    def convert(self, value, kind):
        """A value as another kind, by Blender's rules for links."""
        if value.kind == kind or {value.kind, kind} == {'c', 'v'}:
            return value._replace(kind=kind)
        if kind == 's':
            return self._as_emission(value)
        if value.kind == 's':
            return Value(kind, CONSTANT, 0)
        if value.kind == 'f':
            return self._spread(value, kind)
        return self._to_number(value)

    def _spread(self, value, kind):
        if value.node == CONSTANT:
            return value._replace(kind=kind, constant=(value.constant[0],) * 3)
        if value.node == DEFAULT:
            return value._replace(kind=kind)
        return Value(kind, self.emit(NodeType.COMBINE, (value, value, value)), 0)

    def _to_number(self, value):
        """Luminance of a colour, mean of a vector."""
        if value.kind == 'c':
            return working_space.luminance(self, value)
        third = Value('v', CONSTANT, 0, (1.0 / 3.0,) * 3)
        zero = Value('v', CONSTANT, 0)
        index = self.emit(NodeType.VECTOR_MATH, (value, third, zero, Value('f', CONSTANT, 0)),
                          mode=Vector.DOT)
        return output(index, NodeType.VECTOR_MATH, "value")

    def _as_emission(self, value):
        """A colour where a shader is expected shines with that colour."""
        color = self.convert(value, 'c')
        one = Value('f', CONSTANT, 0, (1.0, 0.0, 0.0))
        return Value('s', self.emit(NodeType.EMISSION, (color, one)), 0)


def _kind(socket):
    return _KINDS.get(socket.type, 'f')


def _nothing(socket):
    """What leaves at an output to which nothing comes, None where that counts as no link."""
    return None if INLINES_GROUPS else Value(_kind(socket), CONSTANT, 0, is_loose=True)


def _held(socket):
    """The value of a group's socket, hidden or not."""
    return _own_constant(socket)._replace(is_loose=not INLINES_GROUPS)


def _has_default(socket):
    """Whether an input has coordinates, a normal or a tangent where nothing is linked to it."""
    return (socket.hide_value and _kind(socket) == 'v' and
            (socket.node.bl_idname, socket.identifier) not in _WITHOUT_DEFAULT)


def _unlinked(socket):
    """What an input of a node holds by itself: the library's default where Blender hides its value."""
    return Value('v', DEFAULT, 0) if _has_default(socket) else _own_constant(socket)


def _own_constant(socket):
    kind, default = _kind(socket), getattr(socket, "default_value", 0.0)
    if kind == 's':
        return NO_SHADER
    if kind == 'f':
        return Value('f', CONSTANT, 0, (float(default), 0.0, 0.0))
    components = tuple(default) if hasattr(default, "__len__") else (float(default),) * 3
    return Value(kind, CONSTANT, 0, components[:3])
