# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels in Blender's own style, and Blender's own panels that hold for this engine too.

Settings that live with Cycles' property groups (object motion steps, light and world sampling) are
shown where that add-on is enabled.
"""

import bpy
from bl_ui.properties_grease_pencil_common import GreasePencilSimplifyPanel
from bpy.types import Panel

from . import passes
from .compat import motion_position

ENGINE = 'VOLLEY'

# Panels of other engines whose content holds here as it is; not every version has each.
_SHARED_PANELS = {
    "DATA_PT_camera_dof", "DATA_PT_camera_dof_aperture", "DATA_PT_preview", "MATERIAL_PT_preview",
    "EEVEE_MATERIAL_PT_context_material", "TEXTURE_PT_preview",
    "VIEW3D_PT_shading_lighting",
}
# Panels made for Blender's internal engine that show what this one does not have, or has itself.
_LEFT_OUT_PANELS = {
    "DATA_PT_area", "DATA_PT_falloff_curve", "DATA_PT_light", "DATA_PT_spot", "NODE_DATA_PT_light",
    "NODE_DATA_PT_spot", "OBJECT_PT_visibility", "VIEWLAYER_PT_filter", "VIEWLAYER_PT_layer_passes",
    "RENDER_PT_post_processing", "RENDER_PT_simplify", "RENDER_PT_simplify_viewport",
    "RENDER_PT_simplify_render", "RENDER_PT_simplify_greasepencil",
}


class _VolleyPanel:
    """Shown when Volley is the engine."""

    bl_space_type = 'PROPERTIES'
    bl_region_type = 'WINDOW'
    bl_context = "render"
    COMPAT_ENGINES = {ENGINE}
    needs = None  # name of what the context must have

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES and (
            cls.needs is None or bool(getattr(context, cls.needs, None)))


def _column(panel):
    """The panel's layout in Blender's two-column style."""
    layout = panel.layout
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout


def _prop_if_present(layout, data, name, **options):
    """Show a property that not every version has."""
    if data is not None and hasattr(data, name):
        layout.prop(data, name, **options)


# Render ----------------------------------------------------------------------------------------

class VOLLEY_RENDER_PT_sampling(_VolleyPanel, Panel):
    bl_label = "Sampling"

    def draw(self, context):
        _column(self).prop(context.scene.volley, "integrator")


def _draw_samples(layout, settings, prefix=""):
    """Numbers of samples and the noise threshold; prefix: "preview_" for the viewport's."""
    switch = f"use_{prefix}adaptive_sampling"
    is_adaptive = getattr(settings, switch)
    row = layout.column(align=True, heading="Noise Threshold").row(align=True)
    row.prop(settings, switch, text="")
    value = row.row()
    value.active = is_adaptive
    value.prop(settings, f"{prefix}noise_threshold", text="")
    column = layout.column(align=True)
    column.prop(settings, f"{prefix}samples", text="Max Samples" if is_adaptive else "Samples")
    if is_adaptive:
        column.prop(settings, f"{prefix}adaptive_min_samples")


class VOLLEY_RENDER_PT_sampling_viewport(_VolleyPanel, Panel):
    bl_label = "Viewport"
    bl_parent_id = "VOLLEY_RENDER_PT_sampling"

    def draw(self, context):
        _draw_samples(_column(self), context.scene.volley, "preview_")
        _column(self).prop(context.scene.render, "preview_pixel_size", text="Pixel Size")


class VOLLEY_RENDER_PT_sampling_render(_VolleyPanel, Panel):
    bl_label = "Render"
    bl_parent_id = "VOLLEY_RENDER_PT_sampling"

    def draw(self, context):
        settings, layout = context.scene.volley, _column(self)
        _draw_samples(layout, settings)
        layout.prop(settings, "light_samples")


class VOLLEY_RENDER_PT_sampling_advanced(_VolleyPanel, Panel):
    bl_label = "Advanced"
    bl_parent_id = "VOLLEY_RENDER_PT_sampling"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        settings, layout = context.scene.volley, _column(self)
        row = layout.row(align=True)
        row.prop(settings, "seed")
        row.prop(settings, "use_animated_seed", text="", icon='TIME')
        layout.prop(settings, "sampler")


class VOLLEY_RENDER_PT_light_paths(_VolleyPanel, Panel):
    bl_label = "Light Paths"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        pass


class VOLLEY_RENDER_PT_light_paths_bounces(_VolleyPanel, Panel):
    bl_label = "Max Bounces"
    bl_parent_id = "VOLLEY_RENDER_PT_light_paths"

    def draw(self, context):
        settings, layout = context.scene.volley, _column(self)
        layout.active = settings.integrator != 'RAYCAST'
        column = layout.column(align=True)
        column.prop(settings, "max_depth")
        column.prop(settings, "max_glossy_depth")
        column.prop(settings, "max_transmission_depth")
        column.prop(settings, "max_transparent_depth")
        layout.prop(settings, "attenuation_cutoff")


class VOLLEY_RENDER_PT_light_paths_clamping(_VolleyPanel, Panel):
    bl_label = "Clamping"
    bl_parent_id = "VOLLEY_RENDER_PT_light_paths"

    def draw(self, context):
        settings, layout = context.scene.volley, _column(self)
        column = layout.column(align=True)
        column.prop(settings, "clamp_direct")
        column.prop(settings, "clamp_indirect")
        layout.prop(settings, "filter_glossy")


class VOLLEY_RENDER_PT_ambient_occlusion(_VolleyPanel, Panel):
    bl_label = "Ambient Occlusion"
    bl_parent_id = "VOLLEY_RENDER_PT_light_paths"
    bl_options = {'DEFAULT_CLOSED'}

    def draw_header(self, context):
        self.layout.prop(context.scene.volley, "use_ambient_occlusion", text="")

    def draw(self, context):
        scene, layout = context.scene, _column(self)
        layout.active = scene.volley.use_ambient_occlusion
        layout.prop(scene.volley, "ao_method")
        if scene.world is not None:
            column = layout.column(align=True)
            column.prop(scene.world.light_settings, "ao_factor", text="AO Factor")
            column.prop(scene.world.light_settings, "distance", text="AO Distance")


class VOLLEY_RENDER_PT_simplify(_VolleyPanel, Panel):
    """Blender's own would stand above all panels of this add-on."""

    bl_label = "Simplify"
    bl_options = {'DEFAULT_CLOSED'}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_simplify", text="")

    def draw(self, context):
        pass


def _draw_simplify(panel, scene, suffix=""):
    """Limits of detail; suffix: "_render" for those of final renders."""
    layout = _column(panel)
    layout.active = scene.render.use_simplify
    column = layout.column()
    column.prop(scene.render, f"simplify_subdivision{suffix}", text="Max Subdivision")
    column.prop(scene.render, f"simplify_child_particles{suffix}", text="Child Particles")
    _prop_if_present(column, getattr(scene, "cycles", None), f"texture_limit{suffix}", text="Texture Limit")


class VOLLEY_RENDER_PT_simplify_viewport(_VolleyPanel, Panel):
    bl_label = "Viewport"
    bl_parent_id = "VOLLEY_RENDER_PT_simplify"

    def draw(self, context):
        _draw_simplify(self, context.scene)


class VOLLEY_RENDER_PT_simplify_render(_VolleyPanel, Panel):
    bl_label = "Render"
    bl_parent_id = "VOLLEY_RENDER_PT_simplify"

    def draw(self, context):
        _draw_simplify(self, context.scene, "_render")


class VOLLEY_RENDER_PT_simplify_greasepencil(_VolleyPanel, GreasePencilSimplifyPanel, Panel):
    bl_label = "Grease Pencil"
    bl_parent_id = "VOLLEY_RENDER_PT_simplify"
    bl_options = {'DEFAULT_CLOSED'}


class VOLLEY_RENDER_PT_motion_blur(_VolleyPanel, Panel):
    bl_label = "Motion Blur"
    bl_options = {'DEFAULT_CLOSED'}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context):
        scene, layout = context.scene, _column(self)
        layout.active = scene.render.use_motion_blur
        column = layout.column()
        if hasattr(scene.render, "motion_blur_position"):
            column.prop(scene.render, "motion_blur_position", text="Position")
        elif hasattr(scene, "cycles"):
            column.prop(scene.cycles, "motion_blur_position", text="Position")
        else:
            column.label(text=f"Position: {motion_position(scene).title()}")
        column.prop(scene.render, "motion_blur_shutter")


class VOLLEY_RENDER_PT_motion_blur_curve(_VolleyPanel, Panel):
    bl_label = "Shutter Curve"
    bl_parent_id = "VOLLEY_RENDER_PT_motion_blur"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        render, layout = context.scene.render, self.layout
        layout.active = render.use_motion_blur
        layout.template_curve_mapping(render, "motion_blur_shutter_curve")
        row = layout.row(align=True)
        for shape, icon in (('SMOOTH', 'SMOOTHCURVE'), ('ROUND', 'SPHERECURVE'), ('ROOT', 'ROOTCURVE'),
                            ('SHARP', 'SHARPCURVE'), ('LINE', 'LINCURVE'), ('MAX', 'NOCURVE')):
            row.operator("render.shutter_curve_preset", icon=icon, text="").shape = shape


class VOLLEY_RENDER_PT_film(_VolleyPanel, Panel):
    bl_label = "Film"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        layout = _column(self)
        layout.prop(context.scene.volley, "film_exposure")
        layout.prop(context.scene.render, "film_transparent", text="Transparent")


class VOLLEY_RENDER_PT_film_filter(_VolleyPanel, Panel):
    bl_label = "Pixel Filter"
    bl_parent_id = "VOLLEY_RENDER_PT_film"

    def draw(self, context):
        settings, layout = context.scene.volley, _column(self)
        layout.prop(settings, "pixel_filter_type", text="Type")
        layout.prop(settings, "filter_width")


class VOLLEY_RENDER_PT_performance(_VolleyPanel, Panel):
    bl_label = "Performance"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        pass


class VOLLEY_RENDER_PT_performance_threads(_VolleyPanel, Panel):
    bl_label = "Threads"
    bl_parent_id = "VOLLEY_RENDER_PT_performance"

    def draw(self, context):
        render, layout = context.scene.render, _column(self)
        layout.prop(render, "threads_mode")
        column = layout.column()
        column.enabled = render.threads_mode == 'FIXED'
        column.prop(render, "threads")


class VOLLEY_RENDER_PT_performance_memory(_VolleyPanel, Panel):
    bl_label = "Memory"
    bl_parent_id = "VOLLEY_RENDER_PT_performance"

    def draw(self, context):
        _column(self).prop(context.scene.volley, "texture_memory")


class VOLLEY_RENDER_PT_performance_packets(_VolleyPanel, Panel):
    bl_label = "Packets"
    bl_parent_id = "VOLLEY_RENDER_PT_performance"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        settings, layout = context.scene.volley, _column(self)
        layout.prop(settings, "assembly", text="Assembly")
        layout.prop(settings, "packet_size", text="Size")


class VOLLEY_RENDER_PT_performance_final(_VolleyPanel, Panel):
    bl_label = "Final Render"
    bl_parent_id = "VOLLEY_RENDER_PT_performance"

    def draw(self, context):
        _column(self).prop(context.scene.render, "use_persistent_data", text="Persistent Data")


# View layer ------------------------------------------------------------------------------------

class _ViewLayerPanel(_VolleyPanel):
    bl_context = "view_layer"


class _PassesPanel(_ViewLayerPanel):
    bl_parent_id = "VOLLEY_VIEWLAYER_PT_passes"


class VOLLEY_VIEWLAYER_PT_filter(_ViewLayerPanel, Panel):
    bl_label = "Filter"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        column = _column(self).column(heading="Include")
        column.prop(context.view_layer, "use_sky", text="Environment")
        column.prop(context.view_layer, "use_solid", text="Surfaces")
        motion = column.column()
        motion.active = context.scene.render.use_motion_blur
        motion.prop(context.view_layer, "use_motion_blur", text="Motion Blur")


class VOLLEY_VIEWLAYER_PT_override(_ViewLayerPanel, Panel):
    bl_label = "Override"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        layout = _column(self)
        layout.prop(context.view_layer, "material_override")
        layout.prop(context.view_layer, "samples")


class VOLLEY_VIEWLAYER_PT_passes(_ViewLayerPanel, Panel):
    bl_label = "Passes"

    def draw(self, context):
        pass


class VOLLEY_VIEWLAYER_PT_passes_data(_PassesPanel, Panel):
    bl_label = "Data"

    def draw(self, context):
        view_layer, layout = context.view_layer, _column(self)
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
        view_layer, layout = context.view_layer, _column(self)
        for kind in ("diffuse", "glossy", "transmission"):
            column = layout.column(heading=kind.title(), align=True)
            for part in ("direct", "indirect", "color"):
                column.prop(view_layer, f"use_pass_{kind}_{part}", text=part.title())
        column = layout.column(heading="Other", align=True)
        column.prop(view_layer, "use_pass_emit", text="Emission")
        column.prop(view_layer, "use_pass_environment")
        column.prop(view_layer, "use_pass_ambient_occlusion", text="Ambient Occlusion")
        _prop_if_present(column, view_layer, "use_pass_shadow", text="Shadow")
        column.prop(view_layer.volley, "use_pass_shadow_catcher")


class VOLLEY_VIEWLAYER_PT_passes_cryptomatte(_PassesPanel, Panel):
    bl_label = "Cryptomatte"

    def draw(self, context):
        view_layer, layout = context.view_layer, _column(self)
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
        view_layer, layout = context.view_layer, _column(self)
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
        row = _column(self).row()
        row.column().template_list("UI_UL_list", "lightgroups", view_layer, "lightgroups", view_layer,
                                   "active_lightgroup_index", rows=3)
        buttons = row.column(align=True)
        buttons.operator("scene.view_layer_add_lightgroup", icon='ADD', text="")
        buttons.operator("scene.view_layer_remove_lightgroup", icon='REMOVE', text="")
        buttons.separator()
        buttons.menu("VIEWLAYER_MT_lightgroup_sync", icon='DOWNARROW_HLT', text="")


def _draw_light_group(panel, data, view_layer):
    """The light group of an object or world, and a button that adds one of that name."""
    row = _column(panel).row(align=True)
    row.prop_search(data, "lightgroup", view_layer, "lightgroups", text="Light Group",
                    results_are_suggestions=True)
    button = row.column(align=True)
    button.enabled = bool(data.lightgroup) and data.lightgroup not in view_layer.lightgroups
    button.operator("scene.view_layer_add_lightgroup", icon='ADD', text="").name = data.lightgroup


# Objects ---------------------------------------------------------------------------------------

_SHAPED = {'MESH', 'CURVE', 'SURFACE', 'FONT', 'META', 'CURVES', 'POINTCLOUD'}


def _has_shape(active):
    return active.type in _SHAPED or (active.instance_type == 'COLLECTION'
                                      and active.instance_collection is not None)


class _ObjectPanel(_VolleyPanel):
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
        layout, active = _column(self), context.object
        layout.prop(active, "hide_select", text="Selectable", invert_checkbox=True, toggle=False)
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
        column, active = _column(self).column(), context.object
        for name in ("camera", "diffuse", "glossy", "transmission"):
            column.prop(active, f"visible_{name}", text=name.title())
        if active.type != 'LIGHT':
            column.prop(active, "visible_shadow", text="Shadow")


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
        layout, settings = _column(self), context.object.cycles
        layout.active = context.scene.render.use_motion_blur and settings.use_motion_blur
        layout.prop(settings, "motion_steps", text="Steps")
        if context.object.type != 'CAMERA':
            layout.prop(settings, "use_deform_motion", text="Deformation")


class VOLLEY_OBJECT_PT_lightgroup(_SeenObjectPanel, Panel):
    bl_label = "Light Group"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        _draw_light_group(self, context.object, context.view_layer)


# Lights, world, materials ------------------------------------------------------------------------

class _LightPanel(_VolleyPanel):
    bl_context = "data"
    needs = "light"


class _WorldPanel(_VolleyPanel):
    bl_context = "world"
    needs = "world"


class _MaterialPanel(_VolleyPanel):
    bl_context = "material"
    needs = "material"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and not context.material.grease_pencil


def _draw_surface(panel, data):
    """The surface part of a node tree, as the Properties editor shows it."""
    layout = panel.layout
    if hasattr(data, "use_nodes") and (not data.use_nodes or data.node_tree is None):
        layout.prop(data, "use_nodes", icon='NODETREE', toggle=True)  # nameless where properties are split
        return False
    layout.use_property_split = True
    tree = data.node_tree
    output = tree.get_output_node('CYCLES') if tree is not None else None
    surface = output.inputs.get("Surface") if output is not None else None
    if surface is None:
        layout.label(text="No output node")
    else:
        layout.template_node_view(tree, output, surface)
    return True


class VOLLEY_LIGHT_PT_light(_LightPanel, Panel):
    bl_label = "Light"

    def draw(self, context):
        light, layout = context.light, self.layout
        layout.row().prop(light, "type", expand=True)
        layout = _column(self)
        column = layout.column()
        column.prop(light, "color")
        _prop_if_present(column, light, "use_temperature")
        if getattr(light, "use_temperature", False):
            column.prop(light, "temperature")
        column.prop(light, "energy", text="Strength" if light.type == 'SUN' else "Power")
        _prop_if_present(column, light, "exposure")
        column.separator()
        self._draw_shape(column, light)
        column.separator()
        settings = getattr(light, "cycles", None)
        if hasattr(light, "use_shadow"):
            column.prop(light, "use_shadow", text="Cast Shadow")
        else:
            _prop_if_present(column, settings, "cast_shadow")
        _prop_if_present(column, settings, "use_multiple_importance_sampling",
                         text="Multiple Importance")

    @staticmethod
    def _draw_shape(column, light):
        if light.type in {'POINT', 'SPOT'}:
            column.prop(light, "shadow_soft_size", text="Radius")
            _prop_if_present(column, light, "use_soft_falloff")
        elif light.type == 'SUN':
            column.prop(light, "angle")
        elif light.type == 'AREA':
            column.prop(light, "shape", text="Shape")
            sub = column.column(align=True)
            if light.shape in {'SQUARE', 'DISK'}:
                sub.prop(light, "size")
            else:
                sub.prop(light, "size", text="Size X")
                sub.prop(light, "size_y", text="Y")


class VOLLEY_LIGHT_PT_beam_shape(_LightPanel, Panel):
    bl_label = "Beam Shape"
    bl_parent_id = "VOLLEY_LIGHT_PT_light"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light.type in {'SPOT', 'AREA'}

    def draw(self, context):
        light, column = context.light, _column(self).column()
        if light.type == 'SPOT':
            column.prop(light, "spot_size", text="Spot Size")
            column.prop(light, "spot_blend", text="Blend", slider=True)
            column.prop(light, "show_cone")
        else:
            column.prop(light, "spread", text="Spread")


class VOLLEY_LIGHT_PT_nodes(_LightPanel, Panel):
    bl_label = "Nodes"

    def draw(self, context):
        _draw_surface(self, context.light)


class VOLLEY_WORLD_PT_preview(_WorldPanel, Panel):
    bl_label = "Preview"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        self.layout.template_preview(context.world)


class VOLLEY_WORLD_PT_surface(_WorldPanel, Panel):
    bl_label = "Surface"

    def draw(self, context):
        if not _draw_surface(self, context.world):
            self.layout.prop(context.world, "color")


class VOLLEY_WORLD_PT_mist(_WorldPanel, Panel):
    bl_label = "Mist Pass"
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and any(layer.use_pass_mist for layer in context.scene.view_layers)

    def draw(self, context):
        layout, settings = _column(self), context.world.mist_settings
        column = layout.column(align=True)
        column.prop(settings, "start")
        column.prop(settings, "depth")
        layout.prop(settings, "falloff")


class VOLLEY_WORLD_PT_ray_visibility(_WorldPanel, Panel):
    bl_label = "Ray Visibility"
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.world, "cycles_visibility")

    def draw(self, context):
        column = _column(self).column()
        for name in ("camera", "diffuse", "glossy", "transmission"):
            column.prop(context.world.cycles_visibility, name)


class VOLLEY_WORLD_PT_settings(_WorldPanel, Panel):
    bl_label = "Settings"
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.world, "cycles")

    def draw(self, context):
        column, settings = _column(self).column(), context.world.cycles
        column.prop(settings, "sampling_method", text="Sampling")
        if settings.sampling_method == 'MANUAL':
            column.prop(settings, "sample_map_resolution")


class VOLLEY_WORLD_PT_lightgroup(_WorldPanel, Panel):
    bl_label = "Light Group"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        _draw_light_group(self, context.world, context.view_layer)


class VOLLEY_MATERIAL_PT_surface(_MaterialPanel, Panel):
    bl_label = "Surface"

    def draw(self, context):
        if not _draw_surface(self, context.material):
            self.layout.prop(context.material, "diffuse_color")


class VOLLEY_MATERIAL_PT_settings(_MaterialPanel, Panel):
    bl_label = "Settings"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        material, column = context.material, _column(self).column()
        column.prop(material, "pass_index")
        settings = getattr(material, "cycles", None)
        if hasattr(material, "use_transparent_shadow"):
            column.prop(material, "use_transparent_shadow", text="Transparent Shadows")
        else:
            _prop_if_present(column, settings, "use_transparent_shadow", text="Transparent Shadows")
        _prop_if_present(column, settings, "sample_as_light", text="Multiple Importance")
        _prop_if_present(column, settings, "emission_sampling")


# Registration ----------------------------------------------------------------------------------

def _own_panels():
    return [value for value in globals().values()
            if isinstance(value, type) and issubclass(value, Panel) and value is not Panel]


def _compatible_panels():
    """Blender's panels that hold for this engine."""
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if engines is None or panel.__module__ == __name__:
            continue
        name = panel.__name__
        if name in _SHARED_PANELS or ('BLENDER_RENDER' in engines and name not in _LEFT_OUT_PANELS):
            yield panel


def register():
    for panel in _own_panels():
        bpy.utils.register_class(panel)
    for panel in _compatible_panels():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister():
    for panel in _compatible_panels():
        panel.COMPAT_ENGINES.discard(ENGINE)
    for panel in reversed(_own_panels()):
        bpy.utils.unregister_class(panel)
