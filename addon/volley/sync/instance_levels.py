# SPDX-License-Identifier: GPL-3.0-or-later
"""Attributes of the instances that geometry nodes make, which Blender tells of geometries, not of instances.

An instance's numbers (persistent_id) lead to it: of instances in instances, each number is the place in one
geometry, or in the collection that an object shows, the outermost last. A geometry that has meshes and the like
besides instances has a number more: theirs, which the instances in it go behind. Of what is no instance it is the
first number.
"""

import bpy
import numpy as np

from .attribute_values import colors_of

HAS_GEOMETRIES = hasattr(bpy.types.Object, "evaluated_geometry")

_NO_NUMBER = 0x7FFFFFFF  # of Blender's persistent_id where there is no further maker
_COMPONENTS = {  # of a geometry, and the types of objects that they are the own data of
    "mesh": {'MESH'}, "volume": {'VOLUME'}, "curves": {'CURVE', 'FONT', 'CURVES'}, "pointcloud": {'POINTCLOUD'},
    "grease_pencil": {'GREASEPENCIL'}}


class InstanceLevels:
    """What geometries hold, each read once. It holds geometries of Blender's: leave it when a sync ends."""

    def __init__(self):
        self._roots = {}  # name of an object -> as _level_of

    def find(self, instance, name):
        """RGBA of an attribute of an instance, or of the ones that it is in, the innermost first; None where none has
        it."""
        maker = instance.parent
        if maker.name_full not in self._roots:
            self._roots[maker.name_full] = _level_of(maker)
        numbers = _numbers_of(instance)
        for level, index in _way_to(self._roots[maker.name_full], numbers):
            values = level.values(name)
            if values is not None:
                return tuple(values[index].tolist())
        return None


def are_by_nodes(instance):
    """Whether nodes may have made an instance: those of its maker, or of an object in the collection that this
    shows."""
    return _makes_by_nodes(instance.parent, len(_numbers_of(instance)))


def _makes_by_nodes(maker, depth):
    """The same by an object; depth: how many makers there are, each in the one before."""
    return _has_nodes(maker) or depth > 1 and _shows_collection(maker) and any(
        _makes_by_nodes(each, depth - 1) for each in maker.instance_collection.all_objects)


def _numbers_of(instance):
    return [number for number in instance.persistent_id if number != _NO_NUMBER]


def _has_nodes(blender_object):
    return any(modifier.type == 'NODES' for modifier in blender_object.modifiers)


def _shows_collection(blender_object):
    return blender_object.instance_type == 'COLLECTION' and blender_object.instance_collection is not None


def _level_of(blender_object):
    """The instances that an evaluated object makes, by nodes or of its collection; None where it makes others or
    none."""
    if _has_nodes(blender_object):
        return _Level(blender_object.evaluated_geometry(), blender_object.type)
    return _Members(blender_object.instance_collection) if _shows_collection(blender_object) else None


def _way_to(level, numbers):
    """(level, index of the instance in it) of each level that numbers lead through, the innermost first."""
    way = []
    while level is not None and len(numbers) > level.has_components:
        *numbers, number = numbers[:-1] if level.has_components else numbers
        index = level.index_of(number)
        if index is None:
            break
        way.insert(0, (level, index))
        level = level.inner(index)
    return way


class _Members:
    """The objects of a collection that is instanced, which nothing gives attributes as its instances."""

    has_components = False

    def __init__(self, collection):
        self._objects, self._inner = collection.all_objects[:], {}

    def index_of(self, number):
        """As _Level's."""
        return number if 0 <= number < len(self._objects) else None

    def inner(self, index):
        """The level of the instances that an object makes, None where it makes none."""
        if index not in self._inner:
            self._inner[index] = _level_of(self._objects[index])
        return self._inner[index]

    @staticmethod
    def values(_name):
        """As _Level's."""
        return None


class _Level:
    """The instances of a geometry. owner_type: the type of the object that it is all of, None where it is
    instanced."""

    def __init__(self, geometry, owner_type=None):
        self._geometry, self._cloud = geometry, geometry.instances_pointcloud()
        self.has_components = any(getattr(geometry, name, None) is not None and owner_type not in types
                                  for name, types in _COMPONENTS.items())
        self._values, self._inner = {}, {}
        self._places, self._references = self._numbers("id"), self._numbers(".reference_index")
        self._renumbered = []  # those that have other numbers, as one before has theirs
        if self._places is not None:
            self._places = self._first_of_each(self._places)

    def _first_of_each(self, numbers):
        """{number: instance} of those that keep their number."""
        places = {}
        for index, number in enumerate(numbers):
            if number in places:
                self._renumbered.append(index)
            else:
                places[number] = index
        self._renumbered.reverse()
        return places

    def _numbers(self, name):
        attribute = None if self._cloud is None else self._cloud.attributes.get(name)
        if attribute is None:
            return None
        numbers = np.empty(len(attribute.data), np.int32)
        attribute.data.foreach_get("value", numbers)
        return numbers.tolist()

    def index_of(self, number):
        """Which instance has that number, None where there is none."""
        if self._references is None:
            return None
        if self._places is not None:
            if number not in self._places and self._renumbered:  # Blender draws others, and tells them in order
                self._places[number] = self._renumbered.pop()
            return self._places.get(number)
        return number if 0 <= number < len(self._references) else None

    def inner(self, index):
        """The level of the geometry or the object that an instance shows, None where it shows a collection."""
        handle = self._references[index]
        if handle not in self._inner:
            shown = self._geometry.instance_references()[handle]
            if isinstance(shown, bpy.types.Object):
                self._inner[handle] = _level_of(shown)
            else:
                self._inner[handle] = _Level(shown) if hasattr(shown, "instances_pointcloud") else None
        return self._inner[handle]

    def values(self, name):
        """(instances, 4) of an attribute, None where there is none of numbers."""
        if name not in self._values:
            attribute = self._cloud.attributes.get(name)
            self._values[name] = None if attribute is None else colors_of(attribute)
        return self._values[name]
