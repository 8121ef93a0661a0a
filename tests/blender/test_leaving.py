# SPDX-License-Identifier: Apache-2.0
"""The add-on is disabled, reloaded and replaced while Blender renders with it."""

import os
import shutil

import blender as blender_support
import pytest

pytestmark = pytest.mark.own_process

STEP_SECONDS = 0.1
LONGEST_STEPS = 150
DRAW_SECONDS = 0.5
ENDLESS = 1 << 20  # samples


def _wait_until(is_true):
    for _ in range(LONGEST_STEPS):
        if is_true():
            return
        yield STEP_SECONDS
    raise AssertionError("waited in vain")


def _scene(frames=1):
    """A render that does not end by itself, a few view layers, a moving object."""
    import bpy
    import scenes
    scene = scenes.empty(size=(64, 48), samples=ENDLESS)
    scenes.camera()
    wall = scenes.wall(material=scenes.emitter((0.0, 1.0, 0.0)))
    wall.keyframe_insert("location", frame=1)
    wall.location.x = 1.0
    wall.keyframe_insert("location", frame=2)
    scene.view_layers.new("Second")
    scene.frame_end = frames
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.render_display_type = 'NONE'
    return scene


def _leave(way, archive):
    """What a user or a script does; archive: of the add-on, to install over it."""
    import addon_utils
    import bpy
    if way == "operator":
        bpy.ops.preferences.addon_disable(module="volley")
    elif way == "module":
        addon_utils.disable("volley")
    elif way == "other engine":
        addon_utils.disable("cycles")
    elif way == "install":
        bpy.ops.preferences.addon_install(filepath=archive, overwrite=True)
        bpy.ops.preferences.addon_enable(module="volley")
    else:
        bpy.ops.script.reload()


def inside_leaving(way, is_animation, is_persistent, has_view, archive):
    """Leave during a render job and, if asked for, one in the viewport, then render again. Returns whether
    Blender forgot the engine at once, the handles of the library that were alive then, and what its modules
    say of their version."""
    import bpy
    import addon_utils
    yield 0.1
    scene = _scene(frames=20 if is_animation else 1)
    yield DRAW_SECONDS
    from volley import engine, native, session
    scene.render.use_persistent_data = is_persistent
    scene.render.filepath = bpy.app.tempdir + "frame"
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == 'VIEW_3D')
    if has_view:
        scene.volley.preview_samples = ENDLESS
        area.spaces.active.shading.type = 'RENDERED'
        yield 2.0 * DRAW_SECONDS
    shown = []
    show = session._Run._show_progress
    session._Run._show_progress = lambda run, *rest: (shown.append(1), show(run, *rest))
    with bpy.context.temp_override(window=window):
        bpy.ops.render.render('INVOKE_DEFAULT', animation=is_animation)
    yield from _wait_until(lambda: len(shown) > 2)
    with bpy.context.temp_override(window=window, area=area):
        _leave(way, archive)
    is_gone = "bl_rna" not in vars(engine.VolleyRenderEngine)
    area.spaces.active.shading.type = 'SOLID'
    yield from _wait_until(lambda: not bpy.app.is_job_running('RENDER'))
    handles = len(native._owners)
    addon_utils.enable("volley")
    scene = bpy.context.scene
    scene.render.engine = 'VOLLEY'
    scene.volley.samples = 1
    bpy.ops.render.render()
    from volley import log
    return is_gone, handles, getattr(log, "EDITION", 1)


@pytest.mark.parametrize("way, is_animation, is_persistent, has_view", [
    ("operator", True, True, True), ("module", True, False, False), ("reload", False, False, True),
    ("other engine", False, False, False)])
def test_leaving_during_a_render(window, way, is_animation, is_persistent, has_view):
    is_gone, handles, _ = window.run_in_window(inside_leaving, way, is_animation, is_persistent, has_view, "")
    assert is_gone == (way in {"operator", "module"})  # scripts are reloaded later
    assert handles == 0
    assert "Traceback" not in window.output and "ReferenceError" not in window.output


@pytest.fixture
def second_edition(tmp_path, monkeypatch):
    """The add-on where it can be replaced, and an archive of one that differs in a module and its library's
    file."""
    installed, folder = tmp_path / "scripts", tmp_path / "second"
    shutil.copytree(blender_support.user_scripts(), installed)
    shutil.copytree(installed / "addons" / "volley", folder / "volley",
                    ignore=shutil.ignore_patterns("__pycache__"))
    with open(folder / "volley" / "log.py", "a", encoding="utf-8") as file:
        file.write("\nEDITION = 2\n")
    monkeypatch.setenv("BLENDER_USER_SCRIPTS", str(installed))
    return shutil.make_archive(str(tmp_path / "second"), "zip", folder)


def test_an_update_during_a_render(window, second_edition):
    is_gone, _, edition = window.run_in_window(inside_leaving, "install", False, False, True, second_edition)
    assert is_gone and edition == 2
    assert "Traceback" not in window.output and "ReferenceError" not in window.output


def inside_update(archive):
    """Install it over the add-on that has rendered; the modules that changed, whether the add-on still uses
    the old library, the brightest pixel of both."""
    import sys
    import bpy
    import scenes
    scene = _scene()
    scene.volley.samples = 1
    before = {name: module for name, module in sys.modules.items() if name.startswith("volley.")}
    brightest = [scenes.render()[..., 1].max()]
    bpy.ops.preferences.addon_install(filepath=archive, overwrite=True)
    bpy.ops.preferences.addon_disable(module="volley")
    bpy.ops.preferences.addon_enable(module="volley")
    scene.render.engine = 'VOLLEY'
    scene.volley.samples = 1
    brightest.append(scenes.render()[..., 1].max())
    from volley import log
    kept = [name for name, module in before.items() if sys.modules.get(name) is module]
    return kept, log.EDITION, _loaded_libraries(), brightest


def _loaded_libraries():
    """Paths of the library's files in this process; None where a change of root hides them."""
    if not os.path.exists("/proc/self/maps"):
        return None
    with open("/proc/self/maps", encoding="utf-8") as file:
        return {line.split(maxsplit=5)[5].strip() for line in file if "libtracer" in line}


def test_an_update_takes_the_place_of_the_old_one(blender, second_edition):
    kept, edition, libraries, brightest = blender.run(inside_update, second_edition)
    assert kept == [] and edition == 2
    assert libraries is None or len(libraries) == 1 and "deleted" not in libraries.pop()
    assert brightest == pytest.approx([1.0, 1.0])


def inside_handler(way):
    """A handler disables the add-on in the middle of a render with motion blur, on the thread that renders;
    what the render then says, and whether the next one, enabled again, works."""
    import addon_utils
    import bpy
    import scenes
    scene = _scene()
    from volley import jobs
    scene.volley.samples = 1
    scene.render.use_motion_blur = True
    left = []

    def leave(*_):
        if not left and jobs._Jobs.render_thread is not None:
            left.append(1)
            addon_utils.disable("volley")

    {"frame": bpy.app.handlers.frame_change_post, "after": bpy.app.handlers.render_post}[way].append(leave)
    try:
        bpy.ops.render.render()
        message = ""
    except RuntimeError as error:
        message = str(error)
    addon_utils.enable("volley")
    scene.render.engine = 'VOLLEY'
    scene.volley.samples = 1
    return message, len(left), scenes.render()[..., 1].max()


@pytest.mark.parametrize("way", ["frame", "after"])
def test_leaving_within_a_render(blender, way):
    message, left, brightest = blender.run(inside_handler, way)
    assert left == 1
    assert ("Volley: stopped" in message) == (way == "frame")
    assert brightest == pytest.approx(1.0)
    assert "Traceback" not in blender.output
