# SPDX-License-Identifier: GPL-3.0-or-later
"""What a walk takes over from the one before, in place of reading some twenty properties of each object again.

Blender names every object of which anything is another, and those that come into its scene or are shown again.
These are read; all are where a setting decides of all of them and is another, or where what is not named may
be read otherwise: of instances within instances, whose makers have a maker, and where lights are linked, tangents
are read, or a collection makes holes."""

from typing import NamedTuple

from . import instance


class Circumstances(NamedTuple):
    """What a walk finds decides of all objects: attributes that meshes bring, the view layer's override and
    switches, how meshes are diced, the library's ids of materials, and whether
    each object has to be asked: before 5, its light group changes without its being named."""

    names: tuple
    override: str
    switches: tuple
    dicing: dict
    materials: dict
    asks_all: bool

    @classmethod
    def of(cls, walk, source, materials):
        """Those of a walk that begins; materials: material.Materials."""
        layer = source.depsgraph.view_layer_eval
        override = layer.material_override
        asks_all = bool(source.light_groups or walk.tangent_readers or not walk.links.is_empty()
                        or _has_special(layer.layer_collection))
        return cls(walk.names, override and override.name_full, (layer.use_solid, layer.use_strand),
                   source.dicing and source.dicing.settings, materials.ids(), asks_all)

    def are_as(self, former):
        """Whether an object that is as it was then is shown as it was then; materials may have come."""
        if self.asks_all or self._replace(materials=None) != former._replace(materials=None):
            return False
        return all(self.materials.get(name) == known for name, known in former.materials.items())


def _has_special(layer_collection):
    """Whether a collection of a view layer, or one in it, is a hole or hidden from the camera alone."""
    return layer_collection.holdout or layer_collection.indirect_only or any(
        [_has_special(child) for child in layer_collection.children])


class Kept:
    """The items of a former walk that hold as they are, as long as one walk lasts."""

    def __init__(self, shown, source, values_of, meshes):
        """shown: shown.Shown of a walk under circumstances that are as now, None where there is none; values_of: see
        Materials.instance_values; meshes: meshes.Meshes, of which nothing was put yet."""
        self._source, self._scene = source, source.depsgraph.scene_eval
        self._values_of, self._meshes = values_of, meshes
        self._taken = set()  # keys of the items that were taken over and own their meshes
        self._pointers = meshes.pointers()
        named = source.changes.objects
        keeps_nested = not any([_may_instance(name, source) for name in named])
        self._items = {} if shown is None else {
            key: item for key, item in shown.items.items()
            if key[0] not in named and key[0] not in shown.haired and not item.holes
            and (instance.is_plain(key) or (key[2] not in named and (keeps_nested or not instance.is_nested(key))))}

    def find(self, each):
        """The item of an instance of the depsgraph, None where it is to be read."""
        if not self._items or not each.show_self:
            return None
        blender_object = each.object
        key = instance.key_of(each) if each.is_instance else (blender_object.name_full, "Mesh")
        item = self._items.get(key)
        if item is None or (item.asset != item.name and item.asset != instance.uppermost(blender_object).name):
            return None
        # Materials may have begun to read others.
        if self._values_of is not None and self._values_of(each, self._scene) != item.values:
            return None
        return item

    def take(self, item, owners, names_of):
        """Take an item over, False where its mesh has to be found anew; owners: Walk's, of which it becomes one if it
        was; names_of: of a mesh's pointer, what it brings."""
        pointer = self._pointers.get(item.mesh_key)
        if item.mesh_key != item.key:
            return pointer is not None and owners.get(pointer) == item.mesh_key
        if pointer is None or pointer in owners or not self._meshes.reuse(item.key, pointer, names_of(pointer)):
            return False
        owners[pointer] = item.key
        self._taken.add(item.key)
        return True

    def is_stale(self, key, pointer):
        """Whether the owner of a mesh was taken over although that pointer is another mesh's now: Blender may have
        evaluated the owner again, to the same."""
        if key not in self._taken:
            return False
        owner = self._source.originals.get(key[0])
        data = None if owner is None else owner.evaluated_get(self._source.depsgraph).data
        return data is None or data.as_pointer() != pointer


def _may_instance(name, source):
    """Whether the object of that name, perhaps a linked one, may make instances."""
    owner = source.originals.get(name)
    return owner is None or instance.may_instance(owner.evaluated_get(source.depsgraph))
