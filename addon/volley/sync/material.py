# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials: node trees or plain settings to the library's node lists, once per change."""

import bpy

from .. import abi, native
from ..abi import DisplacementMethod, NodeType
from ..compat import (
    DEFAULT_IS_PRINCIPLED, HAS_DEFENSIVE_SAMPLING, HAS_FACET_SHADOWING, HAS_WIDE_SHADOWS, KEEPS_NORMALS, LEAVES_BUMPS,
    LIGHT_IS_OBJECT, cycles, has_light_tree, uses_nodes)
from . import flatten, instance, nodes, studio, tangents
from .attributes import Attributes, FixedAttributes
from .changes import Changes
from .inlined import shader_tree
from .values import CONSTANT, DEFAULT, Value

_DEFAULT_KEY = ("default",)
_HOLE = "hole"
_STUDIO_KEY = ("studio",)
_DISPLACEMENTS = {'BUMP': DisplacementMethod.BUMP, 'DISPLACEMENT': DisplacementMethod.TRUE,
                  'BOTH': DisplacementMethod.BOTH}
_VERSION_FLAGS = ((abi.MaterialFlags.DEFENSIVE_SAMPLING if HAS_DEFENSIVE_SAMPLING else 0) |
                  (abi.MaterialFlags.FACET_SHADOWING if HAS_FACET_SHADOWING else 0) |
                  (abi.MaterialFlags.WIDE_SHADOWS if HAS_WIDE_SHADOWS else 0) |
                  (abi.MaterialFlags.KEEPS_NORMALS if KEEPS_NORMALS else 0))
_DEFAULT_COLOR = 0.8, 0.8, 0.8
_DEFAULT_NAME = "default_surface"  # in mattes


class Materials:
    """The materials of one scene of the library, by name."""

    def __init__(self, scene, images, warnings):
        self._scene, self._images, self._warnings = scene, images, warnings
        self._entries = {}  # key -> Entry
        self._seen = set()
        self._lights = set()  # keys of the lights that are flattened in this sync
        self._changes = Changes.everything()
        self._aovs, self._has_light_tree = {}, False
        self._attributes = Attributes(warnings)

    def begin(self, depsgraph, changes, aovs):
        """Start a sync: nothing has been asked for yet. Materials that changes does not name are taken
        as they are. aovs: {name: (type, number)}."""
        self._attributes.begin(depsgraph)
        self._seen, self._lights = set(), set()
        read = aovs, has_light_tree(depsgraph.scene_eval)
        self._changes = changes if read == (self._aovs, self._has_light_tree) else Changes.everything()
        self._aovs, self._has_light_tree = read

    def note_move(self, depsgraph):
        """Blender is at another time now, of which instances' values are."""
        self._attributes.begin(depsgraph)

    def ids_of(self, made_of):
        """The library's ids of evaluated materials, the default's for None; and whether each of them is of a
        volume alone, so that what is made of them is not there."""
        entries = [self._default_entry() if material is None else self.entry_of(material) for material in made_of]
        is_volume = bool(entries) and entries[0].is_volume and all([entry.is_volume for entry in entries])
        return tuple([entry.id for entry in entries]), is_volume

    def ids(self):
        """By name of material, the library's ids of this sync's and whether they are of volumes alone. The default,
        which never changes, stays in the library if it is there."""
        if _DEFAULT_KEY in self._entries:
            self._seen.add(_DEFAULT_KEY)
        return {key: (self._entries[key].id, self._entries[key].is_volume) for key in self._seen
                if not isinstance(key, tuple)}

    def moving(self):
        """The library's ids of the materials of this sync whose displacement moves vertices."""
        return {self._entries[key].id for key in self._seen if self._entries[key].moves_vertices}

    def entry_of(self, material):
        """The entry of an evaluated material, brought up to date once per sync."""
        return self._entry(material.name_full, material)

    def holes_of(self, made_of):
        """The library's ids of what the camera sees of a holdout of these evaluated materials: what is
        transparent stays so, all else punches a hole."""
        return tuple([self._hole(material).id for material in made_of])

    def _hole(self, material):
        if material is not None:
            return self._entry((_HOLE, material.name_full), material, abi.MaterialFlags.CUTS_OUT)
        key = (_HOLE, None)
        if key not in self._seen:
            self._update(key, _default_surface(), flags=abi.MaterialFlags.CUTS_OUT)
        return self._entries[key]

    def _entry(self, key, material, flags=0):
        """The entry of an evaluated material with flags besides its own."""
        if key not in self._seen and not self._keep(key):
            label = f"Material '{material.name}'"
            if not cycles(material, "use_bump_map_correction", True):
                self._warnings.add(f"{label}: bent normals are corrected nonetheless")
            flat = self.flatten(material, label)
            is_volume = flat.surface < 0 and flat.has_volume
            if is_volume:  # nothing but the bounds of what is left out
                _let_through(flat)
            self._update(key, flat, material.name, pass_index=material.pass_index,
                         flags=flags | _flags(material, is_volume, self._has_light_tree))
            self._entries[key].is_volume = is_volume
        return self._entries[key]

    def _default_entry(self):
        """The entry of what has no material."""
        if _DEFAULT_KEY not in self._seen:
            self._update(_DEFAULT_KEY, _default_surface(), _DEFAULT_NAME, flags=_VERSION_FLAGS)
        return self._entries[_DEFAULT_KEY]

    def knows(self, name):
        """Whether the last sync had a material of that name."""
        return name in self._entries

    def change(self, depsgraph, changes):
        """Flatten those again that changes names, all others stay. False if one cannot be found."""
        self._attributes.begin(depsgraph)
        self._changes = changes
        self._seen, self._lights = set(), set()
        for key in list(self._entries):
            name = _material_name(key)
            if name is None:
                self._hold(key)
            elif not self._keep(key):
                material = bpy.data.materials.get(name)
                if material is None or not material.evaluated_get(depsgraph).is_evaluated:
                    return False
                material = material.evaluated_get(depsgraph)
                self._entry(key, material, abi.MaterialFlags.CUTS_OUT if isinstance(key, tuple) else 0)
        return True

    def _keep(self, key):
        """Take a material as it is in the library, if it is there and has not changed."""
        entry = self._entries.get(key)
        if entry is None or entry.is_animated or self._changes.material_of(_material_name(key)):
            return False
        self._hold(key)
        return True

    def _hold(self, key):
        self._seen.add(key)
        self._images.keep(self._entries[key].images)

    def world_id(self, world):
        """A world's surface as a material, and the sky_texture.Sun that it shows or None."""
        key = ("world", world.name_full)
        label = f"World '{world.name}'"
        if uses_nodes(world):
            flat = self._flatten(world, label, FixedAttributes(self._attributes), is_of_world=True)
        else:
            flat = _background(world.color)
        flat.ask_nothing()
        self._update(key, flat)
        entry = self._entries[key]
        return entry.id, entry.sun

    def light_id(self, each):
        """The nodes of the evaluated light that an instance shows as a material, flattened once per sync; for each
        instance where they read attributes of that."""
        light = each.object.data
        key = ("light", light.name_full)
        own = (*key, instance.key_of(each))
        if self._lights.isdisjoint({key, own}):
            attributes = FixedAttributes(self._attributes, each if LIGHT_IS_OBJECT else None)
            with shader_tree(light) as (tree, is_made):
                flat = flatten.flatten(tree, f"Light '{light.name}'", self._warnings, self._images,
                                       attributes=attributes)
            if flat.instance_attributes:
                key = own
            flat.follows_scene |= is_made
            flat.ask_nothing()
            self._lights.add(key)
            self._update(key, flat)
        key = key if key in self._lights else own
        self._seen.add(key)
        return self._entries[key].id

    def studio_id(self, light):
        """A viewport's studio.Studio as a material."""
        image_id = self._images.id_of_file(light.path) if light.path else 0
        self._update(_STUDIO_KEY, studio.flatten_studio(light, image_id))
        return self._entries[_STUDIO_KEY].id

    def attribute_names(self):
        """The UV maps and colour attributes that the materials of this sync read, two sets, whether one
        reads Generated coordinates, and {name: attributes of tangents} of the materials that read
        those."""
        uv_names, color_names, needs_generated = set(), set(), False
        tangent_readers = {}
        for key in self._seen:
            of_tangents = tangents.names_among(self._entries[key].color_names)
            if of_tangents:
                tangent_readers[key] = of_tangents
            uv_names |= self._entries[key].uv_names
            color_names |= self._entries[key].color_names
            needs_generated |= self._entries[key].needs_generated
        return uv_names, color_names, needs_generated, tangent_readers

    def instance_values(self):
        """Makes instances' values as the materials of this sync read them: a function of an instance of
        the depsgraph and the scene; None where they read none."""
        entries = [self._entries[key] for key in self._seen]
        wanted = set().union(*(entry.instance_attributes for entry in entries))
        needs_instancer = any(entry.needs_instancer for entry in entries)
        if not wanted and not needs_instancer:
            return None

        def values_of(each, scene):
            values = instance.instancer_values(each, scene) if needs_instancer and each.is_instance else ()
            return self._attributes.add_values(wanted, each, values)
        return values_of

    def read_names(self):
        """All that the materials of this sync read of meshes and instances, which are of volumes alone and which
        move vertices: where it stays the same, so does what the others need."""
        entries = [self._entries[key] for key in self._seen]
        return (self.attribute_names(), self.volume_names(),
                set().union(*(entry.instance_attributes for entry in entries)),
                any(entry.needs_instancer for entry in entries),
                self.moving())

    def tangents_read_by(self, materials):
        """The attributes of tangents that some of Blender's materials of this sync read."""
        return tangents.names_among(set().union(*(self.entry_of(each).color_names for each in materials)))

    def end(self):
        """Free what nothing asked for since begin; call when no instance uses it any more."""
        self._attributes.end()
        for key in [key for key in self._entries if key not in self._seen]:
            material_id = self._entries.pop(key).id
            if material_id:
                self._scene.destroy_material(material_id)

    def flatten(self, material, label):
        """A material's surface as a flat tree."""
        if uses_nodes(material):
            return self._flatten(material, label, self._attributes, _displacement_mode(material))
        return _plain_surface(material.diffuse_color)  # as in Cycles

    def volume_names(self):
        """The names of materials of this sync that are of volumes alone."""
        return {key for key in self._seen if self._entries[key].is_volume}

    def _flatten(self, data, label, attributes, displacement=None, is_of_world=False):
        """The tree of an evaluated material or world; one of Blender's making may be another in the next sync."""
        with shader_tree(data) as (tree, is_made):
            flat = flatten.flatten(tree, label, self._warnings, self._images, self._aovs, attributes, displacement,
                                   is_of_world)
        flat.follows_scene |= is_made
        return flat

    def names(self):
        """The names in mattes."""
        return {entry.name for entry in self._entries.values() if entry.name} | {_DEFAULT_NAME}

    def _update(self, key, flat, name="", **values):
        self._seen.add(key)
        signature = (flat.signature(), name, tuple(values.items()))
        entry = self._entries.get(key)
        if entry is None:
            entry = self._entries[key] = Entry()
        if entry.signature != signature:
            values["cryptomatte"] = native.cryptomatte_id(name) if name else 0.0
            self._send(entry, key, flat, values)
        entry.signature, entry.name = signature, name
        entry.uv_names, entry.color_names, entry.emits = flat.uv_names, flat.color_names, flat.emits()
        entry.moves_vertices = flat.moves_vertices()
        entry.needs_generated, entry.sun = flat.needs_generated, flat.sun
        entry.needs_instancer, entry.instance_attributes = flat.needs_instancer, flat.instance_attributes
        entry.images, is_animated = self._images.take_asked()
        entry.is_animated = is_animated or flat.follows_scene

    def _send(self, entry, key, flat, values):
        """Create or change it in the library; a refused one becomes the default material."""
        try:
            if entry.id:
                self._scene.update_material(entry.id, flat.nodes, flat.surface, flat.film_colors, **values)
            else:
                entry.id = self._scene.create_material(flat.nodes, flat.surface, flat.film_colors, **values)
        except native.TracerError as error:
            if error.status not in (abi.StatusCode.ERROR_INVALID_ARGUMENT, abi.StatusCode.ERROR_TOO_LARGE):
                raise
            self._warnings.add(f"Material '{key[-1] if isinstance(key, tuple) else key}': {error}; the "
                               "default material is used")
            if entry.id:
                self._scene.destroy_material(entry.id)
            entry.id = 0


class Entry:
    """What is known of one material in the library."""

    def __init__(self):
        self.id = 0
        self.signature = None
        self.name = ""  # in mattes
        self.uv_names, self.color_names = set(), set()
        self.needs_generated, self.sun = False, None
        self.needs_instancer, self.instance_attributes = False, set()
        self.emits = False      # perhaps
        self.moves_vertices = False
        self.is_volume = False  # of a volume alone: what has no other is not there
        self.images = set()  # those it reads
        self.is_animated = False  # whether what it reads may be another in the next sync


def _material_name(key):
    """Of the key of an entry, the name of Blender's material that it is of; None where it is of no such."""
    if not isinstance(key, tuple):
        return key
    return key[1] if key[0] == _HOLE else None


def _flags(material, is_volume, is_by_light_tree):
    has_transparent_shadow = is_volume or _has_transparent_shadow(material)
    flags = _VERSION_FLAGS | (abi.MaterialFlags.TRANSPARENT_SHADOW if has_transparent_shadow else 0)
    flags |= abi.MaterialFlags.LIGHT_TREE if is_by_light_tree else 0
    if cycles(material, "sample_as_light", cycles(material, "emission_sampling", 'AUTO') != 'NONE'):
        flags |= abi.MaterialFlags.SAMPLE_EMISSION
    return flags


def _displacement_mode(material):
    """How displacement shows. The setting moved from Cycles' to the material itself in 4.1."""
    method = getattr(material, "displacement_method", cycles(material, "displacement_method", 'BUMP'))
    return _DISPLACEMENTS[method] | (0 if LEAVES_BUMPS else DisplacementMethod.ABOVE)


def _has_transparent_shadow(material):
    """The switch moved from Cycles' settings to the material itself in 4.2."""
    return getattr(material, "use_transparent_shadow", cycles(material, "use_transparent_shadow", True))


def _let_through(flat):
    """Make a tree without a surface one that lets all light through."""
    white = CONSTANT, 0, (1.0, 1.0, 1.0)
    flat.nodes.append(flatten.FlatNode(NodeType.TRANSPARENT, [white]))
    flat.surface = len(flat.nodes) - 1


def _default_surface():
    if not DEFAULT_IS_PRINCIPLED:
        return _plain_surface(_DEFAULT_COLOR)
    walker = flatten.Walker("", None)
    walker.flat.surface = nodes.emit_default_principled(walker)
    return walker.flat


def _plain_surface(color):
    """A diffuse of that colour."""
    walker = flatten.Walker("", None)
    values = (Value('c', CONSTANT, 0, tuple(color)[:3]), Value('f', CONSTANT, 0), Value('v', DEFAULT, 0))
    walker.flat.surface = walker.emit(NodeType.DIFFUSE, values)
    return walker.flat


def _background(color):
    walker = flatten.Walker("", None)
    values = (Value('c', CONSTANT, 0, tuple(color)[:3]), Value('f', CONSTANT, 0, (1.0, 0.0, 0.0)))
    walker.flat.surface = walker.emit(NodeType.BACKGROUND, values)
    return walker.flat
