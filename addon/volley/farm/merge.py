# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of frames put together: each frame as a multilayer OpenEXR file, the bits of one render.

A frame whose parts do not fit is refused with the reason, and what was there before stays.
"""

import glob
import os

import numpy as np

from .. import native
from ..abi import SumsId
from . import exr
from .parts import EXTENSION, Part, PartError

_WAIT_FOREVER = -1.0


def frames_in(folder):
    """{frame number: paths of its parts} of a folder."""
    return frames_of(glob.glob(os.path.join(glob.escape(folder), f"*{EXTENSION}")))


def frames_of(paths):
    """{frame number: paths of its parts} by their names, in order; what is named otherwise is left out."""
    found = {}
    for path in sorted(paths):
        number = os.path.basename(path).split(".")[0]
        if path.endswith(EXTENSION) and number.lstrip("-").isdigit():
            found.setdefault(int(number), []).append(path)
    return found


def output_path(pattern, frame):
    """The pattern with its last run of # as the frame's digits, or the number at its end, and .exr."""
    stem = pattern[:-4] if pattern.lower().endswith(".exr") else pattern
    end = stem.rfind("#") + 1
    if not end:
        stem, end = f"{stem}####", len(stem) + 4
    begin = end - (len(stem[:end]) - len(stem[:end].rstrip("#")))
    return f"{stem[:begin]}{frame:0{end - begin}d}{stem[end:]}.exr"


def merge_frame(paths, output):
    """Write the frame of these parts; PartError says why not, OSError that it cannot be written. Warnings are
    returned."""
    layers, warnings = _checked(paths)
    channels, attributes, size = {}, {}, None
    for parts in layers:
        if size not in (None, parts[0].size):
            raise PartError(f"{parts[0].path}: its size is another than that of {layers[0][0].path}")
        size = parts[0].size
        channels.update(_merged(parts))
        attributes.update(parts[0].manifests)
    exr.write(output, size, channels, attributes)
    return warnings


# What fits ---------------------------------------------------------------------------------------

def _checked(paths):
    """Parts by layer and view, each list in order and whole; and warnings."""
    layers = {}
    for path in paths:
        part = Part(path)
        layers.setdefault((part.identity["frame"]["layer"], part.identity["frame"]["view"]), []).append(part)
    if not layers:
        raise PartError("there are no parts")
    first = next(iter(layers.values()))[0]
    for parts in layers.values():
        parts.sort(key=lambda part: part.begin)
        for part in parts:
            _check_identity(first, part, ("version", "file"))
            _check_identity(parts[0], part, ("frame", "settings"))
            _check_content(parts[0], part)
            if part.size != parts[0].size or part.passes != parts[0].passes:
                raise PartError(f"{part.path}: size or passes are others than in {parts[0].path}")
        _check_range(parts)
    machines = sorted({part.isa for parts in layers.values() for part in parts})
    warnings = [f"parts were rendered with different instructions ({', '.join(machines)}): last digits may "
                "differ from one machine's"] if len(machines) > 1 else []
    return list(layers.values()), warnings


def _check_identity(one, other, groups):
    for group in groups:
        ours, theirs = one.identity[group], other.identity[group]
        for name in sorted({*ours, *theirs}):
            if ours.get(name) != theirs.get(name):
                raise PartError(f"{other.path}: its {group} is another than in {one.path}: {name} is "
                                f"{theirs.get(name)}, not {ours.get(name)}")


def _check_content(one, other):
    """That scripts did not change one of them after the file was read; rounding of places is none of theirs."""
    digests, places = one.content
    other_digests, other_places = other.content
    differing = {name for name in digests if digests[name] != other_digests[name]}
    differing |= {name for name, (place, tolerance) in places.items()
                  if not abs(place - other_places[name][0]) <= tolerance}
    if differing:
        raise PartError(f"{other.path}: its scene was changed after the file was read, or that of {one.path}: "
                        f"{', '.join(sorted(differing))}")


def _check_range(parts):
    """That there is every sample once."""
    total, end = parts[0].identity["settings"]["sample_count"], 0
    for before, part in zip([None, *parts], parts):
        if part.begin < end:
            raise PartError(f"{part.path}: samples {part.begin} to {part.end} overlap those of {before.path}")
        if part.begin > end:
            raise PartError(f"{part.path}: a part is missing before it: samples {end} to {part.begin}")
        end = part.end
    if end != total:
        raise PartError(f"{parts[-1].path}: a part is missing after it: samples {end} to {total}")


# Sums --------------------------------------------------------------------------------------------

def _merged(parts):
    """{channel: array} of a layer."""
    identity = parts[0].identity
    render = None
    try:
        for part in parts:
            sums = part.sums()
            if render is None:
                render = native.start_merge(SumsId.CATCHERS in sums, **identity["settings"])
            try:
                render.add_part(part.begin, part.end - part.begin, sums)
            except native.TracerError as error:
                raise PartError(f"{part.path}: {error}") from error
        render.finish_merge()
        render.wait(_WAIT_FOREVER)
        return _read(render, identity["frame"], parts[0].passes)
    finally:
        if render is not None:
            render.destroy()


def _read(render, frame, passes):
    width, height = render.size
    channels = {}
    for index, name, letters in passes:
        pixels = render.read(index, np.empty(width * height * len(letters), np.float32))
        planes = pixels.reshape(height, width, len(letters))
        prefix = ".".join(text for text in (frame["layer"], name, frame["view"]) if text)
        channels.update((f"{prefix}.{letter}", np.ascontiguousarray(planes[..., k]))
                        for k, letter in enumerate(letters))
    return channels
