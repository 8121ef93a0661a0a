# SPDX-License-Identifier: Apache-2.0
"""The rendered viewport, panels and previews in a window on a virtual display."""

import numpy as np
import pytest

DRAW_SECONDS = 0.5
ENDLESS = 1 << 20  # samples
LONGEST_DRAWS = 60  # until a view must have come to rest, on a busy machine too


def _view():
    """The window, its 3D view and that view's space."""
    import bpy
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == 'VIEW_3D')
    return window, area, area.spaces.active


def _shot():
    """What the 3D view shows, (height, width, 3), display colours."""
    import screen
    picture, area = screen.Screen().picture(), _view()[1]
    region = next(region for region in area.regions if region.type == 'WINDOW')
    return picture[region.y:region.y + region.height, region.x:region.x + region.width, :3]


def _settled():
    """The view once it no longer changes, without the status line, which tells of speed. Pictures that
    are equal do not tell: on a busy machine one may stay for long before the next."""
    from volley import viewport
    read, is_running = viewport._Pictures.read, [True]

    def noting_read(*arguments):
        is_running[0] = read(*arguments)
        return is_running[0]

    viewport._Pictures.read = noting_read
    before = None
    for _ in range(LONGEST_DRAWS):
        _view()[1].tag_redraw()
        yield DRAW_SECONDS
        shot = _shot()
        shot = shot[:len(shot) * 3 // 4]
        if before is not None and np.array_equal(shot, before) and not is_running[0]:
            break
        before = shot
    viewport._Pictures.read = read
    return shot


def _open(scene):
    """A plain view through the camera: no overlays, no gizmos, colours as they are."""
    import bpy
    bpy.context.preferences.view.show_splash = False
    scene.view_settings.view_transform, scene.render.dither_intensity = 'Standard', 0.0
    scene.volley.preview_samples = 2
    _, _, space = _view()
    space.overlay.show_overlays = space.show_gizmo = False
    space.shading.type = 'RENDERED'
    return space


def _fail_once():
    """Let the next sync of a viewport fail without the view being given up; a list that says if it did."""
    from volley import viewport
    failed, synchronise, update = [], viewport.Viewport._synchronise, viewport.SceneSync.update

    def fail(*_):
        viewport.SceneSync.update = update
        raise KeyboardInterrupt

    def careless(*arguments):
        try:
            return synchronise(*arguments)
        except KeyboardInterrupt:
            failed.append(True)
            return False

    viewport.Viewport._synchronise, viewport.SceneSync.update = careless, fail
    return failed


def inside_edits():
    import bpy
    import scenes
    yield 0.1
    scene = scenes.empty(samples=2)
    yield DRAW_SECONDS
    scenes.camera()
    material = scenes.emitter((0.0, 1.0, 0.0))
    wall = scenes.wall(size=30.0, material=material)
    space = _open(scene)
    colors = {}

    def center():
        picture = _shot()
        height, width = picture.shape[:2]
        return picture[height // 2 - 8:height // 2 + 8, width // 2 - 8:width // 2 + 8].mean(axis=(0, 1))

    space.region_3d.view_perspective = 'CAMERA'
    yield DRAW_SECONDS
    colors["camera"] = center()
    space.region_3d.view_perspective = 'PERSP'
    space.region_3d.view_rotation = scene.camera.rotation_euler.to_quaternion()
    yield DRAW_SECONDS
    colors["perspective"] = center()
    space.region_3d.view_perspective = 'ORTHO'
    yield DRAW_SECONDS
    colors["orthographic"] = center()
    space.region_3d.view_perspective = 'CAMERA'
    failed = _fail_once()
    material.node_tree.nodes["Emission"].inputs["Color"].default_value = (1.0, 0.0, 0.0, 1.0)
    yield DRAW_SECONDS
    colors["recoloured"] = center()
    assert failed == [True]
    near = scenes.wall("Near", 30.0, -1.0, material=scenes.emitter((0.0, 0.0, 1.0), "Blue"))
    yield DRAW_SECONDS
    colors["added"] = center()
    near.location.y = 5.0
    yield DRAW_SECONDS
    colors["moved"] = center()
    near.location.y = 0.0
    bpy.data.objects.remove(wall)
    yield DRAW_SECONDS
    colors["deleted"] = center()
    space.shading.type = 'SOLID'
    yield DRAW_SECONDS
    space.shading.type = 'RENDERED'
    yield DRAW_SECONDS
    colors["again"] = center()
    window, area, _ = _view()
    with bpy.context.temp_override(window=window, area=area,
                                   region=next(r for r in area.regions if r.type == 'WINDOW')):
        bpy.ops.screen.region_quadview()
    yield DRAW_SECONDS
    scene.render.engine = 'BLENDER_WORKBENCH'
    yield DRAW_SECONDS
    return colors


def test_viewport_follows_edits(window):
    colors = window.run_in_window(inside_edits)
    expected = {"camera": 'g', "perspective": 'g', "orthographic": 'g', "recoloured": 'r', "added": 'b',
                "moved": 'r', "deleted": 'b', "again": 'b'}
    for name, channel in expected.items():
        wanted = [float(letter == channel) for letter in "rgb"]
        assert colors[name] == pytest.approx(wanted, abs=0.03), name
    assert not window.complaints()


def inside_random_edits(count):
    """Random edits while the view renders; what it shows at the end and what a new view shows."""
    import random
    import bpy
    import edits
    import scenes
    yield 0.1
    scene = scenes.empty()
    yield DRAW_SECONDS
    window, area, _ = _view()
    with bpy.context.temp_override(window=window, area=area,
                                   region=next(r for r in area.regions if r.type == 'WINDOW')):
        edits.fill(scene)
    space = _open(scene)
    scene.volley.preview_samples = 16
    space.region_3d.view_perspective = 'CAMERA'
    yield DRAW_SECONDS
    random = random.Random(7)
    for _ in range(count):
        random.choice(edits.ALL)(random)
        yield random.choice((0.0, 0.01, 0.05))
    scene.render.film_transparent = False
    yield DRAW_SECONDS
    followed = yield from _settled()
    space.shading.type = 'SOLID'
    yield DRAW_SECONDS
    space.shading.type = 'RENDERED'
    yield DRAW_SECONDS
    fresh = yield from _settled()
    return followed, fresh


def test_random_edits_in_a_window(window):
    followed, fresh = window.run_in_window(inside_random_edits, 200)
    assert fresh.std() > 0.01
    assert np.abs(followed - fresh).mean() < 0.002
    assert not window.complaints()


def inside_session():
    """A working session: visibility, view layers, undo, playback, border, engines, another file."""
    import bpy
    import scenes
    yield 0.1
    scene = scenes.empty(samples=2)
    yield DRAW_SECONDS
    scenes.camera()
    wall = scenes.wall(size=30.0, material=scenes.emitter((0.0, 1.0, 0.0), "Green"))
    near = scenes.wall("Near", 30.0, -1.0, material=scenes.emitter((0.0, 0.0, 1.0), "Blue"))
    layer = scene.view_layers.new("Without")
    hidden = bpy.data.collections.new("Hidden")
    scene.collection.children.link(hidden)
    scene.collection.objects.unlink(near)
    hidden.objects.link(near)
    layer.layer_collection.children["Hidden"].exclude = True
    space = _open(scene)
    space.region_3d.view_perspective = 'CAMERA'
    window, area, _ = _view()
    region = next(r for r in area.regions if r.type == 'WINDOW')
    view = {"window": window, "area": area, "region": region}
    colors = {}

    def center():
        picture = _shot()
        height, width = picture.shape[:2]
        return picture[height // 2 - 8:height // 2 + 8, width // 2 - 8:width // 2 + 8].mean(axis=(0, 1))

    yield DRAW_SECONDS
    colors["start b"] = center()
    near.hide_set(True)
    yield DRAW_SECONDS
    colors["hidden g"] = center()
    near.hide_set(False)
    yield DRAW_SECONDS
    colors["shown b"] = center()
    window.view_layer = layer
    yield DRAW_SECONDS
    colors["other layer g"] = center()
    window.view_layer = scene.view_layers[0]
    yield DRAW_SECONDS
    colors["first layer b"] = center()
    space.show_object_viewport_mesh = False
    yield DRAW_SECONDS
    colors["no meshes k"] = center()
    space.show_object_viewport_mesh = True
    bpy.ops.object.select_all(action='DESELECT')
    wall.select_set(True)
    with bpy.context.temp_override(**view):
        bpy.ops.view3d.localview(frame_selected=False)
    yield DRAW_SECONDS
    space.region_3d.view_perspective = 'CAMERA'
    yield DRAW_SECONDS
    colors["local g"] = center()
    with bpy.context.temp_override(**view):
        bpy.ops.view3d.localview(frame_selected=False)
    yield DRAW_SECONDS
    bpy.ops.ed.undo_push(message="before")
    bpy.data.materials["Blue"].node_tree.nodes["Emission"].inputs[0].default_value = (1, 0, 0, 1)
    bpy.ops.ed.undo_push(message="red")
    yield DRAW_SECONDS
    colors["red r"] = center()
    with bpy.context.temp_override(**view):
        bpy.ops.ed.undo()
    yield DRAW_SECONDS
    colors["undone b"] = center()
    with bpy.context.temp_override(**view):
        bpy.ops.ed.redo()
    yield DRAW_SECONDS
    colors["redone r"] = center()
    scene, near = bpy.context.scene, bpy.data.objects["Near"]
    near.location.y = 0.0
    near.keyframe_insert("location", frame=1)
    near.location.y = 20.0
    near.keyframe_insert("location", frame=20)
    scene.frame_end = 20
    scene.frame_set(1)
    with bpy.context.temp_override(**view):
        bpy.ops.screen.animation_play()
    yield 1.0
    with bpy.context.temp_override(**view):
        bpy.ops.screen.animation_cancel(restore_frame=False)
    scene.frame_set(20)
    yield DRAW_SECONDS
    colors["last frame g"] = center()
    space.region_3d.view_perspective = 'PERSP'
    space.region_3d.view_rotation = scene.camera.rotation_euler.to_quaternion()
    space.use_render_border = True
    space.render_border_min_x, space.render_border_max_x = 0.4, 0.6
    space.render_border_min_y, space.render_border_max_y = 0.4, 0.6
    yield DRAW_SECONDS
    colors["border g"] = center()
    space.use_render_border = False
    scene.volley.preview_samples = 4096
    yield 0.1
    scene.render.engine = 'BLENDER_WORKBENCH'
    yield DRAW_SECONDS
    scene.render.engine = 'VOLLEY'
    yield DRAW_SECONDS
    colors["engine back g"] = center()
    path = bpy.app.tempdir + "other.blend"
    bpy.data.materials["Green"].node_tree.nodes["Emission"].inputs[0].default_value = (1, 0, 0, 1)
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.data.materials["Green"].node_tree.nodes["Emission"].inputs[0].default_value = (0, 1, 0, 1)
    yield DRAW_SECONDS
    bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)
    yield 2.0 * DRAW_SECONDS
    _view()[2].shading.type = 'RENDERED'
    yield DRAW_SECONDS
    colors["loaded r"] = center()
    return colors


def test_a_session_of_work(window):
    colors = window.run_in_window(inside_session)
    for name, color in colors.items():
        wanted = [float(letter == name[-1]) for letter in "rgb"]
        assert color == pytest.approx(wanted, abs=0.03), name
    assert not window.complaints()


def inside_drag():
    """An object dragged before a bright wall, looked at after each step: how dark it ever was."""
    import bpy
    import scenes
    yield 0.1
    scene = scenes.empty()
    yield DRAW_SECONDS
    scenes.camera()
    scenes.wall(size=60.0, material=scenes.emitter((1.0, 1.0, 1.0)))
    ball = scenes.wall("Ball", 1.0, -1.0, material=scenes.emitter((0.0, 1.0, 0.0), "Green"))
    space = _open(scene)
    scene.volley.preview_samples = 256
    space.region_3d.view_perspective = 'CAMERA'
    yield DRAW_SECONDS
    darkest, places = 1.0, []
    for step in range(20):
        ball.location.x = 0.1 * step - 1.0
        yield 0.05
        picture = _shot()
        height, width = picture.shape[:2]  # within the camera's frame
        picture = picture[height * 2 // 5:height * 3 // 5, width * 3 // 10:width * 7 // 10]
        darkest = min(darkest, float(picture[..., 1].min()))
        places.append(float(np.nonzero(picture[..., 0].min(axis=0) < 0.5)[0].mean()))
    return darkest, places


def test_a_dragged_object_is_always_a_whole_picture(window):
    darkest, places = window.run_in_window(inside_drag)
    assert darkest > 0.9
    assert (np.diff(places) >= 0.0).all() and places[-1] - places[0] > 50.0
    assert not window.complaints()


def inside_panels():
    """Every tab of the Properties editor for a mesh, a light and a camera, all panels open."""
    import bpy
    import scenes
    yield 0.1
    scene = scenes.empty()
    yield DRAW_SECONDS
    scenes.camera()
    wall = scenes.wall(material=scenes.emitter((1.0, 1.0, 1.0)))
    lamps = [scenes.light(kind) for kind in ('POINT', 'SPOT', 'SUN', 'AREA')]
    for panel in bpy.types.Panel.__subclasses__():
        if panel.__name__.startswith("VOLLEY") and 'DEFAULT_CLOSED' in getattr(panel, "bl_options", ()):
            bpy.utils.unregister_class(panel)
            panel.bl_options = set()
            bpy.utils.register_class(panel)
    window, area, _ = _view()
    area.type = 'PROPERTIES'
    drawn = 0
    for active in [wall, scene.camera] + lamps:
        bpy.context.view_layer.objects.active = active
        yield 0.1
        for context in ('RENDER', 'VIEW_LAYER', 'WORLD', 'OBJECT', 'DATA', 'MATERIAL'):
            if context == 'MATERIAL' and active != wall:
                continue
            area.spaces.active.context = context
            area.tag_redraw()
            yield 0.1
            drawn += 1
    material = wall.active_material
    with bpy.context.temp_override(id=material):
        bpy.ops.ed.lib_id_generate_preview()
    yield 2.0
    area.spaces.active.context = 'RENDER'  # no preview is under way when Blender ends
    yield 1.0
    preview = np.array(material.preview.image_pixels_float[:]).reshape(-1, 4)
    return drawn, preview.max(axis=0).tolist()


def test_panels_draw_and_previews_render(window):
    drawn, preview = window.run_in_window(inside_panels)
    assert drawn == 31
    assert preview[0] > 0.5 and preview[3] > 0.5
    assert not window.complaints()


def inside_render_that_begins_within_a_draw(leaves):
    """Writes from a timer after a render that began while the viewport was being drawn, and which ended by
    itself or as the add-on was disabled; whether it did begin there."""
    import time
    import addon_utils
    import bpy
    import scenes
    from volley import session, viewport
    yield 0.1
    scene = scenes.empty(size=(64, 48), samples=ENDLESS if leaves else 4)
    scenes.camera((0.0, -9.0, 0.0))
    yield DRAW_SECONDS
    window, area, space = _view()
    bpy.context.preferences.view.render_display_type = 'NONE'
    space.shading.type = 'RENDERED'
    scene.volley.preview_samples = 1
    yield from _settled()
    region = next(region for region in area.regions if region.type == 'WINDOW')
    drawing, was_within, renders = [False], [False], [False]
    draw, render = viewport.Viewport.draw, session.Session.render

    def slow_draw(self, *arguments):
        drawing[0] = True
        draw(self, *arguments)
        time.sleep(1.5)
        drawing[0] = False

    def slow_render(self, *arguments):
        was_within[0] |= drawing[0]
        while drawing[0]:
            time.sleep(0.1)
        renders[0] = True
        render(self, *arguments)

    bpy.app.handlers.render_pre.append(lambda *_: time.sleep(1.0))
    viewport.Viewport.draw, session.Session.render = slow_draw, slow_render
    with bpy.context.temp_override(window=window):
        bpy.ops.render.render('INVOKE_DEFAULT')
    yield 0.3
    region.tag_redraw()
    for _ in range(LONGEST_DRAWS):
        yield 0.1
        if renders[0] and leaves or not bpy.app.is_job_running('RENDER'):
            break
    if leaves:
        addon_utils.disable("volley")
        addon_utils.enable("volley")
    else:
        yield 3.0 * DRAW_SECONDS
    scene.volley.samples = 5  # fails where writing is forbidden
    return was_within[0]


@pytest.mark.parametrize("leaves", [False, True])
def test_scripts_may_write_after_a_render_that_begins_within_a_draw(window, leaves):
    assert window.run_in_window(inside_render_that_begins_within_a_draw, leaves, timeout=60)
    assert not window.complaints()


# The view through the camera, and what the shading menu says ----------------------------------------

def _green_box(shot):
    """left, right, bottom, top of what is green."""
    is_green = (shot[..., 1] > 0.9) & (shot[..., 0] < 0.1)
    columns, rows = np.flatnonzero(is_green.any(axis=0)), np.flatnonzero(is_green.any(axis=1))
    return [int(edge) for edge in (columns[0], columns[-1] + 1, rows[0], rows[-1] + 1)]


def _moved_view(rv3d, region, wall):
    """Where a small wall is shown, and where Blender has it, by two offsets of the view."""
    from bpy_extras.view3d_utils import location_3d_to_region_2d
    boxes, offset = [], tuple(rv3d.view_camera_offset)
    wall.scale = (0.02, 1.0, 0.02)
    for rv3d.view_camera_offset in (offset, (-0.06, 0.05)):
        shot = yield from _settled()
        corners = [wall.matrix_world @ vertex.co for vertex in wall.data.vertices]
        at = [location_3d_to_region_2d(region, rv3d, corner) for corner in corners]
        boxes.append((_green_box(shot), [edge(point[axis] for point in at) for axis in (0, 1)
                                         for edge in (min, max)]))
    rv3d.view_camera_offset, wall.scale = offset, (1.0, 1.0, 1.0)
    return boxes


def _chosen_sizes(scene):
    """{size of a pixel that the user chose: that of the last picture in the view's pixels}"""
    from volley import native
    start, widths, found = native.Scene.start_render, [], {}

    def noting_start(self, **fields):
        widths.append(fields["width"])
        return start(self, **fields)

    native.Scene.start_render = noting_start
    for scene.render.preview_pixel_size in ('1', '4', 'AUTO'):
        yield from _settled()
        found[scene.render.preview_pixel_size] = widths[-1]
    native.Scene.start_render = start
    return found


def inside_camera_region():
    """The part of the view that is rendered, beside where Blender has the camera's frame; then a lamp that
    is hidden by the shading menu, and a view that is paused."""
    import bpy
    import scenes
    from bpy_extras.view3d_utils import location_3d_to_region_2d
    yield 0.1
    scene = scenes.empty(samples=2)
    yield DRAW_SECONDS
    made = scenes.camera(shift_x=0.1, shift_y=-0.05)
    wall = scenes.wall(size=60.0, material=scenes.emitter((0.0, 1.0, 0.0)))
    space = _open(scene)
    _, area, _ = _view()
    region = next(region for region in area.regions if region.type == 'WINDOW')
    rv3d = space.region_3d
    rv3d.view_perspective, rv3d.view_camera_zoom = 'CAMERA', -8.0
    rv3d.view_camera_offset = (0.03, -0.02)
    render = scene.render
    found = {"boxes": []}
    for kind in ('PERSP', 'ORTHO'):
        made.data.type = kind
        render.use_border = True
        render.border_min_x, render.border_max_x = 0.2, 0.7
        render.border_min_y, render.border_max_y = 0.4, 0.6
        yield from _settled()
        shot = _shot()
        corners = [made.matrix_world @ corner for corner in made.data.view_frame(scene=scene)]
        at = [location_3d_to_region_2d(region, rv3d, corner) for corner in corners]
        low = [min(point[axis] for point in at) for axis in (0, 1)]
        high = [max(point[axis] for point in at) for axis in (0, 1)]
        found["boxes"].append((_green_box(shot), [
            low[0] + 0.2 * (high[0] - low[0]), low[0] + 0.7 * (high[0] - low[0]),
            low[1] + 0.4 * (high[1] - low[1]), low[1] + 0.6 * (high[1] - low[1])]))
    render.use_border, made.data.type = False, 'PERSP'
    found["moved"] = yield from _moved_view(rv3d, region, wall)
    found["sizes"] = yield from _chosen_sizes(scene)
    wall.data.materials[0] = scenes.material("Matt", "ShaderNodeBsdfDiffuse", Color=(1.0, 1.0, 1.0))
    scenes.light('SUN', energy=3.0, rotation=(0.5, 0.0, 0.0))
    for name, is_shown in (("lit", True), ("unlit", False), ("lit again", True)):
        space.shading.use_scene_lights_render = is_shown
        shot = yield from _settled()
        found[name] = float(shot[shot.shape[0] // 2, shot.shape[1] // 2, 1])
    wall.data.materials[0] = scenes.material("Blue", "ShaderNodeBsdfDiffuse", Color=(0.0, 0.214, 1.0))
    for name in ('DIFFUSE_COLOR', 'EMISSION', 'UV', 'COMBINED'):
        space.shading.volley.render_pass = name
        shot = yield from _settled()
        found[name] = shot[shot.shape[0] // 2, shot.shape[1] // 2].tolist()
    wall.data.materials[0] = bpy.data.materials["Matt"]
    yield from _settled()
    scene.volley.preview_pause = True
    bpy.data.objects["Light"].data.energy = 0.0
    for _ in range(4):
        area.tag_redraw()
        yield DRAW_SECONDS
    shot = _shot()
    found["paused"] = float(shot[shot.shape[0] // 2, shot.shape[1] // 2, 1])
    scene.volley.preview_pause = False
    shot = yield from _settled()
    found["resumed"] = float(shot[shot.shape[0] // 2, shot.shape[1] // 2, 1])
    return found


def inside_studio():
    """The background as a studio light, then as a world of the same nodes, and where the camera does not see
    it."""
    import bpy
    import scenes
    yield 0.1
    scene = scenes.empty(samples=2)
    yield DRAW_SECONDS
    scenes.camera(lens=20.0)
    scenes.sphere(material=scenes.material("Mirror", "ShaderNodeBsdfGlossy", Roughness=0.0), smooth=True)
    space = _open(scene)
    space.region_3d.view_perspective = 'CAMERA'
    shading, found = space.shading, {}
    scenes.world_color(scene.world, (0.0, 0.214, 0.0))
    shading.use_scene_world_render = False
    shading.studio_light = 'forest.exr'
    shading.studiolight_rotate_z, shading.studiolight_intensity = 0.7, 0.6
    for share in (1.0, 0.0):
        shading.studiolight_background_alpha = share
        found[share] = yield from _settled()
    scene.world.use_nodes = True
    tree = scene.world.node_tree
    picture, mapping = tree.nodes.new("ShaderNodeTexEnvironment"), tree.nodes.new("ShaderNodeMapping")
    picture.image = bpy.data.images.load(shading.selected_studio_light.path)
    mapping.vector_type, mapping.inputs["Rotation"].default_value = 'VECTOR', (0.0, 0.0, 0.7)
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], picture.inputs[0])
    tree.links.new(picture.outputs[0], tree.nodes["Background"].inputs["Color"])
    tree.nodes["Background"].inputs["Strength"].default_value = 0.6
    shading.use_scene_world_render = True
    found["world"] = yield from _settled()
    return found


def test_studio_lights_are_shown_for_the_world(window):
    found = window.run_in_window(inside_studio)
    seen, hidden, world = found[1.0], found[0.0], found["world"]
    assert world.std() > 0.05
    assert np.abs(seen - world).max() < 0.02
    x, y = seen.shape[1] // 2, seen.shape[0] * 2 // 3  # the upper quarter is left out
    middle = np.s_[y - 4:y + 4, x - 4:x + 4]
    assert np.abs(hidden[middle] - world[middle]).max() < 0.02  # mirrored
    assert (np.abs(hidden - (0.0, 0.5, 0.0)).max(axis=-1) < 0.01).mean() > 0.05


def test_view_through_the_camera(window):
    found = window.run_in_window(inside_camera_region)
    for box, frame in found["boxes"]:
        assert np.abs(np.subtract(box, frame)).max() < 2.0, (box, frame)
    for box, place in found["moved"]:
        assert np.abs(np.subtract(box, place)).max() < 2.0, (box, place)
    assert abs(found["moved"][0][0][0] - found["moved"][1][0][0]) > 20
    sizes = found["sizes"]
    assert sizes['4'] == sizes['1'] // 4 and sizes['AUTO'] == sizes['1'] > 400
    assert found["lit"] > 0.3 and found["lit again"] == found["lit"] and found["unlit"] < 0.01
    assert np.allclose(found['DIFFUSE_COLOR'], (0.0, 0.5, 1.0), atol=0.01)  # display colours
    assert found['EMISSION'] == [0.0, 0.0, 0.0] and found['COMBINED'][2] > 0.3
    assert found['UV'][0] > 0.5 and found['UV'][1] > 0.5 and found['UV'][2] == 1.0
    assert found["paused"] == found["lit"] and found["resumed"] < 0.01


def inside_linked_instance(path):
    """What a view shows in its middle where an instance is of a collection that is in a library alone."""
    import bpy
    import scenes
    yield 0.1
    scene = scenes.empty(size=(64, 48))
    group = bpy.data.collections.new("Group")
    group.objects.link(scenes.wall(size=30.0, material=scenes.emitter((0.0, 1.0, 0.0))))
    bpy.data.libraries.write(path, {group})
    scene = scenes.empty(size=(64, 48))
    yield DRAW_SECONDS
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.collections = ["Group"]
    made = scenes.link("Instance", None)
    made.instance_type, made.instance_collection = 'COLLECTION', wanted.collections[0]
    scenes.camera()
    space = _open(scene)
    space.region_3d.view_perspective = 'CAMERA'
    shot = yield from _settled()
    height, width = shot.shape[:2]
    return shot[height // 2, width // 2]


def test_instances_of_what_is_linked_are_seen(window, tmp_path):
    shown = window.run_in_window(inside_linked_instance, str(tmp_path / "assets.blend"))
    assert shown == pytest.approx([0.0, 1.0, 0.0], abs=0.03)


def _noting(shown):
    """Let viewports note what they show, by whether it is a preview that is cleaned, with the plain picture; None
    for that where samples came in between."""
    from volley import passes
    read_shown, read_preview = passes.read_shown, passes.read_preview

    def note_shown(render, entry):
        shown["plain"].append(read_shown(render, entry).copy())
        return read_shown(render, entry)

    def note_preview(render):
        before = passes.read_combined(render).copy()
        picture = read_preview(render)
        is_still = np.array_equal(before, passes.read_combined(render))
        shown["previews"].append((picture.copy(), before if is_still else None))
        return picture

    passes.read_shown, passes.read_preview = note_shown, note_preview


def inside_denoised_previews():
    """Squared errors of previews and of the plain pictures under them, and how many there were of each kind."""
    import bpy
    import scenes
    yield 0.1
    scene = scenes.empty()
    scenes.wall(size=8.0, material=scenes.material("Grey", "ShaderNodeBsdfDiffuse"))
    scenes.wall("Blocker", 1.0, -1.0)
    scenes.light('AREA', (0.0, -6.0, 4.0), (0.6, 0.0, 0.0), energy=500.0, size=4.0)
    scenes.camera()
    space = _open(scene)
    space.region_3d.view_perspective = 'CAMERA'
    scene.render.preview_pixel_size = '1'
    scene.volley.preview_samples, shown = 512, {"plain": [], "previews": []}
    _noting(shown)
    yield from _settled()
    exact = shown["plain"][-1]
    counts = [len(shown["previews"])]
    scene.volley.use_preview_denoising, scene.volley.preview_samples = True, 4
    scene.volley.preview_denoising_start_sample = 16
    yield from _settled()
    counts.append(len(shown["previews"]))
    scene.volley.preview_denoising_start_sample = 1
    yield from _settled()
    previews = [pair for pair in shown["previews"] if pair[1] is not None and pair[0].shape == exact.shape]
    return counts, [[float(((picture - exact) ** 2).mean()) for picture in pair] for pair in previews]


def test_previews_are_denoised_from_the_start_sample_on(window):
    counts, errors = window.run_in_window(inside_denoised_previews)
    assert counts == [0, 0] and errors
    gains = [plain / clean for clean, plain in errors]
    assert min(gains) > 1.3, gains
