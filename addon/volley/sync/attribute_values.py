# SPDX-License-Identifier: GPL-3.0-or-later
"""Attributes of meshes, curves and points as colours, as Cycles reads Blender's."""

import zlib

import numpy as np

from ..compat import HAS_BLENDERS_ATTRIBUTES

_TYPES = {  # data type: (field, components, type of its numbers)
    'FLOAT_COLOR': ("color", 4, np.float32), 'BYTE_COLOR': ("color", 4, np.float32),
    'FLOAT_VECTOR': ("vector", 3, np.float32), 'FLOAT2': ("vector", 2, np.float32),
    'FLOAT': ("value", 1, np.float32), 'INT': ("value", 1, np.int32), 'BOOLEAN': ("value", 1, np.bool_)}
if HAS_BLENDERS_ATTRIBUTES:
    _TYPES.update(INT8=("value", 1, np.int8), QUATERNION=("value", 4, np.float32))

_BYTE = 255.0


def colors_of(attribute):
    """(items, 4) float32 of an attribute of any domain, None if it is of an odd type."""
    if attribute.data_type not in _TYPES:
        return None
    return widen(_read(attribute, *_TYPES[attribute.data_type]).astype(np.float32, copy=False))


def _read(attribute, field, width, dtype):
    values = np.empty((len(attribute.data), width), dtype)
    attribute.data.foreach_get(field, values.reshape(-1))
    return values


def widen(values):
    """1 to 4 components as a colour: a number is grey, what is missing is 0, alpha 1."""
    width = values.shape[1]
    if width == 4:
        return values
    rgba = np.zeros((len(values), 4), np.float32)
    rgba[:, 3] = 1.0
    rgba[:, :3 if width == 1 else width] = values
    return rgba


def linear(values):
    """Colours encoded by sRGB as scene-linear ones."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


# What Attribute nodes make of them -----------------------------------------------------------------

def lack_name(name):
    """The library's attribute for what the alpha of an attribute lacks of 1, as a missing one's is 1."""
    return f".lack {zlib.crc32(name.encode()):08x}"


def excess_name(name):
    """The library's attribute for how far the number of an attribute is above the mean of its colour: of two
    components, the first one counts."""
    return f".excess {zlib.crc32(name.encode()):08x}"


_SPOKEN = ((".tangent ", "tangents of a UV map"), (".lack ", "an alpha"), (".excess ", "a number of two"))


def named_colors(name, names, read, is_pair):
    """The colours of an attribute, read(name), None for none. The name may also be one that lack_name or excess_name
    made of another of names: None where that is 0 all over. is_pair(name): whether it has two components."""
    for source in names:
        if name == lack_name(source):
            values = read(source)
            return None if values is None else _grey(1.0 - values[:, 3:])
        if name == excess_name(source):
            values = read(source) if is_pair(source) else None
            return None if values is None else _grey(values[:, :1] - values[:, :3].mean(axis=1, keepdims=True))
    return read(name)


def _grey(values):
    return widen(values) if values.any() else None


def spoken(names):
    """The library's names of attributes for a message."""
    known = (next((text for prefix, text in _SPOKEN if name.startswith(prefix)), f"'{name}'") for name in names)
    return ", ".join(dict.fromkeys(known))


def is_pair(attributes, name):
    """Whether the attribute of that name is there and has two components."""
    attribute = attributes.get(name)
    return attribute is not None and attribute.data_type == 'FLOAT2'


# What Cycles moves by an attribute ------------------------------------------------------------------

VELOCITY = "velocity"  # metres a second, in object space


def has_velocity(attributes):
    """Whether an attribute of that name moves what has it. Cycles before 4.1 takes vectors and colours of points
    alone."""
    attribute = attributes.get(VELOCITY)
    return attribute is not None and (
        HAS_BLENDERS_ATTRIBUTES or
        attribute.domain == 'POINT' and attribute.data_type in {'FLOAT_VECTOR', 'FLOAT_COLOR'})


# Vertex groups -------------------------------------------------------------------------------------

def group_names(blender_object):
    """Names of the vertex groups that Cycles takes for attributes of an evaluated object's mesh, by their number."""
    return [group.name for group in blender_object.vertex_groups] if HAS_BLENDERS_ATTRIBUTES else []


def group_colors(mesh, number):
    """(vertices, 4) float32: the weights of a mesh's vertices in a vertex group; 0 of those outside."""
    weights = np.zeros((len(mesh.vertices), 1), np.float32)
    for index, vertex in enumerate(mesh.vertices):  # Blender gives them one by one alone
        for element in vertex.groups:
            if element.group == number:
                weights[index] = element.weight
    return widen(weights)


# From edges to vertices ----------------------------------------------------------------------------

def colors_at_vertices(attribute, edges, vertex_count):
    """(vertices, 4) float32 of an attribute of edges, None if it is of an odd type: the mean of a vertex' edges.
    edges: (edges, 2), the vertices of each."""
    values = colors_of(attribute)
    if values is None:
        return None
    mix = _MIXERS.get(attribute.data_type) if HAS_BLENDERS_ATTRIBUTES else None
    if mix is not None:
        return mix(attribute, values, edges, vertex_count).astype(np.float32)
    return _means(values, edges, vertex_count).astype(np.float32)


def _means(values, edges, vertex_count):
    """(vertices, components): the mean of the values of a vertex' edges."""
    ends = edges.reshape(-1)
    sums = [np.bincount(ends, part, vertex_count) for part in np.repeat(values, 2, axis=0).T]
    return np.stack(sums, axis=1) / np.maximum(np.bincount(ends, minlength=vertex_count), 1)[:, None]


def _any(_attribute, values, edges, vertex_count):
    """A vertex has what any of its edges has."""
    return _means(values, edges, vertex_count) > 0.0


def _whole(_attribute, values, edges, vertex_count):
    """Means are rounded, halves away from 0."""
    means = _means(values, edges, vertex_count)
    return np.copysign(np.floor(np.abs(means) + 0.5), means)


def _whole_bytes(attribute, _values, edges, vertex_count):
    """Means are of bytes, before they are decoded, and lose their fractions."""
    encoded = np.rint(_read(attribute, "color_srgb", 4, np.float32) * _BYTE)
    means = np.floor(_means(encoded, edges, vertex_count) + 1e-4) / _BYTE  # where they are whole, as good as that
    means[:, :3] = linear(means[:, :3])
    return means


def _turns(_attribute, values, edges, vertex_count):
    """Means are of axes times angles."""
    sines = np.linalg.norm(values[:, 1:], axis=1, keepdims=True)
    angles = 2.0 * np.arctan2(sines, values[:, :1])
    axes = values[:, 1:] / np.maximum(sines, np.finfo(np.float32).tiny)
    means = _means(axes * angles, edges, vertex_count)
    angles = np.linalg.norm(means, axis=1, keepdims=True)
    axes = means / np.maximum(angles, np.finfo(np.float32).tiny)
    return np.concatenate([np.cos(0.5 * angles), axes * np.sin(0.5 * angles)], axis=1)


# How Blender's own interpolation, which Cycles asks since it has it, takes types other than of plain numbers.
_MIXERS = {'BOOLEAN': _any, 'INT': _whole, 'INT8': _whole, 'BYTE_COLOR': _whole_bytes, 'QUATERNION': _turns}
