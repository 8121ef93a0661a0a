# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes of one mesh in time: which meshes keep their topology, and what they look like at each motion key."""

import numpy as np

from .. import abi
from .mesh import LazyLoops, Topology, corner_normals, read_positions, shown_mesh, vertex_normals

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


def is_posable(blender_object):
    """Whether a mesh object's new shapes differ in places alone, as long as their topology is equal."""
    original = blender_object.original
    return original.type == 'MESH' and bool(original.modifiers) and all(
        modifier.type in _POSING_MODIFIERS for modifier in original.modifiers)


class KeyedShapes:
    """Shapes of a mesh over the shutter, one slot per motion key."""

    def __init__(self, data, key_count):
        self._data = data
        self.positions = [data.positions] * key_count
        self.normals = [data.normals] * key_count
        self.is_dropped = False

    def keys(self):
        """positions and normals, (keys, ...) each; one key when nothing moves or motion is dropped."""
        base = self._data
        is_static = all(np.array_equal(p, base.positions) for p in self.positions)
        if self.is_dropped or is_static:
            return base.positions[None], None if base.normals is None else base.normals[None]
        return np.stack(self.positions), None if base.normals is None else np.stack(self.normals)


class MeshMotion(KeyedShapes):
    """The shapes of one deforming mesh of Blender's."""

    def __init__(self, mesh, data, key_count):
        super().__init__(data, key_count)
        self._topology = Topology(mesh)
        self._corners = None
        if data.normal_kind == abi.NormalsLayout.CORNER:
            self._corners = LazyLoops(mesh, len(data.indices)).of_triangles

    def set_key(self, index, blender_object):
        """Take the shape of an evaluated object as that key; False (and no motion) when its topology is
        another."""
        with shown_mesh(blender_object) as mesh:
            return self._set_key(index, mesh)

    def _set_key(self, index, mesh):
        if not self._topology.is_of(mesh):
            self.is_dropped = True
            return False
        self.positions[index] = read_positions(mesh)
        if self._data.normal_kind == abi.NormalsLayout.CORNER:
            self.normals[index] = corner_normals(mesh)[self._corners]
        elif self._data.normal_kind == abi.NormalsLayout.VERTEX:
            self.normals[index] = np.array(vertex_normals(mesh))
        return True
