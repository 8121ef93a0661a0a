# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of objects."""

import bpy
from bpy.types import Panel

from ..compat import shadow_terminator_settings
from .panel import VolleyPanel, column_of, draw_light_group, prop_if_present


_SHAPED = {'MESH', 'CURVE', 'SURFACE', 'FONT', 'META', 'CURVES', 'POINTCLOUD'}


def _has_shape(active):
    return active.type in _SHAPED or (active.instance_type == 'COLLECTION'
                                      and active.instance_collection is not None)


class _ObjectPanel(VolleyPanel):
    bl_context = "object"
    needs = "object"


class _SeenObjectPanel(_ObjectPanel):
    """Of objects that rays meet: shapes and lights."""

    @classmethod
    def poll(cls, context):
        active = context.object
        return super().poll(context) and (_has_shape(active) or active.type == 'LIGHT')


class VOLLEY_OBJECT_PT_visibility(_ObjectPanel, Panel):
    bl_label = "Visibility"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        layout, active = column_of(self, has_keys=True), context.object
        layout.prop(active, "hide_select", text="Selectable", invert_checkbox=True, toggle=False)
        prop_if_present(layout, active, "hide_surface_pick", text="Surface Picking", invert_checkbox=True,
                        toggle=False)
        column = layout.column(heading="Show In")
        column.prop(active, "hide_viewport", text="Viewports", invert_checkbox=True, toggle=False)
        column.prop(active, "hide_render", text="Renders", invert_checkbox=True, toggle=False)
        column = layout.column(heading="Mask")
        if _has_shape(active) or active.type == 'LIGHT':
            column.prop(active, "is_shadow_catcher")
        if _has_shape(active):
            column.prop(active, "is_holdout")


class VOLLEY_OBJECT_PT_ray_visibility(_SeenObjectPanel, Panel):
    bl_label = "Ray Visibility"
    bl_parent_id = "VOLLEY_OBJECT_PT_visibility"

    def draw(self, context):
        column, active = column_of(self, has_keys=True).column(), context.object
        for name in ("camera", "diffuse", "glossy", "transmission"):
            column.prop(active, f"visible_{name}", text=name.title())
        if active.type == 'LIGHT':
            return
        column.prop(active, "visible_shadow", text="Shadow")


class VOLLEY_OBJECT_PT_culling(_SeenObjectPanel, Panel):
    bl_label = "Culling"
    bl_parent_id = "VOLLEY_OBJECT_PT_visibility"
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and _has_shape(context.object) and hasattr(context.object, "cycles")

    def draw(self, context):
        layout, settings, scene = column_of(self), context.object.cycles, context.scene
        for kind in ("camera", "distance"):
            row = layout.row()
            row.active = scene.render.use_simplify and getattr(scene.cycles, f"use_{kind}_cull")
            row.prop(settings, f"use_{kind}_cull")


class _ShadingPanel(_ObjectPanel):
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and _has_shape(context.object) and hasattr(context.object, "cycles")


if hasattr(bpy.types, "OBJECT_PT_shading"):  # with Light Linking in it; seen in 4.3, not in 3.4
    _SHADING_PANEL = "OBJECT_PT_shading"
else:
    _SHADING_PANEL = "VOLLEY_OBJECT_PT_shading"

    class VOLLEY_OBJECT_PT_shading(_ShadingPanel, Panel):
        bl_label = "Shading"

        def draw(self, context):
            pass


class VOLLEY_OBJECT_PT_shadow_terminator(_ShadingPanel, Panel):
    bl_label = "Shadow Terminator"
    bl_parent_id = _SHADING_PANEL

    def draw(self, context):
        column, active = column_of(self).column(align=True), context.object
        owner, names = shadow_terminator_settings(active)
        for name, text in zip(names, ("Geometry Offset", "Shading Offset")):
            column.prop(owner, name, text=text)


class VOLLEY_OBJECT_PT_fast_gi(_ShadingPanel, Panel):
    bl_label = "Ambient Occlusion"
    bl_parent_id = _SHADING_PANEL

    def draw(self, context):
        column, settings = column_of(self).column(), context.scene.volley
        column.active = settings.use_ambient_occlusion and settings.ao_method == 'REPLACE'
        column.prop(context.object.cycles, "ao_distance", text="AO Distance")


class VOLLEY_OBJECT_PT_subdivision(_ShadingPanel, Panel):
    """Blender has this in the modifier: before 5.0 for Cycles alone."""

    bl_label = "Adaptive Subdivision"
    bl_parent_id = _SHADING_PANEL

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.object.cycles, "use_adaptive_subdivision") \
            and any(modifier.type == 'SUBSURF' for modifier in context.object.modifiers)

    def draw_header(self, context):
        self.layout.prop(context.object.cycles, "use_adaptive_subdivision", text="")

    def draw(self, context):
        column, settings = column_of(self).column(), context.object.cycles
        column.active = settings.use_adaptive_subdivision
        column.prop(settings, "dicing_rate")
        if context.scene.cycles.feature_set != 'EXPERIMENTAL':
            column.label(text="Needs Experimental in the Subdivision panel of the render", icon='INFO')


class VOLLEY_OBJECT_PT_motion_blur(_ObjectPanel, Panel):
    bl_label = "Motion Blur"
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        active = context.object
        return super().poll(context) and hasattr(active, "cycles") \
            and (_has_shape(active) or active.type == 'CAMERA')

    def draw_header(self, context):
        self.layout.active = context.scene.render.use_motion_blur
        self.layout.prop(context.object.cycles, "use_motion_blur", text="")

    def draw(self, context):
        layout, settings = column_of(self), context.object.cycles
        layout.active = context.scene.render.use_motion_blur and settings.use_motion_blur
        layout.prop(settings, "motion_steps", text="Steps")
        if context.object.type != 'CAMERA':
            layout.prop(settings, "use_deform_motion", text="Deformation")


class VOLLEY_OBJECT_PT_lightgroup(_SeenObjectPanel, Panel):
    bl_label = "Light Group"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        draw_light_group(self, context.object, context.view_layer)
