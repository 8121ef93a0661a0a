# SPDX-License-Identifier: Apache-2.0
"""The add-on registers, names its passes, checks its library and leaves nothing behind."""

import os
import re
import shutil
from pathlib import Path

import blender as blender_support
import pytest

pytestmark = pytest.mark.own_process


def inside_register():
    import bpy
    from volley import native, passes
    scene = bpy.context.scene
    scene.render.engine = 'VOLLEY'
    names = {}
    for entry in passes.PASSES:
        names[entry.names] = native.pass_channels(entry.index) == len(entry.channels)
    panels = [p.__name__ for p in bpy.types.Panel.__subclasses__()
              if 'VOLLEY' in getattr(p, "COMPAT_ENGINES", ())]
    defaults = {p.identifier: getattr(scene.volley, p.identifier)
                for p in scene.volley.bl_rna.properties if p.identifier not in {"rna_type", "name"}}
    handlers = {name for name in dir(bpy.app.handlers)
                for listed in [getattr(bpy.app.handlers, name)] if isinstance(listed, list)
                for function in listed if function.__module__.startswith("volley")}
    bpy.ops.preferences.addon_disable(module="volley")
    left = [p.__name__ for p in bpy.types.Panel.__subclasses__()
            if 'VOLLEY' in getattr(p, "COMPAT_ENGINES", ()) and not p.__name__.startswith("VOLLEY")]
    had_settings = hasattr(scene, "volley")
    bpy.ops.preferences.addon_enable(module="volley")
    return {"error": native.load_error(), "names": names, "panels": panels, "defaults": defaults,
            "left": left, "left_settings": had_settings, "again": hasattr(scene, "volley"),
            "handlers": handlers}


def test_register_and_unregister(blender):
    found = blender.run(inside_register)
    assert found["error"] == ""
    assert all(found["names"].values()), found["names"]
    # Views that another engine or Blender itself draws do not meet the add-on at all; open files do.
    assert found["handlers"] == {"load_post"}
    assert found["left"] == [] and not found["left_settings"] and found["again"]
    for panel in ("RENDER_PT_output", "RENDER_PT_color_management", "DATA_PT_lens", "MATERIAL_PT_preview",
                  "DATA_PT_camera_dof", "VOLLEY_RENDER_PT_sampling", "VOLLEY_MATERIAL_PT_surface"):
        assert panel in found["panels"]
    for panel in ("DATA_PT_light", "RENDER_PT_eevee_sampling", "CYCLES_RENDER_PT_sampling"):
        assert panel not in found["panels"]
    expected = {"integrator": 'DISTRIBUTION', "samples": 64, "light_samples": 0, "max_depth": 50,
                "assembly": 'AUTO', "packet_size": 'AUTO', "sampler": 'SOBOL', "seed": 0}
    assert {name: found["defaults"][name] for name in expected} == expected


def inside_preferences():
    """What the page of the preferences shows."""
    import types
    import bpy
    from volley import preferences
    shown = []

    class Column:
        alert = False

        def label(self, text, icon='NONE'):
            shown.append(text)

    page = types.SimpleNamespace(layout=types.SimpleNamespace(column=Column))
    preferences.VolleyPreferences.draw(page, bpy.context)
    return shown


def test_preferences_name_version_and_revision(blender):
    path = Path(blender_support.user_scripts(), "addons/volley/lib/revision")
    revision = f" ({path.read_text().strip()})" if path.exists() else ""  # sources without git have none
    shown, = blender.run(inside_preferences)
    assert re.fullmatch(rf"libtracer \d+\.\d+\.\d+{re.escape(revision)}, \w+", shown)


def inside_integrator_samples():
    import bpy
    settings = bpy.context.scene.volley
    settings.integrator = 'WHITTED'
    first = settings.samples
    settings.integrator = 'DISTRIBUTION'
    second = settings.samples
    settings.samples = 7
    settings.integrator = 'RAYCAST'
    return first, second, settings.samples


def test_integrator_brings_its_samples(blender):
    assert blender.run(inside_integrator_samples) == (1, 64, 7)


def inside_changed_settings():
    """Of each setting, whether the depsgraph hears of its change by a script."""
    import bpy
    import scenes
    scene = scenes.empty()
    layer, told, heard = bpy.context.view_layer, {}, []

    def another(settings, setting):
        value = getattr(settings, setting.identifier)
        if setting.type == 'ENUM':
            return next(item.identifier for item in setting.enum_items if item.identifier != value)
        if setting.type == 'BOOLEAN':
            return not value
        return value + 1 if value + 1 <= setting.hard_max else value - 1

    bpy.app.handlers.depsgraph_update_post.append(lambda _scene, depsgraph: heard.extend(
        type(update.id).__name__ for update in depsgraph.updates))
    for settings in (scene.volley, layer.volley):
        for setting in settings.bl_rna.properties:
            if setting.identifier in {"rna_type", "name"} or setting.is_hidden:
                continue
            layer.update()
            heard.clear()
            setattr(settings, setting.identifier, another(settings, setting))
            layer.update()
            told[type(settings).__name__, setting.identifier] = list(heard)
    return told


def test_a_changed_setting_is_heard_of(blender):
    told = blender.run(inside_changed_settings)
    assert len(told) > 30
    assert [name for name, heard in told.items() if "Scene" not in heard] == []


def inside_render_passes():
    import bpy
    import scenes
    scenes.empty()
    view_layer = bpy.context.view_layer
    from volley import passes
    found = []

    class Fake:
        def register_pass(self, scene, layer, name, channels, ids, kind):
            found.append((name, channels, ids, kind))

    passes.register_passes(Fake(), bpy.context.scene, view_layer)
    default = list(found)
    found.clear()
    for entry in passes.PASSES:
        if "." not in entry.setting:
            setattr(view_layer, entry.setting, True)
    view_layer.volley.use_pass_sample_count = view_layer.volley.denoising_store_passes = True
    passes.register_passes(Fake(), bpy.context.scene, view_layer)
    long_names = [passes.name_of(entry, True) for entry in passes.PASSES]
    return default, found, long_names


def test_pass_names_are_blenders(blender):
    default, everything, long_names = blender.run(inside_render_passes)
    assert ("Combined", 4, "RGBA", 'COLOR') in default and len(default) <= 2
    assert len({name for name, *_ in everything}) == len(everything) > 20
    assert ("Depth", 1, "Z", 'VALUE') in everything
    for name in ("Object Index", "Diffuse Direct", "Emission", "Environment"):
        assert name in long_names


def inside_broken_library():
    import bpy
    from volley import native
    scene = bpy.context.scene
    scene.render.engine = 'VOLLEY'
    try:
        bpy.ops.render.render()
        failure = ""
    except RuntimeError as error:
        failure = str(error)
    return native.load_error(), failure


def test_missing_library_is_a_message(blender, tmp_path, monkeypatch):
    """A copy of the add-on without its library loads, and rendering says why nothing comes."""
    copy = tmp_path / "scripts"
    shutil.copytree(blender_support.user_scripts(), copy)
    os.remove(copy / "addons" / "volley" / "lib" / "libtracer.so")
    monkeypatch.setenv("BLENDER_USER_SCRIPTS", str(copy))
    error, failure = blender.run(inside_broken_library)
    assert "libtracer.so" in error
    assert "libtracer.so" in failure
    assert "Traceback" not in blender.output


def test_damaged_library_is_a_message(blender, tmp_path, monkeypatch):
    copy = tmp_path / "scripts"
    shutil.copytree(blender_support.user_scripts(), copy)
    with open(copy / "addons" / "volley" / "lib" / "libtracer.so", "wb") as file:
        file.write(b"not a library")
    monkeypatch.setenv("BLENDER_USER_SCRIPTS", str(copy))
    error, failure = blender.run(inside_broken_library)
    assert error and failure and "Traceback" not in blender.output
