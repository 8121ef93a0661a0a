# SPDX-License-Identifier: GPL-3.0-or-later
"""Strands and points as the library has them: Catmull-Rom splines with radii, and balls."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .. import abi
from ..compat import HAS_ROUND_BALLS, cycles_curves
from .deform import KeyedShapes
from .hashing import HASH_MAX, hash_numbers

_SHORTEST = 1e-12   # m; keys of a strand that are closer are one
_ROUND_PIECES = 8   # most of a segment of round curves
_TOLERANCE = 0.1    # radii that pieces may be off: less than is seen


class Wanted(NamedTuple):
    """What a sync makes of all strands and points."""

    uv_names: frozenset
    color_names: frozenset
    needs_generated: bool
    shape: int   # abi.CurveShape
    pieces: int  # most of a segment

    @classmethod
    def of_scene(cls, names, scene):
        """names: the first three fields; the others are those that Cycles is set to in the scene."""
        if cycles_curves(scene, "shape", 'RIBBONS') == 'RIBBONS':
            pieces = min(1 << cycles_curves(scene, "subdivisions", 2), abi.MAX_CURVE_PIECES)
            return cls(*names, abi.CurveShape.RIBBON, pieces)
        is_linear = cycles_curves(scene, "shape", 'RIBBONS') == 'THICK_LINEAR'
        return cls(*names, abi.CurveShape.ROUND, 1 if is_linear else _ROUND_PIECES)


@dataclass
class Strands:
    """Strands or points at one time. The keys of a strand follow each other. Places and lengths stay as they are
    made: what is found from them is kept."""

    positions: np.ndarray       # (keys, 3)
    radii: np.ndarray           # (keys,)
    lengths: np.ndarray = None  # (strands,) keys of each; None: all are points

    def is_like(self, other):
        """Whether they are as many of as many keys."""
        return len(self.positions) == len(other.positions) and (
            self.lengths is None if other.lengths is None else np.array_equal(self.lengths, other.lengths))

    def points(self):
        """(keys, 4) float32: places and radii."""
        points = np.empty((len(self.positions), 4), np.float32)
        points[:, :3], points[:, 3] = self.positions, self.radii
        return points

    def keys_kept(self):
        """(keys,) bool: which are not where the one before is; None: all."""
        is_kept = np.empty(len(self.positions), bool)
        is_kept[1:] = self._steps > _SHORTEST
        is_kept[self._starts()] = True
        return None if is_kept.all() else is_kept

    def only(self, is_kept):
        """The same without other keys; None: with all."""
        if is_kept is None:
            return self
        lengths = np.add.reduceat(is_kept, self._starts(), dtype=np.int64)
        return Strands(self.positions[is_kept], self.radii[is_kept], lengths)

    def _starts(self):
        return np.cumsum(self.lengths) - self.lengths

    @cached_property
    def _steps(self):
        """(keys - 1,) how far each key is from the one before."""
        step = np.diff(self.positions, axis=0)
        squares = np.einsum('ij,ij->i', step, step)
        return np.sqrt(squares, out=squares)

    @cached_property
    def fractions(self):
        """How far along its strand each key is, 0 to 1, and the strands' lengths."""
        along = np.zeros(len(self.positions))
        np.cumsum(self._steps, dtype=np.float64, out=along[1:])
        starts = self._starts()
        whole = along[starts + self.lengths - 1] - along[starts]
        along -= np.repeat(along[starts], self.lengths)
        along /= np.repeat(np.maximum(whole, _SHORTEST), self.lengths)
        return along, whole

    def info(self):
        """(keys, 4) float32: what strands.HAIR_ATTRIBUTE holds."""
        info = np.empty((len(self.positions), 4), np.float32)
        info[:, 0], whole = self.fractions
        info[:, 1] = np.repeat(whole, self.lengths)
        info[:, 2] = 2.0 * self.radii
        info[:, 3] = np.repeat(hash_numbers(np.arange(len(self.lengths))) / HASH_MAX, self.lengths)
        return info

    def directions(self):
        """(keys, 4) float32: what strands.DIRECTION_ATTRIBUTE holds."""
        starts = self._starts()
        before = np.arange(-1, len(self.positions) - 1)
        after = before + 2
        before[starts], after[starts + self.lengths - 1] = starts, starts + self.lengths - 1
        way = self.positions[after] - self.positions[before]
        length = np.linalg.norm(way, axis=1, keepdims=True)
        directions = np.ones((len(way), 4), np.float32)
        directions[:, :3] = np.where(length > _SHORTEST, way / np.maximum(length, _SHORTEST), (0.0, 0.0, 1.0))
        return directions

    def first_points(self):
        """(strands, 3) the roots."""
        return self.positions[self._starts()]


@dataclass
class CurvesData:
    """Strands or points at one time as the library takes them, in the place of a mesh.MeshData."""

    positions: np.ndarray             # (keys, 4) float32
    lengths: np.ndarray = None        # (strands,) uint32; None: balls
    shape: int = abi.CurveShape.RIBBON
    pieces: int = 1
    attributes: list = field(default_factory=list)  # (name, (keys | strands, 2 | 4) float32, whether of strands)
    left_out: list = field(default_factory=list)    # names of attributes that there is no room for
    generated: np.ndarray = None      # (strands, 3) float32
    normals = corners = poses = dicing = diced_by = None
    normal_kind = abi.NormalsLayout.NONE

    def topology(self):
        """What later shapes have to be like, but for positions."""
        arrays = [self.lengths, self.generated, *(values for _, values, _ in self.attributes)]
        return (len(self.positions), self.shape, self.pieces, *(name for name, *_ in self.attributes)), arrays

    def create(self, scene, positions, _normals):
        """A mesh of the library's scene, of those keys; its id."""
        return scene.create_curves(positions, self.lengths, self.shape, self.pieces, self.attributes,
                                   self.generated, _TOLERANCE)

    @staticmethod
    def update(scene, mesh_id, positions, _normals):
        """Give it other places and radii."""
        scene.update_curves(mesh_id, positions)


def curves_of(strands, wanted, values=(), generated=None):
    """Strands or points as CurvesData; values: (name, (keys | strands, 2 | 4), whether of strands), of which as many
    are taken as there is room for."""
    lengths = None if strands.lengths is None else strands.lengths.astype(np.uint32)
    shape = wanted.shape
    if lengths is None:
        shape = abi.CurveShape.BALL if HAS_ROUND_BALLS else abi.CurveShape.HOLLOW_BALL
    return CurvesData(strands.points(), lengths, shape, wanted.pieces, list(values)[:abi.MAX_ATTRIBUTES],
                      [name for name, *_ in values[abi.MAX_ATTRIBUTES:]], generated)


class StrandMotion(KeyedShapes):
    """The shapes of one object's strands or points over the shutter, one slot per motion key."""

    def __init__(self, strands, is_kept, data, key_count):
        super().__init__(data, key_count)
        self._strands, self._is_kept = strands, is_kept

    def set_key(self, index, strands):
        """Take strands as that key; False (and no motion) where they are not as many of as many keys."""
        if strands is None or not strands.is_like(self._strands):
            self.drop()
            return False
        self.positions[index] = strands.only(self._is_kept).points()
        return True
