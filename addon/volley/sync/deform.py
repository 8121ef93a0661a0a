# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes of one mesh in time: which meshes keep their topology, and what they look like at each motion key."""

import numpy as np

from .. import abi
from .mesh import LazyLoops, Topology, corner_normals, read_positions, shown_mesh, vertex_normals
from .tangents import face_normals

# Modifiers that move vertices, or make new ones by a rule that does not look at where they are.
_POSING_MODIFIERS = {
    'ARMATURE', 'CAST', 'CORRECTIVE_SMOOTH', 'CURVE', 'HOOK', 'LAPLACIANDEFORM', 'LAPLACIANSMOOTH',
    'LATTICE', 'MESH_CACHE', 'MESH_DEFORM', 'MIRROR', 'MULTIRES', 'SHRINKWRAP', 'SIMPLE_DEFORM',
    'SMOOTH', 'SUBSURF', 'SURFACE_DEFORM', 'WARP', 'WAVE', 'CLOTH', 'SOFT_BODY'}
# Those of them that join vertices which come near each other.
_JOINING_MODIFIERS = {'MIRROR'}


def keeps_topology(blender_object):
    """Whether a posable object's topology is another only when its mesh or modifiers were edited."""
    return not any(modifier.type in _JOINING_MODIFIERS for modifier in blender_object.original.modifiers)


def is_filled(blender_object):
    """Whether Blender fills outlines to make an object's mesh."""
    return blender_object.original.type in {'CURVE', 'FONT'}


def is_posable(blender_object):
    """Whether a mesh object's new shapes differ in places alone, as long as their topology is equal."""
    original = blender_object.original
    return original.type == 'MESH' and bool(original.modifiers) and all(
        modifier.type in _POSING_MODIFIERS for modifier in original.modifiers)


class KeyedShapes:
    """Shapes of a mesh over the shutter, one slot per motion key. awaits_keys: whether they are still to be told at
    other times; motion is dropped where that ends early."""

    def __init__(self, data, key_count):
        self._data = data
        self.awaits_keys = True
        self.positions = [data.positions] * key_count
        self.normals = [data.normals] * key_count

    def drop(self):
        """Leave what moves as it is in the middle of the shutter."""
        self.positions, self.awaits_keys = [self._data.positions], False

    def keys(self):
        """positions and normals, (keys, ...) each; one key when nothing moves or motion is dropped."""
        base = self._data
        is_static = all(np.array_equal(p, base.positions) for p in self.positions)
        if is_static:
            return base.positions[None], None if base.normals is None else base.normals[None]
        return np.stack(self.positions), None if base.normals is None else np.stack(self.normals)


class MeshMotion(KeyedShapes):
    """The shapes of one deforming mesh of Blender's. is_filled: of a curve or text, whose flat sides Blender fills with
    other faces between the same vertices at each time."""

    def __init__(self, mesh, data, key_count, is_filled=False):
        super().__init__(data, key_count)
        self._topology, self._is_filled = Topology(mesh), is_filled
        self._corners = None
        if data.normal_kind == abi.NormalsLayout.CORNER:
            self._corners = LazyLoops(mesh, len(data.indices)).of_triangles

    def set_key(self, index, blender_object):
        """Take the shape of an evaluated object as that key; False when its topology is another: then it has the shape
        of the middle of the shutter there, as in Cycles."""
        with shown_mesh(blender_object) as mesh:
            return self._set_key(index, mesh)

    def _set_key(self, index, mesh):
        has_other_faces = not self._topology.is_of(mesh)
        if has_other_faces and not (self._is_filled and self._topology.has_counts_of(mesh)):
            return False
        self.positions[index] = read_positions(mesh)
        if has_other_faces and self._data.normals is not None:
            self.normals[index] = _bent_normals(self._data, self.positions[index])
            return True
        if self._data.normal_kind == abi.NormalsLayout.CORNER:
            self.normals[index] = corner_normals(mesh)[self._corners]
        elif self._data.normal_kind == abi.NormalsLayout.VERTEX:
            self.normals[index] = np.array(vertex_normals(mesh))
        return True


class CarriedShapes(KeyedShapes):
    """Shapes of what goes along velocities, at the begin, in the middle and at the end of the shutter. ways: (points,
    3), how far each point goes in all of it (m)."""

    def __init__(self, data, ways):
        super().__init__(data, 3)
        self.awaits_keys = False
        for index, share in ((0, -0.5), (2, 0.5)):
            positions = data.positions.copy()
            positions[:, :3] += np.float32(share) * ways
            self.positions[index] = positions
            if data.normals is not None:
                self.normals[index] = _bent_normals(data, positions)


def _bent_normals(data, positions):
    """The normals of a mesh once its vertices are elsewhere: by as much others as the means of its triangles' are."""
    change = _vertex_means(data.indices, positions) - _vertex_means(data.indices, data.positions)
    vertices = data.indices.reshape(-1) if data.normal_kind == abi.NormalsLayout.CORNER else slice(None)
    normals = data.normals + change[vertices]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=data.normals.copy(), where=length > 0.0)


def _vertex_means(indices, positions):
    """(vertices, 3) float32: the unit mean of the normals of the triangles at each vertex, 0 without one."""
    corners, normals = indices.reshape(-1), np.repeat(face_normals(positions[indices]), 3, axis=0)
    means = np.stack([np.bincount(corners, part, len(positions)) for part in normals.T], axis=1)
    length = np.linalg.norm(means, axis=1, keepdims=True)
    return np.divide(means, length, out=np.zeros(means.shape), where=length > 0.0).astype(np.float32)
