# SPDX-License-Identifier: GPL-3.0-or-later
"""Movies as images: which frame of one, or of a sequence, an image node shows, and how to have Blender read it."""

import bpy

from .. import writes

_CORNER = (0.0, 0.0, 0.0)


def frame_of(image_user, scene_frame):
    """The number of the frame that a node's settings name at a frame of the scene, as Cycles counts: whether they
    refresh is of viewports alone. None is below 0."""
    count = image_user.frame_duration
    place = scene_frame - image_user.frame_start + 1
    if image_user.use_cyclic and count:
        place = (place - 1) % count + 1
    return max(min(max(place, 0), count) + image_user.frame_offset, 0)


def turn_to(image, frame):
    """Have Blender read a frame of a movie, which its pixels then are. Scripts can name one in a texture alone;
    this one lives outside the file's data, so any thread may make it."""
    with bpy.data.temp_data() as data:
        texture = data.textures.new("Frame", 'IMAGE')
        writes.run(lambda: _show(texture, image, frame))


def _show(texture, image, frame):
    texture.image = image
    texture.image_user.frame_current = frame
    texture.evaluate(_CORNER)
    texture.image = None
