# SPDX-License-Identifier: GPL-3.0-or-later
"""The life of one final render or preview: sync, build, run, read back, free.

Nothing of Blender is kept between calls. With persistent data the library's scene stays, and the next
frame sends only what differs.
"""

import time

import bpy

from . import abi, cryptomatte, jobs, native, passes
from .commit import Commit
from .compat import COUNTS_LAST_PASSED, motion_position
from .farm import content, job, parts
from .log import logger
from .sync import Cancelled, SceneSync, Source, camera, culling, dicing, motion, world
from .sync.changes import Changes

POLL_SECONDS = 0.02
FIRST_PICTURE_SECONDS = 0.2  # until the first unfinished picture is shown
STATUS_SECONDS = 0.2         # between two status lines
PICTURE_SECONDS = 0.7        # between two of them
PICTURE_COST = 20            # at least this many times what showing one takes
MEGA = 1024.0 * 1024.0
_GUIDES = {'RGB': abi.GuidesType.NONE, 'RGB_ALBEDO': abi.GuidesType.ALBEDO,
           'RGB_ALBEDO_NORMAL': abi.GuidesType.ALBEDO_NORMAL}
MIN_NOISE_THRESHOLD = 0.001  # that is chosen without the user


class Session:
    """What a render engine instance holds of the library."""

    def __init__(self):
        self._sync = None
        self._sync_settings = None  # what the scene was created with
        self._synchronised = None   # the depsgraph and view layer that it was brought up to date with

    def free(self):
        """Free everything native. May be called at any time, more than once."""
        sync, self._sync, self._synchronised = self._sync, None, None
        if sync is not None:
            sync.destroy()

    def render(self, engine, depsgraph):
        """Render one view layer; called by Blender for each of them."""
        keep = depsgraph.scene_eval.render.use_persistent_data and not engine.is_preview
        try:
            self._render_layer(engine, depsgraph, keep)
        except Cancelled:
            pass
        finally:
            if not keep:
                self.free()

    def _render_layer(self, engine, depsgraph, keep):
        scene = depsgraph.scene_eval
        view_layer = depsgraph.view_layer_eval
        entries = passes.enabled(view_layer)
        passes.add_to_result(engine, entries, view_layer.name)
        film = engine.get_result()
        frame = camera.frame_of(scene.render, (engine.resolution_x, engine.resolution_y))
        crop = _fit_crop(camera.crop_of(scene.render, frame), (film.resolution_x, film.resolution_y))
        view_names = [view.name for view in film.views] or [""]

        self._open(scene, keep)
        for message in passes.left_out(view_layer):
            self._sync.warnings.add(message)
        shutter = motion.shutter_of(scene, view_layer, motion_position(depsgraph.scene),
                                   view_layer.use_pass_vector)
        if shutter is not None and shutter.curve is not None:
            entries = passes.without_vector(entries)
        # A part has all of its samples.
        is_limited = not engine.is_preview and not job.job().parts_folder
        time_limit = scene.volley.time_limit if is_limited else 0.0
        with job.timed("sync"):
            views = self._synchronise(engine, depsgraph, frame, shutter, view_names)
        view_layer = depsgraph.view_layer_eval  # another where a marker within the shutter switches the camera
        for view_name, keys in views:
            self._sync.set_camera(keys, shutter)
            with job.timed("build"):
                self._commit(engine)
            self._report_warnings(engine)
            settings = render_fields(scene, frame, crop, entries, engine.is_preview)
            if view_layer.samples > 0:
                settings["sample_count"] = view_layer.samples
            sample_count = _fit_subset(settings)
            # All of the picture must have samples when the time is over.
            settings["progressive"] = int(time_limit > 0.0)
            if job.job().parts_folder:  # which samples are extra ones takes all parts
                settings["extra_samples"] = 0.0
            render = self._sync.scene.start_render(**settings)
            try:
                progress = _Run(engine, self._sync, render, sample_count, time_limit, scene.frame_current).follow(
                    view_layer.name, view_name, entries)
                folder = "" if engine.is_preview else job.job().parts_folder
                if folder and progress.state == abi.ProgressState.DONE:
                    manifests = cryptomatte.manifests(view_layer, self._sync.cryptomatte_names())
                    parts.write(folder, scene, render, entries, settings, view_layer.name, view_name,
                                self._sync.scene.content(), manifests)
            finally:
                render.destroy()
        cryptomatte.write_manifests(engine, view_layer, self._sync.cryptomatte_names())

    def _open(self, scene, keep):
        """The library's scene: the one kept from the last frame, or a new one."""
        make_scene = content.NotedScene if job.job().parts_folder else native.Scene
        settings = (keep, thread_count(scene.render), scene.volley.texture_memory, make_scene)
        if self._sync is None or self._sync_settings != settings:
            self.free()
            self._sync = SceneSync(is_final=True, thread_count=settings[1], will_resync=keep,
                                   image_megabytes=settings[2], make_scene=make_scene)
            self._sync_settings = settings

    def _synchronise(self, engine, depsgraph, frame, shutter, view_names):
        """Send everything but the camera; the cameras come back, one for each view."""
        engine.update_stats("", "Reading the scene")
        scene = depsgraph.scene_eval
        now = motion.split_frame(motion.frame_of(scene))
        moved = shutter is not None
        shown = depsgraph.as_pointer(), scene.name_full, depsgraph.view_layer_eval.name
        is_same = self._synchronised == shown
        self._synchronised = None  # until all is done: Blender names what changed once
        changes = Changes.since_render(depsgraph) if is_same else Changes.everything()
        source = Source(depsgraph, changes, engine=engine,
                        is_cancelled=lambda: jobs.is_cancelled(engine),
                        needs_uv=depsgraph.view_layer_eval.use_pass_uv,
                        aovs=passes.aov_numbers(depsgraph.view_layer_eval),
                        light_groups=passes.light_group_numbers(depsgraph.view_layer_eval))
        cameras = CameraMotion(engine, depsgraph, frame, shutter, view_names, self._sync.warnings)
        is_apart = moved and shutter.frame_at(motion.CENTER) != now

        def look_at_center():
            cameras.look(motion.CENTER)
            keys = next(iter(cameras.keys.values()))
            source.culling = culling.of(scene, keys)
            source.dicing = dicing.Dicing(scene, keys, frame, True, self._sync.warnings)

        def go_to_center():
            engine.frame_set(*shutter.frame_at(motion.CENTER))
            changes.note(depsgraph)
            look_at_center()

        try:
            if not is_apart:
                look_at_center()
            self._sync.update(source, shutter, cameras, go_to_center if is_apart else None)
        finally:
            if moved:
                engine.frame_set(*now)
        self._synchronised = shown
        return list(cameras.keys.items())

    def _commit(self, engine):
        """Build on another thread, so that Esc is heard meanwhile."""
        engine.update_stats("", "Preparing to render")
        commit = Commit(self._sync.scene)
        try:
            while not commit.is_done(POLL_SECONDS):
                if jobs.is_cancelled(engine):
                    raise Cancelled()
        finally:
            commit.cancel()
        try:
            commit.check()
        except native.TracerError as error:
            if error.status == abi.StatusCode.ERROR_CANCELLED:
                raise Cancelled() from error
            raise

    def _report_warnings(self, engine):
        for message in self._sync.warnings.take() + self._sync.scene.warnings():
            report_warning(engine, message)


class CameraMotion:
    """The render camera over the shutter, for each stereo view, which may have one of its own: keys by view name. As in
    Cycles, that of the frame: a marker that the shutter passes switches to no other.

    ``count`` is how many times it wants to be looked at."""

    def __init__(self, engine, depsgraph, frame, shutter, view_names, warnings):
        self._engine, self._depsgraph, self._frame, self._warnings = engine, depsgraph, frame, warnings
        if engine.camera_override is None:
            raise native.TracerError(abi.StatusCode.ERROR_INVALID_ARGUMENT, "the scene has no camera")
        self.count = motion.key_count(engine.camera_override) if shutter is not None else 1
        # Evaluated ones may not outlive a switch.
        self._cameras = {name: self._shown(name).original for name in view_names}
        self.keys = {}

    def look(self, fraction):
        """Note where the camera is at a fraction of the shutter; the centre comes first."""
        for name, original in self._cameras.items():
            self._shown(name)
            keys = camera.render_camera(self._engine, original.evaluated_get(self._depsgraph), self._frame,
                                        self._warnings)
            if name not in self.keys:
                keys.transforms *= self.count
                keys.windows *= self.count
                self.keys[name] = keys
                continue
            index = motion.key_index(fraction, self.count)
            if index is not None:
                centre = self.keys[name]
                centre.transforms[index] = keys.transforms[0]
                centre.windows[index] = camera.zoomed_window(centre.windows[self.count // 2], centre.lens, keys.lens)

    def _shown(self, name):
        """The evaluated camera of a view, which becomes the one that the engine shows."""
        if name:
            self._engine.active_view_set(name)
        return self._engine.camera_override


class _Run:
    """One running render: progress, unfinished pictures, Esc, the result."""

    def __init__(self, engine, sync, render, sample_count, time_limit, frame):
        self._engine, self._render, self._sample_count = engine, render, sample_count
        self._time_limit = time_limit  # seconds, 0 for none
        self._frame = frame  # that progress is told of
        self._features = sync.scene.features()
        self._next_picture = time.monotonic() + FIRST_PICTURE_SECONDS
        self._shown_version = 0
        self._next_status = 0.0

    def follow(self, layer_name, view_name, entries):
        """Poll until it ends or the user stops it; what is finished is kept either way. Its last progress
        is returned."""
        engine, render = self._engine, self._render
        width, height = render.size
        result = engine.begin_result(0, 0, width, height, layer=layer_name, view=view_name)
        layer = result.layers[0]
        is_done = False
        try:
            while not is_done:
                render.wait(POLL_SECONDS)
                if jobs.is_cancelled(engine):
                    render.cancel()
                    render.wait(-1.0)
                progress = render.poll()
                if self._is_over_time(progress):
                    render.cancel()
                    render.wait(-1.0)
                    progress = render.poll()
                is_done = progress.state != abi.ProgressState.RUNNING
                self._show_progress(progress, is_done)
                if not is_done:
                    self._show_picture(progress, result, layer, entries)
            passes.write(render, layer, entries)
            logger.debug("%d rays in %.3f s; the scene has: %s", native.ray_count(progress), progress.seconds,
                         ", ".join(self._features))
            job.add_render(progress, native.ray_count(progress))
            return progress
        finally:
            engine.end_result(result)

    def _is_over_time(self, progress):
        """Whether to stop with what there is, which is at least a sample of each pixel."""
        return 0.0 < self._time_limit < progress.seconds and progress.samples_done > 0 \
            and progress.fraction < 1.0 and progress.state == abi.ProgressState.RUNNING

    def _show_progress(self, progress, is_done):
        now = time.monotonic()
        if now < self._next_status and not is_done:
            return
        self._next_status = now + STATUS_SECONDS
        self._engine.update_progress(progress.fraction)
        job.say_progress(self._frame, progress.fraction, status_text(progress, self._sample_count))
        self._engine.update_stats("", status_text(progress, self._sample_count))
        self._engine.update_memory_stats(memory_used=progress.memory_bytes / MEGA,
                                         memory_peak=progress.peak_memory_bytes / MEGA)

    def _show_picture(self, progress, result, layer, entries):
        """Show what there is, seldom enough not to cost more than a few percent."""
        now = time.monotonic()
        if bpy.app.background or now < self._next_picture or progress.version == self._shown_version:
            return
        self._shown_version = progress.version
        passes.write(self._render, layer, entries)
        self._engine.update_result(result)
        cost = time.monotonic() - now
        self._next_picture = now + max(PICTURE_SECONDS, PICTURE_COST * cost)


def status_text(progress, sample_count):
    """What is to be said of a running render, in the words of Cycles."""
    samples = f"Sample {progress.samples_done}/{sample_count}"
    if progress.state != abi.ProgressState.RUNNING or not 0.0 < progress.fraction < 1.0:
        return samples
    remaining = progress.seconds * (1.0 / progress.fraction - 1.0)
    return f"Remaining:{timecode(remaining)} | {samples}"


def timecode(seconds):
    """A time as Blender writes it: minutes, seconds and hundredths, with hours where there are any."""
    hundredths = round(seconds * 100.0)
    minutes, seconds = divmod(hundredths // 100, 60)
    hours, minutes = divmod(minutes, 60)
    text = f"{minutes:02d}:{seconds:02d}.{hundredths % 100:02d}"
    return f"{hours:02d}:{text}" if hours else text


def report_warning(engine, message):
    """A warning where the user sees it, once in a render job: in Blender's reports, or on the console
    when there is no window to show them in."""
    if not jobs.is_new(engine, message):
        return
    job.add_warning(message)
    if bpy.app.background:
        logger.warning(message)
    else:
        engine.report({'WARNING'}, message)


def thread_count(render):
    """Threads the user allows, 0 for all."""
    return render.threads if render.threads_mode == 'FIXED' else 0


def render_fields(scene, frame, crop, entries, is_preview=False):
    """The fields of trc_render_desc for an evaluated scene."""
    settings = scene.volley
    seed = settings.seed
    if settings.use_animated_seed:
        seed += scene.frame_current
    return {
        "width": frame.width, "height": frame.height,
        "crop_x": crop[0], "crop_y": crop[1], "crop_width": crop[2], "crop_height": crop[3],
        "integrator": abi.IntegratorType[settings.integrator],
        "sample_count": settings.preview_samples if is_preview else settings.samples,
        "sample_offset": 0 if is_preview else settings.sample_offset,
        "sample_subset": 0 if is_preview else settings.sample_subset,
        "light_samples": settings.light_samples,
        "extra_samples": 0.0 if is_preview else settings.extra_samples,
        "max_depth": settings.max_depth, "max_shadow_depth": settings.max_transparent_depth,
        "max_transparent_depth": max(settings.max_transparent_depth - int(COUNTS_LAST_PASSED), 0),
        "max_glossy_depth": settings.max_glossy_depth,
        "max_transmission_depth": settings.max_transmission_depth,
        "attenuation_cutoff": settings.attenuation_cutoff, "filter_glossy": settings.filter_glossy,
        "clamp_direct": settings.clamp_direct, "clamp_indirect": settings.clamp_indirect,
        "assembly": abi.AssemblyType[settings.assembly],
        "packet_size": 0 if settings.packet_size == 'AUTO' else int(settings.packet_size),
        "sampler": abi.SamplerType[settings.sampler], "seed": seed & 0xFFFFFFFF,
        "filter": abi.FilterType[settings.pixel_filter_type], "filter_width": settings.filter_width,
        "film_transparent": int(scene.render.film_transparent),
        "film_transparent_glass": int(settings.film_transparent_glass),
        "film_transparent_roughness": settings.film_transparent_roughness,
        "film_exposure": settings.film_exposure, **passes.request_fields(entries),
        "denoise": int(settings.use_preview_denoising if is_preview else settings.use_denoising),
        "guides": _GUIDES[settings.preview_denoising_input_passes if is_preview else settings.denoising_input_passes],
        "thread_count": thread_count(scene.render), **_adaptive_fields(settings, is_preview),
        **world.mist_fields(scene.world),
    }


def _fit_subset(fields):
    """Cut the subset of samples to those that there are; how many are rendered."""
    left = max(0, fields["sample_count"] - fields["sample_offset"])
    fields["sample_subset"] = min(fields["sample_subset"], left)
    return fields["sample_subset"] or left


def _adaptive_fields(settings, is_preview):
    """The fields of trc_render_desc that stop pixels by their noise."""
    prefix = "preview_" if is_preview else ""
    if not getattr(settings, f"use_{prefix}adaptive_sampling"):
        return {"noise_threshold": 0.0}
    threshold = getattr(settings, f"{prefix}noise_threshold")
    if threshold == 0.0:  # as Cycles chooses it
        threshold = max(MIN_NOISE_THRESHOLD, 1.0 / getattr(settings, f"{prefix}samples"))
    return {"noise_threshold": threshold,
            "min_samples": getattr(settings, f"{prefix}adaptive_min_samples")}


def _fit_crop(crop, film_size):
    """The crop in the size that Blender's result has, which rules where rounding differs."""
    x, y, _, _ = crop
    return x, y, film_size[0], film_size[1]
