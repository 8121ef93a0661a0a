# SPDX-License-Identifier: GPL-3.0-or-later
"""One scene of the library, kept like Blender's evaluated scene: marking first, copying after."""

import contextlib
import gc

import bpy

from .. import native
from ..compat import uses_nodes
from ..log import Warnings
from . import camera, deform, image, instance, light, mesh, meshes, studio, world
from .image import Images
from .material import Materials
from .shown import Shown
from .walk import Walk, dress, materials_of


@contextlib.contextmanager
def _uncollected():
    """Without Python's look for cycles, of which a sync makes none: the many objects that it makes would have
    all of Blender's looked through."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


class SceneSync:
    """One scene of the library and what it was last given."""

    def __init__(self, is_final, thread_count, will_resync, image_megabytes=0, make_scene=native.Scene):
        image.start_reader()
        self.is_final = is_final
        self.scene = make_scene(is_final, thread_count, image_megabytes)
        self.warnings = Warnings()
        self._images = Images(self.scene, self.warnings)
        self._materials = Materials(self.scene, self._images, self.warnings)
        self._meshes = meshes.Meshes(self.scene, will_resync, self.warnings)
        self._instances = instance.Instances(self.scene, self.warnings)
        self._lights = light.Lights(self.scene, self.warnings)
        self._world = None   # what the library was last given of it
        self._shown = None   # what the last full walk found

    def destroy(self):
        """Free the library's scene."""
        self.scene.destroy()

    @_uncollected()
    def update(self, source, shutter=None, camera_keys=None):
        """Bring everything but the camera up to date. With a shutter, Blender is moved through it;
        camera_keys(fraction) is called at each time to look at the camera too. The caller restores
        the frame."""
        if shutter is None and self._update_part(source):
            return
        self._images.begin(source.changes, size_limit(source), source.depsgraph.scene_eval.frame_current)
        self._materials.begin(source.depsgraph, source.changes, source.aovs)
        self._meshes.begin()
        self._sync_materials(source)
        told = self.warnings.count()
        walk = Walk(self, source, shutter)
        walk.run()
        if shutter is not None:
            walk.follow_motion(camera_keys)
        walk.send_deforming()
        in_world = self._meshes.in_world() if source.v3d is None else set()
        self._instances.update(walk.items.values(), self._meshes.ids(), in_world, self._materials.moving())
        self._lights.update(walk.lights)
        told_by_walk = self.warnings.after(told)
        self._sync_world(source)
        self._meshes.end()
        self._materials.end()
        self._images.end()
        self._shown = Shown(walk, source, told_by_walk) if shutter is None else None

    def _update_part(self, source):
        """Bring up to date what changed, without a walk over everything; False where one is needed,
        which is safe at any point before the end."""
        changes, shown = source.changes, self._shown
        if changes.full or changes.structure or shown is None or not shown.is_of(source) or source.culling:
            return False
        if self.is_final and self._meshes.are_diced():  # by a camera that may have moved
            return False
        if not all(self._materials.knows(name) for name in changes.materials):
            return False
        touched = [shown.find(name, source) for name in changes.objects | shown.owners_of(changes.lights)]
        if not all(touched):
            return False
        self._shown = None  # until all is done
        self._images.begin(changes, size_limit(source), source.depsgraph.scene_eval.frame_current)
        names = self._materials.read_names()
        if not self._materials.change(source.depsgraph, changes):
            return False
        if changes.world:
            self._sync_world(source)
        if self._materials.read_names() != names:
            return False
        for each in touched:
            if each is not shown.IRRELEVANT and not self._change_object(each, shown, source):
                return False
        self._images.end()
        if self.is_final:
            shown.warn_again(self.warnings)
        self._shown = shown
        return True

    def _change_object(self, each, shown, source):
        """Bring one object up to date; False where its mesh must be read in a walk."""
        name, view_layer = each.object.name_full, source.depsgraph.view_layer_eval
        if instance.is_light(each):
            item = instance.describe(each, view_layer, source.light_groups, shown.links)
            fields = light.describe(each.object, item, self._materials, self.warnings)
            return fields is not None and self._lights.change(item.key, fields)
        known = shown.items[instance.key_of(each)]
        made_of = materials_of(each.object, view_layer)
        ids, is_volume = self._materials.ids_of(made_of)
        if is_volume:
            return False
        if not self._meshes.brings(known.mesh_key, self._materials.tangents_read_by(filter(None, made_of))):
            return False
        if name in source.changes.geometry and not self._change_mesh(each, known, shown, source):
            return False
        item = instance.describe(each, view_layer, source.light_groups, shown.links)
        item.mesh_key, item.materials = known.mesh_key, ids
        dress(item, self._materials, each, made_of, view_layer, self._materials.instance_values(),
              source.depsgraph.scene_eval)
        self._instances.change(item, self._meshes.id_of(item.mesh_key), self._materials.moving())
        self._meshes.free_retired()
        return True

    def _change_mesh(self, each, known, shown, source):
        """Send the mesh of one object, of a viewport's pose the places of its vertices alone; False where others
        show it too or it has no faces now."""
        if shown.users[known.mesh_key] != 1:
            return False
        changes, blender_object = source.changes, each.object
        pointer = blender_object.data.as_pointer()
        is_pose = known.owner not in changes.topology and deform.is_posable(blender_object)
        if is_pose and not self.is_final:  # renders cut bent faces as they would be cut anew
            is_known = deform.keeps_topology(blender_object) \
                and blender_object.original.data.name_full not in changes.meshes
            with mesh.shown_mesh(blender_object) as shape:
                if self._meshes.pose(known.mesh_key, pointer, shape, is_known):
                    return True
        return Walk(self, source, None).read_mesh(known, each, pointer)

    def _sync_materials(self, source):
        """Flatten the materials first: they say which attributes the meshes must bring. Their images, and
        the world's, are read meanwhile."""
        override = source.depsgraph.view_layer_eval.material_override
        kind = bpy.types.Material  # compared, as isinstance takes longer than the rest
        shown = [data for data in source.depsgraph.ids if type(data) is kind and override in (None, data)]
        readers = [data for data in (*shown, shown_world(source))
                   if data is not None and uses_nodes(data) and not self._materials.is_kept(data)]
        self._images.expect(data.node_tree for data in readers)
        for data in shown:
            self._materials.entry_of(data)

    def _sync_world(self, source):
        scene = source.depsgraph.scene_eval
        shown_studio = studio.of_view(source.v3d, scene)
        if shown_studio is None:
            shown = shown_world(source)
            material_id, sun = self._materials.world_id(shown) if shown else (0, None)
            if shown:
                world.note_unread(shown, self.warnings)
            fields = world.describe(shown, material_id, sun, scene.volley, source.light_groups)
        else:
            fields = {**world.describe(None, self._materials.studio_id(shown_studio), None, scene.volley, {}),
                      "use_sampling": 1}
        if fields != self._world:
            self.scene.set_world(**fields)
        self._world = fields

    def cryptomatte_names(self):
        """The names of objects, materials and assets in mattes: by TRC_CRYPTOMATTE."""
        objects, assets = self._instances.names()
        return objects, self._materials.names(), assets

    def set_camera(self, keys, shutter=None):
        """Send the camera; keys as camera.CameraKeys."""
        if shutter is None or shutter.curve is None:
            camera.send(self.scene, keys)
        else:
            camera.send(self.scene, keys, shutter)


def shown_world(source):
    """The world that is seen, or None."""
    depsgraph, view_layer = source.depsgraph, source.depsgraph.view_layer_eval
    if not view_layer.use_sky:
        return None
    override = getattr(view_layer, "world_override", None)  # from 4.3 on
    return depsgraph.scene_eval.world if override is None else override.evaluated_get(depsgraph)


def size_limit(source):
    """The longest side (pixels) of images, 0 for any."""
    return image.size_limit(source.depsgraph.scene_eval, source.v3d is None)
