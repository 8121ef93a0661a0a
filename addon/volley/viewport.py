# SPDX-License-Identifier: GPL-3.0-or-later
"""The rendered viewport: the library builds and renders in threads of its own, Blender draws what is there.

An edit is marked when Blender tells of it and copied at the next draw; what was built and rendered
stays on the screen until the first complete picture after the edit replaces it. That one has a sample
per pixel, and fewer pixels where a full one would take too long; then comes one of all pixels, and then
one that gathers samples until the view or the scene changes. The draw that starts a build or a first
picture waits for it as long as a frame may take, since it would else draw the old picture once more;
no other waits. The film is drawn as a scene-linear texture, which Blender turns into display colours.
"""

import math
import time

import bpy
import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d

from . import abi, native, passes, writes
from .commit import Commit
from .session import MEGA, render_fields, status_text, thread_count, timecode
from .sync import SceneSync, Source, camera, culling, dicing, light, studio
from .sync.changes import Changes

MAX_HALF = 65504.0
DRAW_SECONDS = 0.03     # at least this long between two read-outs of the film
NAP_SECONDS = 0.004     # how long a draw may wait for what is nearly there
FRAME_SECONDS = 0.04    # the same for what it has started itself
PICTURE_SECONDS = 0.03  # the budget of the first picture
MAX_DIVISOR = 8         # of the first picture's width and height
PIXEL_SECONDS = 1e-6    # guess of what a sample of a pixel takes, before there was one
SHOWN_SAMPLES = 4       # of a refined picture, before it replaces the first


class Viewport:
    """What one rendered viewport holds."""

    def __init__(self):
        self._sync = None
        self._changes = Changes.everything()  # not yet copied
        self._visibility = None  # what of the view decides which objects it shows
        self._studio = None      # what it shows in place of the world
        self._commit = None
        self._built_revision = -1
        self._pictures = _Pictures()
        self._reported = set()   # warnings are shown once, not at every edit
        self._is_freed = False   # until the next edit

    def free(self):
        """Stop rendering and free everything native."""
        self._is_freed = True
        self._changes, self._built_revision = Changes.everything(), -1
        self._pictures.stop()
        commit, self._commit = self._commit, None
        sync, self._sync = self._sync, None
        if commit is not None:
            commit.cancel()
        if sync is not None:
            sync.destroy()

    def update(self, engine, _context, depsgraph):
        """The scene changed: mark what."""
        if not native.load():
            raise native.TracerError(0, native.load_error())
        self._changes.follow(depsgraph)
        self._is_freed = False
        engine.tag_redraw()

    def draw(self, engine, context, depsgraph):
        """Copy what was marked, start a build or a render where one is due, draw the latest picture."""
        if self._is_freed:
            return
        if depsgraph.scene_eval.volley.preview_pause:
            self._pictures.pause(engine, depsgraph.scene_eval)
            return
        may_wait = not writes.is_rendering()  # which may wait for this draw
        is_current = self._synchronise(engine, context, depsgraph, may_wait)
        if is_current:
            self._pictures.follow(self._sync, context, depsgraph)
        is_running = self._pictures.read(may_wait)
        self._pictures.draw(engine, depsgraph.scene_eval)
        is_urgent = not is_current or self._pictures.is_urgent()
        if is_urgent and may_wait:
            engine.tag_redraw()
        elif is_urgent or is_running:
            _redraw_later()

    def _synchronise(self, engine, context, depsgraph, may_wait):
        """Bring the library's scene up to date; whether it is."""
        if self._commit is not None and not self._end_commit(NAP_SECONDS if may_wait else 0.0):
            return False
        if self._sync is None:
            scene = depsgraph.scene_eval
            self._sync = SceneSync(is_final=False, thread_count=thread_count(scene.render),
                                   will_resync=True, image_megabytes=scene.volley.texture_memory)
        visibility = _visibility_of(context.space_data)
        if visibility != self._visibility:  # Blender tells no engine of these
            self._changes, self._visibility = Changes.everything(), visibility
        shown_studio = studio.of_view(context.space_data, depsgraph.scene_eval)
        if shown_studio != self._studio:  # nor of these
            self._studio, self._changes.world = shown_studio, True
        changes, self._changes = self._changes, Changes()
        if changes.any():
            try:
                self._sync.update(Source(depsgraph, changes, v3d=context.space_data,
                                         needs_uv=_needs_uv(context.space_data),
                                         culling=_culling_of(context, depsgraph, self._sync.warnings),
                                         dicing=_dicing_of(context, depsgraph, self._sync.warnings)))
            except BaseException:
                self._changes = Changes.everything()
                raise
            self._report(engine, self._sync.warnings.take())
        self._pictures.look(self._sync, context, depsgraph)
        if self._sync.scene.revision == self._built_revision:
            return True
        self._pictures.stop()
        self._commit = Commit(self._sync.scene)
        return self._end_commit(FRAME_SECONDS if may_wait else 0.0)

    def _end_commit(self, seconds):
        """Note a commit that has ended, after waiting for it that long; False while it runs."""
        if not self._commit.is_done(seconds):
            return False
        commit, self._commit = self._commit, None
        commit.check()
        self._built_revision = commit.revision
        return True

    def _report(self, engine, messages):
        for message in messages:
            if message not in self._reported:
                self._reported.add(message)
                engine.report({'WARNING'}, message)


def _redraw_later():
    """Redraw rendered views when there may be more to show, and leave the processor to the render until
    then. No engine is kept for it: it could be gone."""
    if not bpy.app.timers.is_registered(redraw):
        bpy.app.timers.register(redraw, first_interval=DRAW_SECONDS)


def redraw():
    """Have all rendered views drawn once more, on Blender's own thread."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == 'VIEW_3D' and area.spaces.active.shading.type == 'RENDERED':
                area.tag_redraw()


class _Pictures:
    """The render of one viewport: its stages from the first quick picture on, and the texture."""

    def __init__(self):
        self._view = None
        self._shown_pass = passes.COMBINED
        self._wanted = None     # what the stages render: revision, view and settings
        self._fields = {}
        self._denoise, self._clean_samples = abi.DenoiseType.NONE, 1  # of the stage; from so many on
        self._stages = []       # still to come: divisor of the size, samples or None for all
        self._is_last = True    # whether the stage under way is the last
        self._render = None
        self._texture, self._place = None, (0.0, 0.0, 0.0, 0.0)
        self._next_place = self._place  # x, y, width, height in the region, of what is rendered
        self._version, self._next_read = -1, 0.0
        self._progress = None
        self._status = ""
        self._samples = 0
        self._started = 0.0
        self._patience = 0.0    # how long the next draw waits
        self._pixel_seconds = PIXEL_SECONDS  # of one sample of one pixel, as last measured

    def look(self, sync, context, depsgraph):
        """Note what the viewport looks at and tell the library if that is new."""
        view = _View.of_context(context, depsgraph, sync.warnings)
        if self._view is None or self._view.signature != view.signature:
            sync.set_camera(view.keys)
        self._view = view

    def follow(self, sync, context, depsgraph):
        """Start to render what is in the library, unless that is under way or done."""
        scene, view = depsgraph.scene_eval, self._view
        self._shown_pass = passes.shown_in(context.space_data)
        self._clean_samples = scene.volley.preview_denoising_start_sample
        fields = render_fields(scene, camera.Frame(*view.size), view.crop,
                               list(dict.fromkeys((passes.COMBINED, self._shown_pass))), is_preview=True)
        fields["progressive"] = 1
        if scene.volley.sampler == 'SOBOL':
            fields["sampler"] = abi.SamplerType['BLUE_NOISE']
        wanted = (sync.scene.revision, view.signature, tuple(sorted(fields.items())),
                  scene.render.preview_pixel_size, self._clean_samples)
        if wanted == self._wanted:
            self._next_stage(sync)
            return
        self.stop()
        self._wanted, self._fields = wanted, fields
        self._started = time.monotonic()
        self._patience = FRAME_SECONDS
        size = scene.render.preview_pixel_size
        smallest = 1 if size == 'AUTO' else int(size)
        pixel_count = fields["crop_width"] * fields["crop_height"]
        first = max(smallest, first_divisor(pixel_count * self._pixel_seconds))
        self._stages = [(first, 1)] + ([(smallest, 1)] if first > smallest else []) + [(smallest, None)]
        self._next_stage(sync)

    def stop(self):
        """End what is rendered; the texture stays."""
        render, self._render = self._render, None
        self._wanted, self._stages, self._is_last = None, [], True
        if render is not None:
            render.destroy()

    def pause(self, engine, scene):
        """Stop where it is and go on drawing what there is; :meth:`follow` starts anew."""
        self.stop()
        self._status = "Paused"
        self.draw(engine, scene)

    def is_urgent(self):
        """Whether quick pictures are still to come."""
        return bool(self._stages) or not self._is_last

    def _next_stage(self, sync):
        """Start the next stage when the one before has ended and been read."""
        if not self._stages or self._render is not None:
            return
        divisor, sample_count = self._stages.pop(0)
        self._is_last = not self._stages
        fields = divided(self._fields, divisor)
        if sample_count is not None:
            is_clean = fields["denoise"] and sample_count >= self._clean_samples
            fields.update(sample_count=sample_count, noise_threshold=0.0,
                          denoise=abi.DenoiseType.PREVIEW if is_clean else abi.DenoiseType.NONE)
        self._denoise = fields["denoise"]
        self._samples = fields["sample_count"]
        width, height = fields["width"], fields["height"]
        scale_x, scale_y = self._view.size[0] / width, self._view.size[1] / height
        self._next_place = (fields["crop_x"] * scale_x, fields["crop_y"] * scale_y,
                            fields["crop_width"] * scale_x, fields["crop_height"] * scale_y)
        self._render = sync.scene.start_render(**fields)
        self._version, self._next_read = -1, 0.0

    def read(self, may_wait):
        """Bring the texture up to date; whether there is more to come."""
        if self._render is None:
            return bool(self._stages)
        if not self._is_last and may_wait:
            self._render.wait(self._patience)
            self._patience = NAP_SECONDS
        progress = self._progress = self._render.poll()
        is_running = progress.state == abi.ProgressState.RUNNING
        shown = min(SHOWN_SAMPLES, self._samples)
        now = time.monotonic()
        if progress.samples_done >= shown and progress.version != self._version and (
                now >= self._next_read or not is_running):
            self._version, self._next_read = progress.version, now + DRAW_SECONDS
            pixels = self._read_pixels(progress)
            self._texture, self._place = _texture_of(pixels), self._next_place
            total = self._fields["sample_count"]
            self._status = " | ".join((f"Time:{timecode(now - self._started)}",
                                       f"Mem:{progress.memory_bytes / MEGA:.0f}M", status_text(progress, total)))
            if not self._is_last:
                self._pixel_seconds = progress.seconds / (pixels.shape[0] * pixels.shape[1])
        if not self._is_last and not is_running:
            self._render.destroy()
            self._render = None
            return True
        return is_running or progress.version != self._version

    def _read_pixels(self, progress):
        """The pass that is shown, without its noise if that is wanted of so many samples."""
        is_final = self._denoise == abi.DenoiseType.FINAL and progress.state == abi.ProgressState.DONE
        if self._shown_pass is passes.COMBINED and self._denoise and not is_final and (
                progress.samples_done >= self._clean_samples):
            return passes.read_preview(self._render)
        return passes.read_shown(self._render, self._shown_pass)

    def draw(self, engine, scene):
        """Draw the texture and write what it took."""
        if self._texture is None:
            return
        gpu.state.blend_set('ALPHA_PREMULT')
        engine.bind_display_space_shader(scene)
        x, y, width, height = self._place
        draw_texture_2d(self._texture, (x, y), width, height)
        engine.unbind_display_space_shader()
        gpu.state.blend_set('NONE')
        engine.update_stats("", self._status)


def first_divisor(seconds):
    """Of the size of a picture that can be there within the budget, where a full one takes seconds."""
    return min(max(1, math.ceil(math.sqrt(seconds / PICTURE_SECONDS))), MAX_DIVISOR)


def divided(fields, divisor):
    """Fields of a render of the same view with 1 / divisor the width and height."""
    if divisor == 1:
        return dict(fields)
    width, height = (max(1, fields[name] // divisor) for name in ("width", "height"))
    x, y = min(fields["crop_x"] // divisor, width - 1), min(fields["crop_y"] // divisor, height - 1)
    return {**fields, "width": width, "height": height, "crop_x": x, "crop_y": y,
            "crop_width": min(max(1, fields["crop_width"] // divisor), width - x),
            "crop_height": min(max(1, fields["crop_height"] // divisor), height - y)}


def _visibility_of(v3d):
    """What a 3D view alone decides of which objects it shows."""
    kinds = tuple(value for name in _OBJECT_KINDS if (value := getattr(v3d, name, None)) is not None)
    local = v3d.local_view is not None
    return local, v3d.use_local_collections, kinds, light.are_shown(v3d), _needs_uv(v3d)


def _needs_uv(v3d):
    return passes.shown_in(v3d).index == abi.PassId.UV


_OBJECT_KINDS = tuple(f"show_object_viewport_{kind}" for kind in (
    "mesh", "curve", "curves", "surf", "meta", "font", "hair", "pointcloud", "volume", "grease_pencil",
    "armature", "lattice", "empty", "light", "light_probe", "camera", "speaker"))


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
        whole_frame = camera.frame_of(depsgraph.scene_eval.render)
        keys = camera.view_camera(rv3d, v3d, camera_object, size, whole_frame, warnings)
        return cls(keys, size, _crop_of(keys, v3d, depsgraph.scene_eval.render, size))


def _culling_of(context, depsgraph, warnings):
    """What Simplify hides from a view; it follows edits, not the view alone, as in Cycles."""
    scene = depsgraph.scene_eval
    if not culling.is_on(scene):
        return None
    return culling.of(scene, _View.of_context(context, depsgraph, warnings).keys)


def _dicing_of(context, depsgraph, warnings):
    """How fine a view has meshes diced; as culling, it follows edits, not the view alone."""
    view = _View.of_context(context, depsgraph, warnings)
    return dicing.Dicing(depsgraph.scene_eval, view.keys, camera.Frame(*view.size), False, warnings)


def _crop_of(keys, v3d, render, size):
    """The render region of a view in pixels, through the camera that of the scene; else the whole region."""
    width, height = size
    if keys.frame_window is None:
        is_used, frame = v3d.use_render_border, (0.0, width, 0.0, height)
        border = (v3d.render_border_min_x, v3d.render_border_max_x,
                  v3d.render_border_min_y, v3d.render_border_max_y)
    else:
        is_used, frame = render.use_border, _place_of(keys.frame_window, keys.windows[0], size)
        border = (render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y)
    if not is_used:
        return 0, 0, width, height
    x0, x1 = (_within(frame[:2], part, width) for part in border[:2])
    y0, y1 = (_within(frame[2:], part, height) for part in border[2:])
    x0, y0 = min(x0, width - 1), min(y0, height - 1)
    return x0, y0, max(1, x1 - x0), max(1, y1 - y0)


def _within(ends, part, most):
    """The pixel, of so many, at a share of the way between two places."""
    return min(max(int(ends[0] + part * (ends[1] - ends[0])), 0), most)


def _place_of(inner, outer, size):
    """left, right, bottom, top of a window in another that has (width, height) pixels."""
    (left, right, bottom, top), (width, height) = outer, size
    return ((inner[0] - left) / (right - left) * width, (inner[1] - left) / (right - left) * width,
            (inner[2] - bottom) / (top - bottom) * height, (inner[3] - bottom) / (top - bottom) * height)


def _texture_of(pixels):
    """A half float texture of (height, width, 4) premultiplied scene-linear pixels."""
    height, width = pixels.shape[:2]
    clip_to_half(pixels)
    buffer = gpu.types.Buffer('FLOAT', width * height * 4, pixels.reshape(-1))
    return gpu.types.GPUTexture((width, height), format='RGBA16F', data=buffer)


def clip_to_half(pixels):
    """Bring what half floats cannot hold to the nearest that they can, NaN to 0, in place. Mostly there is none."""
    if not -MAX_HALF <= pixels.min() <= pixels.max() <= MAX_HALF:  # NaN is in no order
        np.nan_to_num(pixels, copy=False, nan=0.0, posinf=MAX_HALF, neginf=-MAX_HALF)
        np.clip(pixels, -MAX_HALF, MAX_HALF, out=pixels)
