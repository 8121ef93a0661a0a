# SPDX-License-Identifier: GPL-3.0-or-later
"""Procedural textures in the library's terms.

Each function takes the walker, the node and its ``Sockets`` and gives {socket identifier: Value}, or
None for a setting that is not supported. Sockets that 3.4 lacks (lacunarity, offset, gain) have the
values that its textures imply.
"""

from ..abi import (BrickMode, FractalType, GradientType, MagicMode, NodeType, NoiseMode, RadialTilingMode,
                   VoronoiFeature, VoronoiMetric, VoronoiMode, WaveDirection, WaveMode, WaveProfile)
from ..compat import HAS_FAR_CELLS, HASHES_CELLS_BY_PCG, SCALES_MAGIC_FIRST
from .node_list import named_outputs, output
from .sky_texture import sky_texture
from .values import CONSTANT, Value

_DIMENSIONS = ('1D', '2D', '3D', '4D')
_FRACTALS = FractalType.__members__
_PROFILES = {'SIN': WaveProfile.SINE, 'SAW': WaveProfile.SAW, 'TRI': WaveProfile.TRIANGLE}
_RINGS = {'X': WaveDirection.X, 'Y': WaveDirection.Y, 'Z': WaveDirection.Z,
          'SPHERICAL': WaveDirection.DIAGONAL}


def _number(sockets, name, default):
    """A number input; one that this Blender lacks has a default."""
    if sockets.find(name) is None:
        return Value('f', CONSTANT, 0, (default, 0.0, 0.0))
    return sockets.get('f', name)


def _place(node, sockets):
    """The Vector and W inputs; the one that the number of dimensions leaves out is 0."""
    dimensions = getattr(node, "noise_dimensions", getattr(node, "voronoi_dimensions",
                                                           getattr(node, "musgrave_dimensions", '3D')))
    zero = Value('v', CONSTANT, 0)
    vector = zero if dimensions == '1D' else sockets.get('v', "Vector")
    w = sockets.get('f', "W") if dimensions in {'1D', '4D'} else zero._replace(kind='f')
    return _DIMENSIONS.index(dimensions), vector, w


def _noise(walker, node, sockets):
    dimensions, vector, w = _place(node, sockets)
    kind = getattr(node, "noise_type", 'FBM')
    if kind not in _FRACTALS:
        return None
    fractal = _FRACTALS[kind]
    if fractal == FractalType.FBM and getattr(node, "normalize", True):
        fractal = FractalType.FBM_UNIT
    values = [vector, w, sockets.get('f', "Scale"), sockets.get('f', "Detail"),
              sockets.get('f', "Roughness"), _number(sockets, "Lacunarity", 2.0),
              _number(sockets, "Offset", 0.0), _number(sockets, "Gain", 1.0),
              sockets.get('f', "Distortion")]
    index = walker.emit(NodeType.NOISE, values, dimensions | fractal << NoiseMode.TYPE_SHIFT)
    return named_outputs(index, NodeType.NOISE, ("Fac", "Color"))


def _musgrave(walker, node, sockets):
    dimensions, vector, w = _place(node, sockets)
    if node.musgrave_type not in _FRACTALS:
        return None
    values = [vector, w] + [sockets.get('f', name) for name in (
        "Scale", "Detail", "Dimension", "Lacunarity", "Offset", "Gain")]
    mode = dimensions | _FRACTALS[node.musgrave_type] << NoiseMode.TYPE_SHIFT
    index = walker.emit(NodeType.MUSGRAVE, values, mode)
    return named_outputs(index, NodeType.MUSGRAVE, ("Fac",))


def _voronoi(walker, node, sockets):
    dimensions, vector, w = _place(node, sockets)
    if node.feature not in VoronoiFeature.__members__ or node.distance not in VoronoiMetric.__members__:
        return None
    values = [vector, w] + [sockets.get('f', name) for name in (
        "Scale", "Smoothness", "Exponent", "Randomness")]
    values += [_number(sockets, "Detail", 0.0), _number(sockets, "Roughness", 0.0),
               _number(sockets, "Lacunarity", 2.0)]
    mode = (dimensions | VoronoiMetric[node.distance] << VoronoiMode.METRIC_SHIFT
            | VoronoiFeature[node.feature] << VoronoiMode.FEATURE_SHIFT)
    if getattr(node, "normalize", False):
        mode |= VoronoiMode.NORMALIZE
    if HASHES_CELLS_BY_PCG:
        mode |= VoronoiMode.PCG
    if HAS_FAR_CELLS:
        mode |= VoronoiMode.UNLIMITED
    index = walker.emit(NodeType.VORONOI, values, mode)
    return named_outputs(index, NodeType.VORONOI, ("Distance", "Color", "Position", "W", "Radius"))


def _wave(walker, node, sockets):
    if node.wave_type == 'BANDS':
        mode, direction = 0, WaveDirection[node.bands_direction]
    else:
        mode, direction = WaveMode.RINGS, _RINGS[node.rings_direction]
    mode |= _PROFILES[node.wave_profile] | direction << WaveMode.DIRECTION_SHIFT
    values = [sockets.get('v', "Vector")] + [sockets.get('f', name) for name in (
        "Scale", "Distortion", "Detail", "Detail Scale", "Detail Roughness", "Phase Offset")]
    index = walker.emit(NodeType.WAVE, values, mode)
    return _grey(walker, output(index, NodeType.WAVE, "value"))


def _gradient(walker, node, sockets):
    index = walker.emit(NodeType.GRADIENT, [sockets.get('v', "Vector")], GradientType[node.gradient_type])
    return _grey(walker, output(index, NodeType.GRADIENT, "value"))


def _grey(walker, value):
    """A number that is the colour too."""
    return {"Fac": value, "Color": walker.convert(value, 'c')}


def _white_noise(walker, node, sockets):
    dimensions, vector, w = _place(node, sockets)
    index = walker.emit(NodeType.WHITE_NOISE, [vector, w], dimensions)
    return named_outputs(index, NodeType.WHITE_NOISE, ("Value", "Color"))


def _gabor(walker, node, sockets):
    values = [sockets.get('v', "Vector")] + [sockets.get('f', name) for name in (
        "Scale", "Frequency", "Anisotropy", "Orientation 2D")] + [sockets.get('v', "Orientation 3D")]
    index = walker.emit(NodeType.GABOR, values, _DIMENSIONS.index(node.gabor_type))
    return named_outputs(index, NodeType.GABOR, ("Value", "Phase", "Intensity"))


def _magic(walker, node, sockets):
    values = [sockets.get('v', "Vector"), sockets.get('f', "Scale"), sockets.get('f', "Distortion")]
    mode = node.turbulence_depth | MagicMode.SCALED_FIRST * SCALES_MAGIC_FIRST
    index = walker.emit(NodeType.MAGIC, values, mode)
    return named_outputs(index, NodeType.MAGIC, ("Color", "Fac"))


def _brick(walker, node, sockets):
    def amount(value):
        return Value('f', CONSTANT, 0, (value, 0.0, 0.0))
    values = [sockets.get('v', "Vector")]
    values += [sockets.get('c', name) for name in ("Color1", "Color2", "Mortar")]
    values += [sockets.get('f', name) for name in ("Scale", "Mortar Size", "Mortar Smooth", "Bias",
                                                   "Brick Width", "Row Height")]
    values += [amount(node.offset), amount(node.squash)]
    mode = node.offset_frequency | node.squash_frequency << BrickMode.SQUASH_SHIFT
    index = walker.emit(NodeType.BRICK, values, mode)
    return named_outputs(index, NodeType.BRICK, ("Color", "Fac"))


def _radial_tiling(walker, node, sockets):
    values = [sockets.get('v', "Vector"), sockets.get('f', "Sides"), sockets.get('f', "Roundness")]
    index = walker.emit(NodeType.RADIAL_TILING, values, RadialTilingMode.NORMALIZE * node.normalize)
    return named_outputs(index, NodeType.RADIAL_TILING, (
        "Segment Coordinates", "Segment ID", "Segment Width", "Segment Rotation"))


TEXTURES = {
    "ShaderNodeTexNoise": _noise, "ShaderNodeTexMusgrave": _musgrave, "ShaderNodeTexVoronoi": _voronoi,
    "ShaderNodeTexWave": _wave, "ShaderNodeTexGradient": _gradient,
    "ShaderNodeTexWhiteNoise": _white_noise, "ShaderNodeTexMagic": _magic, "ShaderNodeTexBrick": _brick,
    "ShaderNodeTexSky": sky_texture, "ShaderNodeTexGabor": _gabor,
    "ShaderNodeRadialTiling": _radial_tiling,
}
