# SPDX-License-Identifier: GPL-3.0-or-later
"""Volley: packet-based Whitted and distribution ray tracing for Blender. Registration only."""

import sys

bl_info = {
    "name": "Volley",
    "author": "The Volley authors",
    "version": (0, 0, 0),  # the build fills in that of the library
    "blender": (3, 4, 0),
    "location": "Render Properties > Render Engine > Volley",
    "description": "Packet-based Whitted and distribution ray tracing",
    "category": "Render",
}


def _forget_submodules():
    """Have the modules of this package imported anew. Where a newer version is installed in a running
    Blender, it reloads this file alone."""
    for name in [name for name in sys.modules if name.startswith(f"{__name__}.")]:
        del sys.modules[name]
        globals().pop(name[len(__name__) + 1:], None)


_forget_submodules()
_registered = globals().get("_registered", [])  # modules, in order; kept where this file is reloaded


def register():
    """Load the native library and register everything; a load error is shown in the preferences."""
    from . import (
        denoise_nodes, engine, from_cycles, log, native, node_menus, preferences, presets, properties, ui, writes)
    from .farm import command, operator
    native.load()
    for module in (log, writes, preferences, properties, from_cycles, presets, engine, denoise_nodes, ui, node_menus,
                   command, operator):
        module.register()
        _registered.append(module)


def unregister():
    """The reverse, so that the files can be replaced."""
    while _registered:
        _registered.pop().unregister()
    from . import native
    native.unload()
