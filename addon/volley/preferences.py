# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's preferences: the state of the native library."""

import bpy

from . import native


class VolleyPreferences(bpy.types.AddonPreferences):
    """Shows which library was loaded, or why none was."""

    bl_idname = __package__

    def draw(self, _context):
        column = self.layout.column()
        error = native.load_error()
        if not error:
            column.label(text=native.description(), icon='CHECKMARK')
            return
        column.alert = True
        column.label(text="The native library could not be loaded; nothing can be rendered",
                     icon='ERROR')
        for line in error.splitlines():
            column.label(text=line)


def register():
    bpy.utils.register_class(VolleyPreferences)


def unregister():
    bpy.utils.unregister_class(VolleyPreferences)
