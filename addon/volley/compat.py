# SPDX-License-Identifier: GPL-3.0-or-later
"""Where Blender's versions differ, found by looking at what is there.

Per-object ray tracing settings (motion steps, emission sampling and so on) live in the property groups
of Blender's own Cycles add-on; they are read where that add-on is enabled, else its defaults hold.
"""

import math

import bpy

# Render passes were renamed in 5.0, which leaves nothing to look at but the version.
HAS_LONG_PASS_NAMES = bpy.app.version >= (5, 0, 0)

# The power of an area light became its radiance times pi and its area in 4.0; before, times 4 (Blender's
# issue 109404).
AREA_LIGHT_POWER = 4.0 / math.pi if bpy.app.version >= (4, 0, 0) else 1.0


def cycles(data, name, default):
    """``data.cycles.name`` where Cycles' property groups exist, else default."""
    return getattr(getattr(data, "cycles", None), name, default)


def motion_position(scene):
    """Where the shutter interval lies: 'START', 'CENTER' or 'END'."""
    own = getattr(scene.render, "motion_blur_position", None)
    return own if own is not None else cycles(scene, "motion_blur_position", 'CENTER')


def uses_nodes(data):
    """Whether the node tree of a material, world or light rules (from 5.0 on it always does)."""
    return data.node_tree is not None and getattr(data, "use_nodes", True)


def casts_shadow(light):
    """A light's shadow switch: Blender's own from 4.2 or Cycles', whichever is off."""
    return getattr(light, "use_shadow", True) and cycles(light, "cast_shadow", True)


def aov_name(node):
    """The AOV that an AOV Output node writes; till 4.1 it is the name of the node."""
    return getattr(node, "aov_name", node.name)
