# SPDX-License-Identifier: GPL-3.0-or-later
"""What the shading menu of a 3D view has for rendered viewports."""

from bpy.types import Panel

from .panel import VolleyPanel


class VOLLEY_VIEW3D_PT_shading_render_pass(VolleyPanel, Panel):
    bl_label = "Render Pass"
    bl_space_type = 'VIEW_3D'
    bl_region_type = 'HEADER'
    bl_parent_id = "VIEW3D_PT_shading"
    bl_context = ""

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.space_data.shading.type == 'RENDERED'

    def draw(self, context):
        self.layout.prop(context.space_data.shading.volley, "render_pass", text="")
