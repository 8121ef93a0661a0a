# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of view layers."""

from bpy.types import Panel

from .. import passes
from .panel import VolleyPanel, column_of, prop_if_present


class _ViewLayerPanel(VolleyPanel):
    bl_context = "view_layer"


class _PassesPanel(_ViewLayerPanel):
    bl_parent_id = "VOLLEY_VIEWLAYER_PT_passes"


class VOLLEY_VIEWLAYER_PT_filter(_ViewLayerPanel, Panel):
    bl_label = "Filter"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        column = column_of(self).column(heading="Include")
        column.prop(context.view_layer, "use_sky", text="Environment")
        column.prop(context.view_layer, "use_solid", text="Surfaces")
        column.prop(context.view_layer, "use_strand", text="Curves")
        motion = column.column()
        motion.active = context.scene.render.use_motion_blur
        motion.prop(context.view_layer, "use_motion_blur", text="Motion Blur")


class VOLLEY_VIEWLAYER_PT_override(_ViewLayerPanel, Panel):
    bl_label = "Override"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        layout = column_of(self)
        layout.prop(context.view_layer, "material_override")
        prop_if_present(layout, context.view_layer, "world_override")  # from 4.3 on
        layout.prop(context.view_layer, "samples")


class VOLLEY_VIEWLAYER_PT_passes(_ViewLayerPanel, Panel):
    bl_label = "Passes"

    def draw(self, context):
        pass


class VOLLEY_VIEWLAYER_PT_passes_data(_PassesPanel, Panel):
    bl_label = "Data"

    def draw(self, context):
        view_layer, layout = context.view_layer, column_of(self)
        column = layout.column(heading="Include", align=True)
        for name in ("combined", "z", "mist", "position", "normal", "uv"):
            column.prop(view_layer, f"use_pass_{name}")
        vector = column.column()
        vector.active = not context.scene.render.use_motion_blur
        vector.prop(view_layer, "use_pass_vector")
        column = layout.column(heading="Indexes", align=True)
        column.prop(view_layer, "use_pass_object_index")
        column.prop(view_layer, "use_pass_material_index")
        column = layout.column(heading="Debug", align=True)
        column.prop(view_layer.volley, "use_pass_sample_count")
        column.prop(view_layer.volley, "denoising_store_passes")


class VOLLEY_VIEWLAYER_PT_passes_light(_PassesPanel, Panel):
    bl_label = "Light"

    def draw(self, context):
        view_layer, layout = context.view_layer, column_of(self)
        for kind in ("diffuse", "glossy", "transmission"):
            column = layout.column(heading=kind.title(), align=True)
            for part in ("direct", "indirect", "color"):
                column.prop(view_layer, f"use_pass_{kind}_{part}", text=part.title())
        column = layout.column(heading="Other", align=True)
        column.prop(view_layer, "use_pass_emit", text="Emission")
        column.prop(view_layer, "use_pass_environment")
        column.prop(view_layer, "use_pass_ambient_occlusion", text="Ambient Occlusion")
        prop_if_present(column, view_layer, "use_pass_shadow", text="Shadow")
        column.prop(view_layer.volley, "use_pass_shadow_catcher")


class VOLLEY_VIEWLAYER_PT_passes_cryptomatte(_PassesPanel, Panel):
    bl_label = "Cryptomatte"

    def draw(self, context):
        view_layer, layout = context.view_layer, column_of(self)
        settings = [setting for _, setting in passes.CRYPTOMATTES.values()]
        column = layout.column()
        for setting in settings:
            column.prop(view_layer, setting, text=setting.rpartition("_")[2].title())
        column = layout.column()
        column.active = any(getattr(view_layer, setting) for setting in settings)
        column.prop(view_layer, "pass_cryptomatte_depth", text="Levels")


class VOLLEY_VIEWLAYER_PT_passes_aov(_PassesPanel, Panel):
    bl_label = "Shader AOV"

    def draw(self, context):
        view_layer, layout = context.view_layer, column_of(self)
        row = layout.row()
        row.column().template_list("VIEWLAYER_UL_aov", "aovs", view_layer, "aovs", view_layer,
                                   "active_aov_index", rows=3)
        buttons = row.column(align=True)
        buttons.operator("scene.view_layer_add_aov", icon='ADD', text="")
        buttons.operator("scene.view_layer_remove_aov", icon='REMOVE', text="")
        if view_layer.active_aov and not view_layer.active_aov.is_valid:
            layout.label(text="Conflicts with another pass of the same name", icon='ERROR')


class VOLLEY_VIEWLAYER_PT_passes_lightgroups(_PassesPanel, Panel):
    bl_label = "Light Groups"

    def draw(self, context):
        view_layer = context.view_layer
        row = column_of(self).row()
        row.column().template_list("UI_UL_list", "lightgroups", view_layer, "lightgroups", view_layer,
                                   "active_lightgroup_index", rows=3)
        buttons = row.column(align=True)
        buttons.operator("scene.view_layer_add_lightgroup", icon='ADD', text="")
        buttons.operator("scene.view_layer_remove_lightgroup", icon='REMOVE', text="")
        buttons.separator()
        buttons.menu("VIEWLAYER_MT_lightgroup_sync", icon='DOWNARROW_HLT', text="")
