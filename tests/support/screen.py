# SPDX-License-Identifier: Apache-2.0
"""What a virtual display shows, read from the file that Xvfb keeps its memory in (its option -fbdir), which
VOLLEY_SCREEN names. Screenshots by Blender are black there from 4.3 on.
"""

import mmap
import os
import struct

import numpy as np

_HEADER_WORDS = 25
_COLOR_BYTES = 12  # of an entry of the colour map, between header and pixels


class Screen:
    """The screen's pixels as they are now, BGR bytes, the highest row first: (height, width, 3)."""

    def __init__(self, path=None):
        with open(path or os.environ["VOLLEY_SCREEN"], "rb") as file:
            memory = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        header = struct.unpack(f">{_HEADER_WORDS}I", memory[:4 * _HEADER_WORDS])
        header_bytes, width, height, row_bytes, color_count = (header[word] for word in (0, 4, 5, 12, 19))
        pixels = np.frombuffer(memory, np.uint8, height * row_bytes, header_bytes + _COLOR_BYTES * color_count)
        self.pixels = pixels.reshape(height, -1, 4)[:, :width, :3]

    def picture(self):
        """A copy as float32 RGB from 0 to 1, the lowest row first, as Blender counts them."""
        return (self.pixels[::-1, :, ::-1] / 255.0).astype(np.float32)
