# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of lights, worlds and materials."""

from bpy.types import Panel

from ..sync.flatten import output_socket
from .panel import NodeEditorPanel, VolleyPanel, column_of, draw_light_group, prop_if_present


class _LightPanel(VolleyPanel):
    bl_context = "data"
    needs = "light"


class _WorldPanel(VolleyPanel):
    bl_context = "world"
    needs = "world"


class _MaterialPanel(VolleyPanel):
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
    _draw_input(layout, data.node_tree, "Surface")
    return True


def _draw_input(layout, tree, name):
    """What an input of a tree's output, or of that of a group in it, is linked to."""
    layout.use_property_split = True
    socket = output_socket(tree, name) if tree is not None else None
    if socket is None:
        layout.label(text="No output node")
    else:
        layout.template_node_view(socket.id_data, socket.node, socket)


class _Light(_LightPanel):
    bl_label = "Light"

    def draw(self, context):
        light, layout = context.light, self.layout
        layout.row().prop(light, "type", expand=True)
        layout = column_of(self, has_keys=True)
        column = layout.column()
        column.prop(light, "color")
        prop_if_present(column, light, "use_temperature")
        if getattr(light, "use_temperature", False):
            column.prop(light, "temperature")
        column.prop(light, "energy", text="Strength" if light.type == 'SUN' else "Power")
        prop_if_present(column, light, "exposure")
        prop_if_present(column, light, "normalize")
        column.separator()
        self._draw_shape(column, light)
        column.separator()
        settings = getattr(light, "cycles", None)
        # Till 4.1 there are both, and Blender's own is EEVEE's.
        has_own = not hasattr(settings, "cast_shadow")
        prop_if_present(column, light if has_own else settings, "use_shadow" if has_own else "cast_shadow",
                        text="Cast Shadow")
        prop_if_present(column, settings, "use_multiple_importance_sampling",
                         text="Multiple Importance")
        prop_if_present(column, settings, "max_bounces")
        if light.type == 'AREA':
            prop_if_present(column, settings, "is_portal", text="Portal")

    @staticmethod
    def _draw_shape(column, light):
        if light.type in {'POINT', 'SPOT'}:
            column.prop(light, "shadow_soft_size", text="Radius")
            prop_if_present(column, light, "use_soft_falloff")
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


class VOLLEY_LIGHT_PT_light(_Light, Panel):
    pass


class VOLLEY_NODE_PT_light(NodeEditorPanel, _Light, Panel):
    pass


class _BeamShape(_LightPanel):
    bl_label = "Beam Shape"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light.type in {'SPOT', 'AREA'}

    def draw(self, context):
        light, column = context.light, column_of(self, has_keys=True).column()
        if light.type == 'SPOT':
            column.prop(light, "spot_size", text="Spot Size")
            column.prop(light, "spot_blend", text="Blend", slider=True)
            column.prop(light, "show_cone")
        else:
            column.prop(light, "spread", text="Spread")


class VOLLEY_LIGHT_PT_beam_shape(_BeamShape, Panel):
    bl_parent_id = "VOLLEY_LIGHT_PT_light"


class VOLLEY_NODE_PT_beam_shape(NodeEditorPanel, _BeamShape, Panel):
    bl_parent_id = "VOLLEY_NODE_PT_light"


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
        layout, settings = column_of(self), context.world.mist_settings
        column = layout.column(align=True)
        column.prop(settings, "start")
        column.prop(settings, "depth")
        layout.prop(settings, "falloff")


class _WorldRayVisibility(_WorldPanel):
    bl_label = "Ray Visibility"
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.world, "cycles_visibility")

    def draw(self, context):
        column = column_of(self).column()
        for name in ("camera", "diffuse", "glossy", "transmission"):
            column.prop(context.world.cycles_visibility, name)


class VOLLEY_WORLD_PT_ray_visibility(_WorldRayVisibility, Panel):
    pass


class VOLLEY_NODE_PT_world_ray_visibility(NodeEditorPanel, _WorldRayVisibility, Panel):
    pass


class _WorldSettings(_WorldPanel):
    bl_label = "Settings"
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.world, "cycles")

    def draw(self, context):
        column, settings = column_of(self).column(), context.world.cycles
        column.prop(settings, "sampling_method", text="Sampling")
        if settings.sampling_method == 'MANUAL':
            column.prop(settings, "sample_map_resolution")
        prop_if_present(column, settings, "use_shadows", text="Cast Shadow")


class VOLLEY_WORLD_PT_settings(_WorldSettings, Panel):
    pass


class VOLLEY_NODE_PT_world_settings(NodeEditorPanel, _WorldSettings, Panel):
    pass


class VOLLEY_WORLD_PT_lightgroup(_WorldPanel, Panel):
    bl_label = "Light Group"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        draw_light_group(self, context.world, context.view_layer)


class VOLLEY_MATERIAL_PT_surface(_MaterialPanel, Panel):
    bl_label = "Surface"

    def draw(self, context):
        if not _draw_surface(self, context.material):
            self.layout.prop(context.material, "diffuse_color")


class VOLLEY_MATERIAL_PT_displacement(_MaterialPanel, Panel):
    bl_label = "Displacement"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.material.node_tree is not None

    def draw(self, context):
        _draw_input(self.layout, context.material.node_tree, "Displacement")


class _MaterialSettings(_MaterialPanel):
    bl_label = "Settings"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        material, column = context.material, column_of(self).column()
        column.prop(material, "pass_index")
        settings = getattr(material, "cycles", None)
        owner = material if hasattr(material, "displacement_method") else settings
        prop_if_present(column, owner, "displacement_method", text="Displacement")
        if hasattr(material, "use_transparent_shadow"):
            column.prop(material, "use_transparent_shadow", text="Transparent Shadows")
        else:
            prop_if_present(column, settings, "use_transparent_shadow", text="Transparent Shadows")
        prop_if_present(column, settings, "sample_as_light", text="Multiple Importance")
        prop_if_present(column, settings, "emission_sampling")


class VOLLEY_MATERIAL_PT_settings(_MaterialSettings, Panel):
    pass


class VOLLEY_NODE_PT_material_settings(NodeEditorPanel, _MaterialSettings, Panel):
    pass
