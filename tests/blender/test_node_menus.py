# SPDX-License-Identifier: Apache-2.0
"""Blender's Add menu of shader nodes offers what the engine renders."""

OUTPUTS = {"ShaderNodeOutputMaterial", "ShaderNodeOutputLight", "ShaderNodeOutputWorld"}


def _offered(engine, shader_type):
    """{label of a category: types of nodes}; labels are the same in all versions."""
    import bpy
    import drawing
    space = drawing.Context(type='NODE_EDITOR', tree_type='ShaderNodeTree', shader_type=shader_type,
                            edit_tree=None, id_from=None)
    context = drawing.Context(engine=engine, space_data=space)
    offered = {}
    for name in dir(bpy.types):
        if name.startswith(("NODE_MT_category_SH_NEW_", "NODE_MT_category_shader_")):
            cls = getattr(bpy.types, name)
            offered[cls.bl_label] = [button.type for button in drawing.draw(cls, context).nodes]
    return offered


def inside_menus():
    """What engines are offered with the add-on and without, and what this one renders."""
    import bpy
    from volley.sync import nodes
    rendered = {*nodes._SPECS, *nodes._SPECIAL, *nodes.TEXTURES, *nodes.CONVERTERS}

    def of_all():
        return {(engine, kind): _offered(engine, kind) for engine in ('CYCLES', 'VOLLEY', 'BLENDER_WORKBENCH')
                for kind in ('OBJECT', 'WORLD', 'LINESTYLE')}

    with_it = of_all()
    bpy.ops.preferences.addon_disable(module="volley")
    without = of_all()
    bpy.ops.preferences.addon_enable(module="volley")
    return rendered, with_it, without, of_all()


def test_menus_offer_what_is_rendered(blender):
    rendered, with_it, without, again = blender.run(inside_menus)
    assert with_it == again
    others = [key for key in with_it if key[0] != 'VOLLEY']
    assert {key: with_it[key] for key in others} == {key: without[key] for key in others}
    for kind in ('OBJECT', 'WORLD'):
        cycles, own, before = with_it['CYCLES', kind], with_it['VOLLEY', kind], without['VOLLEY', kind]
        for category, types in cycles.items():
            wanted = {name for name in types if name in rendered | OUTPUTS}
            assert wanted <= set(own[category]), (kind, category)
            assert len(own[category]) == len(set(own[category])), (kind, category)
            assert set(own[category]) - set(before[category]) <= rendered | OUTPUTS, (kind, category)
    assert len(with_it['VOLLEY', 'OBJECT']["Shader"]) > 10
    assert "ShaderNodeOutputMaterial" in with_it['VOLLEY', 'OBJECT']["Output"]
    assert with_it['VOLLEY', 'LINESTYLE'] == without['VOLLEY', 'LINESTYLE']
