# SPDX-License-Identifier: GPL-3.0-or-later
"""Images: files by their path, everything else by its pixels.

Plain and packed files are read by the library itself, packed ones from copies. Generated and painted images, frames of
movies, and files in formats that the library does not know, or any where it has no OpenImageIO, come from Blender's
pixels. An image that is missing, damaged, too large or whatever else stays without contents, which renders magenta,
with one warning; it never costs the render. Files are read while meshes are, and waited for at the end of a sync.
Colours are converted to scene-linear ones by the library, with Blender's OpenColorIO configuration.
"""

import functools
import os
import re
import tempfile
import zlib
from dataclasses import dataclass

import bpy
import numpy as np

from .. import abi, native, writes
from ..compat import HAS_LITERAL_ALPHA, cycles, working_space
from . import working_space as spaces
from .movie import frame_of, turn_to

_ALPHA_MODES = {'STRAIGHT': abi.AlphaMode.STRAIGHT, 'PREMUL': abi.AlphaMode.PREMULTIPLIED,
                'CHANNEL_PACKED': abi.AlphaMode.CHANNEL_PACKED, 'NONE': abi.AlphaMode.NONE}
_ANIMATED_SOURCES = {'SEQUENCE', 'MOVIE'}
_FILE_SOURCES = {'FILE', 'SEQUENCE', 'TILED'}
_MAX_NUMBERS = (1 << 31) - 1  # of pixels that Blender's Python can count
_MAX_COPIED_BYTES = 1 << 30    # of packed files that wait on the disk to be read

_FIRST_TILE, _TILES_PER_ROW = 1001, 10  # UDIM


@dataclass(frozen=True)
class _Wanted:
    """What the library's image of that id is to show; path: of a file or of a packed one's copy, "" for Blender's
    pixels; tile: the number of one of a tiled image that is packed."""

    image: bpy.types.Image
    path: str
    is_mip_mapped: bool
    tile: int | None
    id: int
    name: str


class Images:
    """The images of one scene of the library, by Blender image and frame."""

    def __init__(self, scene, warnings):
        self._scene, self._warnings = scene, warnings
        self._entries = {}  # key -> (signature, id)
        self._empty = {}    # key -> _Wanted, of files that are being read
        self._copies, self._copied_bytes = None, 0  # folder of packed files among them
        self._seen = set()
        self._look_again = True
        self._limit = 0
        self._frame = 0
        self._asked = set(), False

    def begin(self, changes, limit=0, frame=0):
        """Start a sync: nothing has been asked for yet. Unless changes names images, those known are
        taken as they are. limit: pixels a side, 0 for none; frame: of the scene."""
        self._seen, self._frame = set(), frame
        self._look_again = changes.full or changes.all_materials or limit != self._limit
        self._limit = limit

    def take_asked(self):
        """The keys asked for since the last call, for :meth:`keep`, and whether one of the images may
        be another on the next frame."""
        asked, self._asked = self._asked, (set(), False)
        return asked

    def keep(self, keys):
        """Keep images for whoever has asked for them in a former sync and has not changed."""
        self._seen |= keys

    def id_of(self, node):
        """The library's image of an image or environment texture node, 0 for a missing one."""
        image = node.image
        if image is None:
            return 0
        if image.source == 'MOVIE':
            return self._id_of_path(image, "", _is_mip_mapped(node), frame_of(node.image_user, self._frame))
        path = _path_on_disk(image, frame_of(node.image_user, self._frame))
        is_there = os.path.isfile(path)
        if path and not is_there and image.source == 'SEQUENCE':  # Blender's pixels are those of any of its frames
            self._asked = self._asked[0], True
            self._warnings.add(f"Image '{image.name}': {os.path.basename(path)} is missing, magenta is used")
            return 0
        return self._id_of_path(image, path if is_there else "", _is_mip_mapped(node))

    def tiles_of(self, node):
        """The tiles of a tiled image: (column, row, library's image) of each."""
        image = node.image
        paths = _tile_paths(image)
        found = []
        for number, path in paths:
            packed = None if path else _packed_file(image, number)
            if path or packed or number == paths[0][0]:
                row, column = divmod(number - _FIRST_TILE, _TILES_PER_ROW)
                found.append((column, row, self._id_of_path(image, path, False, tile=packed and number)))
        if len(found) < len(paths):
            self._warnings.add(f"Image '{image.name}': tiles without a file are shown as missing")
        return found

    def _id_of_path(self, image, path, is_mip_mapped, frame=None, tile=None):
        """The library's image of a file of an image, or of what is in the .blend where path is "": of a movie the
        pixels of a frame, of a tiled image that is packed the file of a tile."""
        key = (image.name_full, path, is_mip_mapped, *(each for each in (frame, tile) if each is not None))
        keys, is_animated = self._asked
        keys.add(key)
        self._asked = keys, is_animated or image.source in _ANIMATED_SOURCES
        known = self._entries.get(key)
        if known and (key in self._seen or not self._look_again):
            self._seen.add(key)
            return known[1]
        self._seen.add(key)
        if frame is not None:
            turn_to(image, frame)
        signature = self._signature(image, path, tile)
        if known and known[0] == signature:
            return known[1]
        created = self._scene.create_image(is_mip_mapped=is_mip_mapped)
        self._entries[key] = (signature, created)
        wanted = _Wanted(image, path or self._copy(image, tile), is_mip_mapped, tile, created, image.name)
        if wanted.path:
            self._scene.expect_image(**self._file_values(wanted, wanted.path), **_encoding(image))
            self._empty[key] = wanted
        else:
            self._fill(wanted)
        if self._copied_bytes > _MAX_COPIED_BYTES:
            self._fill_waiting()
        if known:
            self._scene.destroy_image(known[1])
        return created

    def _signature(self, image, path, tile=None):
        return _signature(image, path, tile) + (self._limit, working_space())

    def _file_values(self, wanted, path):
        """A file as keywords of update_image, but for its colour space."""
        return {"path": path, "alpha_mode": _alpha_mode(wanted.image), "is_alpha_literal": HAS_LITERAL_ALPHA,
                "max_side": self._limit, "is_mip_mapped": wanted.is_mip_mapped}

    def id_of_table(self, name, make, *arguments):
        """The library's image of a table (height, width, 3) of scene-linear colours, make(*arguments)."""
        key = (name, arguments)
        self._asked[0].add(key)
        self._seen.add(key)
        if key not in self._entries:
            table = make(*arguments)
            pixels = np.ones(table.shape[:2] + (4,), np.float32)
            pixels[..., :3] = table
            created = self._scene.create_image(
                pixels=pixels, alpha_mode=abi.AlphaMode.CHANNEL_PACKED, is_srgb=False)
            self._entries[key] = (None, created)
        return self._entries[key][1]

    def id_of_file(self, path):
        """The library's image of a file of scene-linear colours, 0 with a warning if it cannot be read."""
        key = ("", path)
        self._asked[0].add(key)
        self._seen.add(key)
        if key not in self._entries:
            try:
                created = self._scene.create_image(
                    path=path, alpha_mode=abi.AlphaMode.CHANNEL_PACKED, is_srgb=False)
            except native.TracerError as error:
                self._warnings.add(f"Image '{path}': {error}; magenta is used")
                created = 0
            self._entries[key] = (None, created)
        return self._entries[key][1]

    def end(self):
        """Free what nothing asked for since begin, and wait for the files of the others."""
        for key in [key for key in self._entries if key not in self._seen]:
            _, image_id = self._entries.pop(key)
            self._empty.pop(key, None)
            if image_id:
                self._scene.destroy_image(image_id)
        self._fill_waiting()

    def _copy(self, image, tile):
        """The path of a copy of an image's packed file, until that is read; "" where there is none, or the library does
        not read it as Blender does."""
        packed = _packed_file(image, tile)
        data = packed.data if packed else b""
        if not data or not _is_read_alike(image, data):
            return ""
        self._copied_bytes += len(data)
        try:
            if self._copies is None:
                self._copies = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
            return _write_copy(image, tile, data, tempfile.mkdtemp(dir=self._copies.name))
        except OSError:  # Blender's pixels serve
            return ""

    def _fill_waiting(self):
        """Wait for the files that are being read."""
        while self._empty:
            self._fill(self._empty.pop(next(iter(self._empty))))
        if self._copies is not None:
            self._copies.cleanup()
        self._copies, self._copied_bytes = None, 0

    def _fill(self, wanted):
        """Give an image its contents; it stays magenta, with a warning, where that cannot be."""
        try:
            if wanted.path:
                self._fill_from_file(wanted, wanted.path)
            else:
                self._fill_from_blend(wanted)
        # RuntimeError: of Blender, ReferenceError: of an image that is gone since
        except (native.TracerError, OSError, RuntimeError, MemoryError, ReferenceError) as error:
            self._warnings.add(f"Image '{wanted.name}': {error or 'no memory'}; magenta is used")

    def _fill_from_blend(self, wanted):
        """From the pixels that Blender has, of a packed tile from those that it reads."""
        packed = None if wanted.tile is None else _packed_file(wanted.image, wanted.tile)
        if packed is None:
            self._fill_from_pixels(wanted, wanted.image)
            return
        with tempfile.TemporaryDirectory() as folder:
            self._fill_as_blender_reads(wanted, _write_copy(wanted.image, wanted.tile, packed.data, folder))

    def _fill_from_file(self, wanted, path):
        """As the library reads it, or as Blender does where the library cannot."""
        try:
            self._fill_in_its_space(wanted, self._file_values(wanted, path))
            return
        except native.TracerError as error:
            if error.status == abi.StatusCode.ERROR_UNSUPPORTED:
                self._warnings.add(f"{error}; Blender reads them")
            elif error.status != abi.StatusCode.ERROR_FORMAT:
                raise
        self._fill_as_blender_reads(wanted, path)

    def _fill_as_blender_reads(self, wanted, path):
        with bpy.data.temp_data() as data:  # the image itself shows any one of its frames or tiles
            self._fill_from_pixels(wanted, _loaded(data, wanted.image, path))

    def _fill_from_pixels(self, wanted, image):
        pixels = read_pixels(image)
        if pixels is None:
            self._warnings.add(f"Image '{image.name}': cannot be read, magenta is used")
            return
        if image.is_float and _is_rec709(image):
            pixels = spaces.rec709_pixels(pixels)
        values = {"pixels": pixels, "alpha_mode": _pixel_alpha_mode(image), "max_side": self._limit,
                  "is_mip_mapped": wanted.is_mip_mapped}
        if image.is_float:
            self._scene.update_image(wanted.id, **values)
        else:
            self._fill_in_its_space(wanted, values)

    def _fill_in_its_space(self, wanted, values):
        """With colours converted, as sRGB where that cannot be."""
        encoding = _encoding(wanted.image)
        try:
            self._scene.update_image(wanted.id, **values, **encoding)
            return
        except native.TracerError as error:
            cannot = error.status in (abi.StatusCode.ERROR_IMAGE, abi.StatusCode.ERROR_UNSUPPORTED)
            if not cannot or "color_space" not in encoding:
                raise
            failure = error
        try:
            self._scene.update_image(wanted.id, **values, is_srgb=True)
        except native.TracerError:
            raise failure from None  # of the file itself
        self._warnings.add(f"Image '{wanted.image.name}': colour space "
                           f"{wanted.image.colorspace_settings.name} cannot be converted, sRGB is used")


def size_limit(scene, is_final):
    """The longest side (pixels) that Simplify allows an image, 0 for any."""
    name = "texture_limit_render" if is_final else "texture_limit"
    limit = getattr(scene.volley, name)
    if limit == 'CYCLES':
        limit = cycles(scene, name, 'OFF')
    return int(limit) if scene.render.use_simplify and limit != 'OFF' else 0


def read_pixels(image):
    """An image's pixels from Blender, (height, width, 4) float32, or uint8 for an 8-bit image, bottom
    row first; None when it has none. Bytes are in the image's own colour space, floats are linear."""
    width, height = image.size
    if not 0 < width * height * image.channels <= _MAX_NUMBERS:  # Blender raises a SystemError above
        return None
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    if not image.is_float:
        np.multiply(pixels, 255.0, out=pixels)
        pixels += 0.5
        pixels = pixels.astype(np.uint8)
    return _to_rgba(pixels.reshape(height, width, -1))


def _loaded(data, image, path):
    """A file of an image as one of its own in data, with the same settings."""
    loaded = data.images.load(path)
    writes.run(lambda: _take_settings(loaded, image))
    return loaded


def _take_settings(loaded, image):
    loaded.colorspace_settings.name = image.colorspace_settings.name
    loaded.alpha_mode = image.alpha_mode


def _to_rgba(pixels):
    """Any number of channels as four."""
    channels = pixels.shape[2]
    if channels == 4:
        return pixels
    opaque = 255 if pixels.dtype == np.uint8 else 1.0
    rgba = np.full(pixels.shape[:2] + (4,), opaque, pixels.dtype)
    rgba[..., :3] = pixels[..., :3] if channels >= 3 else pixels[..., :1]
    if channels == 2:
        rgba[..., 3] = pixels[..., 1]
    return rgba


def _encoding(image):
    """How the colours of an image's file or bytes are stored, as keywords of create_image."""
    space = image.colorspace_settings.name
    if space == "sRGB":
        return {"is_srgb": True}
    if _is_data(image):
        return {}
    config = _color_config()
    return {} if space == _scene_linear(config) else {"color_space": (config, space)}


def _is_data(image):
    settings = image.colorspace_settings
    return settings.is_data or settings.name == "Raw"  # 3.4 has two names, and knows one of them


def _is_rec709(image):
    """Whether the library has an image's colours in Rec.709: sRGB, and what Blender's configuration converts,
    which has that as its scene-linear space; another's may have the working space."""
    if _is_data(image):
        return False
    return image.colorspace_settings.name == "sRGB" or _scene_linear(_color_config()) != working_space()


def image_color(walker, image, color):
    """The colour that an image's texture gives, in the working space."""
    return spaces.from_rec709(walker, color) if image is not None and _is_rec709(image) else color


def _color_config():
    """The OpenColorIO configuration that Blender has read."""
    folders = (bpy.utils.user_resource('DATAFILES', path="colormanagement"),
               bpy.utils.system_resource('DATAFILES', path="colormanagement"))
    paths = [os.path.join(folder, "config.ocio") for folder in folders]
    return os.environ.get("OCIO") or next(filter(os.path.isfile, paths), paths[-1])


@functools.cache
def _scene_linear(config):
    """The name of the scene-linear space in a configuration, None where it does not say: to let the
    library find out that there is nothing to convert takes up to 0.3 s in Blender 4.3."""
    try:
        with open(config, encoding="utf-8") as file:
            role = re.search(r"^ *scene_linear: *([^\n#]*[^\s#])", file.read(), re.MULTILINE)
    except (OSError, UnicodeDecodeError):
        return None
    return role and role[1].strip("'\"")


def _is_mip_mapped(node):
    """Whether lookups of an image node may stand for several texels. Shading is not linear in data,
    such as normals and roughness: their means would shine otherwise."""
    return (node.type == 'TEX_IMAGE' and node.projection == 'FLAT' and node.interpolation != 'Closest'
            and not _is_data(node.image))


def _alpha_mode(image):
    """What an image file's alpha means. As in Cycles, data is not multiplied by it."""
    mode = _ALPHA_MODES.get(image.alpha_mode, abi.AlphaMode.STRAIGHT)
    return abi.AlphaMode.CHANNEL_PACKED if _is_data(image) and mode != abi.AlphaMode.NONE else mode


def _pixel_alpha_mode(image):
    """Alpha of Blender's own buffers: floats are premultiplied, bytes are not, unless the image says so."""
    mode = _alpha_mode(image)
    if HAS_LITERAL_ALPHA or mode in (abi.AlphaMode.NONE, abi.AlphaMode.CHANNEL_PACKED):
        return mode
    return abi.AlphaMode.PREMULTIPLIED if image.is_float else abi.AlphaMode.STRAIGHT


def _path_on_disk(image, frame):
    """The absolute path of an image that lies in a file, which may be missing, "" for one of Blender's own; frame: of
    a sequence."""
    if image.source not in {'FILE', 'SEQUENCE'} or image.packed_file is not None or image.is_dirty:
        return ""
    path = image.filepath_from_user()
    if path and image.source == 'SEQUENCE':
        path = path_in_sequence(path, frame)
    return os.path.abspath(path) if path else ""


_NUMBER = re.compile(r"(\d+)(\D*)$")  # of a sequence: the last digits of the name


def path_in_sequence(path, number):
    """The path of a sequence's file of that number; path: of any of them."""
    folder, name = os.path.split(path)
    return os.path.join(folder, _NUMBER.sub(lambda found: f"{number:0{len(found[1])}d}{found[2]}", name))


def tile_path(image, number):
    """The absolute path of a tile's file, whether it is there or not."""
    row, column = divmod(number - _FIRST_TILE, _TILES_PER_ROW)
    path = image.filepath_raw.replace("<UDIM>", str(number))
    path = path.replace("<UVTILE>", f"u{column + 1}_v{row + 1}")
    return os.path.abspath(bpy.path.abspath(path, library=image.library))


def _readable_tile_path(image, number):
    """The same, "" where there is none to read."""
    path = "" if image.packed_file is not None or image.is_dirty else tile_path(image, number)
    return path if os.path.isfile(path) else ""


def _tile_paths(image):
    """(number, path as of _readable_tile_path) of each tile of an image."""
    return [(tile.number, _readable_tile_path(image, tile.number)) for tile in image.tiles]


def start_reader():
    """Where there are image files, let what reads them load its libraries, some .4 s, while Blender goes on."""
    if any(image.users and image.source in _FILE_SOURCES for image in bpy.data.images):
        native.start_reader()


def _packed_file(image, tile=None):
    """The file inside the .blend that the image shows, or a tile of that number; None: there is none."""
    if image.is_dirty:
        return None
    if image.source == 'TILED':
        return next((each.packed_file for each in image.packed_files if each.tile_number == tile), None)
    return image.packed_file if image.source == 'FILE' else None


def _write_copy(image, tile, data, folder):
    """The path of a packed file, or of that of a tile, written into a folder under its own name."""
    name = os.path.basename(image.filepath if tile is None else tile_path(image, tile))
    path = os.path.join(folder, name or image.name)
    with open(path, "wb") as file:
        file.write(data)
    return path


def _is_read_alike(image, data):
    """Whether a packed file gives what Blender makes of it, which Cycles shows: that converts the colours of floats
    and of 16 bits and multiplies them by alpha, and divides bytes that are said to be multiplied. The library reads
    files in less time and memory."""
    if data[:8] == _PNG and data[_PNG_DEPTH] <= 8 or data[:3] == _JPEG:
        return image.alpha_mode != 'PREMUL'
    if data[:4] == _EXR:
        return not _encoding(image) and (_is_data(image) or image.alpha_mode != 'STRAIGHT')
    return data[:2] == _HDR and not _encoding(image)


# What files begin with, and where PNGs have the bits of a channel.
_PNG, _JPEG, _EXR, _HDR = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"\x76\x2f\x31\x01", b"#?"
_PNG_DEPTH = 24


def _signature(image, path, tile):
    """Equal while the image's pixels and their meaning are."""
    meaning = (image.colorspace_settings.name, image.alpha_mode, path)
    if path:
        try:
            status = os.stat(path)
        except OSError:  # gone since
            return meaning + (None,)
        return meaning + (status.st_mtime_ns, status.st_size)
    packed = _packed_file(image, tile)
    if packed:
        return meaning + (zlib.crc32(packed.data),)
    pixels = read_pixels(image)
    return meaning + ((0,) if pixels is None else (pixels.shape, zlib.crc32(pixels.tobytes())))
