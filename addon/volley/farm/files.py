# SPDX-License-Identifier: GPL-3.0-or-later
"""The files that a render of a frame reads: the .blend, its libraries, images (of sequences the one of the frame,
of tiled ones each tile), IES files, caches of geometry and fonts; and digests of their bytes.

Not among them: caches of physics beside the .blend, and what add-ons and scripts read.
"""

import hashlib
import itertools
import os

import bpy

from ..sync.image import path_in_sequence, tile_path
from ..sync.movie import frame_of

_BLOCK_BYTES = 1 << 20
_BUILT_IN = "<builtin>"                 # of a font


def paths(frame):
    """{name: absolute path} of all but the .blend itself, whether they are there or not."""
    found = {f"library {library.name}": bpy.path.abspath(library.filepath)
             for library in bpy.data.libraries if not library.packed_file}
    found.update((f"cache {cache.name_full}", _absolute(cache.filepath, cache))
                 for cache in bpy.data.cache_files if cache.users)
    found.update((f"cache {owner.name_full} {modifier.name}", _absolute(modifier.filepath, owner))
                 for owner in bpy.data.objects if owner.users for modifier in owner.modifiers
                 if modifier.type == 'MESH_CACHE' and modifier.show_render and modifier.filepath)
    found.update((f"font {font.name_full}", _absolute(font.filepath, font)) for font in bpy.data.fonts
                 if font.users and not font.packed_file and font.filepath != _BUILT_IN)
    for image in bpy.data.images:
        if image.users and image.filepath and not image.packed_file:
            found.update(_of_image(image))
    for image, user in _image_users():
        if image.source == 'SEQUENCE' and image.filepath and not image.packed_file:
            number = frame_of(user, frame)
            found[f"image {image.name_full} {number}"] = path_in_sequence(_absolute(image.filepath, image), number)
    for tree in _trees():
        for node in tree.nodes:
            if node.type == 'TEX_IES' and node.mode == 'EXTERNAL' and node.filepath:
                path = _absolute(node.filepath, tree)
                found[_free_name(f"light {os.path.basename(path)}", path, found)] = path
    return found


def digests(frame):
    """{name: digest} of the .blend and of :func:`paths`; "missing" where there is no file."""
    return {"scene": _digest_of(bpy.data.filepath),
            **{name: _digest_of(path) for name, path in paths(frame).items()}}


def _free_name(name, path, found):
    """The name, with a number where it stands for another path already."""
    names = itertools.chain([name], (f"{name} {number}" for number in itertools.count(2)))
    return next(each for each in names if found.get(each, path) == path)


def _absolute(path, owner):
    return os.path.abspath(bpy.path.abspath(path, library=owner.library))


# Images ------------------------------------------------------------------------------------------

def _of_image(image):
    """Names and paths of an image that is the same in all frames."""
    if image.source in {'FILE', 'MOVIE'}:
        yield f"image {image.name_full}", _absolute(image.filepath, image)
    elif image.source == 'TILED':
        for tile in image.tiles:
            yield f"image {image.name_full} {tile.number}", tile_path(image, tile.number)


def _trees():
    owners = (*bpy.data.materials, *bpy.data.worlds, *bpy.data.lights)
    return [*(owner.node_tree for owner in owners if owner.node_tree is not None), *bpy.data.node_groups]


def _image_users():
    """(image, what says which of its pictures is shown)."""
    found = [(node.image, node.image_user) for tree in _trees() for node in tree.nodes
             if node.type in {'TEX_IMAGE', 'TEX_ENVIRONMENT'}]
    found += [(texture.image, texture.image_user) for texture in bpy.data.textures if texture.type == 'IMAGE']
    return [(image, user) for image, user in found if image is not None]


# Bytes -------------------------------------------------------------------------------------------

_known = {}  # digests by path, time and size: frames of an animation share most files


def _digest_of(path):
    try:
        status = os.stat(path)
        key = path, status.st_mtime_ns, status.st_size
        if key not in _known:
            digest = hashlib.sha256()
            with open(path, "rb") as file:
                for block in iter(lambda: file.read(_BLOCK_BYTES), b""):
                    digest.update(block)
            _known[key] = digest.hexdigest()
        return _known[key]
    except OSError:
        return "missing"
