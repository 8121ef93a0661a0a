# SPDX-License-Identifier: GPL-3.0-or-later
"""What the shading menu of a 3D view has for rendered viewports."""

from bl_ui.space_view3d import VIEW3D_PT_shading_lighting
from bpy.types import Panel

from .panel import VolleyPanel


class _ShadingPanel(VolleyPanel):
    bl_space_type = 'VIEW_3D'
    bl_region_type = 'HEADER'
    bl_parent_id = "VIEW3D_PT_shading"
    bl_context = ""

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.space_data.shading.type == 'RENDERED'


class VOLLEY_VIEW3D_PT_shading_lighting(_ShadingPanel, Panel):
    """Blender's own is shown for EEVEE alone in rendered viewports."""

    bl_label = "Lighting"
    draw = VIEW3D_PT_shading_lighting.draw


class VOLLEY_VIEW3D_PT_shading_render_pass(_ShadingPanel, Panel):
    bl_label = "Render Pass"

    def draw(self, context):
        self.layout.prop(context.space_data.shading.volley, "render_pass", text="")
