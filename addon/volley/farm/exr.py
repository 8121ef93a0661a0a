# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenEXR files of scan lines, with float and 32-bit integer channels: parts and merged frames.

Written here, as no module that Blender brings in all its versions writes both types into one file.
Format: "OpenEXR File Layout", Academy Software Foundation. Of what can be in such files, those that
this module writes are read: one part, zip compression, channels of 32 bits.
"""

import contextlib
import os
import struct
import tempfile
import zlib

import numpy as np

_MAGIC = 20000630
_VERSION = 2
_LONG_NAMES = 0x400         # names of more than 31 bytes
_SHORT_NAME_BYTES = 31
_ZIP = 3
_CHUNK_LINES = 16           # of zip compression
_TYPES = {np.dtype("<u4"): 0, np.dtype("<f4"): 2}
_DTYPES = {number: dtype for dtype, number in _TYPES.items()}
_COMPRESSION_LEVEL = 1      # sums are noise below their first digits: more effort gains nothing
_MAX_SIDE = 65536
_HEADER_BYTES = 1 << 16     # read at once of a header


class ExrError(Exception):
    """A file is none of those that this module reads, or damaged."""


def write(path, size, channels, attributes):
    """Write a file, which is there whole or not at all. channels: {name: (height, width) float32 or uint32,
    bottom row first}; attributes: {name: text}."""
    width, height = size
    names = sorted(channels, key=lambda name: name.encode())
    arrays = [channels[name] for name in names]
    header = _header(width, height, zip(names, arrays), attributes)
    chunks = [_compressed(arrays, height, first) for first in range(0, height, _CHUNK_LINES)]
    starts = len(header) + 8 * len(chunks) + np.cumsum([0] + [8 + len(chunk) for chunk in chunks[:-1]])
    pieces = [header, starts.astype("<u8").tobytes()]
    for index, chunk in enumerate(chunks):
        pieces += struct.pack("<ii", index * _CHUNK_LINES, len(chunk)), chunk
    write_whole(path, pieces)


def write_whole(path, pieces):
    """Write bytes to a file beside it, have them on the disk, and give it the name."""
    folder = os.path.dirname(path) or "."
    number, other = tempfile.mkstemp(prefix=f".{os.path.basename(path)}.", suffix=".part", dir=folder)
    try:
        with os.fdopen(number, "wb") as file:
            for piece in pieces:
                file.write(piece)
            file.flush()
            os.fsync(file.fileno())
            if os.name == "posix":
                mask = os.umask(0)
                os.umask(mask)
                os.fchmod(file.fileno(), 0o666 & ~mask)
        os.replace(other, path)
    except BaseException:
        os.unlink(other)
        raise


def _header(width, height, channels, attributes):
    names = [*attributes]
    entries = b""
    for name, array in channels:
        names.append(name)
        entries += name.encode() + b"\0" + struct.pack("<iiii", _TYPES[array.dtype], 0, 1, 1)
    is_long = any(len(name.encode()) > _SHORT_NAME_BYTES for name in names)
    window = struct.pack("<iiii", 0, 0, width - 1, height - 1)
    values = [("channels", "chlist", entries + b"\0"), ("compression", "compression", bytes([_ZIP])),
              ("dataWindow", "box2i", window), ("displayWindow", "box2i", window),
              ("lineOrder", "lineOrder", b"\0"), ("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
              ("screenWindowCenter", "v2f", struct.pack("<ff", 0.0, 0.0)),
              ("screenWindowWidth", "float", struct.pack("<f", 1.0)),
              *((name, "string", value.encode()) for name, value in attributes.items())]
    text = b"".join(name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
                    for name, kind, value in values)
    return struct.pack("<ii", _MAGIC, _VERSION | (_LONG_NAMES if is_long else 0)) + text + b"\0"


def _compressed(arrays, height, first):
    """The lines from first on, counted from above, as a chunk."""
    last = min(first + _CHUNK_LINES, height)
    lines = np.stack([array[height - last:height - first][::-1].view("<u4") for array in arrays], axis=1)
    raw = np.ascontiguousarray(lines).reshape(-1).view(np.uint8)
    parted = np.concatenate([raw[0::2], raw[1::2]])
    steps = parted.copy()
    steps[1:] = parted[1:] - parted[:-1] + np.uint8(128)
    data = zlib.compress(steps.tobytes(), _COMPRESSION_LEVEL)
    return data if len(data) < len(raw) else raw.tobytes()


def read(path):
    """(width, height), channels and attributes of a file, as :func:`write` takes them. ExrError, OSError."""
    with open(path, "rb") as file:
        data = file.read()
    with _damage():
        return _parsed(data)


def read_header(path):
    """(width, height) and attributes alone."""
    with open(path, "rb") as file:
        data = file.read(_HEADER_BYTES)
        while True:
            block = file.read(_HEADER_BYTES)
            try:
                with _damage():
                    fields, _ = _fields(data)
                    return _size(fields), _attributes(fields)
            except ExrError:
                if not block:
                    raise
            data += block


@contextlib.contextmanager
def _damage():
    """Whatever damaged bytes lead to, as an ExrError."""
    try:
        yield
    except (struct.error, zlib.error, ValueError, IndexError, KeyError, MemoryError) as error:
        raise ExrError(f"it is damaged, or no file of this kind ({error})") from error


def _parsed(data):
    fields, at = _fields(data)
    width, height = _size(fields)
    channels = _channels(fields["channels"])
    counts = -(-height // _CHUNK_LINES)
    starts = struct.unpack_from(f"<{counts}Q", data, at)
    lines = np.concatenate([_lines(data, start, width, len(channels), height, index * _CHUNK_LINES)
                            for index, start in enumerate(starts)])[::-1]
    arrays = {name: np.ascontiguousarray(lines[:, index]).view(dtype)
              for index, (name, dtype) in enumerate(channels)}
    return (width, height), arrays, _attributes(fields)


def _size(fields):
    if fields["compression"] != bytes([_ZIP]):
        raise ExrError("its compression is not zip")
    x, y, right, top = struct.unpack("<iiii", fields["dataWindow"])
    width, height = right - x + 1, top - y + 1
    if (x, y) != (0, 0) or not (0 < width <= _MAX_SIDE and 0 < height <= _MAX_SIDE):
        raise ExrError("its window is none of a part or a frame")
    return width, height


def _attributes(fields):
    return {name: value.decode() for name, value in fields.items() if ":" in name or "/" in name}


def _fields(data):
    """{name: bytes} of the header, and where it ends."""
    if len(data) < 8 or struct.unpack_from("<i", data)[0] != _MAGIC:
        raise ExrError("it is no OpenEXR file")
    fields, at = {}, 8
    while data[at]:
        end = data.index(b"\0", at)
        kind_end = data.index(b"\0", end + 1)
        size, = struct.unpack_from("<i", data, kind_end + 1)
        begin = kind_end + 5
        if size < 0 or begin + size > len(data):
            raise ExrError("its header is damaged")
        fields[data[at:end].decode()] = data[begin:begin + size]
        at = begin + size
    return fields, at + 1


def _channels(text):
    found, at = [], 0
    while text[at]:
        end = text.index(b"\0", at)
        number, _, _, _ = struct.unpack_from("<iiii", text, end + 1)
        if number not in _DTYPES:
            raise ExrError("a channel has not 32 bits")
        found.append((text[at:end].decode(), _DTYPES[number]))
        at = end + 17
    return found


def _lines(data, start, width, channel_count, height, first):
    """A chunk: (lines, channels, width) uint32, from above."""
    y, size = struct.unpack_from("<ii", data, start)
    count = min(_CHUNK_LINES, height - first)
    byte_count = 4 * count * channel_count * width
    chunk = data[start + 8:start + 8 + size]
    if y != first or size < 0 or len(chunk) != size:
        raise ExrError("it is cut short")
    if size < byte_count:
        unpacker = zlib.decompressobj()
        chunk = unpacker.decompress(chunk, byte_count)
        if not unpacker.eof:
            unpacker.decompress(unpacker.unconsumed_tail)
        steps = np.frombuffer(chunk, np.uint8)
        if len(steps) != byte_count or not unpacker.eof:
            raise ExrError("a chunk is damaged")
        parted = np.cumsum(steps, dtype=np.uint8)
        parted[1::2] += np.uint8(128)
        half = (byte_count + 1) // 2
        raw = np.empty(byte_count, np.uint8)
        raw[0::2], raw[1::2] = parted[:half], parted[half:]
    else:
        raw = np.frombuffer(chunk, np.uint8)
    return raw.view("<u4").reshape(count, channel_count, width)
