# SPDX-License-Identifier: GPL-3.0-or-later
"""The mapping inside a texture node, which old files and scripts set: it has no panel. As in Cycles its limits
(min, max) do not count."""

from ..abi import MappingType, NodeType, SeparateMode
from .node_list import output
from .values import CONSTANT, DEFAULT, Value

_AXES = ('X', 'Y', 'Z')


def mapped(walker, node, vector):
    """The place that a texture node looks up for its vector."""
    mapping = getattr(node, "texture_mapping", None)
    if mapping is None or _is_neutral(mapping):
        return vector
    if vector.node == DEFAULT:
        vector = _own_place(walker, node)
    axes = mapping.mapping_x, mapping.mapping_y, mapping.mapping_z
    if axes != _AXES:
        parts = walker.emit(NodeType.SEPARATE, (vector,), SeparateMode.XYZ)
        chosen = [Value('f', parts, _AXES.index(axis)) if axis in _AXES else Value('f', CONSTANT, 0)
                  for axis in axes]
        vector = Value('v', walker.emit(NodeType.COMBINE, chosen, SeparateMode.XYZ), 0)
    values = [vector] + [Value('v', CONSTANT, 0, tuple(part))
                         for part in (mapping.translation, mapping.rotation, mapping.scale)]
    return Value('v', walker.emit(NodeType.MAPPING, values, MappingType[mapping.vector_type]), 0)


def _is_neutral(mapping):
    return (tuple(mapping.scale) == (1.0, 1.0, 1.0) and not any(mapping.rotation) and not any(mapping.translation)
            and (mapping.mapping_x, mapping.mapping_y, mapping.mapping_z) == _AXES
            and mapping.vector_type != 'NORMAL')


def _own_place(walker, node):
    """What a texture takes where nothing is linked to it."""
    if node.type == 'TEX_IMAGE':
        walker.flat.uv_names.add("")
        return Value('v', walker.emit(NodeType.UV_MAP, (), name=""), 0)
    if node.type == 'TEX_ENVIRONMENT':
        return output(walker.emit(NodeType.GEOMETRY, ()), NodeType.GEOMETRY, "position")
    walker.flat.needs_generated = True
    return output(walker.emit(NodeType.TEXTURE_COORDINATE, ()), NodeType.TEXTURE_COORDINATE, "generated")
