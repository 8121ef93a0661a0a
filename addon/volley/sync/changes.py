# SPDX-License-Identifier: GPL-3.0-or-later
"""Marks what changed since the last sync; copying it is the other modules' work.

Blender's updates name objects and data blocks. Posing marks the mesh object with its geometry flag and
gives no mesh, so geometry is keyed by object. The first update of a viewport and a frame change without
animation come with an empty list; a first sync is therefore always a full one. Whatever adds, removes,
hides or shows objects names the scene or a collection, and so do the settings of the render.
"""

import bpy

from ..compat import uses_nodes


class Changes:
    """What to look at again. ``full``: everything."""

    def __init__(self, full=False):
        self.full = full
        self.structure = False   # objects may have appeared, gone, or be hidden
        self.geometry = set()    # names of objects whose mesh may be another
        self.topology = set()    # those of them of which more than the vertices' places may differ
        self.meshes = set()      # names of meshes that were edited: a pose names none
        self.objects = set()     # names of objects of which anything changed, the above among them
        self.materials = set()   # names of materials to flatten again
        self.lights = set()      # names of lights' data that was edited, for which Blender may name no object
        self.all_materials = False
        self.world = False
        self._shaped = {}        # pointer of an object whose mesh may be another -> its name when that was noted

    @classmethod
    def everything(cls):
        """Marks for a first sync or a final render."""
        return cls(full=True)

    @classmethod
    def since_render(cls, depsgraph):
        """Marks for a final render that follows another of the same depsgraph: what Blender names since then, and
        what may read files and texts, of which it names none."""
        changes = cls()
        changes.all_materials = changes.world = True
        changes.lights = {light.name_full for light in bpy.data.lights if uses_nodes(light)}
        changes.note(depsgraph)
        return changes

    def follow(self, depsgraph):
        """Add what changed by one update of the depsgraph."""
        self.note(depsgraph)
        if not depsgraph.updates:
            # A frame change without animation, or something Blender does not name.
            self.full = True

    def note(self, depsgraph):
        """Add what Blender names, which it forgets at the next change of time."""
        for update in depsgraph.updates:
            self._mark(update)

    def geometry_of(self, name):
        """Whether an object's mesh must be read again."""
        return self.full or name in self.geometry

    def material_of(self, name):
        """Whether a material must be flattened again."""
        return self.full or self.all_materials or name in self.materials

    def any(self):
        """Whether there is anything to sync at all."""
        return bool(self.full or self.structure or self.objects or self.materials or self.lights
                    or self.all_materials or self.world)

    def _mark(self, update):
        data = update.id
        if isinstance(data, bpy.types.Object):
            self._mark_object(data, update)
        elif isinstance(data, bpy.types.Mesh):
            self.meshes.add(data.name_full)
        elif isinstance(data, bpy.types.Material):
            self.materials.add(data.name_full)
        elif isinstance(data, bpy.types.Light):
            self.lights.add(data.name_full)
        elif isinstance(data, bpy.types.World):
            self.world = True
        elif isinstance(data, bpy.types.NodeTree):
            # An embedded tree comes with its owner; a group does not say who uses it.
            if not data.is_embedded_data:
                self._mark_shared()
        elif isinstance(data, (bpy.types.Image, bpy.types.Texture)):
            self._mark_shared()
        elif isinstance(data, (bpy.types.Scene, bpy.types.Collection)):
            self.structure = True

    def _mark_shared(self):
        # Lights have nodes too and are read in a walk.
        self.all_materials = self.world = self.structure = True

    def _mark_object(self, data, update):
        name = data.name_full
        self.objects.add(name)
        if data.library is not None:
            self.structure = True  # names of linked objects need not be unique
        if self._shaped and self._shaped.get(data.original.as_pointer(), name) != name:
            self.full = True  # its name was another then, which may be another object's now
        if not update.is_updated_geometry:
            return
        self.geometry.add(name)
        self._shaped[data.original.as_pointer()] = name
        if update.is_updated_shading:  # of an edited modifier or mesh, not of a pose
            self.topology.add(name)
