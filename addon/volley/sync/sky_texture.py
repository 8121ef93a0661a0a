# SPDX-License-Identifier: GPL-3.0-or-later
"""The Sky Texture in the library's terms: its models (``sky.py``, ``sky_scattering.py``) as formulas of plain
nodes.

A sky of scattered light is an image of its table, looked up by elevation and azimuth; its sun is a disc
whose direction and size the world gets, to be sampled.
"""

import math
from collections import namedtuple

import numpy as np

from ..abi import ImageExtension, MathOperation as Math, NodeType, VectorOperation as Vector
from . import sky, sky_scattering
from .values import CONSTANT, DEFAULT, Value
from .working_space import from_rec709

_HORIZON = math.cos(0.5 * math.pi - 0.001)  # cosine to the zenith below which plain formulas stay the same

# A bright disc that a tree shows, for the world to sample: unit direction, diameter in radians.
Sun = namedtuple("Sun", "direction angle")


def _number(value):
    """A Value as it is, a number as a constant one."""
    return value if isinstance(value, Value) else Value('f', CONSTANT, 0, (float(value), 0.0, 0.0))


class _Formula:
    """Appends nodes that compute with Values and numbers."""

    def __init__(self, walker):
        self._walker = walker

    def number(self, operation, *values):
        """A MATH node's result."""
        values = [_number(value) for value in values + (0.0,) * (3 - len(values))]
        return Value('f', self._walker.emit(NodeType.MATH, values, operation), 0)

    def vector(self, operation, *values):
        """A VECTOR_MATH node's vector."""
        return Value('v', self._vector_math(operation, values), 0)

    def measure(self, operation, *values):
        """A VECTOR_MATH node's number."""
        return Value('f', self._vector_math(operation, values), 1)

    def _vector_math(self, operation, values):
        values = [value if isinstance(value, Value) else Value('v', CONSTANT, 0, tuple(map(float, value)))
                  for value in values + ((0.0,) * 3,) * (3 - len(values))]
        return self._walker.emit(NodeType.VECTOR_MATH, values + [Value('f', CONSTANT, 0)], operation)

    def parts(self, vector):
        """A vector's components."""
        index = self._walker.emit(NodeType.SEPARATE, (vector,))
        return tuple(Value('f', index, i) for i in range(3))

    def combine(self, x, y, z):
        """A vector of three numbers."""
        return Value('v', self._walker.emit(NodeType.COMBINE, [_number(value) for value in (x, y, z)]), 0)

    def spread(self, number):
        """A number in all components."""
        return self.combine(number, number, number)

    def each(self, operation, vector):
        """A MATH node's results for a vector's components."""
        return self.combine(*(self.number(operation, part) for part in self.parts(vector)))

    def choose(self, condition, first, second):
        """first where condition is 1, second where it is 0; vectors."""
        weight = self.spread(condition)
        rest = self.spread(self.number(Math.SUBTRACT, 1.0, condition))
        return self.vector(Vector.MULTIPLY_ADD, first, weight, self.vector(Vector.MULTIPLY, second, rest))


def sky_texture(walker, node, sockets):
    """The Sky Texture's colour."""
    direction = sockets.get('v', "Vector")
    if direction.node == DEFAULT:
        direction = Value('v', walker.emit(NodeType.TEXTURE_COORDINATE, ()), 0)
    formula = _Formula(walker)
    if node.sky_type in {'NISHITA', 'SINGLE_SCATTERING', 'MULTIPLE_SCATTERING'}:
        color = _scattered(walker, formula, node, direction)
    elif node.sky_type == 'PREETHAM':
        color = _preetham(formula, node, direction)
    elif node.sky_type == 'HOSEK_WILKIE':
        color = _hosek_wilkie(formula, node, direction)
    else:
        return None
    color = from_rec709(walker, color)
    return {"Color": formula.vector(Vector.MAXIMUM, color, (0.0,) * 3)._replace(kind='c')}


def _sun_direction(node):
    """Of unit length."""
    sun = np.array(node.sun_direction, np.float64)
    length = np.linalg.norm(sun)
    return sun / length if length > 0.0 else np.array((0.0, 0.0, 1.0))


def _angles(formula, direction, sun):
    """Cosine to the zenith, kept above the horizon, cosine to the sun, and the angle to it."""
    up = formula.number(Math.MAXIMUM, formula.parts(direction)[2], _HORIZON)
    cosine = formula.number(Math.MAXIMUM, formula.measure(Vector.DOT, direction, sun), -1.0)
    cosine = formula.number(Math.MINIMUM, cosine, 1.0)
    return up, cosine, formula.number(Math.ARCCOSINE, cosine)


def _rec709(formula, xyz):
    """The colour of three numbers."""
    color = (0.0, 0.0, 0.0)
    for part, column in zip(xyz, sky.XYZ_TO_RGB.T):
        color = formula.vector(Vector.MULTIPLY_ADD, formula.spread(part), column, color)
    return color


def _preetham(formula, node, direction):
    sun = _sun_direction(node)
    scale, (a, b, c, d, e) = sky.preetham(math.acos(np.clip(sun[2], -1.0, 1.0)), node.turbidity)
    up, cosine, angle = _angles(formula, direction, sun)
    inverse = formula.spread(formula.number(Math.DIVIDE, 1.0, up))
    square = formula.spread(formula.number(Math.MULTIPLY, cosine, cosine))
    one = (1.0, 1.0, 1.0)
    by_height = formula.each(Math.EXPONENT, formula.vector(Vector.MULTIPLY, inverse, b))
    by_height = formula.vector(Vector.MULTIPLY_ADD, by_height, a, one)
    by_sun = formula.each(Math.EXPONENT, formula.vector(Vector.MULTIPLY, formula.spread(angle), d))
    by_square = formula.vector(Vector.MULTIPLY_ADD, square, e, one)
    by_sun = formula.vector(Vector.MULTIPLY_ADD, by_sun, c, by_square)
    x, y, luminance = formula.parts(formula.vector(
        Vector.MULTIPLY, formula.vector(Vector.MULTIPLY, by_height, by_sun), scale))
    per_y = formula.number(Math.DIVIDE, luminance, y)
    z = formula.number(Math.SUBTRACT, formula.number(Math.SUBTRACT, 1.0, x), y)
    return _rec709(formula, (formula.number(Math.MULTIPLY, x, per_y), luminance,
                             formula.number(Math.MULTIPLY, z, per_y)))


def _hosek_wilkie(formula, node, direction):
    x, y, z = _sun_direction(node)
    elevation, azimuth = math.asin(np.clip(z, 0.0, 1.0)), math.atan2(x, y)  # a sun that has set is on the horizon
    sun = (math.cos(elevation) * math.sin(azimuth), math.cos(elevation) * math.cos(azimuth), math.sin(elevation))
    a, b, c, d, e, f, g, i, h, radiance = sky.hosek_wilkie(elevation, node.turbidity, node.ground_albedo)
    up, cosine, angle = _angles(formula, direction, sun)
    inverse = formula.spread(formula.number(Math.DIVIDE, 1.0, formula.number(Math.ADD, up, 0.01)))
    square = formula.number(Math.MULTIPLY, cosine, cosine)
    by_height = formula.each(Math.EXPONENT, formula.vector(Vector.MULTIPLY, inverse, b))
    by_height = formula.vector(Vector.MULTIPLY_ADD, by_height, a, (1.0, 1.0, 1.0))
    by_angle = formula.each(Math.EXPONENT, formula.vector(Vector.MULTIPLY, formula.spread(angle), e))
    base = formula.vector(Vector.MULTIPLY_ADD, formula.spread(cosine), -2.0 * h, 1.0 + h * h)
    base = formula.vector(Vector.MULTIPLY, base, formula.each(Math.SQRT, base))
    glow = formula.vector(Vector.DIVIDE, formula.spread(formula.number(Math.ADD, square, 1.0)), base)
    by_sun = c
    for part, factor in ((by_angle, d), (formula.spread(square), f), (glow, g),
                         (formula.spread(formula.number(Math.SQRT, up)), i)):
        by_sun = formula.vector(Vector.MULTIPLY_ADD, part, factor, by_sun)
    xyz = formula.vector(Vector.MULTIPLY, formula.vector(Vector.MULTIPLY, by_height, by_sun), radiance)
    return _rec709(formula, formula.parts(xyz))


def _altitude(node):
    """Metres above the sea: as in Cycles, the viewer is kept inside the atmosphere."""
    return min(max(node.altitude, 1.0), 99999.0 if node.sky_type == 'MULTIPLE_SCATTERING' else 59999.0)


def _amounts(node):
    """Of air, dust and ozone; dust is called aerosols since 5.0."""
    dust = node.aerosol_density if hasattr(node, "aerosol_density") else node.dust_density
    return node.air_density, dust, node.ozone_density


def _scattered(walker, formula, node, direction):
    """Nishita's sky (single scattering) or one of multiple scattering, and the sun."""
    x, y, z = formula.parts(direction)
    up = formula.number(Math.MINIMUM, formula.number(Math.MAXIMUM, z, -1.0), 1.0)
    elevation = formula.number(Math.ARCSINE, up)
    turns = formula.number(Math.DIVIDE, formula.number(Math.ARCTAN2, x, y), 2.0 * math.pi)
    turns = formula.number(Math.ADD, turns, 0.5 - node.sun_rotation / (2.0 * math.pi))
    turns = formula.number(Math.FRACT, turns)
    if node.sky_type == 'MULTIPLE_SCATTERING':
        color = _multiple(walker, formula, node, turns, elevation)
    else:
        color = _single(walker, formula, node, turns, elevation, z)
    horizon = sky_scattering.horizon(_altitude(node)) if node.sky_type == 'MULTIPLE_SCATTERING' else 0.0
    if not node.sun_disc or node.sun_elevation + 0.5 * node.sun_size <= horizon:
        return color
    return _sun_disc(walker, formula, node, direction, elevation, horizon, color)


def _look_up(walker, formula, turns, row, table, *arguments):
    image = walker.table_image("sky", table, *arguments)
    place = formula.combine(turns, row, 0.0)
    return Value('v', walker.emit(NodeType.IMAGE, (place, _number(0.0)), ImageExtension.EXTEND, image=image), 0)


def _multiple(walker, formula, node, turns, elevation):
    """Its table reaches from the nadir to the zenith."""
    size = formula.number(Math.DIVIDE, formula.number(Math.ABSOLUTE, elevation), 0.5 * math.pi)
    row = formula.number(Math.MULTIPLY, formula.number(Math.SQRT, size), 0.5)
    row = formula.number(Math.MULTIPLY_ADD, row, formula.number(Math.SIGN, elevation), 0.5)
    return _look_up(walker, formula, turns, row, sky_scattering.table, node.sun_elevation, _altitude(node),
                    _amounts(node))


def _single(walker, formula, node, turns, elevation, z):
    """Its table begins at the horizon, below which colours fade out."""
    is_new = node.sky_type == 'SINGLE_SCATTERING'
    above = formula.number(Math.MAXIMUM, elevation, 0.0)
    row = formula.number(Math.SQRT, formula.number(Math.DIVIDE, above, 0.5 * math.pi))
    color = _look_up(walker, formula, turns, row, sky.nishita_table, node.sun_elevation, _altitude(node),
                     _amounts(node), is_new)
    z = formula.number(Math.MINIMUM, z, 0.0)
    if is_new:  # it is a table too, of which a cell's value is that of its lower edge
        below = formula.number(Math.MAXIMUM, formula.number(Math.SUBTRACT, 0.0, elevation), 0.0)
        row = formula.number(Math.SQRT, formula.number(Math.DIVIDE, below, 0.5 * math.pi))
        row = formula.number(Math.ADD, row, 0.5 / sky.TABLE_HEIGHT)
        square = formula.number(Math.MULTIPLY, row, row)
        z = formula.number(Math.SINE, formula.number(Math.MULTIPLY, square, -0.5 * math.pi))
    fade = formula.number(Math.MULTIPLY_ADD, z, 2.5, 1.0)
    fade = formula.number(Math.MAXIMUM, fade, 0.0)
    cube = formula.number(Math.MULTIPLY, formula.number(Math.MULTIPLY, fade, fade), fade)
    return formula.vector(Vector.MULTIPLY, color, formula.spread(cube))


def _sun_disc(walker, formula, node, direction, elevation, horizon, color):
    """The sky's colour with the sun's above the horizon: in front of it or, since 5.0, added to it."""
    height, turn, size = node.sun_elevation, node.sun_rotation, node.sun_size
    sun = (math.cos(height) * math.sin(turn), math.cos(height) * math.cos(turn), math.sin(height))
    walker.flat.sun = Sun(sun, size)
    colors = sky_scattering.sun_colors if node.sky_type == 'MULTIPLE_SCATTERING' else sky.sun_colors
    low, high = colors(height, size, _altitude(node), _amounts(node))
    bottom, top = height - 0.5 * size, height + 0.5 * size
    if node.sky_type == 'NISHITA':
        bottom = max(bottom, 0.0)
    part = formula.number(Math.DIVIDE, formula.number(Math.SUBTRACT, elevation, bottom), top - bottom)
    shown = formula.vector(Vector.MULTIPLY_ADD, formula.spread(part), high - low, low)
    # The angle as Cycles has it, exact for small ones; of vectors that are not of unit length, too.
    chord = formula.measure(Vector.DISTANCE, direction, sun)
    across = formula.measure(Vector.LENGTH, formula.vector(Vector.ADD, direction, sun))
    half = formula.number(Math.ARCTAN2, chord, across)
    angle = formula.number(Math.MULTIPLY, half, 2.0)
    ratio = formula.number(Math.DIVIDE, angle, 0.5 * size)
    square = formula.number(Math.MINIMUM, formula.number(Math.MULTIPLY, ratio, ratio), 1.0)
    limb = formula.number(Math.SQRT, formula.number(Math.SUBTRACT, 1.0, square))
    limb = formula.number(Math.MULTIPLY_ADD, limb, 0.6 * node.sun_intensity, 0.4 * node.sun_intensity)
    shown = formula.vector(Vector.MULTIPLY, shown, formula.spread(limb))
    shown = formula.vector(Vector.MAXIMUM, shown, (0.0,) * 3)
    is_sun = formula.number(Math.LESS_THAN, ratio, 1.0)
    if height - 0.5 * size < horizon:
        is_up = formula.number(Math.LESS_THAN, horizon, elevation)
        is_sun = formula.number(Math.MULTIPLY, is_sun, is_up)
    if node.sky_type == 'NISHITA':
        return formula.choose(is_sun, shown, color)
    color = formula.vector(Vector.MAXIMUM, color, (0.0,) * 3)
    return formula.vector(Vector.MULTIPLY_ADD, shown, formula.spread(is_sun), color)
