# SPDX-License-Identifier: GPL-3.0-or-later
"""IES files (ANSI/IESNA LM-63): what a lamp sends in each direction, as a picture to look it up in.

Horizontal angles go once around, vertical ones from straight down; what the file leaves out by symmetry
is filled in. Photometric types C and B are read, and values between the angles of a file lie on cubics
through four of them, as in Cycles. What lies beyond the first and the last of them is another in Cycles 3, 4
and 5: see IES_ENDS.
"""

import functools
import re

import numpy as np

from ..compat import CLOSES_IES_TYPE_B, IES_ENDS

# Candela to the watts of a light: an efficacy of 177.83 lm/W (D65), times the whole sphere.
_WATTS_PER_CANDELA = 4.0 * np.pi / 177.83

_TYPE_C, _TYPE_B = 1, 2
_NUMBER = re.compile(r"[^\s,]+")


# Of the picture: steps for each of the file's smallest steps, and the most of all.
_STEPS, _MOST_COLUMNS, _MOST_ROWS = 16, 1024, 2048


@functools.lru_cache(maxsize=16)  # a node asks for the picture's size, then for the picture
def web_of(text):
    """A file's horizontal angles (0 to 360 degrees, or a part of them outside of which there is no light) and
    vertical ones, and its values by both, in watts of a light that sends as much everywhere; None for one that
    is no such file."""
    try:
        web = _web_of(text)
    except (ValueError, StopIteration, OverflowError):
        return None
    if web is None or not all(np.isfinite(part).all() for part in web):
        return None
    rises = all(len(angles) > 1 and (np.diff(angles) > 0.0).all() for angles in web[:2])
    return web if rises else None


def picture_size(web):
    """Columns and rows of a web's picture. A web that is the same all around has one column."""
    horizontal, vertical, values = web
    is_round = (values == values[0]).all() and IES_ENDS != 'DARK' and _goes_around(horizontal)
    columns = 1 if is_round else _samples(horizontal, _MOST_COLUMNS)
    return columns, _samples(vertical, _MOST_ROWS)


def picture_of(text):
    """The picture of a file's web, (rows, columns, 3): from the first vertical angle in the first row to the
    last, from the first horizontal angle to the last, all ends included."""
    horizontal, vertical, values = web_of(text)
    columns, rows = picture_size((horizontal, vertical, values))
    down = np.concatenate((_above(vertical, values), values, _below(values)), axis=1)
    by_row = _between(vertical, down, np.linspace(vertical[0], vertical[-1], rows))
    if columns > 1:
        before, after = _beside(by_row.T)
        around = np.concatenate((before, by_row.T, after), axis=1)
        by_row = _between(horizontal, around, np.linspace(horizontal[0], horizontal[-1], columns)).T
    else:
        by_row = by_row[:1]
    picture = np.maximum(by_row.T, 0.0).astype(np.float32)
    return np.repeat(picture[..., None], 3, axis=2)


def _above(vertical, values):
    """What the cubics find before the first vertical angle: on the other side of the pole it goes on as it came."""
    if vertical[0] == 0.0 or IES_ENDS == 'MIRRORED':
        return values[:, 1:2]
    return 0.0 * values[:, :1] if IES_ENDS == 'DARK' else values[:, :1]


def _below(values):
    """The same beyond the last one."""
    return 0.0 * values[:, -1:] if IES_ENDS == 'DARK' else values[:, -1:]


def _beside(values):
    """The same of horizontal angles, before the first and beyond the last."""
    if IES_ENDS == 'MIRRORED':  # around it goes on where it began
        return values[:, -2:-1], values[:, 1:2]
    if IES_ENDS == 'DARK':
        return 0.0 * values[:, :1], 0.0 * values[:, :1]
    return values[:, :1], values[:, -2:-1]


def _goes_around(horizontal):
    return horizontal[0] == 0.0 and horizontal[-1] == 360.0


def _samples(angles, most):
    steps = (angles[-1] - angles[0]) / np.diff(angles).min() * _STEPS
    return int(min(max(round(steps), _STEPS), most - 1)) + 1


def _between(angles, padded, wanted):
    """Values at the wanted angles, on Catmull-Rom splines by the numbers of the angles; padded: rows of
    values, with one more at either end."""
    i = np.clip(np.searchsorted(angles, wanted) - 1, 0, len(angles) - 2)
    t = (wanted - angles[i]) / (angles[i + 1] - angles[i])
    before, first, second, after = (padded[:, i + k] for k in range(4))
    slope, next_slope = 0.5 * (second - before), 0.5 * (after - first)
    rise = second - first
    return first + t * (slope + t * (3.0 * rise - 2.0 * slope - next_slope
                                     + t * (slope + next_slope - 2.0 * rise)))


def _web_of(text):
    """Angles in degrees around and up, and the values by both."""
    start = re.search(r"^\s*TILT=(.*)$", text, re.MULTILINE)
    if start is None:
        return None
    numbers = map(float, _NUMBER.findall(text[start.end():]))
    if start.group(1).strip().startswith("INCLUDE"):
        next(numbers)
        _take(numbers, 2 * _count(numbers))
    _lamps, _lumens, multiplier = _take(numbers, 3)
    vertical_count, horizontal_count = _count(numbers), _count(numbers)
    kind = int(next(numbers))
    _take(numbers, 4)  # the unit of length, and the sizes of the luminous opening
    ballast, ballast_lamp, _watts = _take(numbers, 3)
    vertical, horizontal = _take(numbers, vertical_count), _take(numbers, horizontal_count)
    values = _take(numbers, vertical_count * horizontal_count).reshape(horizontal_count, vertical_count)
    values = values * (multiplier * ballast * ballast_lamp * _WATTS_PER_CANDELA)
    if kind == _TYPE_C:
        return _spread_c(horizontal, vertical, values)
    return _spread_b(horizontal, vertical, values) if kind == _TYPE_B else None


def _count(numbers):
    count = int(next(numbers))
    if not 1 <= count <= 10000:
        raise ValueError(count)
    return count


def _take(numbers, count):
    return np.array([next(numbers) for _ in range(count)])


def _mirrored(angles, values, middle):
    """Angles up to the middle, and as far again beyond it."""
    return (np.concatenate((angles, 2.0 * middle - angles[-2::-1])), np.concatenate((values, values[-2::-1])))


def _closed(horizontal, values):
    """Around to where they began."""
    if horizontal[-1] == 360.0:
        return horizontal, values
    return np.append(horizontal, 360.0), np.concatenate((values, values[:1]))


def _spread_c(horizontal, vertical, values):
    """Around the axis that points straight down."""
    if horizontal[0] == 90.0:
        horizontal = horizontal - 90.0
    if horizontal[0] != 0.0:
        return None
    if horizontal[-1] == 90.0:
        horizontal, values = _mirrored(horizontal, values, 90.0)
    if horizontal[-1] == 180.0:
        horizontal, values = _mirrored(horizontal, values, 180.0)
    horizontal, values = _closed(horizontal, values)
    return horizontal, vertical, values


def _spread_b(horizontal, vertical, values):
    """Around an axis that lies level: its angles change places."""
    horizontal, vertical, values = vertical, horizontal, values.T
    if horizontal[-1] != 90.0 or vertical[-1] != 90.0:
        return None
    horizontal, values = _half_turn(horizontal, values)
    vertical, turned = _half_turn(vertical, values.T)
    values = turned.T
    if CLOSES_IES_TYPE_B:
        horizontal, values = _closed(horizontal, values)
    return horizontal, vertical, values


def _half_turn(angles, values):
    """Angles from -90 to 90, or from 0 for both sides, counted from 0 to 180."""
    if angles[0] == 0.0:
        return (np.concatenate((90.0 - angles[:0:-1], 90.0 + angles)), np.concatenate((values[:0:-1], values)))
    return angles + 90.0, values
