# SPDX-License-Identifier: GPL-3.0-or-later
"""Strands and points as solids: tubes along the Catmull-Rom splines that Cycles draws, and balls.

Both have the normals of round ones. Fewer sides make a thinner shadow, so a tube or a ball is widened until
it looks as large as a round one on the average over all directions (A. Cauchy, 1832: a convex body's mean
projection is a quarter of its surface). A solid is made for strands or points as they are at one time, and
can be placed where they are at others.
"""

import math
from dataclasses import dataclass

import bpy
import numpy as np

from .. import abi
from ..compat import cycles_curves
from .deform import KeyedShapes
from .hashing import HASH_MAX, hash_numbers
from .mesh import MeshData

_MAX_TRIANGLES = 2_000_000  # of one object's strands or points; above the fewest sides
_SIDES = (8, 6, 4, 3)
_SHORTEST = 1e-12            # m; keys of a strand that are closer are one


@dataclass
class Strands:
    """Strands or points at one time. The keys of a strand follow each other."""

    positions: np.ndarray       # (keys, 3)
    radii: np.ndarray           # (keys,)
    lengths: np.ndarray = None  # (strands,) keys of each; None: all are points

    def is_like(self, other):
        """Whether they are as many of as many keys."""
        return len(self.positions) == len(other.positions) and (
            self.lengths is None if other.lengths is None else np.array_equal(self.lengths, other.lengths))


def fractions(keys):
    """How far along its strand each key is, 0 to 1, and the strands' lengths."""
    step = np.linalg.norm(np.diff(keys, axis=1), axis=2)
    along = np.concatenate((np.zeros((len(keys), 1)), np.cumsum(step, axis=1)), axis=1)
    return along / np.maximum(along[:, -1:], _SHORTEST), along[:, -1]


class _Group:
    """Strands of one number of keys: (strands, keys) which of all keys, their numbers, and how they were
    turned about themselves at their roots when they were placed first."""

    def __init__(self, index, numbers):
        self.index, self.numbers, self.across = index, numbers, None


def _groups(strands, joins_keys):
    """The groups of strands of two keys or more; joins_keys: without those that repeat the one before."""
    starts = np.cumsum(strands.lengths) - strands.lengths
    for length in np.unique(strands.lengths[strands.lengths > 1]):
        numbers = np.flatnonzero(strands.lengths == length)
        index = starts[numbers, None] + np.arange(length)
        if not joins_keys:
            yield _Group(index, numbers)
            continue
        step = np.linalg.norm(np.diff(strands.positions[index], axis=1), axis=2)
        is_kept = np.concatenate((np.ones((len(index), 1), bool), step > _SHORTEST), axis=1)
        counts = is_kept.sum(axis=1)
        for count in np.unique(counts[counts > 1]):
            chosen = counts == count
            yield _Group(index[chosen][is_kept[chosen]].reshape(-1, count), numbers[chosen])


def _resolution(segment_count):
    """Pieces of a segment and sides of a tube, as many as there is room for."""
    for sides in _SIDES:
        for level in range(cycles_curves(bpy.context.scene, "subdivisions", 2), -1, -1):
            if 2 * sides * segment_count << level <= _MAX_TRIANGLES:
                return 1 << level, sides
    return 1, _SIDES[-1]


def _subdivided(values, pieces):
    """Catmull-Rom splines (strands, keys, n) with that many pieces between two keys."""
    if pieces == 1:
        return values
    # As in Cycles, the first and the last key stand for those beyond the ends too.
    ends = values[:, [0, -1]]
    p = np.concatenate((ends[:, :1], values, ends[:, 1:]), axis=1)
    p0, p1, p2, p3 = p[:, :-3], p[:, 1:-2], p[:, 2:-1], p[:, 3:]
    shape = values.shape
    out = np.empty((shape[0], shape[1] - 1, pieces, shape[2]))
    for i in range(pieces):
        t = i / pieces
        out[:, :, i] = 0.5 * (2.0 * p1 + t * (p2 - p0 + t * (
            2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3 + t * (3.0 * (p1 - p2) + p3 - p0))))
    return np.concatenate((out.reshape(shape[0], -1, shape[2]), values[:, -1:]), axis=1)


class Tubes:
    """The tubes around strands; empty where no strand has two keys."""

    def __init__(self, strands, joins_keys=False):
        self._groups = list(_groups(strands, joins_keys))
        count = sum(group.index.shape[0] * (group.index.shape[1] - 1) for group in self._groups)
        self._pieces, self._sides = _resolution(count)

    @property
    def is_empty(self):
        """Whether there is nothing to place or to spread over."""
        return not self._groups

    def _splines(self, group, strands):
        """Middles (strands, rings, 3) and radii (strands, rings) of the rings of a group."""
        places = _subdivided(strands.positions[group.index], self._pieces)
        return places, _subdivided(strands.radii[group.index][..., None], self._pieces)[..., 0].clip(0.0, None)

    def place(self, strands):
        """Vertices and their normals, (vertices, 3) each, of the strands at any time. What turns from time
        to time keeps its sides where they are."""
        positions, normals = [], []
        for group in self._groups:
            places, radii = self._splines(group, strands)
            across, other = _frames(places, group.across)
            group.across = across[:, 0] if group.across is None else group.across
            around, wide = _around(across, other, self._sides), _widening(self._sides) * radii
            positions.append((places[:, :, None] + around * wide[..., None, None]).reshape(-1, 3))
            normals.append(around.reshape(-1, 3))
        return np.concatenate(positions).astype(np.float32), np.concatenate(normals).astype(np.float32)

    def faces(self):
        """(triangles, 3) uint32 indices of vertices."""
        found, base = [], 0
        for group in self._groups:
            strands, rings = group.index.shape[0], self._rings(group)
            found.append(_tube_faces(strands, rings, self._sides) + base)
            base += strands * rings * self._sides
        return np.concatenate(found).astype(np.uint32)

    def _rings(self, group):
        return (group.index.shape[1] - 1) * self._pieces + 1

    def spread(self, values, of_keys):
        """(vertices, n) of values that each strand has one of or, on straight lines between them, each
        key."""
        found = []
        for group in self._groups:
            if of_keys:
                of_rings = _between(values[group.index], self._pieces).reshape(-1, values.shape[1])
                found.append(np.repeat(of_rings, self._sides, axis=0))
            else:
                found.append(np.repeat(values[group.numbers], self._rings(group) * self._sides, axis=0))
        return np.concatenate(found)

    def info(self, strands):
        """(vertices, 4): what strands.HAIR_ATTRIBUTE holds."""
        found = []
        for group in self._groups:
            places, radii = self._splines(group, strands)
            along, lengths = fractions(places)
            info = np.empty(radii.shape + (4,))
            info[..., 0], info[..., 2] = along, 2.0 * radii
            info[..., 1] = lengths[:, None]
            info[..., 3] = (hash_numbers(group.numbers) / HASH_MAX)[:, None]
            found.append(np.repeat(info.reshape(-1, 4), self._sides, axis=0))
        return np.concatenate(found).astype(np.float32)

    def directions(self, strands):
        """(vertices, 4): what strands.DIRECTION_ATTRIBUTE holds."""
        found = []
        for group in self._groups:
            along = _tangents(self._splines(group, strands)[0]).reshape(-1, 3)
            found.append(np.repeat(np.concatenate((along, np.ones((len(along), 1))), axis=1), self._sides, axis=0))
        return np.concatenate(found).astype(np.float32)


def _between(values, pieces):
    """(strands, rings, n) of values of keys, on straight lines with that many pieces from one to the next."""
    parts = (np.arange(pieces, dtype=np.float32) / pieces)[:, None]
    lines = values[:, :-1, None] * (1.0 - parts) + values[:, 1:, None] * parts
    return np.concatenate((lines.reshape(len(values), -1, values.shape[2]), values[:, -1:]), axis=1)


def _unit(vectors, fallback):
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > _SHORTEST, vectors / np.maximum(length, _SHORTEST), fallback)


def _tangents(places):
    """Unit vectors along splines, (strands, rings, 3)."""
    return _unit(np.gradient(places, axis=1), np.array((0.0, 0.0, 1.0)))


def _frames(places, start):
    """Unit vectors across splines, (strands, rings, 3) twice; the first at the roots as near as it can be to
    start, where that is given."""
    tangents = _tangents(places)
    across = np.empty_like(tangents)
    last = start
    if last is None:
        smallest = np.eye(3)[np.abs(tangents[:, 0]).argmin(axis=1)]
        last = _unit(np.cross(tangents[:, 0], smallest), np.array((1.0, 0.0, 0.0)))
    # From ring to ring with as little turn as possible.
    for i in range(places.shape[1]):
        tangent = tangents[:, i]
        last = _unit(last - tangent * (last * tangent).sum(axis=1, keepdims=True), last)
        across[:, i] = last
    return across, np.cross(tangents, across)


def _around(across, other, sides):
    """Normals of rings, (strands, rings, sides, 3)."""
    angles = 2.0 * math.pi * np.arange(sides) / sides
    return np.cos(angles)[:, None] * across[:, :, None] + np.sin(angles)[:, None] * other[:, :, None]


def _widening(sides):
    """By how much the corners of a tube are farther out than a round one's surface."""
    return math.pi / (sides * math.sin(math.pi / sides))


def _tube_faces(strands, rings, sides):
    """(triangles, 3) of tubes whose vertices run around rings, along strands."""
    side = np.arange(sides)
    a, b = side, (side + 1) % sides
    quads = np.stack((np.stack((a, b, b + sides), axis=1), np.stack((a, b + sides, a + sides), axis=1)), axis=1)
    starts = (np.arange(strands)[:, None] * rings + np.arange(rings - 1)) * sides
    return (starts.reshape(-1, 1, 1) + quads.reshape(1, -1, 3)).reshape(-1, 3)


class Balls:
    """The balls around points."""

    def __init__(self, points):
        self._count = len(points.positions)
        level = next((level for level in (2, 1) if 20 * 4 ** level * self._count <= _MAX_TRIANGLES), 0)
        self._normals, self._faces = _icosphere(level)
        corners = self._normals[self._faces]
        area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]),
                                    axis=1).sum()
        self._widening = math.sqrt(4.0 * math.pi / area)

    def place(self, points):
        """Vertices and their normals, (vertices, 3) each, of the points at any time."""
        radii = points.radii * self._widening
        positions = points.positions[:, None] + self._normals * radii[:, None, None]
        normals = np.tile(self._normals, (self._count, 1))
        return positions.reshape(-1, 3).astype(np.float32), normals.astype(np.float32)

    def spread(self, values):
        """(vertices, n) of values that each point has one of."""
        return np.repeat(values, len(self._normals), axis=0)

    def faces(self):
        """(triangles, 3) uint32 indices of vertices."""
        indices = (np.arange(self._count) * len(self._normals))[:, None, None] + self._faces
        return indices.reshape(-1, 3).astype(np.uint32)


def _icosphere(level):
    """Unit vertices (n, 3) and faces (m, 3) of an icosahedron cut finer level times."""
    g = 0.5 * (1.0 + math.sqrt(5.0))
    vertices = np.array([(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g), (0, -1, -g),
                         (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)], np.float64)
    faces = np.array([(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4),
                      (11, 10, 2), (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8),
                      (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)])
    for _ in range(level):
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        unique, middle = np.unique(edges, axis=0, return_inverse=True)
        middle = middle.reshape(-1, 3) + len(vertices)
        vertices = np.concatenate((vertices, vertices[unique].sum(axis=1)))
        a, b, c = middle.T
        faces = np.concatenate([np.stack(corners, axis=1) for corners in (
            (faces[:, 0], a, c), (faces[:, 1], b, a), (faces[:, 2], c, b), (a, b, c))])
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


def mesh_of(solid, strands, values=()):
    """Strands or points as MeshData; values: (name, (vertices, 2 | 4)) attributes."""
    positions, normals = solid.place(strands)
    indices = solid.faces()
    corners = indices.reshape(-1)
    return MeshData(positions, indices, normals, abi.NormalsLayout.VERTEX, np.ones(len(indices), np.uint8),
                    attributes=[(name, each[corners]) for name, each in values])


class StrandMotion(KeyedShapes):
    """The shapes of one object's strands or points over the shutter, one slot per motion key."""

    def __init__(self, solid, strands, data, key_count):
        super().__init__(data, key_count)
        self._solid, self._strands = solid, strands

    def set_key(self, index, strands):
        """Take strands as that key; False (and no motion) where they are not as many of as many keys."""
        if strands is None or not strands.is_like(self._strands):
            self.is_dropped = True
            return False
        self.positions[index], self.normals[index] = self._solid.place(strands)
        return True
