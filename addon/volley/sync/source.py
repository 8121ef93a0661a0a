# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a sync reads from."""

from dataclasses import dataclass, field

import bpy

from .changes import Changes


class Cancelled(Exception):
    """The user stopped the sync."""


def objects_of(depsgraph):
    """All evaluated objects. depsgraph.objects lacks those that are there by instances of their collection alone."""
    return (each for each in depsgraph.ids if isinstance(each, bpy.types.Object))


_FEW = 8  # names that are looked up before it is worth to have all of them in a table


class Originals:
    """The file's objects by name. Blender looks through all of them for one, so that all by all would be quadratic."""

    def __init__(self):
        self._asked, self._table = 0, None

    def get(self, name):
        """The object of that name, None where there is none; of linked ones of one name, that which Blender gives."""
        if self._table is None:
            self._asked += 1
            if self._asked <= _FEW:
                return bpy.data.objects.get(name)
            self._table = {}
            for each in bpy.data.objects:
                self._table.setdefault(each.name, each)
        return self._table.get(name)


@dataclass
class Source:
    """Where a sync reads from. engine: moves the scene in time for motion blur, else None; v3d: the
    viewport whose visibility counts, None for a render; aovs: {name: (type, number)} and light_groups:
    {name: number} of those that are rendered; is_cancelled: asked now and then; culling: culling.Culling or
    None; dicing: dicing.Dicing or None."""

    depsgraph: object
    changes: Changes
    engine: object = None
    v3d: object = None
    needs_uv: bool = False
    aovs: dict = field(default_factory=dict)
    light_groups: dict = field(default_factory=dict)
    is_cancelled: object = staticmethod(lambda: False)
    originals: Originals = field(default_factory=Originals)
    culling: object = None
    dicing: object = None
