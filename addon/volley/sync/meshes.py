# SPDX-License-Identifier: GPL-3.0-or-later
"""The meshes of one scene of the library."""

import zlib

from .. import abi, native
from .mesh import corner_normals, normals_domain, read_positions, vertex_normals


class MeshEntry:
    """A mesh in the library. pointer tells one evaluation's data from another's, never followed;
    diced_by: see MeshData."""

    __slots__ = ("id", "pointer", "topology", "shape", "names", "corners", "normal_kind", "poses",
                 "diced_by", "may_be_in_world", "is_deforming")


class Meshes:
    """The meshes of one scene of the library, by the key of the instance that owns each.

    With will_resync, checksums are kept so that a later sync sends only what differs."""

    def __init__(self, scene, will_resync, warnings):
        self._scene, self.will_resync, self._warnings = scene, will_resync, warnings
        self._entries, self._seen, self._retired = {}, set(), []

    def begin(self):
        """Start a sync."""
        self._seen = set()

    def reuse(self, key, pointer, names):
        """Keep a mesh without reading it, if it is of the same evaluation and attributes."""
        entry = self._entries.get(key)
        if entry is None or entry.pointer != pointer or entry.names != names:
            return False
        self._seen.add(key)
        return True

    def pointers(self):
        """By key, of whose data in Blender each mesh is."""
        return {key: entry.pointer for key, entry in self._entries.items()}

    def pointer_of(self, key):
        """Of whose data in Blender one mesh is, None where there is no such mesh."""
        entry = self._entries.get(key)
        return None if entry is None else entry.pointer

    def diced_by(self, key):
        """What MeshData says of it, None where there is no such mesh or nobody asked."""
        entry = self._entries.get(key)
        return None if entry is None else entry.diced_by

    def are_diced(self):
        """Whether any mesh is as a camera asked for."""
        return any(entry.diced_by is not None and entry.diced_by[1] for entry in self._entries.values())

    def put(self, key, pointer, data, names, motion=None):
        """Bring a mesh up to date: nothing, positions alone, or all of it. One that the library
        refuses is left out."""
        positions, normals = motion.keys() if motion else (
            data.positions[None], None if data.normals is None else data.normals[None])
        entry = self._entries.get(key)
        topology, shape = self._signatures(data, positions, normals)
        try:
            if entry is None or topology is None or entry.topology != topology:
                entry = self._create(key, data, positions, normals)
            elif entry.shape != shape:
                data.update(self._scene, entry.id, positions, normals)
        except native.TracerError as error:
            if error.status not in (abi.StatusCode.ERROR_INVALID_ARGUMENT, abi.StatusCode.ERROR_TOO_LARGE):
                raise
            self._warnings.add(f"Mesh of '{key[0]}': {error}; it is left out")
            return
        entry.pointer, entry.topology, entry.shape, entry.names = pointer, topology, shape, names
        entry.poses, entry.corners, entry.normal_kind = data.poses, data.corners, data.normal_kind
        entry.diced_by = data.diced_by
        entry.may_be_in_world, entry.is_deforming = not data.dicing, len(positions) > 1
        self._seen.add(key)

    def pose(self, key, pointer, mesh, is_known):
        """Send a Blender mesh's positions and normals for a known topology. False, and nothing is sent,
        where the topology turns out to be another; is_known: nobody edited it.

        Triangles stay those of the shape that was read in full: faces of more than three corners may
        be cut otherwise in a fresh render, if they bend much."""
        entry = self._entries.get(key)
        if entry is None or entry.poses is None:
            return False
        if not (entry.poses.has_counts_of(mesh) if is_known else entry.poses.is_of(mesh)):
            return False
        if normals_domain(mesh) != entry.poses.normals_domain:
            return False
        normals = None
        if entry.normal_kind == abi.NormalsLayout.CORNER:
            normals = corner_normals(mesh)[entry.corners][None]
        elif entry.normal_kind == abi.NormalsLayout.VERTEX:
            normals = vertex_normals(mesh)[None]
        self._scene.update_mesh(entry.id, read_positions(mesh)[None], normals)
        entry.pointer, entry.shape = pointer, None
        return True

    def _signatures(self, data, positions, normals):
        """Checksums of topology and shape, None where no later sync will compare them."""
        if not self.will_resync or data.dicing:  # what is diced takes no new positions
            return None, None
        normal_sum = 0 if normals is None else zlib.crc32(normals.tobytes())
        counts, arrays = data.topology()
        topology = counts, tuple(None if a is None else zlib.crc32(a.tobytes()) for a in arrays)
        return topology, (zlib.crc32(positions.tobytes()), normal_sum)

    def _create(self, key, data, positions, normals):
        """A new mesh; one of the same key goes when no instance shows it any more."""
        entry = MeshEntry()
        entry.id = data.create(self._scene, positions, normals)
        if key in self._entries:
            self._retired.append(self._entries[key].id)
        self._entries[key] = entry
        return entry

    def is_deforming(self, key):
        """Whether a mesh has several shapes."""
        entry = self._entries.get(key)
        return entry is not None and entry.is_deforming

    def brings(self, key, color_names):
        """Whether a mesh was read with those attributes."""
        entry = self._entries.get(key)
        return entry is not None and color_names <= entry.names[1]

    def in_world(self):
        """Keys of the meshes of this sync that Cycles moves to world space if one object alone shows
        them and stands still, deforming or not: those that are not diced."""
        return {key for key in self._seen if self._entries[key].may_be_in_world}

    def ids(self):
        """Library id of each mesh of this sync, by key."""
        return {key: self._entries[key].id for key in self._seen}

    def ids_of(self, keys):
        """Library id of each of some meshes, by key."""
        return {key: self._entries[key].id for key in keys}

    def end(self):
        """Free what this sync did not see; call after the instances were updated."""
        for key in [key for key in self._entries if key not in self._seen]:
            self._retired.append(self._entries.pop(key).id)
        self.free_retired()

    def free_retired(self):
        """Free the meshes that others took the place of; call after their instances were updated."""
        for mesh_id in self._retired:
            self._scene.destroy_mesh(mesh_id)
        self._retired = []
