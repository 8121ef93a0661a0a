# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras: lens, sensor, shift and depth of field, from Blender's units to the library's.

The library wants the view window on the plane at distance 1 (perspective), in metres (orthographic) or in
shares of the panorama for the whole frame; sensor fit, shift and pixel aspect are folded into it here.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from .. import abi, compat
from . import motion, panorama
from .matrix import rows12

VIEW_SENSOR_MM = 72.0  # the viewport's lens is meant for a sensor of twice Blender's default


# Lights that are seen through have a picture that would be so wide at the angle of a spot, others than spots at that of
# a new one; what is no light has the lens of a new camera. All as in Cycles.
_LIGHT_WIDTH_MM, _LIGHT_ANGLE = 32.0, math.radians(45.0)
_OTHER_CLIP = 1e-5, 1e5  # m


@dataclass(frozen=True)
class Lens:
    """What forms the picture, apart from where the camera stands. Lengths in metres unless said."""

    is_ortho: bool = False
    panorama: tuple = ()  # see panorama.fields
    stereo: tuple = ()    # see panorama.stereo_fields
    focal_mm: float = 50.0
    sensor_width_mm: float = 36.0
    sensor_height_mm: float = 24.0
    sensor_fit: str = 'AUTO'
    ortho_scale: float = 6.0
    shift: tuple = (0.0, 0.0)
    zoom: float = 1.0
    clip_start: float = 0.1
    clip_end: float = 100.0
    aperture_radius: float = 0.0
    focus_distance: float = 10.0
    blade_count: int = 0
    blade_rotation: float = 0.0
    aperture_ratio: float = 1.0


@dataclass(frozen=True)
class Frame:
    """The full frame in pixels, before cropping, and the shape of a pixel."""

    width: int
    height: int
    aspect_x: float = 1.0
    aspect_y: float = 1.0


@dataclass
class CameraKeys:
    """A camera over the shutter: one transform (12 floats) and window (4 floats) per key; frame_window: that
    of the camera's own frame where a viewport looks through it."""

    lens: Lens
    transforms: list = field(default_factory=list)
    windows: list = field(default_factory=list)
    frame_window: tuple = None


def _fits_width(lens, frame):
    """Whether the sensor is fitted to the frame's width, not its height."""
    is_wide = frame.width * frame.aspect_x >= frame.height * frame.aspect_y
    return is_wide if lens.sensor_fit == 'AUTO' else lens.sensor_fit == 'HORIZONTAL'


def _fitted_sensor_mm(lens):
    return lens.sensor_height_mm if lens.sensor_fit == 'VERTICAL' else lens.sensor_width_mm


def _width_at_one(lens):
    """The width, or height, that a perspective lens has on its sensor, at a distance of 1."""
    return _fitted_sensor_mm(lens) / lens.focal_mm


def window(lens, frame, offset=(0.0, 0.0)):
    """left, right, bottom, top of the view window of a plane camera, of panoramas as if they were one;
    offset: in frame widths and heights."""
    pixel_aspect = frame.aspect_y / frame.aspect_x
    fitted_px = frame.width if _fits_width(lens, frame) else frame.height * pixel_aspect
    size = lens.ortho_scale if lens.is_ortho else _width_at_one(lens)
    scale = size * lens.zoom / fitted_px
    center_x = lens.shift[0] * fitted_px + offset[0] * frame.width
    center_y = lens.shift[1] * fitted_px + offset[1] * frame.height
    half_x, half_y = 0.5 * frame.width, 0.5 * frame.height * pixel_aspect
    return ((center_x - half_x) * scale, (center_x + half_x) * scale,
            (center_y - half_y) * scale, (center_y + half_y) * scale)


def zoomed_window(shown, lens, other):
    """The window that shown, of a lens, becomes as the lens turns into another within the shutter. As in Cycles,
    perspective lenses alone zoom, and none shifts."""
    if lens.is_ortho or lens.panorama:
        return shown
    factor = _width_at_one(other) / _width_at_one(lens)
    return tuple(factor * edge for edge in shown)


def panorama_window(lens, seen, whole):
    """The part of a panorama that a window shows if another one, of a plane camera too, shows all of it."""
    left, right, bottom, top = whole
    shift_x, shift_y = lens.shift
    return ((seen[0] - left) / (right - left) + shift_x, (seen[1] - left) / (right - left) + shift_x,
            (seen[2] - bottom) / (top - bottom) + shift_y, (seen[3] - bottom) / (top - bottom) + shift_y)


def _with_sensor(lens, frame):
    """The lens with the sensor that a panorama's fields lack: fitted to the whole frame."""
    if not lens.panorama:
        return lens
    sensor_mm = _fitted_sensor_mm(lens)
    aspect = frame.width * frame.aspect_x / (frame.height * frame.aspect_y)
    size = (sensor_mm, sensor_mm / aspect) if _fits_width(lens, frame) else (sensor_mm * aspect, sensor_mm)
    sensor = (("sensor_width", size[0]), ("sensor_height", size[1]))
    return replace(lens, panorama=lens.panorama + sensor)


def frame_of(render, resolution=None):
    """The full frame of the render settings; resolution: (width, height) in pixels if known."""
    if resolution is None:
        percentage = render.resolution_percentage
        resolution = (int(render.resolution_x * percentage / 100),
                      int(render.resolution_y * percentage / 100))
    return Frame(max(1, resolution[0]), max(1, resolution[1]), render.pixel_aspect_x,
                 render.pixel_aspect_y)


def crop_of(render, frame):
    """x, y, width, height of the border in pixels from the lower left; the frame without a border.

    Blender truncates single-precision products, so this does too."""
    if not render.use_border:
        return 0, 0, frame.width, frame.height
    single = np.float32
    x0 = int(single(render.border_min_x) * single(frame.width))
    x1 = int(single(render.border_max_x) * single(frame.width))
    y0 = int(single(render.border_min_y) * single(frame.height))
    y1 = int(single(render.border_max_y) * single(frame.height))
    return x0, y0, max(1, x1 - x0), max(1, y1 - y0)


def focus_distance(camera_object):
    """Metres along the view axis to what is in focus."""
    dof = camera_object.data.dof
    target = dof.focus_object
    if target is None:
        return dof.focus_distance
    matrix = target.matrix_world
    bone_name = getattr(dof, "focus_subtarget", "")
    if bone_name and target.pose and bone_name in target.pose.bones:
        matrix = matrix @ target.pose.bones[bone_name].matrix
    axis = camera_object.matrix_world.col[2].xyz.normalized()
    offset = camera_object.matrix_world.translation - matrix.translation
    return abs(axis.dot(offset))


def lens_of(camera_object, warnings, shift_x=None):
    """The lens of an evaluated object that is seen through; shift_x replaces a camera's own (stereo views)."""
    if camera_object.type != 'CAMERA':
        return _lens_of_other(camera_object)
    data = camera_object.data
    is_ortho = data.type == 'ORTHO'
    if data.type not in {'PERSP', 'ORTHO', 'PANO'}:
        warnings.add(f"Camera '{data.name}': type {data.type} is not supported, perspective is used")
    dof, aperture_radius = data.dof, 0.0
    if dof.use_dof:
        focal_m = 1.0 if is_ortho else data.lens * 1e-3
        aperture_radius = focal_m / (2.0 * max(dof.aperture_fstop, 1e-5))
    return Lens(
        is_ortho=is_ortho, panorama=panorama.fields(data, warnings) if data.type == 'PANO' else (),
        focal_mm=data.lens, sensor_width_mm=data.sensor_width,
        sensor_height_mm=data.sensor_height, sensor_fit=data.sensor_fit,
        ortho_scale=data.ortho_scale,
        shift=(data.shift_x if shift_x is None else shift_x, data.shift_y),
        clip_start=data.clip_start, clip_end=data.clip_end, aperture_radius=aperture_radius,
        focus_distance=max(focus_distance(camera_object), 1e-5) if dof.use_dof else 10.0,
        blade_count=dof.aperture_blades, blade_rotation=dof.aperture_rotation,
        aperture_ratio=max(dof.aperture_ratio, 1e-5))


def _lens_of_other(seen_through):
    """The lens of an object that is no camera."""
    lens = Lens(clip_start=_OTHER_CLIP[0], clip_end=_OTHER_CLIP[1])
    if seen_through.type != 'LIGHT':
        return lens
    angle = getattr(seen_through.data, "spot_size", _LIGHT_ANGLE)
    return replace(lens, focal_mm=0.5 * _LIGHT_WIDTH_MM / math.tan(0.5 * angle))


def render_camera(engine, camera_object, frame, warnings):
    """The camera of the active view of a render at the depsgraph's present time, with one key."""
    is_camera = camera_object.type == 'CAMERA'  # Blender falls where it is asked for the rest of others
    is_spherical = is_camera and engine.use_spherical_stereo(camera_object)
    shift_x = engine.camera_shift_x(camera_object, use_spherical_stereo=is_spherical) if is_camera else None
    lens = _with_sensor(lens_of(camera_object, warnings, shift_x), frame)
    if is_spherical:
        lens = replace(lens, stereo=panorama.stereo_fields(camera_object.data, engine.active_view_get()))
    transform = rows12(engine.camera_model_matrix(camera_object, use_spherical_stereo=is_spherical))
    shown = window(lens, frame)
    return CameraKeys(lens, [transform], [panorama_window(lens, shown, shown) if lens.panorama else shown])


def view_camera(rv3d, v3d, camera_object, region_size, whole_frame, warnings):
    """The camera of a viewport whose region has (width, height) pixels; whole_frame: of a render.

    Through the camera, Blender fits the sensor to the region as it would to a frame, then zooms and
    moves the picture; shift and offset grow with the zoom."""
    frame = Frame(*region_size)
    view_to_world = rv3d.view_matrix.inverted()
    offset, frame_window = (0.0, 0.0), None
    if rv3d.view_perspective == 'CAMERA' and getattr(camera_object, "type", "") == 'CAMERA':
        factor = view_camera_zoom_factor(rv3d.view_camera_zoom)
        lens = whole = _with_sensor(lens_of(camera_object, warnings), whole_frame)
        lens = replace(lens, zoom=1.0 / factor, shift=tuple(factor * s for s in lens.shift))
        offset = tuple(2.0 * factor * value for value in rv3d.view_camera_offset)
        frame_window = window(whole, whole_frame)
        if whole.panorama:
            shown = panorama_window(whole, window(lens, frame, offset), frame_window)
            return CameraKeys(whole, [rows12(view_to_world)], [shown],
                              panorama_window(whole, frame_window, frame_window))
    elif rv3d.view_perspective == 'ORTHO':
        # Clipping reaches behind the view's origin, so the camera starts that far back.
        lens = Lens(is_ortho=True, ortho_scale=rv3d.view_distance * VIEW_SENSOR_MM / v3d.lens,
                    clip_start=1e-3, clip_end=2.0 * v3d.clip_end)
        view_to_world.translation += view_to_world.col[2].xyz.normalized() * v3d.clip_end
    else:
        lens = Lens(focal_mm=v3d.lens, sensor_width_mm=VIEW_SENSOR_MM, clip_start=v3d.clip_start,
                    clip_end=v3d.clip_end)
    return CameraKeys(lens, [rows12(view_to_world)], [window(lens, frame, offset)], frame_window)


def view_camera_zoom_factor(view_camera_zoom):
    """How much of a region a camera's frame fills, from Blender's zoom setting (-30..600)."""
    return ((2.0 ** 0.5 + view_camera_zoom / 50.0) ** 2) / 4.0


def _thin_lens(lens):
    """The radius of the aperture and the distance of focus, as seen from where the camera stands."""
    if not (lens.is_ortho and compat.FOCUSES_FROM_CLIP_START):
        return lens.aperture_radius, lens.focus_distance
    focus_distance = lens.clip_start + lens.focus_distance
    return lens.aperture_radius * focus_distance / lens.focus_distance, focus_distance


def send(scene, keys, shutter=None):
    """Give the camera to the library; equal keys are sent as one. shutter: as motion.Shutter, None for no
    blur."""
    transforms = motion.follow_turns(np.asarray(_collapse(keys.transforms), np.float32))
    windows, lens = _collapse(keys.windows), keys.lens
    if len(windows) > 1:
        if len(transforms) == 1:
            transforms = np.repeat(transforms, len(windows), axis=0)
        windows = motion.resample(windows, len(transforms))
    kind = abi.CameraType.ORTHOGRAPHIC if lens.is_ortho else abi.CameraType.PERSPECTIVE
    shape = {"type": kind, **dict(lens.panorama), **dict(lens.stereo)}
    shutter = shutter or motion.Shutter(0.0, 0.0, None)
    aperture_radius, focus_distance = _thin_lens(lens)
    scene.set_camera(
        transforms, windows, shutter.curve, **shape,
        blade_count=lens.blade_count, clip_start=lens.clip_start,
        clip_end=max(lens.clip_end, lens.clip_start * (1.0 + 1e-5)),
        aperture_radius=aperture_radius, focus_distance=focus_distance,
        blade_rotation=lens.blade_rotation, aperture_ratio=lens.aperture_ratio,
        shutter_time=shutter.length, row_delay=shutter.row_delay)


def _collapse(values):
    """One value when all are equal."""
    first = np.asarray(values[0], np.float32)
    if all(np.array_equal(first, np.asarray(value, np.float32)) for value in values[1:]):
        return values[:1]
    return values
