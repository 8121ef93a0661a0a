# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's evaluated scene into a scene of the library.

scene.SceneSync holds what is in the library and brings it up to date with a depsgraph. Nothing of
Blender is kept from one sync to the next but names and numbers.
"""

from .scene import SceneSync
from .source import Cancelled, Source

__all__ = ("Cancelled", "SceneSync", "Source")
