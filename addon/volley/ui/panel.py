# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels have in common."""

ENGINE = 'VOLLEY'


class VolleyPanel:
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


class NodeEditorPanel:
    """Put before what a panel of the Properties editor is made of: the same beside the node editor's tree."""

    bl_space_type = 'NODE_EDITOR'
    bl_region_type = 'UI'
    bl_category = "Options"


def column_of(panel, has_keys=False):
    """The panel's layout in Blender's two-column style; has_keys: with a dot to animate each property."""
    layout = panel.layout
    layout.use_property_split = True
    layout.use_property_decorate = has_keys
    return layout


def prop_if_present(layout, data, name, **options):
    """Show a property that not every version has."""
    if data is not None and hasattr(data, name):
        layout.prop(data, name, **options)


def draw_light_group(panel, data, view_layer):
    """The light group of an object or world, and a button that adds one of that name."""
    row = column_of(panel).row(align=True)
    row.prop_search(data, "lightgroup", view_layer, "lightgroups", text="Light Group",
                    results_are_suggestions=True)
    button = row.column(align=True)
    button.enabled = bool(data.lightgroup) and data.lightgroup not in view_layer.lightgroups
    button.operator("scene.view_layer_add_lightgroup", icon='ADD', text="").name = data.lightgroup
