# SPDX-License-Identifier: Apache-2.0
"""Panels stand where those of Cycles do and show what they are for; the status lines are a user's."""

import re

import blender as blender_support

STATUS_LINE = re.compile(r"^(?:Fra:.* \| Time:[^|]* \| |.* \| Fra: \d+ \| )(.*)$", re.MULTILINE)
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


# Panels of Cycles that Volley does without, by tab: what it does not model or render by, or has under another name.
_LEFT_OUT = {
    "NODE_EDITOR material": {"Surface", "Volume"},  # within Settings
    "NODE_EDITOR world": {"Surface", "Volume"},
    "NODE_EDITOR data": {"Settings"},               # within Light
    "PROPERTIES data": {"Settings", "Parameters"},
    "PROPERTIES material": {"Volume"},
    "PROPERTIES world": {"Volume"},
    "PROPERTIES object": {"Caustics", "Fast GI Approximation"},
    "PROPERTIES render": {
        "Acceleration Structure", "Aperture", "Bake", "Caustics", "Debug", "Denoise", "Fast GI Approximation",
        "Influence", "Lights", "Margin", "Output", "Parameters", "Path Guiding", "Sample Subset", "Selected to Active",
        "Texture Cache", "Volumes"},
    "VIEW_3D render": {"Debug"},
}


def inside_tabs():
    """{tab: labels of Cycles' panels and of Volley's}; labels that Volley's tabs of objects and materials have twice
    at the same place."""
    import addon_utils
    import bpy
    addon_utils.enable("cycles")
    tabs, places = {}, {}
    for cls in bpy.types.Panel.__subclasses__():
        engines = getattr(cls, "COMPAT_ENGINES", ())
        if "bl_rna" not in vars(cls) or not cls.bl_label:
            continue
        context = "render" if cls.bl_space_type == 'VIEW_3D' else getattr(cls, "bl_context", "")
        tab = tabs.setdefault(f"{cls.bl_space_type} {context}", {'CYCLES': set(), 'VOLLEY': set()})
        for engine in tab:
            if engine in engines:
                tab[engine].add(cls.bl_label)
        if 'VOLLEY' in engines and context in {"object", "material", "output"}:
            place = cls.bl_space_type, context, getattr(cls, "bl_parent_id", ""), cls.bl_label
            places.setdefault(place, []).append(cls.__name__)
    return tabs, [names for names in places.values() if len(names) > 1]


def test_panels_of_cycles_are_there(blender):
    """Post Processing, Displacement, Subdivision, the sidebar of the node editor and Lighting of rendered views were
    missing; in 4.3 and 5.2 there were two panels Shading."""
    tabs, doubled = blender.run(inside_tabs)
    assert not doubled
    for tab, labels in tabs.items():
        if not labels['CYCLES'] or tab == "PROPERTIES ":  # presets
            continue
        assert labels['CYCLES'] - labels['VOLLEY'] <= _LEFT_OUT.get(tab, set()), tab


def inside_panels():
    """Properties by panel, with those of a panel that is not shown left out."""
    import bpy
    import types
    import drawing
    import scenes
    from volley.ui import render, shading, view, view_layer
    scene = scenes.empty()
    light = scenes.light('POINT').data
    light.use_nodes = False
    context = drawing.Context(engine='VOLLEY', light=light, world=scene.world, scene=scene)
    found = {"no mist": shading.VOLLEY_WORLD_PT_mist.poll(context)}
    bpy.context.view_layer.use_pass_mist = True
    found["mist"] = shading.VOLLEY_WORLD_PT_mist.poll(context)
    for panel in (shading.VOLLEY_WORLD_PT_mist, shading.VOLLEY_LIGHT_PT_nodes,
                  render.VOLLEY_RENDER_PT_simplify_viewport, render.VOLLEY_RENDER_PT_simplify_render,
                  view_layer.VOLLEY_VIEWLAYER_PT_override):
        found[panel.__name__] = drawing.draw(panel, context).properties
    for kind in ('MATERIAL', 'RENDERED'):
        shown = types.SimpleNamespace(type=kind, use_scene_world_render=True, use_scene_world=True)
        context = drawing.Context(engine='VOLLEY', space_data=types.SimpleNamespace(type='VIEW_3D', shading=shown))
        if view.VOLLEY_VIEW3D_PT_shading_lighting.poll(context):
            found[kind] = drawing.draw(view.VOLLEY_VIEW3D_PT_shading_lighting, context).properties
    return found


def test_panels_show_what_they_are_for(blender):
    found = blender.run(inside_panels)
    assert not found["no mist"] and found["mist"]
    assert list(found["VOLLEY_WORLD_PT_mist"]) == ["start", "depth", "falloff"]
    if blender_support.version() < (5, 0):  # since then lights have nodes whatever they are told
        assert not found["VOLLEY_LIGHT_PT_nodes"]["use_nodes"]["is_split"]
    own_world = {"world_override"} if blender_support.version() >= (4, 3) else set()
    assert set(found["VOLLEY_VIEWLAYER_PT_override"]) == {"material_override", "samples"} | own_world
    assert "simplify_subdivision" in found["VOLLEY_RENDER_PT_simplify_viewport"]
    assert "simplify_subdivision_render" in found["VOLLEY_RENDER_PT_simplify_render"]
    assert {"use_scene_lights_render", "use_scene_world_render"} <= set(found['RENDERED']) and 'MATERIAL' not in found


def inside_dots():
    """Names of the properties with a dot that animates them: of each kind of light, and of its rays and a mesh's."""
    import bpy
    import drawing
    import scenes
    from volley.ui import objects, shading
    scenes.empty()
    found = {}

    def note(name, panel, **values):
        shown = drawing.draw(panel, drawing.Context(engine='VOLLEY', scene=bpy.context.scene, **values)).properties
        found[name] = {key for key, options in shown.items() if options["has_dot"]}

    for kind in ('POINT', 'SPOT', 'SUN', 'AREA'):
        note(kind, shading.VOLLEY_LIGHT_PT_light, light=scenes.light(kind).data)
    settings = bpy.data.lights[0].cycles
    found["shadow switch"] = {"cast_shadow" if hasattr(settings, "cast_shadow") else "use_shadow"}
    note("rays of a light", objects.VOLLEY_OBJECT_PT_ray_visibility, object=bpy.data.objects[0])
    note("rays of a mesh", objects.VOLLEY_OBJECT_PT_ray_visibility, object=scenes.wall())
    note("visibility", objects.VOLLEY_OBJECT_PT_visibility, object=bpy.data.objects["Wall"])
    return found


def test_what_is_animated_has_dots(blender):
    found = blender.run(inside_dots)
    for kind in ('POINT', 'SPOT', 'SUN', 'AREA'):
        assert {"color", "energy"} <= found[kind], kind
        assert {"cast_shadow", "use_shadow"} & found[kind] == found["shadow switch"], kind  # that which counts
    rays = {f"visible_{name}" for name in ("camera", "diffuse", "glossy", "transmission")}
    assert rays == found["rays of a light"] and found["rays of a mesh"] == rays | {"visible_shadow"}
    assert {"hide_viewport", "hide_render"} <= found["visibility"]


def inside_cycles_settings():
    """What becomes of the offer, and of settings, when Cycles' are taken over; every preset at last."""
    import os
    import bpy
    import scenes
    from volley import from_cycles, presets
    scene = scenes.empty()
    for name in scene.volley.keys():
        scene.volley.property_unset(name)
    found = {"untouched": from_cycles.is_offered(scene)}
    theirs, ours = scene.cycles, scene.volley
    changed = {"samples": 77, "adaptive_threshold": 0.05, "max_bounces": 9, "glossy_bounces": 7,
               "sample_clamp_indirect": 4.0, "blur_glossy": 0.5, "film_exposure": 1.5, "use_fast_gi": True,
               "fast_gi_method": 'ADD', "pixel_filter_type": 'GAUSSIAN', "filter_width": 2.0,
               "time_limit": 12.0,
               "texture_limit_render": '1024', "diffuse_bounces": 0, "light_sampling_threshold": 0.0,
               "use_denoising": False, "denoising_input_passes": 'RGB',
               "preview_denoising_input_passes": 'RGB_ALBEDO'}
    for name, value in changed.items():
        setattr(theirs, name, value)
    found["offered"] = from_cycles.is_offered(scene)
    theirs.volume_bounces = 3
    if hasattr(theirs, "use_light_tree"):  # from 3.5 on; it is read where it is
        theirs.use_light_tree = False
    found["result"] = bpy.ops.volley.copy_cycles_settings()
    found["again"] = from_cycles.is_offered(scene)
    found["pairs"] = {target: (getattr(theirs, source), getattr(ours, target))
                      for source, target in from_cycles._COPIED if hasattr(theirs, source)}
    found["left"] = from_cycles.copy(scene)
    theirs.pixel_filter_type = 'BOX'
    from_cycles.copy(scene)
    found["box"] = ours.pixel_filter_type, ours.filter_width
    for file in sorted(name for name in os.listdir(presets._OWN) if name.endswith(".py")):
        bpy.ops.script.execute_preset(filepath=os.path.join(presets._OWN, file),
                                      menu_idname="VOLLEY_PT_sampling_presets")
        found[file] = ours.integrator, ours.samples
    found["dismissed"] = bpy.ops.volley.keep_settings()
    return found


def test_settings_of_cycles_are_taken_over(blender):
    found = blender.run(inside_cycles_settings)
    assert not found["untouched"] and found["offered"] and not found["again"]
    assert found["result"] == {'FINISHED'} == found["dismissed"]
    assert len(found["pairs"]) >= 22
    assert all(theirs == ours for theirs, ours in found["pairs"].values()), found["pairs"]
    assert found["pairs"]["samples"][1] == 77 and found["pairs"]["texture_limit_render"][1] == '1024'
    assert "Volume Bounces" in found["left"]
    assert found["box"] == ('BOX', 1.0)  # which is what Cycles draws
    assert "Diffuse Bounces" not in found["left"] and "Light Tree" not in found["left"]
    assert found["Default.py"] == ('DISTRIBUTION', 64) and found["Whitted.py"] == ('WHITTED', 1)
    assert "Settings copied from Cycles; Volley has nothing for" in blender.output


def inside_time_limit():
    """Samples of the pixels and their colours: without a limit and with one far too short."""
    import bpy
    import scenes
    scene = scenes.empty(samples=3)
    scenes.camera()
    scenes.wall(size=40.0, material=scenes.emitter((0.25, 0.5, 1.0)))
    scene.view_layers[0].volley.use_pass_sample_count = True
    found = []
    for samples, limit in ((3, 0.0), (3, 1000.0), (1 << 20, 1e-3)):
        scene.volley.samples, scene.volley.time_limit = samples, limit
        passes = scenes.render_passes(["Combined", "Debug Sample Count"])
        found.append((passes["Combined"], passes["Debug Sample Count"][..., 0]))
    return found


def test_time_limit_ends_a_render(blender):
    found = blender.run(inside_time_limit)
    for picture, _ in found:
        assert abs(picture[..., :3] - (0.25, 0.5, 1.0)).max() < 1e-5
    assert (found[0][1] == 3.0).all() and (found[1][1] == 3.0).all()
    assert 1.0 <= found[2][1].min() and found[2][1].max() < 1 << 19


def inside_panorama_panel():
    import drawing
    import scenes
    from volley.ui import camera as ui
    scenes.empty()
    made = scenes.camera().data
    context = drawing.Context(engine='VOLLEY', camera=made)
    found = {"plane": ui.VOLLEY_CAMERA_PT_panorama.poll(context)}
    made.type = 'PANO'
    found["panorama"] = ui.VOLLEY_CAMERA_PT_panorama.poll(context)
    place = made if hasattr(made, "panorama_type") else made.cycles
    for kind in place.bl_rna.properties["panorama_type"].enum_items.keys():
        place.panorama_type = kind
        found[kind] = list(drawing.draw(ui.VOLLEY_CAMERA_PT_panorama, context).properties)
    return found


def test_panoramas_have_a_panel(blender):
    found = blender.run(inside_panorama_panel)
    assert not found.pop("plane") and found.pop("panorama")
    assert {kind for kind, shown in found.items() if len(shown) == 1} == {
        'EQUIANGULAR_CUBEMAP_FACE', 'MIRRORBALL'}
    assert len(found['EQUIRECTANGULAR']) == 5


def inside_render():
    import scenes
    from volley import session
    scenes.empty(samples=4)
    scenes.camera()
    scenes.wall()
    scenes.render()
    return [session.timecode(seconds) for seconds in (0.004, 59.999, 3723.456)]


def test_status_of_a_render(blender):
    if blender_support.version() >= (5, 0):  # which shows them only if told to, and without the time
        blender.options = ["--log", "render", "--log-level", "info"]
    times = blender.run(inside_render)
    assert times == ["00:00.00", "01:00.00", "01:02:03.46"]
    lines = STATUS_LINE.findall(blender.output)
    samples = [line for line in lines if line not in {"Reading the scene", "Preparing to render"}]
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
        time, memory, status = text.split(" | ", 2)
        assert re.match("Mem:[0-9]+M$", memory), text
        assert re.match("Time:[0-9]{2}:[0-9]{2}[.][0-9]{2}$", time), text
        assert STATUS.match(status).group(2) == "6", text
