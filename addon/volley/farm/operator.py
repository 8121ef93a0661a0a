# SPDX-License-Identifier: GPL-3.0-or-later
"""Merging in Blender's window: parts are chosen in the file browser, reports say what became of each frame."""

import os

import bpy
from bpy.props import CollectionProperty, StringProperty
from bpy.types import Operator, OperatorFileListElement

from .. import native
from . import merge
from .parts import EXTENSION, PartError


class VOLLEY_OT_merge_parts(Operator):
    """Merge parts of the samples of frames, each frame to a multilayer OpenEXR file. Without a choice of files
    all parts in the folder are taken"""

    bl_idname = "volley.merge_parts"
    bl_label = "Merge Parts"

    directory: StringProperty(subtype='DIR_PATH', options={'SKIP_SAVE'})
    files: CollectionProperty(type=OperatorFileListElement, options={'HIDDEN', 'SKIP_SAVE'})
    filter_glob: StringProperty(default=f"*{EXTENSION}", options={'HIDDEN'})
    output: StringProperty(
        name="Output", default="frame_####",
        description="Name of the merged frames, #### for the number; beside the parts unless it has a folder")

    @classmethod
    def poll(cls, context):
        if native.load_error():
            cls.poll_message_set(native.load_error())
            return False
        return True

    def invoke(self, context, _event):
        context.window_manager.fileselect_add(self)
        return {'RUNNING_MODAL'}

    def draw(self, _context):
        self.layout.label(text="Merged Frames")
        self.layout.prop(self, "output", text="")

    def execute(self, context):
        folder = bpy.path.abspath(self.directory)
        names = [file.name for file in self.files if file.name]
        frames = merge.frames_of(os.path.join(folder, name) for name in names) if names \
            else merge.frames_in(folder)
        if not frames:
            self.report({'ERROR'}, "There are no parts" if not names else "None of these files is a part")
            return {'CANCELLED'}
        written = self._merge(frames, os.path.join(folder, bpy.path.abspath(self.output)), context.window_manager)
        if written:
            more = f" and {len(written) - 1} more" if len(written) > 1 else ""
            self.report({'INFO'}, f"Merged to {written[0]}{more}")
        return {'FINISHED'} if written else {'CANCELLED'}

    def _merge(self, frames, pattern, window_manager):
        """Paths of the merged frames; of the others the reasons are reported."""
        written = []
        window_manager.progress_begin(0, len(frames))
        for index, frame in enumerate(sorted(frames)):
            output = merge.output_path(pattern, frame)
            try:
                for message in merge.merge_frame(frames[frame], output):
                    self.report({'WARNING'}, f"Frame {frame}: {message}")
                written.append(output)
            except (PartError, native.TracerError, OSError) as error:
                self.report({'ERROR'}, f"Frame {frame}: {error}")
            window_manager.progress_update(index + 1)
        window_manager.progress_end()
        return written


def _draw_menu(menu, context):
    if context.engine == 'VOLLEY':
        menu.layout.separator()
        menu.layout.operator(VOLLEY_OT_merge_parts.bl_idname, text="Merge Parts of Frames...")


def register():
    bpy.utils.register_class(VOLLEY_OT_merge_parts)
    bpy.types.TOPBAR_MT_render.append(_draw_menu)


def unregister():
    bpy.types.TOPBAR_MT_render.remove(_draw_menu)
    bpy.utils.unregister_class(VOLLEY_OT_merge_parts)
