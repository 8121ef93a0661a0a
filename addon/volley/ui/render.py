# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of render properties."""

from bl_ui import properties_render
from bl_ui.properties_grease_pencil_common import GreasePencilSimplifyPanel
from bpy.types import Panel

from .. import denoise_nodes, from_cycles, presets
from ..compat import SUBDIVIDES_CAGE, motion_position
from ..farm.operator import VOLLEY_OT_merge_parts
from .panel import VolleyPanel, column_of


class VOLLEY_RENDER_PT_sampling(VolleyPanel, Panel):
    bl_label = "Sampling"

    def draw_header_preset(self, context):
        presets.VOLLEY_PT_sampling_presets.draw_panel_header(self.layout)
        self.layout.operator(from_cycles.VOLLEY_OT_copy_cycles_settings.bl_idname, text="", icon='IMPORT',
                             emboss=False)

    def draw(self, context):
        layout = column_of(self)
        from_cycles.draw_offer(layout, context.scene)
        layout.prop(context.scene.volley, "integrator")


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
    layout.prop(settings, f"use_{prefix}denoising")
    guides = layout.column()
    guides.active = getattr(settings, f"use_{prefix}denoising")
    guides.prop(settings, f"{prefix}denoising_input_passes")


class VOLLEY_RENDER_PT_sampling_viewport(VolleyPanel, Panel):
    bl_label = "Viewport"
    bl_parent_id = "VOLLEY_RENDER_PT_sampling"

    def draw(self, context):
        settings, layout = context.scene.volley, column_of(self)
        _draw_samples(layout, settings, "preview_")
        start = layout.column()
        start.active = settings.use_preview_denoising
        start.prop(settings, "preview_denoising_start_sample")
        layout.prop(context.scene.render, "preview_pixel_size", text="Pixel Size")


class VOLLEY_RENDER_PT_sampling_render(VolleyPanel, Panel):
    bl_label = "Render"
    bl_parent_id = "VOLLEY_RENDER_PT_sampling"

    def draw(self, context):
        settings, layout = context.scene.volley, column_of(self)
        _draw_samples(layout, settings)
        extra = layout.column()
        extra.active = not settings.use_adaptive_sampling and not settings.time_limit
        extra.prop(settings, "extra_samples")
        layout.operator(denoise_nodes.VOLLEY_OT_set_up_denoise_nodes.bl_idname)
        layout.prop(settings, "time_limit")
        layout.prop(settings, "light_samples")


class VOLLEY_RENDER_PT_sampling_advanced(VolleyPanel, Panel):
    bl_label = "Advanced"
    bl_parent_id = "VOLLEY_RENDER_PT_sampling"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        settings, layout = context.scene.volley, column_of(self)
        row = layout.row(align=True)
        row.prop(settings, "seed")
        row.prop(settings, "use_animated_seed", text="", icon='TIME')
        layout.prop(settings, "sampler")
        column = layout.column(align=True)
        column.prop(settings, "sample_offset")
        column.prop(settings, "sample_subset", text="Subset")
        layout.operator(VOLLEY_OT_merge_parts.bl_idname, text="Merge Parts...")


class VOLLEY_RENDER_PT_light_paths(VolleyPanel, Panel):
    bl_label = "Light Paths"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        pass


class VOLLEY_RENDER_PT_light_paths_bounces(VolleyPanel, Panel):
    bl_label = "Max Bounces"
    bl_parent_id = "VOLLEY_RENDER_PT_light_paths"

    def draw(self, context):
        settings, layout = context.scene.volley, column_of(self)
        layout.active = settings.integrator != 'RAYCAST'
        column = layout.column(align=True)
        column.prop(settings, "max_depth")
        column.prop(settings, "max_glossy_depth")
        column.prop(settings, "max_transmission_depth")
        column.prop(settings, "max_transparent_depth")
        layout.prop(settings, "attenuation_cutoff")


class VOLLEY_RENDER_PT_light_paths_clamping(VolleyPanel, Panel):
    bl_label = "Clamping"
    bl_parent_id = "VOLLEY_RENDER_PT_light_paths"

    def draw(self, context):
        settings, layout = context.scene.volley, column_of(self)
        column = layout.column(align=True)
        column.prop(settings, "clamp_direct")
        column.prop(settings, "clamp_indirect")
        layout.prop(settings, "filter_glossy")


class VOLLEY_RENDER_PT_ambient_occlusion(VolleyPanel, Panel):
    bl_label = "Ambient Occlusion"
    bl_parent_id = "VOLLEY_RENDER_PT_light_paths"
    bl_options = {'DEFAULT_CLOSED'}

    def draw_header(self, context):
        self.layout.prop(context.scene.volley, "use_ambient_occlusion", text="")

    def draw(self, context):
        scene, layout = context.scene, column_of(self)
        layout.active = scene.volley.use_ambient_occlusion
        layout.prop(scene.volley, "ao_method")
        if scene.world is not None:
            column = layout.column(align=True)
            column.prop(scene.world.light_settings, "ao_factor", text="AO Factor")
            column.prop(scene.world.light_settings, "distance", text="AO Distance")


class VOLLEY_RENDER_PT_subdivision(VolleyPanel, Panel):
    """Its settings are Cycles'."""

    bl_label = "Subdivision"
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.scene, "cycles")

    def draw(self, context):
        column, settings = column_of(self).column(), context.scene.cycles
        if not SUBDIVIDES_CAGE:
            column.prop(settings, "feature_set")
            column = column.column()
            column.active = settings.feature_set == 'EXPERIMENTAL'
        rates = column.column(align=True)
        rates.prop(settings, "dicing_rate", text="Dicing Rate Render")
        rates.prop(settings, "preview_dicing_rate", text="Viewport")
        column.prop(settings, "offscreen_dicing_scale", text="Offscreen Scale")
        column.prop(settings, "max_subdivisions")
        column.prop(settings, "dicing_camera")


class VOLLEY_RENDER_PT_curves(VolleyPanel, Panel):
    bl_label = "Curves"
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        # Shapes are those of Cycles, so that a file looks alike in both.
        return super().poll(context) and hasattr(context.scene, "cycles_curves")

    def draw(self, context):
        layout, settings = column_of(self), context.scene.cycles_curves
        layout.prop(settings, "shape", text="Shape")
        if settings.shape == 'RIBBONS':
            layout.prop(settings, "subdivisions", text="Curve Subdivisions")


class VOLLEY_RENDER_PT_curves_viewport_display(VolleyPanel, Panel):
    bl_label = "Viewport Display"
    bl_parent_id = "VOLLEY_RENDER_PT_curves"
    bl_options = {'DEFAULT_CLOSED'}
    draw = properties_render.draw_curves_settings


class VOLLEY_RENDER_PT_simplify(VolleyPanel, Panel):
    """Blender's own would stand above all panels of this add-on."""

    bl_label = "Simplify"
    bl_options = {'DEFAULT_CLOSED'}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_simplify", text="")

    def draw(self, context):
        pass


def _draw_simplify(panel, scene, suffix=""):
    """Limits of detail; suffix: "_render" for those of final renders."""
    layout = column_of(panel)
    layout.active = scene.render.use_simplify
    column = layout.column()
    column.prop(scene.render, f"simplify_subdivision{suffix}", text="Max Subdivision")
    column.prop(scene.render, f"simplify_child_particles{suffix}", text="Child Particles")
    column.prop(scene.volley, f"texture_limit{suffix}", text="Texture Limit")


class VOLLEY_RENDER_PT_simplify_viewport(VolleyPanel, Panel):
    bl_label = "Viewport"
    bl_parent_id = "VOLLEY_RENDER_PT_simplify"

    def draw(self, context):
        _draw_simplify(self, context.scene)


class VOLLEY_RENDER_PT_simplify_render(VolleyPanel, Panel):
    bl_label = "Render"
    bl_parent_id = "VOLLEY_RENDER_PT_simplify"

    def draw(self, context):
        _draw_simplify(self, context.scene, "_render")


class VOLLEY_RENDER_PT_simplify_culling(VolleyPanel, Panel):
    """Its settings are Cycles'."""

    bl_label = "Culling"
    bl_parent_id = "VOLLEY_RENDER_PT_simplify"
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.scene, "cycles")

    def draw(self, context):
        layout, settings = column_of(self), context.scene.cycles
        layout.active = context.scene.render.use_simplify
        for kind in ("camera", "distance"):
            row = layout.row(heading=f"{kind.title()} Culling")
            row.prop(settings, f"use_{kind}_cull", text="")
            value = row.column()
            value.active = getattr(settings, f"use_{kind}_cull")
            value.prop(settings, f"{kind}_cull_margin", text="")


class VOLLEY_RENDER_PT_simplify_greasepencil(VolleyPanel, GreasePencilSimplifyPanel, Panel):
    bl_label = "Grease Pencil"
    bl_parent_id = "VOLLEY_RENDER_PT_simplify"
    bl_options = {'DEFAULT_CLOSED'}


class VOLLEY_RENDER_PT_motion_blur(VolleyPanel, Panel):
    bl_label = "Motion Blur"
    bl_options = {'DEFAULT_CLOSED'}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context):
        scene, layout = context.scene, column_of(self)
        layout.active = scene.render.use_motion_blur
        column = layout.column()
        if hasattr(scene.render, "motion_blur_position"):
            column.prop(scene.render, "motion_blur_position", text="Position")
        elif hasattr(scene, "cycles"):
            column.prop(scene.cycles, "motion_blur_position", text="Position")
        else:
            column.label(text=f"Position: {motion_position(scene).title()}")
        column.prop(scene.render, "motion_blur_shutter")
        settings = getattr(scene, "cycles", None)
        if hasattr(settings, "rolling_shutter_type"):
            column.separator()
            column.prop(settings, "rolling_shutter_type", text="Rolling Shutter")
            duration = column.column()
            duration.active = settings.rolling_shutter_type != 'NONE'
            duration.prop(settings, "rolling_shutter_duration")


class VOLLEY_RENDER_PT_motion_blur_curve(VolleyPanel, Panel):
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


class VOLLEY_RENDER_PT_film(VolleyPanel, Panel):
    bl_label = "Film"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        column_of(self).prop(context.scene.volley, "film_exposure")


class VOLLEY_RENDER_PT_film_transparency(VolleyPanel, Panel):
    bl_label = "Transparent"
    bl_parent_id = "VOLLEY_RENDER_PT_film"

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "film_transparent", text="")

    def draw(self, context):
        settings, layout = context.scene.volley, column_of(self)
        layout.active = context.scene.render.film_transparent
        layout.prop(settings, "film_transparent_glass")
        row = layout.row()
        row.active = settings.film_transparent_glass
        row.prop(settings, "film_transparent_roughness")


class VOLLEY_RENDER_PT_film_filter(VolleyPanel, Panel):
    bl_label = "Pixel Filter"
    bl_parent_id = "VOLLEY_RENDER_PT_film"

    def draw(self, context):
        settings, layout = context.scene.volley, column_of(self)
        layout.prop(settings, "pixel_filter_type", text="Type")
        layout.prop(settings, "filter_width")


class VOLLEY_RENDER_PT_performance(VolleyPanel, Panel):
    bl_label = "Performance"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        pass


class VOLLEY_RENDER_PT_performance_threads(VolleyPanel, Panel):
    bl_label = "Threads"
    bl_parent_id = "VOLLEY_RENDER_PT_performance"

    def draw(self, context):
        render, layout = context.scene.render, column_of(self)
        layout.prop(render, "threads_mode")
        column = layout.column()
        column.enabled = render.threads_mode == 'FIXED'
        column.prop(render, "threads")


class VOLLEY_RENDER_PT_performance_memory(VolleyPanel, Panel):
    bl_label = "Memory"
    bl_parent_id = "VOLLEY_RENDER_PT_performance"

    def draw(self, context):
        column_of(self).prop(context.scene.volley, "texture_memory")


class VOLLEY_RENDER_PT_performance_packets(VolleyPanel, Panel):
    bl_label = "Packets"
    bl_parent_id = "VOLLEY_RENDER_PT_performance"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        settings, layout = context.scene.volley, column_of(self)
        layout.prop(settings, "assembly", text="Assembly")
        layout.prop(settings, "packet_size", text="Size")


class VOLLEY_RENDER_PT_performance_final(VolleyPanel, Panel):
    bl_label = "Final Render"
    bl_parent_id = "VOLLEY_RENDER_PT_performance"

    def draw(self, context):
        column_of(self).prop(context.scene.render, "use_persistent_data", text="Persistent Data")


if hasattr(properties_render, "CompositorPerformanceButtonsPanel"):  # seen in 4.3, not in 3.4
    class VOLLEY_RENDER_PT_performance_compositor(
            VolleyPanel, properties_render.CompositorPerformanceButtonsPanel, Panel):
        bl_label = "Compositor"
        bl_parent_id = "VOLLEY_RENDER_PT_performance"
        bl_options = {'DEFAULT_CLOSED'}

if hasattr(properties_render, "CompositorDenoisePerformanceButtonsPanel"):
    class VOLLEY_RENDER_PT_performance_compositor_denoise(
            VolleyPanel, properties_render.CompositorDenoisePerformanceButtonsPanel, Panel):
        bl_label = "Denoise Nodes"
        bl_parent_id = "VOLLEY_RENDER_PT_performance_compositor"
        bl_options = {'DEFAULT_CLOSED'}
