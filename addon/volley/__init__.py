# SPDX-License-Identifier: GPL-3.0-or-later
"""Volley: packet-based Whitted and distribution ray tracing for Blender. Registration only."""

bl_info = {
    "name": "Volley",
    "author": "The Volley authors",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "Render Properties > Render Engine > Volley",
    "description": "Packet-based Whitted and distribution ray tracing",
    "category": "Render",
}


def _modules():
    """The modules that register something, in order."""
    from . import engine, log, preferences, properties, ui
    return log, preferences, properties, engine, ui


def register():
    """Load the native library and register everything; a load error is shown in the preferences."""
    from . import native
    native.load()
    for module in _modules():
        module.register()


def unregister():
    """The reverse, so that the library's file can be replaced."""
    from . import native
    for module in reversed(_modules()):
        module.unregister()
    native.unload()
