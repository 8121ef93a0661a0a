# SPDX-License-Identifier: Apache-2.0
"""Which of a material's output nodes is used, beside Cycles: of several, of those in groups, and of muted ones."""

RED, GREEN, BLUE = (0.9, 0.1, 0.1), (0.1, 0.9, 0.1), (0.1, 0.1, 0.9)
# Outputs of a material and of the group in it, of the group in that one: (colour, None where nothing is linked;
# target; "active", "muted" or "").
CASES = {
    "one": ([(RED, 'ALL', "")],),
    "the second is active": ([(RED, 'ALL', ""), (GREEN, 'ALL', "active")],),
    "the first is active": ([(RED, 'ALL', "active"), (GREEN, 'ALL', "")],),
    "another of Cycles": ([(RED, 'ALL', "active"), (GREEN, 'CYCLES', "")],),
    "an active one of Eevee": ([(RED, 'ALL', ""), (GREEN, 'EEVEE', "active")],),
    "of Eevee alone": ([(RED, 'EEVEE', "active")],),
    "two of Cycles": ([(RED, 'ALL', "active"), (GREEN, 'CYCLES', ""), (BLUE, 'CYCLES', "")],),
    "two of Cycles, the second is active": ([(RED, 'ALL', ""), (GREEN, 'CYCLES', ""), (BLUE, 'CYCLES', "active")],),
    "muted": ([(RED, 'ALL', "muted")],),
    "muted of Cycles": ([(RED, 'ALL', "active"), (GREEN, 'CYCLES', "muted")],),
    "an empty one is active": ([(RED, 'ALL', ""), (None, 'ALL', "active")],),
    "an empty one of Cycles": ([(RED, 'ALL', "active"), (None, 'CYCLES', "")],),
    "own and a group's": ([(RED, 'ALL', "active")], [(GREEN, 'ALL', "active")]),
    "a group's": ([], [(GREEN, 'ALL', "active")]),
    "a group's of Eevee": ([], [(GREEN, 'EEVEE', "active")]),
    "a group's of Cycles": ([(RED, 'ALL', "active")], [(GREEN, 'CYCLES', "active")]),
    "own and a group's of Cycles": ([(RED, 'CYCLES', "active")], [(GREEN, 'CYCLES', "active")]),
    "an empty one and a group's": ([(None, 'ALL', "active")], [(GREEN, 'ALL', "active")]),
    "two of a group": ([], [(GREEN, 'ALL', ""), (BLUE, 'ALL', "active")]),
    "a muted one of a group": ([(RED, 'ALL', "")], [(GREEN, 'ALL', "muted")]),
    "a group's in a group": ([], [], [(BLUE, 'ALL', "active")]),
    "of groups in groups": ([], [(GREEN, 'ALL', "active")], [(BLUE, 'ALL', "active")]),
    "of Cycles in a group's": ([], [(GREEN, 'ALL', "active")], [(BLUE, 'CYCLES', "active")]),
    "all of them": ([(RED, 'ALL', "active")], [(GREEN, 'ALL', "active")], [(BLUE, 'CYCLES', "active")])}


def _fill(tree, levels):
    """Make a level's outputs in a tree, and a group of the levels below."""
    import bpy
    for color, target, state in levels[0]:
        output = tree.nodes.new("ShaderNodeOutputMaterial")
        output.target = target
        if color is not None:
            emission = tree.nodes.new("ShaderNodeEmission")
            emission.inputs["Color"].default_value = (*color, 1.0)
            tree.links.new(emission.outputs[0], output.inputs["Surface"])
    outputs = [node for node in tree.nodes if node.type == 'OUTPUT_MATERIAL']
    for output, (_, _, state) in zip(outputs, levels[0]):
        output.is_active_output, output.mute = state == "active", state == "muted"
    if len(levels) > 1:
        group = tree.nodes.new("ShaderNodeGroup")
        group.node_tree = bpy.data.node_groups.new("Group", 'ShaderNodeTree')
        _fill(group.node_tree, levels[1:])


def _shown_color(material):
    """The colour of the emission that the panel of a material's surface shows, black where it shows nothing."""
    import bpy
    import drawing
    from volley.ui import shading
    context = drawing.Context(engine='VOLLEY', scene=bpy.context.scene, material=material)
    links = [link for socket in drawing.draw(shading.VOLLEY_MATERIAL_PT_surface, context).sockets
             for link in socket.links]
    color = links[0].from_node.inputs["Color"].default_value[:3] if links else (0.0, 0.0, 0.0)
    return [round(value, 3) for value in color]


def inside_outputs():
    """{case: the colours of a wall by both, and that of the panel}."""
    import scenes
    found = {}
    for case, levels in CASES.items():
        scenes.empty(size=(4, 4), samples=1)
        scenes.camera(type='ORTHO', ortho_scale=1.0)
        material = scenes.bpy.data.materials.new("Made")
        material.use_nodes = True
        material.node_tree.nodes.clear()
        _fill(material.node_tree, levels)
        scenes.wall(material=material)
        found[case] = [[round(float(value), 3) for value in picture[2, 2, :3]] for picture in scenes.by_both(1)]
        found[case].append(_shown_color(material))
    return found


def test_outputs(blender):
    """In 5.2 that of a group that is for Cycles alone was passed over where the material has one for all. The panel
    had no output of groups."""
    found = blender.run(inside_outputs)
    assert {case: each for case, each in found.items() if each[0] != each[1] or each[1] != each[2]} == {}
    assert len({tuple(theirs) for _, theirs, _ in found.values()}) == 4  # nothing, too
