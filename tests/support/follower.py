# SPDX-License-Identifier: Apache-2.0
"""A scene of the library that follows Blender's by its updates, without a window."""

import bpy

from volley import passes
from volley.session import render_fields
from volley.sync import SceneSync, Source, camera
from volley.sync.dicing import Dicing
from volley.sync.changes import Changes
from volley.sync.matrix import rows12


class Follower:
    """Follows the scene as a viewport does, by the depsgraph's updates."""

    def __init__(self):
        self.sync = SceneSync(is_final=False, thread_count=0, will_resync=True)
        self._changes = Changes.everything()
        bpy.app.handlers.depsgraph_update_post.append(self._mark)
        bpy.app.handlers.frame_change_post.append(self._mark)

    def _mark(self, _scene, depsgraph):
        self._changes.follow(depsgraph)

    def picture(self):
        changes, self._changes = self._changes, Changes()
        return picture(self.sync, changes)


def picture(sync, changes):
    """Bring a sync up to date and render what it holds."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    scene = depsgraph.scene_eval
    frame = camera.frame_of(scene.render)
    lens = camera.lens_of(scene.camera, sync.warnings)
    keys = camera.CameraKeys(lens, [rows12(scene.camera.matrix_world)], [camera.window(lens, frame)])
    if changes.any():
        sync.update(Source(depsgraph, changes, dicing=Dicing(scene, keys, frame, False, sync.warnings)))
    sync.set_camera(keys)
    sync.scene.commit()
    crop = (0, 0, frame.width, frame.height)
    fields = render_fields(scene, frame, crop, [passes.COMBINED])
    fields.update(sample_count=8)
    render = sync.scene.start_render(**fields)
    render.wait(-1.0)
    pixels = passes.read_combined(render)
    render.destroy()
    return pixels
