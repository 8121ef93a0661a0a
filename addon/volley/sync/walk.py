# SPDX-License-Identifier: GPL-3.0-or-later
"""Walks over the depsgraph: what is there, what it shows, and where it is at other times."""

from dataclasses import dataclass

import bpy

from ..abi import MAX_ATTRIBUTES, InstanceFlags
from . import attribute_values, curves, deform, instance, light, mesh, motion, strands, visibility
from .changes import Changes
from .kept import Circumstances, Kept
from .linking import Links
from .matrix import rows
from .source import Cancelled, objects_of

_BREAK_INTERVAL = 32  # instances between two looks at whether the user pressed Esc


def materials_of(blender_object, view_layer):
    """What an object is made of, slot by slot, None where a slot is empty and of one that has no slots."""
    if view_layer.material_override is not None:
        return [view_layer.material_override]
    return [slot.material for slot in blender_object.material_slots] or [None]


@dataclass
class _Deforming:
    """A mesh that waits for its other shapes. read: of an instance at one time, what its shapes take."""

    pointer: int
    data: mesh.MeshData
    names: tuple
    shapes: deform.KeyedShapes
    read: object


class Walk:
    """One sync's walks over the depsgraph: the first finds everything, more follow motion."""

    def __init__(self, sync, source, shutter, links=None):
        self._sync, self._source, self._shutter = sync, source, shutter
        self._view_layer, self._scene = source.depsgraph.view_layer_eval, source.depsgraph.scene_eval
        uv_names, color_names, needs_generated, self.tangent_readers = sync._materials.attribute_names()
        self._values_of = sync._materials.instance_values()
        if source.needs_uv:
            uv_names.add("")
        self.names = frozenset(uv_names), frozenset(color_names), needs_generated
        self._wanted_strands = curves.Wanted.of_scene(self.names, self._scene)
        self._tangents = None  # pointer of a mesh -> the tangents that its objects' materials read
        self._missing = set()  # keys of items that are not there at all times of the shutter
        self._owners = {}     # pointer of a mesh -> key of its owner, within this walk
        self._deforming = {}  # owner key -> _Deforming
        self.items = {}       # key -> Item with a mesh
        self.lights = {}      # key -> fields of a light
        self.tied = set()     # names of objects that are instanced or make instances
        self.haired = set()   # names of objects with hair or of strands or points
        self._volumes = set()  # names of objects of volumes
        self._shining = set()  # and of strands and points that emit
        self.links = Links(source.depsgraph, sync.warnings) if links is None else links
        self.circumstances = self._kept = None  # of a walk over everything

    def run(self, former):
        """Find what is there now; former: shown.Shown of the walk before, None where nothing may be taken over."""
        self.circumstances = Circumstances.of(self, self._source, self._sync._materials)
        holds = former is not None and self.circumstances.are_as(former.circumstances)
        self._kept = Kept(former if holds else None, self._source, self._values_of, self._sync._meshes)
        culling = self._source.culling
        shows_solids, shows_strands = self._view_layer.use_solid, self._view_layer.use_strand
        for each in self._instances():
            if self._take_over(each):
                continue
            if each.is_instance:
                self.tied.update(instance.names_of(each))
            is_mesh = instance.has_mesh(each)
            is_light = not is_mesh and instance.is_light(each)
            if culling and not is_light and culling.hides(each):
                continue
            if shows_strands and each.show_particles:
                self._add_hair(each)
            if not each.show_self:
                continue
            if is_light:
                self._add_light(each)
            elif shows_solids and is_mesh:
                self._add_mesh_instance(each)
            elif shows_strands and strands.has_strands(each):
                self._add_strands(each)
            elif isinstance(each.object.data, bpy.types.Volume):
                self._volumes.add(each.object.name)
        self._warn_of("Volumes are not supported", self._volumes, "is left out")
        self._warn_of("Light of strands and points is not sampled", self._shining, "lights nothing that is matt")

    def _take_over(self, each):
        """Whether the item of an instance is that of the walk before."""
        item = self._kept.find(each)
        if item is None or not self._kept.take(item, self._owners, self._names_of):
            return False
        self.items[item.key] = item
        self.tied.update(instance.names_in(item.key))
        return True

    def _warn_of(self, text, names, does):
        """One warning of all objects of those names, if there are any."""
        if names:
            first, more = min(names), len(names) - 1
            also = f" and {more} more" if more else ""
            self._sync.warnings.add(f"{text}: object '{first}'{also} {does}")

    def times(self, camera_keys):
        """Go to the other times at which something that may move wants to be looked at, each in turn."""
        counts = {item.motion_keys for item in self.items.values()}
        counts.add(camera_keys.count)
        for fraction in motion.fractions_of(counts):
            if self._source.is_cancelled():
                raise Cancelled()
            self._source.engine.frame_set(*self._shutter.frame_at(fraction))
            camera_keys.look(fraction)
            yield fraction

    def follow_motion(self, camera_keys):
        """Look at every moving thing at its other times."""
        named = Changes()
        particles = {key for key, item in self.items.items() if item.is_particle}
        for fraction in self.times(camera_keys):
            named.note(self._source.depsgraph)
            missing = set(particles) if self._needs_all(named) else set()
            for each in self._instances_of(named):
                key = instance.key_of(each)
                self._move_hair(each, fraction)
                self.look_again(self.items.get(key), each, fraction)
                missing.discard(key)
            self._missing.update(key for key in missing
                                 if motion.key_index(fraction, self.items[key].motion_keys) is not None)

    def present_items(self):
        """The items without particles that are born or die while the shutter is open, which Cycles hides."""
        return [item for key, item in self.items.items() if key not in self._missing]

    def send_deforming(self):
        """Send the meshes that waited for their motion keys."""
        for key, waiting in self._deforming.items():
            self._sync._meshes.put(key, waiting.pointer, waiting.data, waiting.names, waiting.shapes)

    def movers(self):
        """Names of the objects that moved, and of those whose meshes changed their shapes, once these are sent."""
        moved = {item.owner for item in self.items.values()
                 if any(transform != item.transforms[0] for transform in item.transforms)}
        return moved, {key[0] for key in self._deforming if self._sync._meshes.is_deforming(key)}

    def _instances(self):
        """Those that take part, by themselves or by their particles."""
        v3d = self._source.v3d
        for number, each in enumerate(self._source.depsgraph.object_instances):
            if number % _BREAK_INTERVAL == 0 and self._source.is_cancelled():
                raise Cancelled()
            if v3d is None or instance.is_in_view(each, v3d):
                yield each

    def _needs_all(self, named):
        return named.structure or not self.tied.isdisjoint(named.objects)

    def _instances_of(self, named):
        """The instances of what Blender has named; all where objects with hair or instances are among it."""
        if self._needs_all(named):
            return self._instances()
        depsgraph = self._source.depsgraph
        return [instance.Plain(self._source.originals.get(name).evaluated_get(depsgraph)) for name in named.objects]

    def _materials_of(self, each):
        return materials_of(each.object, self._view_layer)

    def _dress(self, item, each, made_of):
        """Note the ids of the holes in place of an instance's materials, and the values that these read of it.
        made_of: what materials_of() gave, or a part."""
        if self._values_of is not None:
            item.values = self._values_of(each, self._scene)
        if visibility.is_holdout(each.object, instance.maker_of(each), self._view_layer):
            item.holes = self._sync._materials.holes_of(made_of)

    def describe(self, each):
        """The parts of an item that meshes and lights share."""
        return instance.describe(each, self._view_layer, self._source.light_groups, self.links)

    def _add_light(self, each):
        if not light.are_shown(self._source.v3d):
            return
        item = self.describe(each)
        fields = light.describe(each, item, self._sync._materials, self._sync.warnings)
        if fields is not None:
            self.lights[item.key] = fields

    def _add_mesh_instance(self, each):
        item = self.item_of(each)
        if item is not None:
            item.mesh_key = self._mesh_key(item, each)
            if item.mesh_key is not None:
                self.items[item.key] = item

    def item_of(self, each):
        """An instance with a mesh as an item that has none yet, None where it is a volume."""
        made_of = self._materials_of(each)
        ids, is_volume = self._sync._materials.ids_of(made_of)
        if is_volume:  # those that pass many of its bounds would be seen through too often
            return None
        item = self.describe(each)
        item.materials = ids
        self._dress(item, each, made_of)
        self._ask_keys(item, each)
        return item

    def _ask_keys(self, item, each):
        """Have room for the motion keys that an object asks for."""
        if self._shutter is not None:
            item.motion_keys = motion.key_count(each.object, instance.maker_of(each))
            item.transforms *= item.motion_keys
            item.is_particle = each.is_instance and each.particle_system is not None

    def _add_hair(self, each):
        """The hair of an object's particle systems, each a mesh of one material."""
        blender_object = each.object
        is_final = self._source.v3d is None
        for number, modifier in strands.hair_systems(blender_object, is_final):
            self._note_hair(blender_object)
            item = self.describe(each)
            item.key = instance.hair_key(each, number)
            made_of = self._materials_of(each)
            slot = max(min(modifier.particle_system.settings.material, len(made_of)), 1) - 1
            self._make_of(item, each, made_of[slot])
            hair = strands.Hair(number, self._source.depsgraph, is_final, self._wanted_strands)
            self._add_made(each, item, (blender_object.name_full, number), hair)

    def _note_hair(self, blender_object):
        """Only a walk sees what the hair or the strands of an object do."""
        self.tied.add(blender_object.name_full)
        self.haired.add(blender_object.name_full)

    def _move_hair(self, each, fraction):
        """Hair goes where its object goes, and by itself."""
        for number in range(len(each.object.particle_systems)):
            self.look_again(self.items.get(instance.hair_key(each, number)), each, fraction)

    def _add_strands(self, each):
        """A Curves or Point Cloud object."""
        item = self.describe(each)
        self._make_of(item, each, self._materials_of(each)[0])
        self._note_hair(each.object)
        self._add_made(each, item, each.object.data.as_pointer(), strands.StrandObject(self._wanted_strands))

    def _make_of(self, item, each, material):
        """Strands or points are of one material, maybe None. Those that emit are noted."""
        item.materials, _ = self._sync._materials.ids_of([material])
        self._dress(item, each, [material])
        if material is not None and self._sync._materials.entry_of(material).emits:
            self._shining.add(each.object.name)

    def _add_made(self, each, item, source, made_of):
        """An item of strands or points (strands.Hair or strands.StrandObject) whose mesh is made unless another
        item of the same source has it. As in Cycles, displacement moves neither."""
        item.flags |= InstanceFlags.KEEPS_SHAPE
        self._ask_keys(item, each)
        if source not in self._owners:
            self._owners[source] = item.key if self._put_made(each, item, source, made_of) else None
        item.mesh_key = self._owners[source]
        if item.mesh_key is not None:
            self.items[item.key] = item

    def _put_made(self, each, item, source, made_of):
        """Have the mesh of an item in the library, or wait for its shapes; False where there is nothing to
        show."""
        changes, meshes = self._source.changes, self._sync._meshes
        is_same = not changes.full and item.owner not in changes.objects
        if is_same and meshes.reuse(item.key, source, self._wanted_strands):
            return True
        shape = made_of.read(each)
        if shape is None:
            return False
        is_kept, data = made_of.curves(each, shape)
        self._tell_left_out(each.object, data)
        shapes = None
        if self._blurs_shapes(item, each):
            velocities = made_of.velocities(each)
            if velocities is not None:
                shapes = self._carried(data, velocities)
            elif motion.may_deform(each.object) and made_of.may_move(each):
                shapes = curves.StrandMotion(shape, is_kept, data, item.motion_keys)
        if shapes is not None:
            self._deforming[item.key] = _Deforming(source, data, self._wanted_strands, shapes, made_of.read)
        else:
            meshes.put(item.key, source, data, self._wanted_strands)
        return True

    def _mesh_key(self, item, each):
        """The key of the mesh the item shows, which is read now if no other item showed it before."""
        pointer = each.object.data.as_pointer()
        if pointer in self._owners and not self._kept.is_stale(self._owners[pointer], pointer):
            return self._owners[pointer]
        self._owners[pointer] = item.key if self.read_mesh(item, each, pointer) else None
        return self._owners[pointer]

    def read_mesh(self, item, each, pointer):
        """Have the mesh of an item in the library, or wait for its shapes; False where there is nothing
        to show."""
        meshes, blender_object = self._sync._meshes, each.object
        is_changed = self._source.changes.geometry_of(item.owner)
        names = self._names_of(pointer)
        if not is_changed and self._is_diced_alike(item.key, each) and meshes.reuse(item.key, pointer, names):
            return True
        with mesh.shown_mesh(blender_object) as shape:
            data, shapes = self._extract(item, each, shape, names)
        if data is None:
            return False
        if shapes is not None:
            self._deforming[item.key] = _Deforming(pointer, data, names, shapes, lambda each: each.object)
        else:
            meshes.put(item.key, pointer, data, names)
        return True

    def _is_diced_alike(self, key, each):
        diced_by, dicing = self._sync._meshes.diced_by(key), self._source.dicing
        return diced_by is None or dicing is None or dicing.would_repeat(each, *diced_by)

    def _extract(self, item, each, shape, names):
        """The mesh that an instance shows as MeshData, None where it has no face, and its shapes
        in time (deform.KeyedShapes), None where it has one."""
        blender_object = each.object
        if mesh.is_sculpted_multires(blender_object):
            self._sync.warnings.add(f"Object '{blender_object.name}': while it is sculpted, the mesh below its "
                                    "multiresolution is shown")
        slot_count = max(len(blender_object.material_slots), len(shape.materials))
        dicing = self._source.dicing
        cage = dicing and dicing.cage_of(each)
        shape = cage or shape
        group_names = attribute_values.group_names(blender_object)
        data = mesh.extract(shape, *names[:2], slot_count, group_names)
        if data is None:
            return None, None
        self._tell_left_out(blender_object, data)
        if names[2]:
            data.generated = mesh.generated_coordinates(blender_object, shape, data.positions)
        fields = dicing and dicing.fields_of(each)
        data.diced_by = dicing and (dicing.settings, fields)
        if fields:
            mesh.dice(data, shape, {**fields, **dicing.creases_of(each, shape, fields)}, names[2])
        elif not self._sync.is_final and deform.is_posable(blender_object):
            data.poses = mesh.Topology(shape)
        if cage is not None or not self._blurs_shapes(item, each):
            return data, None
        if attribute_values.has_velocity(shape.attributes):
            velocities = mesh.colors_of_vertices(shape, attribute_values.VELOCITY, group_names)
            if velocities is not None:
                return data, self._carried(data, velocities[:, :3])
        if not motion.may_deform(blender_object):
            return data, None
        return data, deform.MeshMotion(shape, data, item.motion_keys, deform.is_filled(blender_object))

    def _blurs_shapes(self, item, each):
        """Whether an instance is looked at while the shutter is open, and its shapes count."""
        return item.motion_keys > 1 and motion.blurs_shapes(each.object, instance.maker_of(each))

    def _carried(self, data, velocities):
        """The shapes of data whose points go along velocities (m/s), whatever else moves it, as in Cycles."""
        return deform.CarriedShapes(data, velocities * self._shutter.seconds(self._scene))

    def _tell_left_out(self, blender_object, data):
        """Warn of the attributes that there is no room for."""
        if data.left_out:
            self._sync.warnings.add(f"Object '{blender_object.name}': has more than {MAX_ATTRIBUTES} attributes that "
                                    f"materials read, without {attribute_values.spoken(data.left_out)}")

    def _names_of(self, pointer):
        """What a mesh brings: tangents only where they are read, as they take longest to make."""
        if not self.tangent_readers:
            return self.names
        if self._tangents is None:
            self._tangents = self._find_tangents()
        uv_names, color_names, needs_generated = self.names
        every = set().union(*self.tangent_readers.values())
        return uv_names, color_names - (every - self._tangents.get(pointer, every)), needs_generated

    def _find_tangents(self):
        """{pointer of a mesh: names of the tangents that the materials of its objects read}"""
        found = {}
        for each in objects_of(self._source.depsgraph):
            if each.data is not None:
                names = found.setdefault(each.data.as_pointer(), set())
                for material in filter(None, materials_of(each, self._view_layer)):
                    names |= self.tangent_readers.get(material.name_full, set())
        return found

    def look_again(self, item, each, fraction):
        """Note where an item, if there is one, is at that time, and which shape it has."""
        index = None if item is None else motion.key_index(fraction, item.motion_keys)
        if index is None:
            return
        item.transforms[index] = rows(each.matrix_world)
        waiting = self._deforming.get(item.key)
        if waiting is None or not waiting.shapes.awaits_keys:
            return
        if not waiting.shapes.set_key(index, waiting.read(each)):
            self._sync.warnings.add(
                f"Object '{each.object.name}': its topology changes in time, deformation blur in part at most")
