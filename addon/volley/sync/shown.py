# SPDX-License-Identifier: GPL-3.0-or-later
"""What a full walk found, so that later syncs need not walk."""

from collections import Counter

from . import instance


class Shown:
    """What a full walk found, by which later syncs know objects that stand for themselves."""

    IRRELEVANT = object()  # an object that is no part of the picture

    # These never show anything and never make instances.
    _SILENT_TYPES = {'ARMATURE', 'CAMERA', 'LATTICE', 'SPEAKER', 'LIGHT_PROBE', 'VOLUME'}

    def __init__(self, walk, source, warnings):
        self.items, self._lights, self._tied, self.haired = walk.items, walk.lights, walk.tied, walk.haired
        self.links, self.circumstances = walk.links, walk.circumstances
        self.users = Counter(item.mesh_key for item in walk.items.values())
        assets = {item.asset for item in walk.items.values() if item.asset != item.name}
        parents = filter(None, map(source.originals.get, assets))
        self._asset_names = {parent.as_pointer(): parent.name for parent in parents}
        self._identity = self._identity_of(source)
        self._warnings = warnings

    @staticmethod
    def _identity_of(source):
        depsgraph = source.depsgraph
        return (depsgraph.scene.name_full, depsgraph.view_layer.name, depsgraph.as_pointer(), source.needs_uv,
                source.aovs, source.light_groups)

    def is_of(self, source):
        """Whether a source shows the same scene and view layer."""
        return self._identity == self._identity_of(source)

    def links_now(self, source):
        """Who lights and shades whom, where that can be told without a look at every object, else None."""
        named = [source.originals.get(name) for name in source.changes.objects]
        is_empty = self.links.is_empty() and all(
            [each is not None and self.links.knows(each.evaluated_get(source.depsgraph)) for each in named])
        return self.links if is_empty else None

    def warn_again(self, warnings):
        """Add what the walk warned of, which renders tell each time."""
        for message in self._warnings:
            warnings.add(message)

    def owners_of(self, lights, source):
        """Names of the objects that show these lights, by the names of their data."""
        if not lights:
            return set()
        owners = filter(None, (source.originals.get(key[0]) for key in self._lights))
        return {owner.name_full for owner in owners if owner.data.name_full in lights}

    def find(self, name, source):
        """The object of that name as an instance, IRRELEVANT, or None where only a walk can tell."""
        original = source.originals.get(name)
        if original is None or name in self._tied:
            return None
        if self._asset_names.get(original.as_pointer(), original.name) != original.name:  # what its children have
            return None
        evaluated = original.evaluated_get(source.depsgraph)
        if not evaluated.is_evaluated or not self.links.knows(evaluated):
            return None
        if source.v3d is None and name in source.changes.geometry and instance.may_instance(evaluated):
            return None
        each = instance.Plain(evaluated)
        key = instance.key_of(each)
        if key in self.items or key in self._lights:
            is_hidden = evaluated.hide_render if source.v3d is None else not instance.is_in_view(each, source.v3d)
            return None if is_hidden else each
        is_silent = evaluated.type in self._SILENT_TYPES or (
            evaluated.type == 'EMPTY' and evaluated.instance_type == 'NONE')
        return self.IRRELEVANT if is_silent else None
