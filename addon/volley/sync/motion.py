# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion blur: when to look at the scene, and how many times for each object.

The shutter is an interval of frames. An object with ``steps`` motion steps (a setting of Cycles') is
seen at 2^steps + 1 evenly spaced times, so that objects of different steps share theirs. The scene's
still parts are those of the interval's centre.
"""

import math
from dataclasses import dataclass

import numpy as np

from .. import native
from ..compat import cycles

_CURVE_SAMPLES = 256
_CENTER_OFFSETS = {'START': 0.5, 'CENTER': 0.0, 'END': -0.5}  # in shutter times
CENTER = 0.5


@dataclass
class Shutter:
    """When it is open: length and centre in frames; curve: samples of its opening, None for a box."""

    length: float
    center: float
    curve: np.ndarray = None

    def frame_at(self, fraction):
        """The frame at a fraction of the shutter time, as (whole frame, rest in [0, 1))."""
        return split_frame(self.center + (fraction - CENTER) * self.length)


def split_frame(frame):
    """A frame as Blender wants it: whole and rest."""
    whole = math.floor(frame)
    return whole, frame - whole


def shutter_of(scene, view_layer, position):
    """The shutter of an evaluated scene, None without motion blur; position: 'START', 'CENTER' or
    'END' of the interval is the current frame."""
    render = scene.render
    is_used = render.use_motion_blur and view_layer.use_motion_blur
    if not is_used or render.motion_blur_shutter <= 0.0:
        return None
    now = scene.frame_current_final
    length = render.motion_blur_shutter
    center = now + _CENTER_OFFSETS[position] * length
    return Shutter(length, center, _curve_of(render))


def _curve_of(render):
    """The shutter curve's samples, None when it is open all the time."""
    mapping = render.motion_blur_shutter_curve
    mapping.initialize()
    curve = mapping.curves[0]
    samples = np.array([mapping.evaluate(curve, i / (_CURVE_SAMPLES - 1))
                        for i in range(_CURVE_SAMPLES)], np.float32).clip(0.0, None)
    return None if samples.min() > 0.999 else samples


def key_count(blender_object, parent=None):
    """How many times to look at an object (1: not moving); an instancer's setting counts too."""
    chain = [blender_object] + ([parent] if parent is not None else [])
    if not all(cycles(each, "use_motion_blur", True) for each in chain):
        return 1
    steps = max(cycles(each, "motion_steps", 1) for each in chain)
    return min((2 << (steps - 1)) + 1, native.MAX_KEYS)


def may_deform(blender_object):
    """Whether an object's mesh may change its shape in time: modifiers, shape keys, or a mesh that is
    made anew on each frame."""
    if not cycles(blender_object, "use_deform_motion", True):
        return False
    original = blender_object.original or blender_object
    if original.type != 'MESH':
        return True
    data = original.data
    return bool(original.modifiers) or (data is not None and (
        data.shape_keys is not None or data.animation_data is not None))


def fractions_of(counts):
    """The times at which to look, as fractions of the shutter, for objects of those key counts;
    without the centre, which is looked at first."""
    times = {index / (count - 1) for count in counts if count > 1 for index in range(count)}
    return sorted(times - {CENTER})


def key_index(fraction, count):
    """The key of an object of that many keys at a time, None if it has none there."""
    index = fraction * (count - 1)
    return int(index) if count > 1 and index == int(index) else None
