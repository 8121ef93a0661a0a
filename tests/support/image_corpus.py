# SPDX-License-Identifier: Apache-2.0
"""Small valid image files of every format that OpenImageIO was built with, and damaged ones made of them.

    python3 tests/support/image_corpus.py [--fuzz] FOLDER

With --fuzz the files are inputs of tests/fuzz/fuzz_image.c. ``make`` writes the files: those of formats that
OpenImageIO writes by it, those of the others byte by byte. ``damage`` spoils one by a random generator: the same
seed, the same file.
"""

import os
import struct
import sys
import tempfile

import numpy as np
import OpenImageIO as oiio

WIDTH, HEIGHT = 32, 36  # JPEG 2000 is not written for shorter sides

# Name: the type of its pixels, then attributes for OpenImageIO, of which "channels", "parts" and "tile" are
# told otherwise.
_WRITTEN = {
    "bytes.bmp": "uint8", "bytes.dpx": "uint8", "words.dpx": "uint16",
    "ten.dpx": "uint16 oiio:BitsPerSample=10", "floats.fits": "float", "colors.gif": "uint8",
"bytes.heic": "uint8", "bytes.avif": "uint8", "floats.hdr": "float",
    "alpha.ico": "uint8 channels=4", "bytes.iff": "uint8", "bytes.jpg": "uint8", "grey.jpg": "uint8 channels=1",
    "bytes.jp2": "uint8", "words.jp2": "uint16", "plain.exr": "float compression=none",
    "rle.exr": "float compression=rle", "zip.exr": "half compression=zip", "zips.exr": "float compression=zips",
    "piz.exr": "half compression=piz", "pxr24.exr": "float compression=pxr24",
    "b44.exr": "half compression=b44", "b44a.exr": "half compression=b44a", "dwaa.exr": "half compression=dwaa",
    "dwab.exr": "half compression=dwab", "tiles.exr": "half tile=16", "parts.exr": "half parts=2",
    "bytes.png": "uint8", "alpha.png": "uint8 channels=4", "words.png": "uint16", "grey.png": "uint8 channels=1",
    "bytes.ppm": "uint8", "words.pgm": "uint16 channels=1", "bits.pbm": "uint8 channels=1 oiio:BitsPerSample=1",
    "bytes.rla": "uint8", "words.sgi": "uint16", "rle.sgi": "uint8 compression=rle", "bytes.rgb": "uint8",
    "rle.tga": "uint8 compression=rle", "plain.tga": "uint8 compression=none", "lzw.tif": "uint8 compression=lzw",
    "zip.tif": "uint16 compression=zip", "packbits.tif": "uint8 compression=packbits",
    "jpeg.tif": "uint8 compression=jpeg", "tiles.tif": "half tile=16",
    "planes.tif": "uint8 planarconfig=separate", "floats.tif": "float compression=zip", "bytes.webp": "uint8",
    "alpha.webp": "uint8 channels=4", "depth.zfile": "float channels=1"}


def _color(x, y):
    """Bytes of a pixel of the files written here."""
    return x * 255 // WIDTH, y * 255 // HEIGHT, (x * y) % 256


_PIXELS = [_color(x, y) for y in range(HEIGHT) for x in range(WIDTH)]


def _cineon():
    file = struct.pack(">6I8s100s12s12s36x", 0x802A5FD7, 2048, 1024, 1024, 0, 2048 + 4 * len(_PIXELS), b"V4.5",
                       b"cineon", b"", b"")
    channels = b"".join(struct.pack(">4B2I4f", 0, channel, 10, 0, WIDTH, HEIGHT, 0.0, 0.0, 1023.0, 2.046)
                        for channel in (1, 2, 3))
    image = struct.pack(">2B2x224s8f200x28x", 0, 3, channels, *[0.3] * 8)
    data = struct.pack(">4B2I20x", 0, 5, 0, 0, 0, 0)
    words = b"".join(struct.pack(">I", r << 24 | g << 14 | b << 4) for r, g, b in _PIXELS)
    return (file + image + data).ljust(2048, b"\0") + words


def _dds(four_cc=b"\0\0\0\0"):
    is_plain = four_cc == b"\0\0\0\0"
    form = struct.pack("<2I4s5I", 32, 0x41 if is_plain else 4, four_cc, 32, 0xFF0000, 0xFF00, 0xFF, 0xFF000000)
    header = struct.pack("<7I44x32s5I", 124, 0x100F, HEIGHT, WIDTH, 4 * WIDTH, 0, 0, form, 0x1000, 0, 0, 0, 0)
    if is_plain:
        return b"DDS " + header + b"".join(bytes((b, g, r, 200)) for r, g, b in _PIXELS)
    size = 8 if four_cc == b"DXT1" else 16
    return b"DDS " + header + bytes(range(size)) * (WIDTH // 4 * HEIGHT // 4)


def _dicom():
    def element(group, number, kind, value):
        value = value.encode() if isinstance(value, str) else value
        value += (b" " if kind == "CS" else b"\0") * (len(value) % 2)
        long = kind in ("OW", "OB")
        return struct.pack("<2H2s", group, number, kind.encode()) + \
            (struct.pack("<2xI", len(value)) if long else struct.pack("<H", len(value))) + value

    def short(number, value):
        return element(0x28, number, "US", struct.pack("<H", value))

    meta = element(2, 1, "OB", b"\0\1") + element(2, 2, "UI", "1.2.840.10008.5.1.4.1.1.7") + \
        element(2, 3, "UI", "1.2.3.4") + element(2, 0x10, "UI", "1.2.840.10008.1.2.1")
    image = short(2, 1) + element(0x28, 4, "CS", "MONOCHROME2") + short(0x10, HEIGHT) + short(0x11, WIDTH) + \
        short(0x100, 8) + short(0x101, 8) + short(0x102, 7) + short(0x103, 0)
    return bytes(128) + b"DICM" + element(2, 0, "UL", struct.pack("<I", len(meta))) + meta + \
        element(8, 0x16, "UI", "1.2.840.10008.5.1.4.1.1.7") + image + \
        element(0x7FE0, 0x10, "OW", bytes(r for r, _, _ in _PIXELS))


def _photoshop(is_packed):
    header = struct.pack(">4sH6xH2I2H3I", b"8BPS", 1, 3, HEIGHT, WIDTH, 8, 3, 0, 0, 0)
    rows = [bytes(_color(x, y)[c] for x in range(WIDTH)) for c in range(3) for y in range(HEIGHT)]
    if not is_packed:
        return header + struct.pack(">H", 0) + b"".join(rows)
    rows = [bytes((WIDTH - 1,)) + row for row in rows]
    return header + struct.pack(f">H{len(rows)}H", 1, *map(len, rows)) + b"".join(rows)


def _softimage():
    header = struct.pack(">If80s4s2HfHH", 0x5380F634, 3.71, b"", b"PICT", WIDTH, HEIGHT, 1.0, 3, 0)
    rows = b"".join(bytes((128 + 1, *_color(x, y))) for y in range(HEIGHT) for x in range(0, WIDTH, 2))
    return header + bytes((0, 8, 2, 0xE0)) + rows


def _palette_bmp():
    palette = b"".join(bytes((i, 255 - i, i // 2, 0)) for i in range(256))
    offset = 14 + 40 + len(palette)
    pixels = bytes((x * y) % 256 for y in range(HEIGHT) for x in range(WIDTH))
    return struct.pack("<2sI4xI", b"BM", offset + len(pixels), offset) + \
        struct.pack("<I2i2H6I", 40, WIDTH, HEIGHT, 1, 8, 0, len(pixels), 2835, 2835, 256, 0) + palette + pixels


def _float_map():
    return b"PF\n%d %d\n-1.0\n" % (WIDTH, HEIGHT) + b"".join(
        struct.pack("<3f", *(channel / 255.0 for channel in color)) for color in _PIXELS)


def _raw():
    """A digital negative, which is TIFF with a mosaic."""
    entries = []
    extra_at, extra = 8 + 2 + 19 * 12 + 4, b""

    def entry(tag, kind, values):
        nonlocal extra
        code = {1: "B", 2: "B", 3: "H", 4: "I", 10: "i"}[kind]
        data = struct.pack(f"<{len(values)}{code}", *values)
        count = len(values) // (2 if kind == 10 else 1)
        if len(data) > 4:
            entries.append(struct.pack("<2H2I", tag, kind, count, extra_at + len(extra)))
            extra += data + b"\0" * (len(data) % 2)
        else:
            entries.append(struct.pack("<2HI", tag, kind, count) + data.ljust(4, b"\0"))

    matrix = [value for i in range(9) for value in (10000 if i % 4 == 0 else 0, 10000)]
    for tag, kind, values in (
            (254, 4, [0]), (256, 4, [WIDTH]), (257, 4, [HEIGHT]), (258, 3, [16]), (259, 3, [1]),
            (262, 3, [32803]), (271, 2, b"Volley\0"), (272, 2, b"Corpus\0"), (273, 4, [1024]), (277, 3, [1]),
            (278, 4, [HEIGHT]), (279, 4, [2 * WIDTH * HEIGHT]), (284, 3, [1]), (33421, 3, [2, 2]),
            (33422, 1, [0, 1, 1, 2]), (50706, 1, [1, 4, 0, 0]), (50708, 2, b"Volley Corpus\0"),
            (50717, 4, [65535]), (50721, 10, matrix)):
        entry(tag, kind, list(values))
    head = struct.pack("<2sHIH", b"II", 42, 8, len(entries)) + b"".join(entries) + bytes(4) + extra
    return head.ljust(1024, b"\0") + b"".join(struct.pack("<H", r << 8 | g) for r, g, _ in _PIXELS)


def _movie(jpeg):
    """One frame of Motion JPEG."""
    def chunk(name, data):
        return name + struct.pack("<I", len(data)) + data + b"\0" * (len(data) % 2)

    frame = chunk(b"00dc", jpeg)
    header = chunk(b"avih", struct.pack("<14I", 40000, 0, 0, 0x10, 1, 0, 1, len(jpeg), WIDTH, HEIGHT, 0, 0, 0, 0))
    stream = chunk(b"strh", struct.pack("<4s4sI2H8I4H", b"vids", b"MJPG", 0, 0, 0, 0, 1, 25, 0, 1, len(jpeg), 0, 0,
                                        0, 0, WIDTH, HEIGHT))
    form = chunk(b"strf", struct.pack("<I2i2H4s5I", 40, WIDTH, HEIGHT, 1, 24, b"MJPG", 3 * WIDTH * HEIGHT,
                                      0, 0, 0, 0))
    lists = chunk(b"LIST", b"hdrl" + header + chunk(b"LIST", b"strl" + stream + form))
    index = chunk(b"idx1", struct.pack("<4s3I", b"00dc", 0x10, 4, len(jpeg)))
    return chunk(b"RIFF", b"AVI " + lists + chunk(b"LIST", b"movi" + frame) + index)


def _volume():
    """The header of a volume without grids."""
    return b" BDV\0\0\0\0" + struct.pack("<3IB", 224, 10, 0, 1) + b"0" * 36 + struct.pack("<2I", 0, 0)


_BY_HAND = {
    "log.cin": _cineon, "plain.dds": _dds, "dxt1.dds": lambda: _dds(b"DXT1"), "dxt5.dds": lambda: _dds(b"DXT5"),
    "grey.dcm": _dicom, "plain.psd": lambda: _photoshop(False), "packed.psd": lambda: _photoshop(True),
    "mixed.pic": _softimage, "palette.bmp": _palette_bmp, "floats.pfm": _float_map, "mosaic.dng": _raw,
    "empty.vdb": _volume}


def _write(path, data):
    with open(path, "wb") as file:
        file.write(data)
    return path


def _by_oiio(path, pixels, settings):
    """Write pixels (height, width, 4); the list of the path, empty for a format that OpenImageIO cannot write."""
    kind, *words = settings.split()
    values = dict(word.split("=") for word in words)
    channels, parts, tile = (int(values.pop(name, default)) for name, default in
                             (("channels", 3), ("parts", 1), ("tile", 0)))
    specs = []
    for part in range(parts):
        spec = oiio.ImageSpec(WIDTH, HEIGHT, channels, kind)
        spec.tile_width = spec.tile_height = tile
        for name, value in values.items():
            spec.attribute(name, int(value) if value.isdigit() else value)
        if parts > 1:
            spec.attribute("oiio:subimagename", f"part{part}")
        specs.append(spec)
    output = oiio.ImageOutput.create(path)
    if output is None or not output.open(path, tuple(specs) if parts > 1 else specs[0]):
        return []
    is_written = True
    for part, spec in enumerate(specs):
        if part:
            is_written &= output.open(path, spec, "AppendSubimage")
        is_written &= output.write_image(np.ascontiguousarray(pixels[..., :channels]))
    output.close()
    return [path] if is_written else []


def make(folder):
    """Write the corpus; the paths of its files. Formats that OpenImageIO was built without are left out."""
    os.makedirs(folder, exist_ok=True)
    pixels = np.full((HEIGHT, WIDTH, 4), 0.5, np.float32)
    pixels[..., :3] = np.reshape(_PIXELS, (HEIGHT, WIDTH, 3)) / 255.0
    paths = [_write(os.path.join(folder, name), make_one()) for name, make_one in _BY_HAND.items()]
    for name, settings in _WRITTEN.items():
        paths += _by_oiio(os.path.join(folder, name), pixels, settings)
    jpeg = os.path.join(folder, "bytes.jpg")
    if jpeg in paths:
        with open(jpeg, "rb") as file:
            paths.append(_write(os.path.join(folder, "frame.avi"), _movie(file.read())))
    return sorted(paths)


# Formats and settings that change a colour by no more than a byte's rounding.
_EXACT = {"png": "uint8", "tif": "uint16 compression=lzw", "exr": "half compression=zip",
          "tga": "uint8 compression=rle", "bmp": "uint8", "ppm": "uint8", "hdr": "float", "sgi": "uint8"}


def make_plain(folder, count, dice):
    """Write files of one colour each, in several formats; [(path, colour)]."""
    os.makedirs(folder, exist_ok=True)
    made = []
    for number in range(count):
        extension = list(_EXACT)[number % len(_EXACT)]
        color = [dice.randrange(30, 225) / 255.0 for _ in range(3)]
        path = os.path.join(folder, f"plain{number}.{extension}")
        pixels = np.ones((HEIGHT, WIDTH, 4), np.float32)
        pixels[..., :3] = color
        made += [(path, color) for path in _by_oiio(path, pixels, _EXACT[extension])]
    return made


_EXTREME = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0xFFFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
_HEADER_BYTES = 512


def _truncate(data, dice):
    return data[:dice.randrange(len(data))]


def _flip(data, dice):
    spoiled = bytearray(data)
    for _ in range(dice.choice((1, 2, 4, 16))):
        end = len(data) if dice.random() < 0.5 else min(len(data), _HEADER_BYTES)
        spoiled[dice.randrange(end)] ^= 1 << dice.randrange(8)
    return bytes(spoiled)


def _enlarge(data, dice):
    """Numbers of the header become extreme ones, of either byte order."""
    spoiled = bytearray(data)
    for _ in range(dice.choice((1, 1, 2, 3))):
        size = dice.choice((1, 2, 4, 4))
        at = dice.randrange(min(len(data), _HEADER_BYTES))
        value = dice.choice(_EXTREME) & ((1 << 8 * size) - 1)
        spoiled[at:at + size] = value.to_bytes(size, dice.choice(("little", "big")))[:len(data) - at]
    return bytes(spoiled)


def _shuffle(data, dice):
    """A part stands where another was, or is missing, or twice there."""
    begin, end, to = (dice.randrange(len(data) + 1) for _ in range(3))
    part = data[min(begin, end):max(begin, end)][:256]
    return data[:to] + part + data[to + dice.choice((0, len(part))):]


KINDS = {"truncated": _truncate, "flipped": _flip, "enlarged": _enlarge, "shuffled": _shuffle}


def damage(data, kind, dice):
    """A file's bytes spoiled in the way of that name, by a random.Random."""
    return KINDS[kind](data, dice)


# What fuzz_image.c reads before a file: straight alpha, no sRGB, bytes, linear interpolation, and that it is one.
_FUZZ_SETTINGS = bytes((0, 0, 0, 0, 1))


def make_inputs(folder):
    """Write the corpus as inputs of the image fuzzer; their paths."""
    with tempfile.TemporaryDirectory() as files:
        inputs = []
        for path in make(files):
            name = os.path.basename(path)
            with open(path, "rb") as file:
                data = _FUZZ_SETTINGS + name.rpartition(".")[2].encode() + b"\0" + file.read()
            os.makedirs(folder, exist_ok=True)
            inputs.append(_write(os.path.join(folder, name), data))
    return inputs


if __name__ == "__main__":
    made = make_inputs(sys.argv[2]) if sys.argv[1] == "--fuzz" else make(sys.argv[1])
    print("\n".join(made))
