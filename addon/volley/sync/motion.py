# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion blur: when to look at the scene, and how many times for each object.

The shutter is an interval of frames. An object with ``steps`` motion steps (a setting of Cycles') is
seen at 2^steps + 1 evenly spaced times, so that objects of different steps share theirs. The scene's
static parts are those of the interval's centre.
"""

import math
from dataclasses import dataclass

import numpy as np
from mathutils import Matrix, Quaternion

from .. import abi
from ..compat import SHUTTER_DELAY, cycles

_CURVE_SAMPLES = 256
_TINY = 1e-30       # in place of a zero to divide by
_PIECE_SAMPLES = 8  # of the opening in each piece of Cycles' table: its steps stay sharp
_CENTER_OFFSETS = {'START': 0.5, 'CENTER': 0.0, 'END': -0.5}  # in shutter times
CENTER = 0.5
_MAX_TURN = math.radians(4.0)  # between two keys: what turns shrinks by at most 0.06 % halfway
_SINGULAR = 1e-6               # smallest share of its size that a matrix needs in two directions


@dataclass
class Shutter:
    """When it is open: length and centre in frames; curve: samples of its opening, None where motion
    is only given to the Vector pass and nothing is blurred; row_delay: of a rolling shutter, the share of
    the length in which rows begin."""

    length: float
    center: float
    curve: np.ndarray
    row_delay: float = 0.0

    def seconds(self, scene):
        """How long it is open, in the time of a scene."""
        return self.length * scene.render.fps_base / scene.render.fps

    def frame_at(self, fraction):
        """The frame at a fraction of the shutter time, as (whole frame, rest in [0, 1))."""
        return split_frame(self.center + (fraction - CENTER) * self.length)


def frame_of(scene):
    """The frame that a scene is at, with its rest, as Blender wants it: Time Remapping comes after."""
    return scene.frame_current + scene.frame_subframe


def split_frame(frame):
    """A frame as Blender wants it: whole and rest."""
    whole = math.floor(frame)
    return whole, frame - whole


def shutter_of(scene, view_layer, position, wants_vector=False):
    """The shutter of an evaluated scene, None without motion blur; position: 'START', 'CENTER' or
    'END' of the interval is the current frame; wants_vector: whether motion matters without blur."""
    render = scene.render
    is_used = render.use_motion_blur and view_layer.use_motion_blur
    now = frame_of(scene)
    if not is_used or render.motion_blur_shutter <= 0.0:
        # From the frame before to the one after.
        return Shutter(2.0, now, None) if wants_vector else None
    length = render.motion_blur_shutter
    center = now + _CENTER_OFFSETS[position] * length
    return Shutter(length, center, _curve_of(render), _row_delay_of(scene))


def _row_delay_of(scene):
    if cycles(scene, "rolling_shutter_type", 'NONE') == 'NONE':
        return 0.0
    return 1.0 - cycles(scene, "rolling_shutter_duration", 0.1)


def _curve_of(render):
    """Samples of how far the shutter is open, from Blender's curve as Cycles takes it."""
    mapping = render.motion_blur_shutter_curve
    mapping.initialize()
    curve = mapping.curves[0]
    samples = np.array([mapping.evaluate(curve, i / (_CURVE_SAMPLES - 1))
                        for i in range(_CURVE_SAMPLES)])
    return _opening(samples.clip(0.0, None))


def _opening(samples):
    """Samples of the opening from which Cycles' shutter times come, for those of a curve.

    Its table of times has as many entries as the curve has samples, n; all but the last stand for
    shares of 1/n of the light but are spread as if for 1/(n - 1), and each time is a share of n + 1
    pieces. Measured on a moving edge: a box is open up to 254/257 of its time and a third after
    that. Half a pixel of a long streak, but a picture from both engines would show it."""
    count = len(samples)
    total = np.concatenate([[0.0], np.cumsum(samples)])
    if total[-1] <= 0.0:
        return np.ones(2, np.float32)
    total /= total[-1]
    shares = np.arange(count - 1) / count
    piece = np.searchsorted(total, shares, side='right')
    area = np.diff(total, append=2.0)[piece]
    # Each time is drawn back from the next piece's start by that piece's slope, which is right as
    # long as neighbours are alike; Cycles does so even where the curve rises from or falls to zero.
    back = np.where(area > 0.0, (total[piece] - shares) / np.maximum(area, _TINY), 0.0).clip(0.0, 2.0)
    times = np.append(np.maximum.accumulate((piece - back).clip(0.0)) / (count + 1), 1.0)
    times[:-1] += SHUTTER_DELAY / count
    fine = (count + 1) * _PIECE_SAMPLES
    middles = (np.arange(fine) + 0.5) / fine
    let_through = np.interp(middles, times, np.linspace(0.0, 1.0, count))
    edges = np.concatenate([[-let_through[0]], let_through, [2.0 - let_through[-1]]])
    return np.diff(edges).astype(np.float32)


def _chain(blender_object, parent):
    return [blender_object] + ([parent] if parent is not None else [])


def key_count(blender_object, parent=None):
    """How many times to look at an object (1: not moving); an instancer's setting counts too."""
    chain = _chain(blender_object, parent)
    if not all(cycles(each, "use_motion_blur", True) for each in chain):
        return 1
    steps = max(cycles(each, "motion_steps", 1) for each in chain)
    return min((2 << (steps - 1)) + 1, abi.MAX_KEYS)


def blurs_shapes(blender_object, parent=None):
    """Whether changes of an object's shape count; an instancer's setting does too."""
    return all(cycles(each, "use_deform_motion", True) for each in _chain(blender_object, parent))


def may_deform(blender_object):
    """Whether an object's mesh may change its shape in time: modifiers, shape keys, or a mesh that is
    made anew on each frame."""
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


def follow_turns(transforms):
    """Keys (count, 12) with more in between where they turn.

    The library joins keys by straight lines, on which whatever turns shrinks. So keys that are far
    apart get others in between: turned about a fixed axis at a steady rate, moved and stretched
    evenly. That is how Cycles moves from key to key (polar decomposition: K. Shoemake and T. Duff,
    "Matrix Animation and Polar Decomposition", 1992)."""
    count = len(transforms)
    if count == 1:
        return transforms
    matrices = transforms.reshape(count, 3, 4)
    if (matrices[1:, :, :3] == matrices[0, :, :3]).all():  # as of most
        return transforms
    matrices = matrices.astype(np.float64)
    linear = matrices[:, :, :3]
    # A turn by an angle below pi moves the axes by its sine or more: most keys need no decomposition.
    if np.abs(np.diff(linear, axis=0)).max(initial=0.0) < math.sin(_MAX_TURN) * _smallest_axis(linear):
        return transforms
    u, sizes, v = np.linalg.svd(linear)
    limit = sizes.max() * _SINGULAR
    if sizes[:, 1].min() <= limit:
        return transforms
    flat = sizes[:, 2] <= limit  # either side of what is flat may be its front: the one that only turns
    u[flat, :, 2] *= np.sign(np.linalg.det(u @ v))[flat, None]
    rotations = u @ v
    rotations *= np.sign(np.linalg.det(rotations))[:, None, None]
    stretches = rotations.transpose(0, 2, 1) @ linear
    turns = [Matrix(a.T @ b).to_quaternion() for a, b in zip(rotations, rotations[1:])]
    largest = max(turn.angle if turn.angle <= math.pi else 2.0 * math.pi - turn.angle for turn in turns)
    steps = min(math.ceil(largest / _MAX_TURN), (abi.MAX_KEYS - 1) // (count - 1))
    if steps < 2:
        return transforms
    parts = np.arange(steps) / steps
    keys = [matrices[-1:]]
    for i in reversed(range(count - 1)):
        turned = rotations[i] @ np.array([Quaternion().slerp(turns[i], f).to_matrix() for f in parts])
        between = np.empty((steps, 3, 4))
        between[:, :, :3] = turned @ _mix(stretches[i], stretches[i + 1], parts)
        between[:, :, 3] = _mix(matrices[i, :, 3], matrices[i + 1, :, 3], parts)
        keys.insert(0, between)
    return np.concatenate(keys).reshape(-1, 12).astype(np.float32)


def _smallest_axis(linear):
    """Length of the shortest image of an axis in matrices (count, 3, 3)."""
    return np.linalg.norm(linear, axis=1).min()


def _mix(a, b, parts):
    """(parts, ...) from a to b."""
    parts = parts.reshape((-1,) + (1,) * a.ndim)
    return a * (1.0 - parts) + b * parts


def resample(values, count):
    """Keys (n, m) on a straight line from one to the next, as so many."""
    values = np.asarray(values, np.float64)
    old, new = np.linspace(0.0, 1.0, len(values)), np.linspace(0.0, 1.0, count)
    return np.stack([np.interp(new, old, column) for column in values.T], axis=1).astype(np.float32)


def key_index(fraction, count):
    """The key of an object of that many keys at a time, None if it has none there."""
    index = fraction * (count - 1)
    return int(index) if count > 1 and index == int(index) else None
