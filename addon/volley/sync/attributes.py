# SPDX-License-Identifier: GPL-3.0-or-later
"""What Attribute nodes read of objects, of what made an instance, and of the view layer.

A name is looked up as Cycles does: a custom property, else a path from the data-block such as
"pass_index", "color" or "location", in one data-block after the other. Numbers are grey; of arrays of up
to four numbers, not switches, the fourth is alpha.
"""

import bpy

from ..abi import MAX_INSTANCE_VALUES, NodeType
from .instance import VALUES_END
from .instance_levels import HAS_GEOMETRIES, InstanceLevels, are_by_nodes
from .values import CONSTANT, Value

_COMPONENTS = 4  # RGBA
_NOTHING = (0.0,) * _COMPONENTS
_NO_OBJECT = 0.0, 0.0, 0.0, 1.0  # of what is no object


class Attributes:
    """Where the values of attributes of instances stand among those that the library has of an instance,
    the same for all materials of a scene."""

    def __init__(self, warnings):
        self._warnings = warnings
        self._firsts = {}  # (type of attribute, name): number of the first of four
        self._depsgraph, self._levels = None, InstanceLevels()

    def begin(self, depsgraph):
        """Look into a depsgraph until end()."""
        self._depsgraph, self._levels = depsgraph, InstanceLevels()

    def end(self):
        """Keep nothing of Blender."""
        self._depsgraph, self._levels = None, InstanceLevels()

    def read(self, walker, attribute_type, name):
        """An attribute's colour and alpha as Values; None where there is no room for it."""
        if not name:
            return _constants(_NOTHING)
        if attribute_type == 'VIEW_LAYER':
            walker.flat.follows_scene = True
            return _constants(self._of_view_layer(name))
        key = attribute_type, name
        first = self._firsts.setdefault(key, VALUES_END + _COMPONENTS * len(self._firsts))
        if first + _COMPONENTS > MAX_INSTANCE_VALUES:
            return None
        walker.flat.instance_attributes.add(key)
        color = Value('c', walker.emit(NodeType.INSTANCE_VALUES, (), first), 0)
        last = Value('c', walker.emit(NodeType.INSTANCE_VALUES, (), first + 3), 0)
        return color, Value('f', walker.emit(NodeType.SEPARATE, (last,)), 0)

    def _of_view_layer(self, name):
        """Looked up in the view layer, the scene and the world."""
        scene = self._depsgraph.scene_eval
        return _first_found((self._depsgraph.view_layer_eval, scene, scene.world), name) or _NOTHING

    def add_values(self, wanted, instance, values):
        """The values of an instance with the attributes that are wanted, a set of (type, name)."""
        if not wanted:
            return values
        firsts = {self._firsts[key]: key for key in wanted}
        values = list(values) + [0.0] * (max(firsts) + _COMPONENTS - len(values))
        for first, (attribute_type, name) in firsts.items():
            values[first:first + _COMPONENTS] = self.value_of(attribute_type, name, instance)
        return tuple(values)

    def value_of(self, attribute_type, name, instance):
        """An attribute of an instance, RGBA."""
        read = self._of_instancer if attribute_type == 'INSTANCER' and instance.is_instance else _of_object
        return read(instance, name) or _NOTHING

    def _of_instancer(self, instance, name):
        """Looked up in the settings of particles, in what nodes gave the instance, in its maker and the object."""
        system, maker = instance.particle_system, instance.parent
        value = None if system is None else _first_found((system.settings,), name)
        if system is None and HAS_GEOMETRIES:
            value = self._levels.find(instance, name)
        if value is None:
            value = _first_found((maker,), name) or _of_object(instance, name)
        if value is None and system is None and not HAS_GEOMETRIES and are_by_nodes(instance):
            self._warnings.add(f"Object '{maker.name}': attributes that nodes give instances, such as '{name}', "
                               "cannot be read in this Blender")
        return value


class FixedAttributes:
    """The same for one light or world: constants, as no other instance shows its nodes. instance: of the light where
    it is an object, else None."""

    def __init__(self, attributes, instance=None):
        self._attributes, self._instance = attributes, instance

    def read(self, walker, attribute_type, name):
        """As Attributes'."""
        if attribute_type == 'VIEW_LAYER':
            return self._attributes.read(walker, attribute_type, name)
        if self._instance is None:
            return _constants(_NO_OBJECT)
        walker.flat.instance_attributes.add((attribute_type, name))
        return _constants(self._attributes.value_of(attribute_type, name, self._instance) if name else _NOTHING)


def _constants(rgba):
    """A colour and its alpha as Values."""
    *color, alpha = rgba
    return Value('c', CONSTANT, 0, tuple(color)), Value('f', CONSTANT, 0, (alpha, 0.0, 0.0))


def _of_object(instance, name):
    return _first_found((instance.object, instance.object.data), name)


def _first_found(owners, name):
    """The value of the first data-block that has it, RGBA; None where none has."""
    for owner in owners:
        for path in (f'["{bpy.utils.escape_identifier(name)}"]', name):
            value = _resolved(owner, path)
            if value is not None:
                return value
    return None


def _resolved(owner, path):
    """A property as RGBA, None where there is none of numbers."""
    if owner is None:
        return None
    try:
        value = owner.path_resolve(path)
    except (ValueError, TypeError):
        return None
    if isinstance(value, (float, int)):
        return (float(value),) * 3 + (1.0,)
    components = tuple(value) if hasattr(value, "__len__") and len(value) <= _COMPONENTS else ()
    if not components or not all(type(component) in (float, int) for component in components):
        return None
    return tuple(map(float, components)) + (0.0, 0.0, 0.0, 1.0)[len(components):]
