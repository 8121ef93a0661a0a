# SPDX-License-Identifier: GPL-3.0-or-later
"""The rendered viewport: the library renders progressively in its threads, Blender draws what is there.

An edit syncs what changed and starts anew; a view move sends the camera alone. The film is drawn as a
scene-linear texture, which Blender turns into display colours.
"""

import time

import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d

from . import native, passes
from .session import render_fields, status_text, thread_count
from .sync import SceneSync, Source, camera
from .sync.changes import Changes

MAX_HALF = 65504.0
DRAW_SECONDS = 0.03  # at least this long between two read-outs of the film


class Viewport:
    """What one rendered viewport holds."""

    def __init__(self):
        self._sync = None
        self._render = None
        self._view = None      # what the running render looks at
        self._texture = None
        self._origin = (0, 0)  # of the texture in the region, pixels
        self._version = -1
        self._next_read = 0.0
        self._features = ""
        self._samples = 0
        self._progress = None
        self._reported = set()  # warnings are shown once, not at every edit

    def free(self):
        """Stop rendering and free everything native."""
        self._stop()
        sync, self._sync = self._sync, None
        if sync is not None:
            sync.destroy()

    def update(self, engine, context, depsgraph):
        """The scene changed: stop, sync, build; the next draw starts a render."""
        if not native.load():
            raise native.TracerError(0, native.load_error())
        scene = depsgraph.scene_eval
        changes = Changes.of_depsgraph(depsgraph)
        if self._sync is None:
            self._sync = SceneSync(is_final=False, thread_count=thread_count(scene.render),
                                   will_resync=True)
            changes = Changes.everything()
        elif not changes.any():
            # A frame change without animation, or something Blender does not name.
            changes = Changes.everything()
        self._stop()
        self._view = None
        self._sync.update(Source(depsgraph, changes, v3d=context.space_data))
        self._report(engine, self._sync.warnings.take())

    def draw(self, engine, context, depsgraph):
        """Start a render if the view is another, read the film if there is more of it, draw it."""
        if self._sync is None:
            return
        scene = depsgraph.scene_eval
        view = _View.of_context(context, depsgraph, self._sync.warnings)
        if self._view is None or self._view.signature != view.signature:
            self._start(scene, view)
        is_running = self._read()
        self._draw_texture(engine, scene)
        if is_running:
            engine.tag_redraw()

    def _report(self, engine, messages):
        for message in messages:
            if message not in self._reported:
                self._reported.add(message)
                engine.report({'WARNING'}, message)

    def _start(self, scene, view):
        self._stop()
        self._sync.set_camera(view.keys)
        self._sync.scene.commit()
        self._features = ", ".join(self._sync.scene.features())
        frame = camera.Frame(*view.size)
        fields = render_fields(scene, frame, view.crop, [passes.COMBINED], is_preview=True)
        self._samples = fields["sample_count"]
        fields.update(progressive=1, film_transparent=int(scene.render.film_transparent))
        self._render = self._sync.scene.start_render(**fields)
        self._view, self._version, self._next_read = view, -1, 0.0
        self._origin = view.crop[:2]

    def _stop(self):
        render, self._render = self._render, None
        if render is not None:
            render.destroy()

    def _read(self):
        """Bring the texture up to date; whether the render still runs."""
        if self._render is None:
            return False
        progress = self._render.poll()
        is_running = progress.state == native.STATE_RUNNING
        now = time.monotonic()
        is_due = now >= self._next_read or not is_running
        if progress.version != self._version and progress.version > 0 and is_due:
            self._version, self._next_read = progress.version, now + DRAW_SECONDS
            self._texture = _texture_of(passes.read_combined(self._render))
        self._progress = progress
        return is_running or progress.version != self._version

    def _draw_texture(self, engine, scene):
        if self._texture is None:
            return
        gpu.state.blend_set('ALPHA_PREMULT')
        engine.bind_display_space_shader(scene)
        draw_texture_2d(self._texture, self._origin, self._texture.width, self._texture.height)
        engine.unbind_display_space_shader()
        gpu.state.blend_set('NONE')
        if self._render is not None:
            engine.update_stats("", status_text(self._progress, self._samples, self._features))


class _View:
    """What a viewport looks at: camera, size of the region and the part of it to render."""

    def __init__(self, keys, size, crop):
        self.keys, self.size, self.crop = keys, size, crop
        self.signature = (keys.lens, tuple(keys.transforms[0]), keys.windows[0], size, crop)

    @classmethod
    def of_context(cls, context, depsgraph, warnings):
        """The view of a context's region, by a depsgraph's evaluated camera."""
        region, v3d, rv3d = context.region, context.space_data, context.region_data
        size = (max(1, region.width), max(1, region.height))
        camera_object = v3d.camera if v3d.use_local_camera else depsgraph.scene.camera
        if camera_object is not None:
            camera_object = camera_object.evaluated_get(depsgraph)
        keys = camera.view_camera(rv3d, v3d, camera_object, size, warnings)
        return cls(keys, size, _crop_of(v3d, rv3d, size))


def _crop_of(v3d, rv3d, size):
    """The render region of a view outside the camera, in pixels; else the whole region."""
    width, height = size
    if rv3d.view_perspective == 'CAMERA' or not v3d.use_render_border:
        return 0, 0, width, height
    x0, x1 = int(v3d.render_border_min_x * width), int(v3d.render_border_max_x * width)
    y0, y1 = int(v3d.render_border_min_y * height), int(v3d.render_border_max_y * height)
    return x0, y0, max(1, x1 - x0), max(1, y1 - y0)


def _texture_of(pixels):
    """A half float texture of (height, width, 4) premultiplied scene-linear pixels."""
    height, width = pixels.shape[:2]
    np.nan_to_num(pixels, copy=False, nan=0.0, posinf=MAX_HALF, neginf=0.0)
    np.clip(pixels, -MAX_HALF, MAX_HALF, out=pixels)
    buffer = gpu.types.Buffer('FLOAT', width * height * 4, pixels.reshape(-1))
    return gpu.types.GPUTexture((width, height), format='RGBA16F', data=buffer)
