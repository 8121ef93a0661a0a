# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels in Blender's own style, and Blender's own panels that hold for this engine too.

Settings that live with Cycles' property groups (object motion steps, light and world sampling) are
shown where that add-on is enabled.
"""

import bpy
from bpy.types import Panel

from . import camera, objects, render, shading, view, view_layer
from .panel import ENGINE

_MODULES = (render, view_layer, objects, camera, shading, view)

# Panels of other engines whose content holds here as it is; not every version has each.
_SHARED_PANELS = {
    "DATA_PT_camera_dof", "DATA_PT_camera_dof_aperture", "DATA_PT_preview", "MATERIAL_PT_preview",
    "EEVEE_MATERIAL_PT_context_material", "TEXTURE_PT_preview",
}
# Panels made for Blender's internal engine that show what this one does not have, or has itself.
_LEFT_OUT_PANELS = {
    "DATA_PT_area", "DATA_PT_falloff_curve", "DATA_PT_light", "DATA_PT_spot", "NODE_DATA_PT_light",
    "NODE_DATA_PT_spot", "OBJECT_PT_visibility", "VIEWLAYER_PT_filter", "VIEWLAYER_PT_layer_passes",
    "RENDER_PT_simplify", "RENDER_PT_simplify_viewport", "RENDER_PT_simplify_render",
    "RENDER_PT_simplify_greasepencil",
}


def _own_panels():
    """All panels of this package, in the order in which they are shown."""
    return [value for module in _MODULES for value in vars(module).values()
            if isinstance(value, type) and issubclass(value, Panel) and value.__module__ == module.__name__]


def _compatible_panels():
    """Blender's panels that hold for this engine."""
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if engines is None or panel.__module__.startswith(__name__):
            continue
        name = panel.__name__
        if name in _SHARED_PANELS or ('BLENDER_RENDER' in engines and name not in _LEFT_OUT_PANELS):
            yield panel


def _draw_pause(header, context):
    """The button that pauses a rendered viewport, in the 3D view's header."""
    if context.engine == ENGINE and context.space_data.shading.type == 'RENDERED':
        settings = context.scene.volley
        icon = 'PLAY' if settings.preview_pause else 'PAUSE'
        header.layout.prop(settings, "preview_pause", text="", icon=icon)


def register():
    for panel in _own_panels():
        bpy.utils.register_class(panel)
    for panel in _compatible_panels():
        panel.COMPAT_ENGINES.add(ENGINE)
    bpy.types.VIEW3D_HT_header.append(_draw_pause)


def unregister():
    bpy.types.VIEW3D_HT_header.remove(_draw_pause)
    for panel in _compatible_panels():
        panel.COMPAT_ENGINES.discard(ENGINE)
    for panel in reversed(_own_panels()):
        bpy.utils.unregister_class(panel)
