# SPDX-License-Identifier: GPL-3.0-or-later
"""A part of the samples of a frame's layer, as an OpenEXR file.

Its picture can be looked at; beside it are the film's sums, from which :mod:`merge` makes the frame. A
double is the bits of two integers, or one number where that holds it whole. The metadata say of what file,
settings and version it is and which samples it has, and have a digest of all that.
"""

import contextlib
import hashlib
import json
import os
import re
import zlib

import bpy
import numpy as np

from .. import native, passes
from ..abi import SUMS_END
from . import exr, files, job

ATTRIBUTE = "volley:part"
EXTENSION = ".part.exr"
_DIGEST = "volley:digest"
_MAX_CHARACTERS = 48  # of each name in a file's; systems allow 255 bytes in all
# Fields of trc_render_desc in which parts of a picture may differ.
_OWN_FIELDS = {"sample_offset", "sample_subset", "thread_count", "progressive"}


class PartError(Exception):
    """A file that is no part, or one that does not fit others."""


# What a part is made of --------------------------------------------------------------------------

def identity(scene, fields, layer_name, view_name):
    """What all parts of a picture have in common, {group: {name: value}}, as JSON can hold it."""
    settings = {name: float(value) if isinstance(value, float) else int(value)
                for name, value in fields.items() if name not in _OWN_FIELDS}
    return {"frame": {"number": scene.frame_current, "layer": layer_name, "view": view_name},
            "version": version(), "settings": settings, "file": digests(scene)}


def version():
    """{name: version} of what renders."""
    return {"volley": native.description().rsplit(", ", 1)[0], "blender": bpy.app.version_string}


def digests(scene):
    """{name: digest} of the file and of those that a frame reads."""
    if not bpy.data.filepath:
        raise PartError("parts are of a saved file")
    return files.digests(scene.frame_current)


# Files -------------------------------------------------------------------------------------------

def path_of(folder, scene, layer_name, view_name, begin, end):
    """Where a part belongs."""
    names = [_file_name(name) for name in (scene.name, layer_name, view_name) if name]
    return os.path.join(folder, f"{scene.frame_current:06d}.{'.'.join(names)}.{begin:07d}-{end:07d}{EXTENSION}")


def _file_name(name):
    """A name of Blender's for a part of a file's: other names have others, and none is too long."""
    plain = re.sub(r"[^A-Za-z0-9_-]", "_", name)[:_MAX_CHARACTERS]
    return plain if plain == name else f"{plain}-{zlib.crc32(name.encode()):08x}"


def write(folder, scene, render, entries, fields, layer_name, view_name, content, manifests):
    """Write a finished render as a part. entries: of passes; content: as content.NotedScene has it; manifests:
    attributes of Cryptomatte."""
    begin = fields["sample_offset"]
    end = begin + (fields["sample_subset"] or fields["sample_count"] - begin)
    sums = {number: render.read_sums(number) for number in range(SUMS_END) if render.sums_channels(number)}
    width, height = render.size
    channels = {}
    for number, values in sums.items():
        planes = values.reshape(height, width, -1)
        for index in range(planes.shape[2]):
            channels.update(_split(f"sums.{number:03d}.{index:02d}", planes[..., index]))
    combined = passes.read_combined(render)
    channels.update((letter, np.ascontiguousarray(combined[..., index]))
                    for index, letter in enumerate("RGBA"))
    about = {"identity": identity(scene, fields, layer_name, view_name), "begin": begin, "end": end,
             "content": content,
             "isa": native.description().rsplit(", ", 1)[1],
             "passes": [[int(entry.index), passes.name_of(entry), entry.channels] for entry in entries],
             "manifests": manifests, "pixels": _digest_of(channels)}
    text = json.dumps(about, sort_keys=True)
    os.makedirs(folder, exist_ok=True)
    path = path_of(folder, scene, layer_name, view_name, begin, end)
    exr.write(path, render.size, channels, {ATTRIBUTE: text, _DIGEST: _digest_of_text(text)})
    job.job().part_paths.append(path)


def _digest_of_text(text):
    return hashlib.sha256(text.encode()).hexdigest()


def _digest_of(channels):
    digest = hashlib.sha256()
    for name in sorted(channels):
        digest.update(name.encode())
        digest.update(channels[name].tobytes())
    return digest.hexdigest()


def _split(name, values):
    """{channel: array} that hold doubles to the bit."""
    values = np.ascontiguousarray(values)
    bits = values.view("<u8")
    for letter, dtype in (("U", "<u4"), ("F", "<f4")):
        with np.errstate(all="ignore"):
            narrow = values.astype(dtype)
        if (narrow.astype("<f8").view("<u8") == bits).all():
            return {f"{name}.{letter}": narrow}
    return {f"{name}.H": (bits >> np.uint64(32)).astype("<u4"), f"{name}.L": bits.astype("<u4")}


class Part:
    """A part's file. ``begin``, ``end``: its samples; ``identity``: as :func:`identity`; ``content``: as
    content.NotedScene has it."""

    def __init__(self, path):
        """Read what it says of itself; PartError says what is wrong with it."""
        self.path = path
        with self._errors():
            self.size, attributes = exr.read_header(path)
        self._text = attributes.get(ATTRIBUTE)
        if self._text is None:
            raise PartError(f"{path}: it is not a part of a render")
        if attributes.get(_DIGEST) != _digest_of_text(self._text):
            raise PartError(f"{path}: it is damaged")
        about = json.loads(self._text)
        self.begin, self.end, self.identity = about["begin"], about["end"], about["identity"]
        self.content, self._pixels = about["content"], about["pixels"]
        self.isa, self.passes, self.manifests = about["isa"], about["passes"], about["manifests"]

    @contextlib.contextmanager
    def _errors(self):
        try:
            yield
        except exr.ExrError as error:
            raise PartError(f"{self.path}: {error}") from error
        except OSError as error:
            raise PartError(f"{self.path}: {error.strerror or error}") from error

    def channels(self):
        """Read the rest, which is whole and what it was; PartError otherwise."""
        with self._errors():
            size, channels, attributes = exr.read(self.path)
        if (size, attributes.get(ATTRIBUTE)) != (self.size, self._text):
            raise PartError(f"{self.path}: it changed meanwhile")
        if self._pixels != _digest_of(channels):
            raise PartError(f"{self.path}: it is damaged")
        return channels

    def sums(self):
        """{number: doubles, flat}, read."""
        planes = {}
        for name, values in self.channels().items():
            if name.startswith("sums."):
                _, number, index, letter = name.split(".")
                planes.setdefault(int(number), {}).setdefault(int(index), {})[letter] = values
        return {number: np.stack([_joined(by_index[index]) for index in sorted(by_index)], axis=-1).reshape(-1)
                for number, by_index in planes.items()}


def _joined(by_letter):
    if "H" in by_letter:
        bits = by_letter["H"].astype("<u8") << np.uint64(32) | by_letter["L"]
        return bits.view("<f8")
    return next(iter(by_letter.values())).astype("<f8")
