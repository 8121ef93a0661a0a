# SPDX-License-Identifier: GPL-3.0-or-later
"""One scene of the library, kept like Blender's evaluated scene: marking first, copying after."""

import contextlib
import gc

import bpy

from .. import native
from ..compat import uses_nodes
from ..log import Warnings
from . import camera, deform, image, instance, light, mesh, meshes, motion, studio, visibility, world
from .changes import Changes
from .image import Images
from .material import Materials
from .shown import Shown
from .walk import Walk, materials_of


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
        self._had_shutter = False
        self._moved, self._deformed = set(), set()  # names of objects that did so while the shutter was open

    def destroy(self):
        """Free the library's scene."""
        self.scene.destroy()

    @_uncollected()
    def update(self, source, shutter=None, camera_keys=None, go_to_center=None):
        """Bring everything but the camera up to date. With a shutter, Blender is moved through it;
        camera_keys(fraction) is called at each time to look at the camera too. The caller restores
        the frame. go_to_center: moves Blender there from the frame where that is not the shutter's middle, else None;
        shaders are those of the frame, as in Cycles."""
        source.changes.objects |= self._moved | self._deformed  # though they may stand still now
        source.changes.geometry |= self._deformed
        # What was read at one time alone, or at several, may be named at none of them.
        source.changes.full |= self._had_shutter != (shutter is not None)
        self._had_shutter = shutter is not None
        shown, frame = self._shown, motion.frame_of(source.depsgraph.scene_eval)
        if self._update_part(source, shutter, camera_keys, go_to_center):
            return
        if motion.frame_of(source.depsgraph.scene_eval) != frame:  # as the attempt may have left it
            source.engine.frame_set(*motion.split_frame(frame))
        self._images.begin(source.changes, size_limit(source), source.depsgraph.scene_eval.frame_current)
        self._materials.begin(source.depsgraph, source.changes, source.aovs)
        self._meshes.begin()
        self._sync_materials(source)
        self._sync_world(source)  # as materials, before Blender is moved
        if go_to_center is not None:
            self._sync_shown_shaders(source)
            go_to_center()
            self._materials.note_move(source.depsgraph)
        former = self._former(source, shown)
        told = self.warnings.count()
        walk = Walk(self, source, shutter, former and former.links_now(source))
        walk.run(former)
        messages = self.warnings.after(told)
        if shutter is not None:
            walk.follow_motion(camera_keys)
        told = self.warnings.count()  # what moves is looked at again by each sync
        walk.send_deforming()
        in_world = self._meshes.in_world() if source.v3d is None else set()
        self._instances.update(walk.present_items(), self._meshes.ids(), in_world, self._materials.moving())
        self._lights.update(walk.lights)
        messages += self.warnings.after(told)
        self._meshes.end()
        self._materials.end()
        self._images.end()
        self._moved, self._deformed = walk.movers()
        self._shown = Shown(walk, source, messages)

    def _former(self, source, shown):
        """What the last walk found if another may take something over from it, else None."""
        if shown is None or source.changes.full or source.culling or not shown.is_of(source):
            return None
        if self.is_final and self._meshes.are_diced():  # by a camera that may have moved
            return None
        return shown

    def _touched(self, shown, source):
        """The objects to look at again, each as shown.Shown.find gives it; None where only a walk can tell of one."""
        names = source.changes.objects | shown.owners_of(source.changes.lights, source)
        touched = [shown.find(name, source) for name in names]
        return touched if all(touched) else None

    def _update_part(self, source, shutter, camera_keys, go_to_center):
        """Bring up to date what changed, without a walk over everything; False where one is needed,
        which is safe at any point before the end."""
        changes, shown = source.changes, self._former(source, self._shown)
        if shown is None or changes.structure:
            return False
        if not all(self._materials.knows(name) for name in changes.materials):
            return False
        touched = self._touched(shown, source)
        if touched is None:
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
        if go_to_center is not None:
            for each in touched:
                self._sync_light_shader(each)
            go_to_center()
            touched = None if changes.structure or self._former(source, shown) is None \
                else self._touched(shown, source)
            if touched is None:
                return False
        walk = Walk(self, source, shutter, shown.links)
        for each in touched:
            if each is not shown.IRRELEVANT and not self._change_object(each, shown, walk, source):
                return False
        if shutter is not None and not self._follow_part(walk, camera_keys, source):
            return False
        walk.send_deforming()
        items = walk.items.values()
        mesh_ids = self._meshes.ids_of({item.mesh_key for item in items})
        self._instances.change(items, mesh_ids, self._materials.moving())
        shown.items.update(walk.items)
        self._meshes.free_retired()
        self._images.end()
        self._moved, self._deformed = walk.movers()
        if self.is_final:
            shown.warn_again(self.warnings)
        self._shown = shown
        return True

    def _follow_part(self, walk, camera_keys, source):
        """Look at what moves at its other times; False where Blender names anything else there, which is marked."""
        depsgraph = source.depsgraph
        for fraction in walk.times(camera_keys):
            named = Changes()
            named.note(depsgraph)
            if named.structure or not (named.objects <= source.changes.objects
                                       and named.geometry <= source.changes.geometry):
                source.changes.note(depsgraph)
                return False
            for item in walk.items.values():
                evaluated = source.originals.get(item.owner).evaluated_get(depsgraph)
                walk.look_again(item, instance.Plain(evaluated), fraction)
        return True

    def _change_object(self, each, shown, walk, source):
        """Bring one object up to date, but for its instance, which becomes an item of the walk; False where its mesh
        must be read in a walk over everything."""
        if instance.is_light(each):
            item = walk.describe(each)
            fields = light.describe(each, item, self._materials, self.warnings)
            return fields is not None and self._lights.change(item.key, fields)
        item = walk.item_of(each)
        if item is None:
            return False
        item.mesh_key = shown.items[item.key].mesh_key
        if walk.tangent_readers and not self._brings_tangents(item, each, source):
            return False
        if item.owner not in source.changes.geometry:
            if self._meshes.pointer_of(item.mesh_key) != each.object.data.as_pointer():  # another has the name now
                return False
        elif not self._change_mesh(item, each, shown, walk, source):
            return False
        walk.items[item.key] = item
        return True

    def _brings_tangents(self, item, each, source):
        """Whether an item's mesh has those that its materials read."""
        made_of = materials_of(each.object, source.depsgraph.view_layer_eval)
        return self._meshes.brings(item.mesh_key, self._materials.tangents_read_by(filter(None, made_of)))

    def _change_mesh(self, item, each, shown, walk, source):
        """Send the mesh of one object, of a viewport's pose the places of its vertices alone; False where others
        show it too or it has no faces now."""
        if shown.users[item.mesh_key] != 1:
            return False
        changes, blender_object = source.changes, each.object
        pointer = blender_object.data.as_pointer()
        is_pose = item.owner not in changes.topology and deform.is_posable(blender_object)
        if is_pose and not self.is_final:  # renders cut bent faces as they would be cut anew
            is_known = deform.keeps_topology(blender_object) \
                and blender_object.original.data.name_full not in changes.meshes
            with mesh.shown_mesh(blender_object) as shape:
                if self._meshes.pose(item.mesh_key, pointer, shape, is_known):
                    return True
        return walk.read_mesh(item, each, pointer)

    def _sync_materials(self, source):
        """Flatten the materials first: they say which attributes the meshes must bring, and the files of their images
        are read while those are."""
        override = source.depsgraph.view_layer_eval.material_override
        kind = bpy.types.Material  # compared, as isinstance takes longer than the rest
        for data in source.depsgraph.ids:
            if type(data) is kind and override in (None, data):
                self._materials.entry_of(data)

    def _sync_shown_shaders(self, source):
        """Flatten what else a walk would: lights' nodes, and materials as holes."""
        view_layer = source.depsgraph.view_layer_eval
        for each in source.depsgraph.object_instances:
            if instance.is_light(each):
                self._sync_light_shader(each)
            elif visibility.is_holdout(each.object, instance.maker_of(each), view_layer):
                self._materials.holes_of(materials_of(each.object, view_layer))

    def _sync_light_shader(self, each):
        if each is not Shown.IRRELEVANT and instance.is_light(each) and uses_nodes(each.object.data):
            self._materials.light_id(each)

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
