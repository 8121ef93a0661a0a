# SPDX-License-Identifier: GPL-3.0-or-later
"""Marks what changed since the last sync; copying it is the other modules' work.

Blender's updates name objects and data blocks. Posing marks the mesh object with its geometry flag and
gives no mesh, so geometry is keyed by object. The first update of a viewport and a frame change without
animation come with an empty list; a first sync is therefore always a full one.
"""

import bpy


class Changes:
    """What to look at again. ``full``: everything."""

    def __init__(self, full=False):
        self.full = full
        self.objects = set()     # names of objects whose geometry may differ
        self.transforms = False  # some object moved, appeared or disappeared
        self.materials = set()   # names of materials to flatten again
        self.all_materials = False
        self.world = False
        self.lights = False
        self.camera = False
        self.settings = False

    @classmethod
    def everything(cls):
        """Marks for a first sync or a final render."""
        return cls(full=True)

    @classmethod
    def of_depsgraph(cls, depsgraph):
        """Marks from the depsgraph's list of updates."""
        changes = cls()
        for update in depsgraph.updates:
            changes._mark(update)
        return changes

    def geometry_of(self, name):
        """Whether an object's mesh must be read again."""
        return self.full or name in self.objects

    def any(self):
        """Whether there is anything to sync at all."""
        return bool(self.full or self.objects or self.transforms or self.materials
                    or self.all_materials or self.world or self.lights or self.camera
                    or self.settings)

    def _mark(self, update):
        data = update.id
        if isinstance(data, bpy.types.Object):
            self._mark_object(data, update)
        elif isinstance(data, bpy.types.Material):
            self.materials.add(data.name_full)
        elif isinstance(data, bpy.types.World):
            self.world = True
        elif isinstance(data, bpy.types.Light):
            self.lights = self.transforms = True
        elif isinstance(data, bpy.types.Camera):
            self.camera = True
        elif isinstance(data, bpy.types.Collection):
            self.transforms = True
        elif isinstance(data, (bpy.types.NodeTree, bpy.types.Image, bpy.types.Texture)):
            # Groups and images do not say which material uses them.
            self.all_materials = self.world = self.lights = True
        elif isinstance(data, bpy.types.Scene):
            self.settings = self.camera = self.transforms = True

    def _mark_object(self, data, update):
        if update.is_updated_geometry:
            self.objects.add(data.name_full)
        if data.type == 'CAMERA':
            self.camera = True
        self.transforms = True
