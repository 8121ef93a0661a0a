# SPDX-License-Identifier: GPL-3.0-or-later
"""The shader nodes that this engine renders, in Blender's own menus.

Till 4.1 those menus offer most shaders and outputs to Cycles and EEVEE alone, by name. There, this engine
puts its own into the same categories. The search of the Add menu finds them: in 3.4 it asks no menu, later
it reads these.
"""

import bpy
import nodeitems_builtins

try:
    from bl_ui import node_add_menu_shader
except ImportError:  # 3.4
    node_add_menu_shader = None

ENGINE = 'VOLLEY'

# Categories by the menus that stand for them: of 3.4, since 3.5.
_OUTPUT_MENUS = ("NODE_MT_category_SH_NEW_OUTPUT", "NODE_MT_category_shader_output")
_SHADER_MENUS = ("NODE_MT_category_SH_NEW_SHADER", "NODE_MT_category_shader_shader")

# Of those that are offered to other engines by name; not every version has each. By the kinds of trees.
_OBJECT, _WORLD = {'OBJECT'}, {'WORLD'}
_OUTPUTS = {"ShaderNodeOutputMaterial": _OBJECT, "ShaderNodeOutputLight": _OBJECT}
_SHADERS = {
    "ShaderNodeAddShader": _OBJECT | _WORLD, "ShaderNodeBsdfAnisotropic": _OBJECT,
    "ShaderNodeBsdfDiffuse": _OBJECT, "ShaderNodeBsdfGlass": _OBJECT, "ShaderNodeBsdfGlossy": _OBJECT,
    "ShaderNodeBsdfHair": _OBJECT, "ShaderNodeBsdfHairPrincipled": _OBJECT,
    "ShaderNodeBsdfPrincipled": _OBJECT, "ShaderNodeBsdfRefraction": _OBJECT,
    "ShaderNodeBsdfSheen": _OBJECT, "ShaderNodeBsdfToon": _OBJECT, "ShaderNodeBsdfTranslucent": _OBJECT,
    "ShaderNodeBsdfTransparent": _OBJECT, "ShaderNodeBsdfVelvet": _OBJECT,
    "ShaderNodeEmission": _OBJECT | _WORLD, "ShaderNodeHoldout": _OBJECT,
    "ShaderNodeMixShader": _OBJECT | _WORLD}


def _is_needed():
    """Whether Blender's menus know Cycles and EEVEE by name."""
    return any(hasattr(module, "object_eevee_cycles_shader_nodes_poll")
               for module in (nodeitems_builtins, node_add_menu_shader))


def _draw(node_types):
    """A menu's function that adds those types, sorted as Blender does, each once by whichever name."""
    def draw(menu, context):
        space = context.space_data
        if context.engine != ENGINE or space.tree_type != 'ShaderNodeTree':
            return
        found = {bpy.types.Node.bl_rna_get_subclass(name): name for name, trees in node_types.items()
                 if space.shader_type in trees}
        found.pop(None, None)
        for kind, name in sorted(found.items(), key=lambda item: item[0].name):
            button = menu.layout.operator("node.add_node", text=kind.name,
                                          text_ctxt=kind.translation_context)
            button.type, button.use_transform = name, True
    return draw


_ADDITIONS = ((_OUTPUT_MENUS, _draw(_OUTPUTS)), (_SHADER_MENUS, _draw(_SHADERS)))


def _menus():
    """The menus of this Blender that lack something, and what is added to each."""
    if not _is_needed():
        return
    for names, draw in _ADDITIONS:
        for menu in filter(None, (getattr(bpy.types, name, None) for name in names)):
            yield menu, draw


def register():
    for menu, draw in _menus():
        menu.prepend(draw)


def unregister():
    for menu, draw in _menus():
        menu.remove(draw)
