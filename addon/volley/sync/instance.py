# SPDX-License-Identifier: GPL-3.0-or-later
"""Instances: one walk over the depsgraph finds every object that is drawn, however it came to be.

Items of ``depsgraph.object_instances`` die with the loop, so everything is copied while they live. A
mesh that many instances show is read once; the first of them to come along owns it.
"""

import functools
from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

import bpy
import numpy as np

from .. import abi, compat, native
from . import motion, visibility
from .hashing import HASH_MAX, hash_name, hash_pair
from .linking import ObjectLinks
from .matrix import rows


_SHADOW_CATCHER = int(abi.InstanceFlags.SHADOW_CATCHER)  # flags of Python's are slow
_WORLD_NORMALS = int(abi.InstanceFlags.WORLD_NORMALS)


class Offsets(NamedTuple):
    """The fields of trc_instance_desc that say where rays of an object start and end."""

    shadow_terminator_geometry: float
    shadow_terminator_shading: float
    ao_distance: float


def offsets_of(blender_object):
    """Those of an object's settings."""
    owner, (geometry, shading) = compat.shadow_terminator_settings(blender_object)
    distance = getattr(getattr(blender_object, "cycles", None), "ao_distance", 0.0)
    return Offsets(getattr(owner, geometry, 0.1), getattr(owner, shading, 0.0), distance if distance > 0.0 else 0.0)


@dataclass
class Item:
    """What one instance shows, copied out of the depsgraph."""

    key: tuple                 # stable from sync to sync, see key_of
    owner: str                 # name of the object it is of, as Blender's updates name it
    name: str                  # in mattes, of the object and
    asset: str                 # of its uppermost parent
    transforms: list           # a tuple of 12 floats for each motion key
    mesh_key: tuple = None     # the key of the item that owns the mesh
    materials: tuple = ()
    holes: tuple = ()          # the materials that the camera sees in place of them, none: no others
    visibility: int = 0
    pass_index: int = 0
    random: float = 0.0
    color: tuple = (1.0, 1.0, 1.0, 1.0)
    light_group: int = 0       # from 1 on, 0 for none
    flags: int = 0             # INSTANCE_*
    links: ObjectLinks = ObjectLinks()
    offsets: Offsets = Offsets(0.1, 0.0, 0.0)
    values: tuple = ()         # see instancer_values and attributes.Attributes
    light: dict = None         # fields of a light instead of a mesh
    motion_keys: int = 1       # how many the object asks for
    deforms: bool = False      # whether the mesh may change its shape in time
    is_particle: bool = False  # and is therefore hidden where one of its motion keys is missing


_PLAIN_LENGTH = 2  # of the key of an object that stands for itself


def key_of(instance):
    """What names an instance at every time and in every sync: object, instancer, numbers."""
    if type(instance) is Plain:
        return instance.key
    if not instance.is_instance:
        return _plain_key(instance.object)
    parent = instance.parent
    return (*_plain_key(instance.object), parent.name_full if parent else "", tuple(instance.persistent_id))


def _plain_key(blender_object):
    data = blender_object.data
    return blender_object.name_full, type(data).__name__ if data is not None else ""


class Plain:
    """An object on its own, in the form of the depsgraph's instances."""

    is_instance, parent, show_self, show_particles = False, None, True, True

    def __init__(self, evaluated):
        self.object, self.matrix_world, self.key = evaluated, evaluated.matrix_world, _plain_key(evaluated)


def names_in(key):
    """Names of the object an instance shows and of what makes it, by its key; none of what stands for itself."""
    return () if is_plain(key) else (key[0], key[2])


def is_plain(key):
    """Whether a key is of an object that stands for itself."""
    return len(key) == _PLAIN_LENGTH


_NO_NUMBER = 0x7FFFFFFF  # of Blender's persistent_id where there is no further maker


def is_nested(key):
    """Whether an instance's key is of one within another: only the outermost maker is in it."""
    return key[3][1] != _NO_NUMBER


def maker_of(instance):
    """What makes an instance, None for an object that stands for itself."""
    return instance.parent if instance.is_instance else None


def hair_key(instance, number):
    """The key of the hair of one of the object's particle systems."""
    return key_of(instance) + ("hair", number)


def may_instance(evaluated):
    """Whether an object may have begun to make instances of others: nodes may at any frame."""
    return evaluated.instance_type != 'NONE' or any([modifier.type in {'NODES', 'PARTICLE_SYSTEM'}
                                                     for modifier in evaluated.modifiers])


# Types of objects that 3D views call otherwise.
_VIEW_KINDS = {'SURFACE': "surf", 'GPENCIL': "grease_pencil", 'GREASEPENCIL': "grease_pencil"}


def is_in_view(instance, v3d=None):
    """Whether its object and particles may be seen: viewports have local views, which show instances with
    what makes them, and hide types of objects, which hides instances by their own."""
    if v3d is None or instance.object.visible_in_viewport_get(v3d):
        return True
    # Of an object that only a linked collection has Blender may not say so, though what instances it is seen.
    return instance.is_instance and _is_kind_shown(instance.object, v3d) \
        and instance.parent.visible_in_viewport_get(v3d)


def _is_kind_shown(blender_object, v3d):
    kind = _VIEW_KINDS.get(blender_object.type, blender_object.type.lower())
    return getattr(v3d, f"show_object_viewport_{kind}", True)


def names_of(instance):
    """Names of the object an instance shows and of the one that makes it."""
    owners = [instance.object] + ([instance.parent] if instance.parent else [])
    return {owner.name_full for owner in owners}


def random_of(instance):
    """Object Info's Random, [0, 1), the number Cycles has for the same instance."""
    if instance.is_instance:
        return _random_number(instance.random_id & HASH_MAX)
    return _name_random(instance.object.name)


@functools.lru_cache(maxsize=1 << 16)  # a walk asks for every object
def _name_random(name):
    return _random_number(hash_pair(hash_name(name), 0))


def _random_number(number):
    return min(number / HASH_MAX, 1.0 - 2.0 ** -24)


def uppermost(blender_object):
    """The first of an object's parents, the object itself where it has none."""
    while blender_object.parent is not None:
        blender_object = blender_object.parent
    return blender_object


def describe(instance, view_layer, light_groups, links):
    """The parts of an item that meshes and lights share; light_groups: {name: number}, links:
    linking.Links."""
    blender_object, maker, key = instance.object, maker_of(instance), key_of(instance)
    return Item(
        key=key, owner=key[0],
        name=blender_object.name, asset=uppermost(blender_object).name,
        transforms=[rows(instance.matrix_world)],
        visibility=visibility.instance_visibility(blender_object, maker, view_layer),
        pass_index=blender_object.pass_index, random=random_of(instance),
        color=blender_object.color[:],
        light_group=light_groups.get(blender_object.lightgroup, 0) if light_groups else 0,
        links=links.of(blender_object, maker),
        offsets=offsets_of(blender_object),
        flags=_SHADOW_CATCHER if visibility.is_shadow_catcher(blender_object, maker, view_layer) else 0)


# Where the numbers of instancer_values begin, and where they all end.
VALUES_PARTICLE = 0
VALUES_LOCATION = VALUES_PARTICLE + 5
VALUES_VELOCITY = VALUES_LOCATION + 3
VALUES_SPIN = VALUES_VELOCITY + 3
VALUES_GENERATED = VALUES_SPIN + 3
VALUES_UV = VALUES_GENERATED + 3
VALUES_END = VALUES_UV + 2

# Random of what is no particle. Values are 0 there, so those of particles count from it.
NO_PARTICLE_RANDOM = hash_pair(0, 0) / HASH_MAX


def instancer_values(instance, scene):
    """What made an instance: its particle's index, random number (less NO_PARTICLE_RANDOM), age, lifetime
    (frames) and size, its location, velocity and angular velocity, the Generated (halved, as in Cycles) and
    the UV coordinates of its place; 0 what there is not. Child particles have nothing, as in Cycles."""
    values = np.zeros(VALUES_END, np.float32)
    values[VALUES_GENERATED:VALUES_UV] = 0.5 * np.array(instance.orco) - 0.5
    values[VALUES_UV:VALUES_END] = instance.uv
    system, number = instance.particle_system, instance.persistent_id[0]
    if system is not None and 0 <= number < len(system.particles):
        particle = system.particles[number]
        age = scene.frame_current_final - particle.birth_time
        values[:VALUES_GENERATED] = (
            number, hash_pair(number, 0) / HASH_MAX - NO_PARTICLE_RANDOM, age, particle.lifetime, particle.size,
            *particle.location, *particle.velocity, *particle.angular_velocity)
    return tuple(np.nan_to_num(values).tolist())


def has_mesh(instance):
    """Whether the instance shows a mesh; curves, text and the like come along as one of their own."""
    return type(instance.object.data) is bpy.types.Mesh  # isinstance takes thrice as long


def is_light(instance):
    """Whether the instance is a light."""
    return instance.object.type == 'LIGHT'


@dataclass
class InstanceEntry:
    """An instance in the library; a holdout is two, for the camera and for all other rays."""

    ids: tuple
    item: Item
    transforms: tuple  # where the item was
    key_count: int     # of the library's transforms
    mesh: tuple        # its mesh in the library, and whether its normals are the world's
    signature: tuple   # all else


@dataclass
class Instances:
    """The instances of one scene of the library."""

    scene: object
    warnings: object
    _entries: dict = field(default_factory=dict)
    _in_world: set = field(default_factory=set)

    def update(self, items, mesh_ids, in_world, moving):
        """Make the library's instances those of the items; mesh_ids: library id by mesh key. One that the library
        refuses is left out. in_world: keys of meshes that Cycles moves to world space if they have one user, and
        no material of moving, the ids of those that move vertices."""
        users = Counter(item.mesh_key for item in items) if in_world else {}
        self._in_world = {key for key in in_world if users[key] == 1}
        shown = [item for item in items if mesh_ids.get(item.mesh_key) is not None]
        refused = self._update_all(shown, mesh_ids, moving, "it is left out")
        seen = {item.key for item in shown} - refused
        for key in [key for key in self._entries if key not in seen]:
            for instance_id in self._entries.pop(key).ids:
                self.scene.destroy_instance(instance_id)

    def change(self, items, mesh_ids, moving):
        """Bring some of them up to date, as update(); what the library refuses goes on as it was."""
        self._update_all(items, mesh_ids, moving, "it stays as it was")

    def names(self):
        """The names in mattes, of objects and of assets: two sets."""
        entries = self._entries.values()
        return {entry.item.name for entry in entries}, {entry.item.asset for entry in entries}

    def _update_all(self, items, mesh_ids, moving, outcome):
        """Bring instances up to date; the keys of those that the library refused, which are warned of."""
        refused, moved = set(), []
        for item in items:
            try:
                moved += self._update_one(item, mesh_ids[item.mesh_key], moving)
            except native.TracerError as error:
                if error.status != abi.StatusCode.ERROR_INVALID_ARGUMENT:
                    raise
                self.warnings.add(f"Object '{item.owner}': {error}; {outcome}")
                refused.add(item.key)
        self._send_moved(moved)
        return refused

    def _update_one(self, item, mesh_id, moving):
        """Send an item where it differs; its entry where only the transforms do, which then wait."""
        is_in_world = item.mesh_key in self._in_world and moving.isdisjoint(item.materials)
        shown = mesh_id, is_in_world
        entry = self._entries.get(item.key)
        if entry is not None and entry.mesh == shown and (
                entry.item is item or entry.signature == _signature(item)):
            entry.item = item
            return (entry,) if entry.transforms != tuple(item.transforms) else ()
        self._send(item, entry, shown)
        return ()

    def _send(self, item, entry, shown):
        """Have all of an item in the library; entry: the former one, None where there is none."""
        mesh_id, is_in_world = shown
        transforms = _keys_of(item)
        values = {"mesh": mesh_id, "transforms": transforms, "pass_index": item.pass_index,
                  "random": item.random, "color": item.color, "light_group": item.light_group,
                  "flags": item.flags | _WORLD_NORMALS * is_in_world,
                  **item.links._asdict(), **item.offsets._asdict(), "values": item.values,
                  "cryptomatte_object": native.cryptomatte_id(item.name),
                  "cryptomatte_asset": native.cryptomatte_id(item.asset)}
        parts = _parts(item)
        ids = list(entry.ids) if entry is not None else []
        while len(ids) > len(parts):
            self.scene.destroy_instance(ids.pop())
        for instance_id, part in zip(ids, parts):
            self.scene.update_instance(instance_id, **values, **part)
        for part in parts[len(ids):]:
            ids.append(self.scene.create_instance(**values, **part))
        self._entries[item.key] = InstanceEntry(
            tuple(ids), item, tuple(item.transforms), len(transforms), shown, _signature(item))

    def _send_moved(self, moved):
        """Send the transforms of entries that moved, together where the numbers of keys stay."""
        together = {}  # number of keys -> [(entry, transforms)]
        for entry in moved:
            transforms = _keys_of(entry.item)
            if len(transforms) == entry.key_count:
                together.setdefault(entry.key_count, []).append((entry, transforms))
            else:
                self._send(entry.item, entry, entry.mesh)
        for group in together.values():
            ids = [instance_id for entry, _ in group for instance_id in entry.ids]
            self.scene.move_instances(ids, [transforms for entry, transforms in group for _ in entry.ids])
            for entry, _ in group:
                entry.transforms = tuple(entry.item.transforms)


def _signature(item):
    """All of an item that its instance in the library has but its mesh and where it is."""
    return (item.materials, item.holes, item.visibility, item.pass_index, item.random, item.color, item.name,
            item.asset, item.light_group, item.flags, item.links, item.offsets, item.values)


def _parts(item):
    """What rays see of an item: all the same, or the camera a hole where others see what it is made of."""
    if not item.holes:
        return [{"materials": item.materials, "visibility": item.visibility}]
    return [{"materials": item.holes, "visibility": item.visibility & abi.VisibleRays.CAMERA},
            {"materials": item.materials, "visibility": item.visibility & ~abi.VisibleRays.CAMERA}]


def _keys_of(item):
    """The transforms of an item as the library takes them, (keys, 12) float32: equal ones as one."""
    stacked = np.array(item.transforms, np.float32)
    if len(stacked) > 1 and (stacked == stacked[0]).all():
        return stacked[:1]
    return motion.follow_turns(stacked)
