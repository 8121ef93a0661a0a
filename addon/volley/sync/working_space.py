# SPDX-License-Identifier: GPL-3.0-or-later
"""The space that a file's colours are in, of its own choice since Blender 5.0. The library computes in it as it
does in Rec.709; what has colours of its own (images, skies, temperatures, wavelengths) is converted by nodes,
which other files do not have.
"""

import functools

import numpy as np
from mathutils import Color

from ..abi import Gamut, NodeType, VectorOperation as Vector
from ..compat import LINEAR_REC709, working_space
from .node_list import output
from .values import CONSTANT, Value


def is_rec709():
    """Whether it is Rec.709, as in every Blender before 5.0."""
    return working_space() == LINEAR_REC709


@functools.cache
def _columns(_space, conversion):
    """What a conversion of Blender's colours makes of each primary (3, 3) while the file is in that space."""
    return tuple(tuple(getattr(Color(primary), conversion)()) for primary in np.eye(3).tolist())


def from_rec709_matrix():
    """What makes colours of the working space of those in Rec.709, row by row."""
    matrix = np.transpose(_columns(working_space(), "from_rec709_linear_to_scene_linear"))
    return tuple(map(tuple, matrix.tolist()))


def from_rec709(walker, color):
    """A colour in Rec.709 in the working space."""
    if is_rec709():
        return color
    return _combine(walker, [_dot(walker, color, row) for row in from_rec709_matrix()])


def spectral(walker, node_type, value):
    """The colour of a BLACKBODY or WAVELENGTH node; nothing is negative."""
    if is_rec709():
        return Value('c', walker.emit(node_type, (value,)), 0)
    color = from_rec709(walker, Value('c', walker.emit(node_type, (value,), Gamut.OPEN), 0))
    values = (color, _constant('v', 0.0), _constant('v', 0.0), _constant('f', 0.0))
    return Value('c', walker.emit(NodeType.VECTOR_MATH, values, Vector.MAXIMUM), 0)


def luminance(walker, color):
    """The grey of a colour, a number."""
    if is_rec709():
        return Value('f', walker.emit(NodeType.RGB_TO_BW, (color,)), 0)
    return _dot(walker, color, [xyz[1] for xyz in _columns(working_space(), "from_scene_linear_to_xyz_d65")])


def rec709_pixels(pixels):
    """Pixels (..., 4) of the working space in Rec.709."""
    if is_rec709():
        return pixels
    matrix = np.array(_columns(working_space(), "from_scene_linear_to_rec709_linear"), np.float32)
    return np.concatenate((pixels[..., :3] @ matrix, pixels[..., 3:]), axis=-1)


def _constant(kind, *numbers):
    return Value(kind, CONSTANT, 0, (numbers + (0.0, 0.0, 0.0))[:3])


def _dot(walker, color, weights):
    values = (color._replace(kind='v'), _constant('v', *weights), _constant('v'), _constant('f'))
    index = walker.emit(NodeType.VECTOR_MATH, values, mode=Vector.DOT)
    return output(index, NodeType.VECTOR_MATH, "value")


def _combine(walker, numbers):
    return Value('c', walker.emit(NodeType.COMBINE, numbers), 0)
