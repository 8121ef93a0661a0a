# SPDX-License-Identifier: Apache-2.0
"""Files as they lie on the disk, rendered beside Cycles inside Blender: as F12 does, and in the viewport of a window.

Files are opened as they are and rendered small, Cycles without diffuse bounces. One without a camera is looked at
from a corner, one without any light gets a sun.
"""

import math

import bpy
import numpy as np

import scenes

SEEDS = scenes.SEEDS
WINDOW_SEEDS = SEEDS[:2]
DRAW_SECONDS = 0.5
STILL_DRAWS = 5       # that show the same, after which a viewport is taken to have ended
LONGEST_DRAWS = 240
EXPOSED_SAMPLES, EXPOSED_PERCENT, EXPOSED_TO = 16, 99.5, 0.7
EXTENT_DISTANCES = 1.6  # of the camera that is added, from the middle of the scene


def open_file(path, size, has_lens_blur=False, has_motion_blur=False):
    """Open a file for both engines: the scene. The longer side of its pictures has so many pixels."""
    bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)
    bpy.ops.preferences.addon_enable(module="volley")
    scene = bpy.context.scene
    render = scene.render
    share = size / max(render.resolution_x, render.resolution_y)
    render.resolution_x, render.resolution_y = (
        max(1, round(share * pixels)) for pixels in (render.resolution_x, render.resolution_y))
    render.resolution_percentage = 100
    render.use_compositing = render.use_sequencer = render.use_stamp = False
    scenes.set_file_format(render.image_settings, 'OPEN_EXR')
    render.image_settings.color_depth, render.image_settings.color_mode = '32', 'RGBA'
    scene.display_settings.display_device = 'sRGB'  # files of Blender 2.4 have one without 'Raw'
    scene.view_settings.view_transform, render.dither_intensity = 'Raw', 0.0
    if scene.camera is None:
        _add_camera()
    if has_lens_blur:
        scene.camera.data.dof.use_dof = True
    if has_motion_blur:
        render.use_motion_blur = True
    if not _is_lit(scene):
        scenes.light('SUN', rotation=(0.6, 0.3, 0.0), energy=3.0, angle=0.1)
    return scene


def _is_lit(scene):
    return any(each.type == 'LIGHT' for each in scene.objects)


def _add_camera():
    """Look at all there is from above, in front and the right."""
    from mathutils import Vector
    corners = np.array([each.matrix_world @ Vector(corner) for each in bpy.context.scene.objects
                        if each.type == 'MESH' for corner in each.bound_box])
    low, high = corners.min(axis=0), corners.max(axis=0)
    away = Vector((0.5, -0.75, 0.45)).normalized()
    made = scenes.camera()
    made.location = Vector(0.5 * (low + high)) + away * EXTENT_DISTANCES * float(np.linalg.norm(high - low))
    made.rotation_euler = away.to_track_quat('Z', 'Y').to_euler()
    bpy.context.view_layer.update()


def in_background(path, size, samples, **switches):
    """The file by both engines: arrays (seeds, height, width, 4), and what Volley warns of."""
    from volley import session
    told = []
    session.report_warning = lambda _engine, message: told.append(message)
    open_file(path, size, **switches)
    return scenes.seeds_by_both(samples), sorted(set(told))


def in_window(path, size, samples, **switches):
    """The viewport of a window by both engines, through the camera: arrays (seeds, height, width, 3) of what
    the screen shows, and what Volley warns of. A view that fails raises. For Blender.run_in_window."""
    from volley import viewport
    told, failures = [], _noted_failures()
    viewport.Viewport._report = lambda _self, _engine, messages: told.extend(messages)
    yield 0.1
    scene = open_file(path, size, **switches)
    _expose(scene)
    bpy.context.preferences.view.show_splash = False
    yield DRAW_SECONDS
    area, space = view()
    space.overlay.show_overlays = space.show_gizmo = space.show_region_header = False
    space.region_3d.view_perspective = 'CAMERA'
    shown = []
    for engine in ('VOLLEY', 'CYCLES'):
        space.shading.type = 'SOLID'
        pictures = []
        for _ in scenes.each_seed(engine, samples, WINDOW_SEEDS):
            getattr(scene, engine.lower()).preview_samples = max(1, samples // len(WINDOW_SEEDS))
            if engine == 'CYCLES':
                scene.cycles.use_preview_denoising = scene.cycles.use_preview_adaptive_sampling = False
            scene.update_tag()  # which buttons do
            space.shading.type = 'RENDERED'
            pictures.append((yield from _still(area, failures)))
            space.shading.type = 'SOLID'
            yield DRAW_SECONDS
        shown.append(np.array(pictures))
    return shown, sorted(set(told))


def _expose(scene):
    """Have the screen show what is bright as nearly white, nothing brighter: it has no values above 1."""
    scenes.set_engine('VOLLEY', EXPOSED_SAMPLES)
    bright = np.percentile(scenes.render(scene)[..., :3].max(axis=2), EXPOSED_PERCENT)
    scene.view_settings.exposure = math.log2(EXPOSED_TO / max(bright, 1e-3))


def view():
    """The 3D view of the window and its space."""
    area = next(area for area in bpy.context.window_manager.windows[0].screen.areas if area.type == 'VIEW_3D')
    return area, area.spaces.active


def _noted_failures():
    """The messages with which Volley gives a render or a view up from now on."""
    from volley import engine
    noted, fail = [], engine.VolleyRenderEngine._fail

    def noting_fail(self, message):
        noted.append(message)
        fail(self, message)

    engine.VolleyRenderEngine._fail = noting_fail
    return noted


def _still(area, failures):
    """What the middle of the view shows once it does not change any more. A failed view does not change either:
    it is known by Volley's failures, or by its one colour where an engine says nothing."""
    import screen
    region = next(region for region in area.regions if region.type == 'WINDOW')
    before, still_count = None, 0
    for _ in range(LONGEST_DRAWS):
        area.tag_redraw()
        yield DRAW_SECONDS
        if failures:
            raise AssertionError(f"the view failed: {failures[0]}")
        picture = screen.Screen().picture()
        shot = picture[region.y + region.height // 4:region.y + region.height * 3 // 4,
                       region.x + region.width // 4:region.x + region.width * 3 // 4]
        still_count = still_count + 1 if before is not None and np.array_equal(shot, before) else 0
        if still_count == STILL_DRAWS:
            if not np.ptp(shot, axis=(0, 1)).any():
                raise AssertionError("the view shows one colour")
            return shot
        before = shot
    raise AssertionError("the viewport does not come to rest")
