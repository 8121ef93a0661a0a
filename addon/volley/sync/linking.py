# SPDX-License-Identifier: GPL-3.0-or-later
"""Light linking and shadow linking (Blender 4.0 on).

A light names a collection of receivers, which it lights, and one of blockers, which cast its shadows. If
something is included in it, nothing else counts; what is excluded never does. To the library, objects that
the same collections leave out are one set, and a light has a mask of the sets that it does without.
"""

from typing import NamedTuple

import bpy

from .source import objects_of

_HAS_LINKING = "light_linking" in bpy.types.Object.bl_rna.properties
_SET_MAX = 64  # of the bits of a mask


class ObjectLinks(NamedTuple):
    """The fields of trc_instance_desc."""

    light_set: int = 0
    shadow_set: int = 0
    light_exclude: int = 0
    shadow_exclude: int = 0


_NO_LINKS = ObjectLinks()


def _collections_of(blender_object):
    """An object's collections of receivers and of blockers, None where it has none."""
    linking = blender_object.light_linking if _HAS_LINKING else None
    if linking is None:
        return None, None
    return linking.receiver_collection, linking.blocker_collection


def _members(collection):
    """(name of object, whether it is included) of a collection and those in it, which say it for all of
    theirs."""
    for child, entry in zip(collection.children, collection.collection_children):
        yield from _members_as(child, entry.light_linking.link_state)
    for member, entry in zip(collection.objects, collection.collection_objects):
        yield member.name_full, entry.light_linking.link_state == 'INCLUDE'


def _members_as(collection, state):
    for member in collection.all_objects:
        yield member.name_full, state == 'INCLUDE'


class _Sets:
    """The sets of objects that collections of one kind make; 0 is of the objects in no collection."""

    def __init__(self, collections):
        members = {collection.name_full: list(_members(collection)) for collection in collections}
        self._includers = {name for name, entries in members.items() if any(is_in for _, is_in in entries)}
        states = {}  # name of object -> {name of collection: whether it is in}
        for collection, entries in members.items():
            for name, is_in in entries:
                own = states.setdefault(name, {})
                own[collection] = own.get(collection, True) and is_in
        self._left_out_by = {name: frozenset(
            collection for collection in members if not own.get(collection, collection not in self._includers))
            for name, own in states.items()}
        self._numbers = {}   # names of the collections that leave a set out -> its number
        for left_out_by in self._left_out_by.values():
            if len(self._numbers) < _SET_MAX - 1:
                self._numbers.setdefault(left_out_by, len(self._numbers) + 1)
        self.overflow = any(each not in self._numbers for each in self._left_out_by.values())

    def has(self, name):
        """Whether an object is in some collection."""
        return name in self._left_out_by

    def number(self, name):
        """The set of an object; of one too many, 0."""
        return self._numbers.get(self._left_out_by.get(name), 0)

    def exclude(self, collection):
        """The mask of the sets that a collection, None for all, leaves out."""
        if collection is None:
            return 0
        name = collection.name_full
        return int(name in self._includers) + sum(
            1 << number for left_out_by, number in self._numbers.items() if name in left_out_by)


class Links:
    """Who lights and shades whom in a depsgraph."""

    def __init__(self, depsgraph, warnings):
        self._collections = {}  # name of object -> its collections, of those that have some
        for each in objects_of(depsgraph) if _HAS_LINKING else ():
            collections = _collections_of(each)
            if any(collections):
                self._collections[each.name_full] = collections
        self._sets = [_Sets({each[kind] for each in self._collections.values()} - {None}) for kind in (0, 1)] \
            if self._collections else None
        if self._sets and any(sets.overflow for sets in self._sets):
            warnings.add(f"Lights are linked to more than {_SET_MAX} different sets of objects: some of these "
                         "are taken for not linked")

    def is_empty(self):
        """Whether no object has such collections."""
        return not self._collections

    def of(self, blender_object, maker):
        """What holds for an object or the instance of it that another one makes. As in Cycles, that is lit and
        shades as its maker, if this is in some collection, and emits as the object itself."""
        if self._sets is None:
            return _NO_LINKS
        receivers, blockers = self._collections.get(blender_object.name_full, (None, None))
        lights, shadows = self._sets
        return ObjectLinks(self._number(lights, blender_object, maker),
                           self._number(shadows, blender_object, maker),
                           lights.exclude(receivers), shadows.exclude(blockers))

    @staticmethod
    def _number(sets, blender_object, maker):
        owner = maker if maker is not None and sets.has(maker.name_full) else blender_object
        return sets.number(owner.name_full)

    def knows(self, evaluated):
        """Whether the object's collections are as they were found."""
        collections = _collections_of(evaluated)
        if self.is_empty():
            return not any(collections)
        names = [None if each is None else each.name_full for each in collections]
        known = self._collections.get(evaluated.name_full, (None, None))
        return names == [None if each is None else each.name_full for each in known]
