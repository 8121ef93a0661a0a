# SPDX-License-Identifier: GPL-3.0-or-later
"""The library's list of node types (abi.NODES) in terms of Values: kinds of sockets, and where they stand."""

from ..abi import NODES, NodeType, SeparateMode
from .values import CONSTANT, DEFAULT, Value

# All other kinds are vectors with a default.
_KINDS = {"FLOAT": 'f', "COLOR": 'c', "SHADER": 's'}


def _kinds(sockets):
    return tuple(_KINDS.get(kind, 'v') for kind, _ in sockets)


_INPUT_KINDS = {node_type: _kinds(inputs) for node_type, (_, inputs, _) in NODES.items()}
_OUTPUT_KINDS = {node_type: _kinds(outputs) for node_type, (_, _, outputs) in NODES.items()}
_INPUT_NUMBERS = {(node_type, name): number for node_type, (_, inputs, _) in NODES.items()
                  for number, (_, name) in enumerate(inputs)}
_GENERATED_INPUTS = {node_type: tuple(number for number, (kind, _) in enumerate(inputs) if kind == "GENERATED")
                     for node_type, (_, inputs, _) in NODES.items()}
_OUTPUT_NUMBERS = {(node_type, name): number for node_type, (_, _, outputs) in NODES.items()
                   for number, (_, name) in enumerate(outputs)}


def input_kinds(node_type):
    """Kinds of a type's inputs, as Value has them."""
    return _INPUT_KINDS[node_type]


def output_kinds(node_type, mode=0):
    """Kinds of a type's outputs; XYZ is combined to a vector, other triples to a colour."""
    if node_type == NodeType.COMBINE and mode == SeparateMode.XYZ:
        return ('v',)
    return _OUTPUT_KINDS[node_type]


def input_number(node_type, name):
    """Where an input of the library's name stands."""
    return _INPUT_NUMBERS[node_type, name]


def takes_generated(node_type, values):
    """Whether an input of a type takes Generated coordinates as its default; values: in the library's order."""
    return any(values[number].node == DEFAULT for number in _GENERATED_INPUTS[node_type])


def absent(kind):
    """The value of an input that nothing gives: 0 or, for a vector, the library's default."""
    return Value(kind, DEFAULT if kind == 'v' else CONSTANT, 0)


def arranged(node_type, values):
    """The inputs of a type in the library's order; values: {the library's name: Value}, the others are
    absent."""
    names = [name for _, name in NODES[node_type][1]]
    assert set(values) <= set(names)
    return [values.get(name) or absent(kind) for name, kind in zip(names, input_kinds(node_type))]


def named_outputs(index, node_type, names, mode=0):
    """{Blender's name: Value} of the node at index; names: of its outputs in the library's order."""
    return {name: Value(kind, index, number)
            for number, (kind, name) in enumerate(zip(output_kinds(node_type, mode), names))}


def output(index, node_type, name):
    """The output of that name of the node at index."""
    number = _OUTPUT_NUMBERS[node_type, name]
    return Value(_OUTPUT_KINDS[node_type][number], index, number)
