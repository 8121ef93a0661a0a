# SPDX-License-Identifier: Apache-2.0
"""Panels stand where those of Cycles do and show what they are for; the status lines are a user's."""

import re

STATUS = re.compile(r"(Remaining:[0-9:.]+ \| )?Sample [0-9]+/([0-9]+)$")


def _labels_of_render_panels(engine, own_panels):
    """Labels of the Render tab from top to bottom: Blender sorts by bl_order, then by registration, which
    is that of its own panels before those of add-ons."""
    import bpy
    shown = [cls for cls in bpy.types.Panel.__subclasses__()
             if engine in getattr(cls, "COMPAT_ENGINES", ()) and getattr(cls, "bl_context", "") == "render"
             and not hasattr(cls, "bl_parent_id") and "bl_rna" in vars(cls)]
    own_panels = list(own_panels)
    place = {cls: own_panels.index(cls) if cls in own_panels else -1 for cls in shown}
    shown.sort(key=lambda cls: (getattr(cls, "bl_order", 0), place[cls]))
    return [cls.bl_label for cls in shown if cls.bl_label]


def inside_order():
    import addon_utils
    addon_utils.enable("cycles")
    import cycles.ui
    from volley import ui
    return (_labels_of_render_panels('CYCLES', cycles.ui.classes),
            _labels_of_render_panels('VOLLEY', ui._own_panels()))


def test_panels_stand_as_those_of_cycles(blender):
    cycles, own = blender.run(inside_order)
    assert own[0] == "Sampling" and len(own) == len(set(own))
    assert {"Simplify", "Motion Blur", "Film", "Performance", "Color Management"} <= set(own)
    assert [label for label in own if label in cycles] == [label for label in cycles if label in own]


def inside_panels():
    """Properties by panel, with those of a panel that is not shown left out."""
    import bpy
    import drawing
    import scenes
    from volley.ui import render, shading
    scene = scenes.empty()
    light = scenes.light('POINT').data
    light.use_nodes = False
    context = drawing.Context(engine='VOLLEY', light=light, world=scene.world, scene=scene)
    found = {"no mist": shading.VOLLEY_WORLD_PT_mist.poll(context)}
    bpy.context.view_layer.use_pass_mist = True
    found["mist"] = shading.VOLLEY_WORLD_PT_mist.poll(context)
    for panel in (shading.VOLLEY_WORLD_PT_mist, shading.VOLLEY_LIGHT_PT_nodes, render.VOLLEY_RENDER_PT_simplify_viewport,
                  render.VOLLEY_RENDER_PT_simplify_render):
        found[panel.__name__] = drawing.draw(panel, context).properties
    return found


def test_panels_show_what_they_are_for(blender):
    found = blender.run(inside_panels)
    assert not found["no mist"] and found["mist"]
    assert list(found["VOLLEY_WORLD_PT_mist"]) == ["start", "depth", "falloff"]
    assert not found["VOLLEY_LIGHT_PT_nodes"]["use_nodes"]["is_split"]
    assert "simplify_subdivision" in found["VOLLEY_RENDER_PT_simplify_viewport"]
    assert "simplify_subdivision_render" in found["VOLLEY_RENDER_PT_simplify_render"]


def inside_render():
    import scenes
    from volley import session
    scenes.empty(samples=4)
    scenes.camera()
    scenes.wall()
    scenes.render()
    return [session.timecode(seconds) for seconds in (0.004, 59.999, 3723.456)]


def test_status_of_a_render(blender):
    times = blender.run(inside_render)
    assert times == ["00:00.00", "01:00.00", "01:02:03.46"]
    lines = [line.partition(" | Time:")[2].partition(" | ")[2] for line in blender.output.splitlines()
             if line.startswith("Fra:")]
    samples = [line for line in lines if line not in {"Synchronizing", "Building"}]
    assert all(STATUS.match(line) for line in samples), samples
    assert samples[-1] == "Sample 4/4"


def inside_view():
    """The status lines of a viewport, until all its samples are there."""
    import bpy
    import scenes
    from volley import viewport
    yield 0.1
    scene = scenes.empty(samples=2)
    yield 0.5
    scenes.camera()
    scenes.wall()
    texts = []
    draw = viewport._Pictures.draw

    def noting_draw(self, engine, scene):
        draw(self, engine, scene)
        if self._texture is not None:
            texts.append(self._status)

    viewport._Pictures.draw = noting_draw
    scene.volley.preview_samples = 6
    area = next(area for area in bpy.context.window_manager.windows[0].screen.areas if area.type == 'VIEW_3D')
    area.spaces.active.shading.type = 'RENDERED'
    for _ in range(100):
        yield 0.1
        if texts and texts[-1].endswith("6/6"):
            break
    return texts


def test_status_of_a_viewport(window):
    texts = window.run_in_window(inside_view)
    assert texts[-1].endswith("Sample 6/6")
    for text in texts:
        time, _, status = text.partition(" | ")
        assert re.match("Time:[0-9]{2}:[0-9]{2}[.][0-9]{2}$", time), text
        assert STATUS.match(status).group(2) == "6", text
