# SPDX-License-Identifier: Apache-2.0
"""Rendering through Blender: F12, borders, passes, animation, cancelling, bad input."""

import os

import numpy as np
import pytest


def _emission_walls():
    """Three squares of plain colours at different depths: every pixel is known without lighting."""
    import scenes
    scenes.wall("Red", 2.0, 0.0, (-1.0, 0.0), scenes.emitter((1.0, 0.1, 0.05), "Red"))
    scenes.wall("Green", 2.0, 2.0, (1.2, 0.5), scenes.emitter((0.1, 0.8, 0.2), "Green"))
    scenes.wall("Blue", 9.0, 5.0, (0.5, -0.6), scenes.emitter((0.05, 0.2, 0.9), "Blue"))


# F12 ---------------------------------------------------------------------------------------------

def inside_integrators():
    import bpy
    import scenes
    scene = scenes.empty()
    scenes.camera()
    scenes.wall(size=20.0, material=scenes.emitter((0.25, 0.5, 0.75), strength=2.0))
    pictures = {}
    for integrator in ('RAYCAST', 'WHITTED', 'DISTRIBUTION'):
        scene.volley.integrator = integrator
        pictures[integrator] = scenes.render()
    scene.volley.film_exposure = 2.0
    pictures["exposure"] = scenes.render()
    scene.volley.film_exposure = 1.0
    bpy.data.objects["Wall"].hide_render = True
    scenes.world_color(scene.world, (0.1, 0.2, 0.3))
    pictures["world"] = scenes.render()
    scene.render.film_transparent = True
    pictures["transparent"] = scenes.render()
    return pictures


def test_constant_pictures(blender):
    pictures = blender.run(inside_integrators)
    for integrator in ('RAYCAST', 'WHITTED', 'DISTRIBUTION'):
        assert pictures[integrator] == pytest.approx(np.broadcast_to(
            np.array([0.5, 1.0, 1.5, 1.0], np.float32), (48, 64, 4)), rel=1e-4), integrator
    assert pictures["exposure"][..., :3].mean() == pytest.approx(2.0, rel=1e-4)
    assert pictures["world"].reshape(-1, 4).mean(axis=0) == pytest.approx([0.1, 0.2, 0.3, 1.0], rel=1e-4)
    assert not pictures["transparent"].any()


def inside_borders():
    import scenes
    scene = scenes.empty(size=(80, 60))
    scene.volley.pixel_filter_type = 'BOX'
    scene.volley.filter_width = 1.0
    scenes.camera()
    _emission_walls()
    whole = scenes.render()
    render = scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x = 0.25, 0.75
    render.border_min_y, render.border_max_y = 0.2, 0.9
    inside = scenes.render()
    render.use_crop_to_border = True
    return whole, inside, scenes.render()


def test_border_and_crop_show_their_part(blender):
    whole, inside, cropped = blender.run(inside_borders)
    part = whole[12:54, 20:60]
    assert inside.shape == whole.shape and cropped.shape == part.shape
    outside = inside.copy()
    outside[12:54, 20:60] = 0.0
    assert not outside.any()
    assert np.array_equal(cropped, inside[12:54, 20:60])
    assert np.abs(cropped - part).mean() < 2e-3


def inside_view_layers():
    import bpy
    import scenes
    scene = scenes.empty()
    scenes.camera()
    red = scenes.wall("Red", 20.0, 1.0, material=scenes.emitter((1.0, 0.0, 0.0), "Red"))
    hidden = bpy.data.collections.new("Hidden")
    scene.collection.children.link(hidden)
    near = scenes.wall("Near", 20.0, 0.0, material=scenes.emitter((0.0, 1.0, 0.0), "Green"))
    scene.collection.objects.unlink(near)
    hidden.objects.link(near)
    first = scene.view_layers[0]
    second = scene.view_layers.new("Second")
    second.layer_collection.children["Hidden"].exclude = True
    third = scene.view_layers.new("Third")
    third.material_override = scenes.emitter((0.0, 0.0, 1.0), "Blue")
    tree, shown = scenes.compositor()
    layers = tree.nodes.new("CompositorNodeRLayers")
    tree.links.new(layers.outputs["Image"], shown)
    pictures = []
    for layer in (first, second, third):
        layers.layer = layer.name
        pictures.append(scenes.channel_means(scenes.render()))
    return pictures, red.name


def test_view_layers_and_override(blender):
    pictures, _ = blender.run(inside_view_layers)
    assert pictures[0] == pytest.approx([0, 1, 0, 1], abs=1e-5)
    assert pictures[1] == pytest.approx([1, 0, 0, 1], abs=1e-5)
    assert pictures[2] == pytest.approx([0, 0, 1, 1], abs=1e-5)


def inside_layer_switches():
    """Channel means of a shining wall before half of a world, with a layer's switches."""
    import bpy
    import scenes
    scene = scenes.empty()
    scenes.world_color(scene.world, (0.25, 0.25, 0.25))
    scenes.camera()
    moving = scenes.wall("Wall", 40.0, 0.0, (-20.0, 0.0), scenes.emitter((1.0, 0.0, 0.0)))
    for frame, x in ((0, -24.0), (1, -20.0), (2, -16.0)):
        moving.location.x = x + 20.0
        moving.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 0.5
    layer = bpy.context.view_layer
    pictures = {}
    for name in ("as it is", "use_sky", "use_solid", "use_motion_blur"):
        if name != "as it is":
            setattr(layer, name, False)
        pictures[name] = scenes.render()
        if name != "as it is":
            setattr(layer, name, True)
    layer.samples = 7
    layer.volley.use_pass_sample_count = True
    pictures["samples"] = scenes.render_passes(["Debug Sample Count"])["Debug Sample Count"]
    return pictures


def test_switches_of_a_layer(blender):
    pictures = blender.run(inside_layer_switches)

    def column(name, x):
        return pictures[name][:, x, :3].mean(axis=0)

    assert column("as it is", 5) == pytest.approx([1, 0, 0], abs=1e-5)
    assert column("as it is", 58) == pytest.approx([0.25] * 3, abs=1e-5)
    assert 0.05 < column("as it is", 32)[1] < 0.2
    assert column("use_sky", 5) == pytest.approx([1, 0, 0], abs=1e-5)
    assert column("use_sky", 58) == pytest.approx([0, 0, 0], abs=1e-5)
    assert pictures["use_solid"][..., :3] == pytest.approx(0.25, abs=1e-5)
    assert column("use_motion_blur", 29) == pytest.approx([1, 0, 0], abs=1e-5)
    assert column("as it is", 29)[1] > 0.01
    assert pictures["samples"][..., 0].min() == 7.0


def inside_passes():
    import bpy
    import scenes
    from volley import passes
    scene = scenes.empty(samples=64)
    scenes.camera()
    layer = bpy.context.view_layer
    wall = scenes.wall(size=20.0, material=scenes.material(
        "Diffuse", "ShaderNodeBsdfDiffuse", Color=(0.5, 0.25, 0.75)))
    wall.pass_index, wall.active_material.pass_index = 3, 5
    small = scenes.wall("Small", 1.0, -1.0, material=scenes.emitter((2.0, 1.0, 0.5)))
    small.pass_index = 4
    scenes.light('SUN', rotation=(np.pi / 2, 0.0, 0.0), energy=2.0)
    scenes.world_color(scene.world, (0.0, 0.0, 0.0))
    names = []
    for entry in passes.PASSES:
        if "." not in entry.setting:
            setattr(layer, entry.setting, True)
            names.append(passes.name_of(entry))
    return scenes.render_passes(names)


def test_passes_hold_what_they_say(blender):
    found = blender.run(inside_passes)
    by_short = {}
    for old, new in (("IndexOB", "Object Index"), ("IndexMA", "Material Index"), ("Emit", "Emission"),
                     ("Env", "Environment"), ("DiffDir", "Diffuse Direct"), ("DiffCol", "Diffuse Color")):
        by_short[old] = found[old] if old in found else found[new]
    corner, center = (2, 2), (24, 32)
    assert found["Depth"][corner][0] == pytest.approx(6.0, rel=1e-4)
    assert found["Depth"][center][0] == pytest.approx(5.0, rel=1e-4)
    assert found["Normal"][corner][:3] == pytest.approx([0, -1, 0], abs=1e-4)
    assert found["Position"][corner][1] == pytest.approx(0.0, abs=1e-4)
    assert found["Position"][corner][0] == pytest.approx(6.0 * 0.36 * (2.5 / 32 - 1.0), abs=0.05)
    assert 0.0 < found["UV"][corner][0] < 0.5 and found["UV"][corner][2] == pytest.approx(1.0)
    assert by_short["IndexOB"][corner][0] == 3.0 and by_short["IndexOB"][center][0] == 4.0
    assert by_short["IndexMA"][corner][0] == 5.0
    assert by_short["Emit"][center][:3] == pytest.approx([2.0, 1.0, 0.5], rel=1e-4)
    assert not by_short["Emit"][corner][:3].any() and not by_short["Env"][..., :3].any()
    assert by_short["DiffCol"][corner][:3] == pytest.approx([0.5, 0.25, 0.75], rel=1e-3)
    combined = found["Combined"][corner][:3]
    # The sun's part; the small emitter adds a little.
    assert combined == pytest.approx([2.0 / np.pi * c for c in (0.5, 0.25, 0.75)], rel=0.05)
    product = by_short["DiffDir"][corner][:3] * by_short["DiffCol"][corner][:3]
    assert product == pytest.approx(combined, rel=1e-3)


# Running -----------------------------------------------------------------------------------------

CANCELLED_SAMPLES = 100000  # minutes, were they all rendered


class _Watched:
    """A render of the library that writes down what is asked of it from the press of Esc on, which comes
    as soon as some of the film is there."""

    def __init__(self, render):
        self._render, self.size = render, render.size
        self.is_pressed, self.calls, self.progress = False, [], None

    def __getattr__(self, name):
        def call(*arguments):
            if self.is_pressed:
                self.calls.append((name, *arguments[:1]))
            result = getattr(self._render, name)(*arguments)
            if name == "poll":
                self.progress = result
            return result
        return call

    def press(self):
        """Whether Esc is pressed."""
        self.is_pressed |= self.progress is not None and self.progress.fraction > 0.0
        return self.is_pressed


def inside_adaptive():
    import scenes
    scene = scenes.empty(samples=128)
    scenes.camera(location=(0.0, -6.0, 0.0))
    scenes.wall(material=scenes.material("Grey", "ShaderNodeBsdfDiffuse", Color=(0.5, 0.5, 0.5)))
    scenes.light('AREA', energy=300.0, size=3.0)
    scene.view_layers[0].volley.use_pass_sample_count = True
    settings, counts = scene.volley, {}
    settings.extra_samples = 0.0
    for name, values in (("off", {}), ("fine", {"noise_threshold": 0.0001}),
                         ("coarse", {"noise_threshold": 0.01}),
                         ("few", {"noise_threshold": 0.01, "adaptive_min_samples": 9}),
                         ("automatic", {"noise_threshold": 0.0})):
        settings.use_adaptive_sampling = bool(values)
        settings.adaptive_min_samples = 0
        for key, value in values.items():
            setattr(settings, key, value)
        counts[name] = scenes.render_passes(["Debug Sample Count"])["Debug Sample Count"][..., 0]
    return counts, _preview_thresholds(settings)


def _preview_thresholds(settings):
    """The thresholds of noise of viewports and previews whose adaptive sampling is off, on, automatic."""
    import bpy
    from volley import passes
    from volley.session import render_fields
    from volley.sync import camera
    scene, found = bpy.context.scene, []
    settings.preview_samples = 16
    for settings.use_preview_adaptive_sampling, settings.preview_noise_threshold in (
            (False, 0.25), (True, 0.25), (True, 0.0)):
        fields = render_fields(scene, camera.frame_of(scene.render), (0, 0, 64, 48), [passes.COMBINED],
                               is_preview=True)
        found.append(fields["noise_threshold"])
    return found


def test_adaptive_sampling_and_its_settings(blender):
    counts, preview_thresholds = blender.run(inside_adaptive)
    assert preview_thresholds == [0.0, 0.25, 1.0 / 16.0]
    assert (counts["off"] == 128).all()
    assert counts["fine"].max() == 128 and counts["fine"].mean() > counts["coarse"].mean()
    # Automatic choices are those of Cycles: 64 samples before the first look at 0.01.
    assert counts["coarse"].min() == 64 and counts["automatic"].min() == 64
    assert set(np.unique(counts["few"])) <= {16, 32, 64, 128} and counts["few"].min() == 16
    assert len(np.unique(counts["few"])) > 1


def inside_extra():
    """Pictures and counts of samples of a shadow's edge, by the share of extra samples and other settings."""
    import scenes
    scene = scenes.empty(samples=16)
    scenes.camera(location=(0.0, -6.0, 0.0))
    scenes.wall(material=scenes.material("Grey", "ShaderNodeBsdfDiffuse", Color=(0.5, 0.5, 0.5)))
    scenes.sphere(radius=0.5, location=(0.3, -1.0, 0.2))
    scenes.light('AREA', energy=300.0, size=0.1)
    scene.view_layers[0].volley.use_pass_sample_count = True
    found = {}
    for name, values in (("exact", {"samples": 4096, "extra_samples": 0.0}), ("none", {"extra_samples": 0.0}),
                         ("default", {}), ("all", {"extra_samples": 1.0}), ("limit", {"time_limit": 1000.0}),
                         ("threshold", {"use_adaptive_sampling": True, "noise_threshold": 1e-4,
                                        "adaptive_min_samples": 8})):
        for key, value in values.items():
            setattr(scene.volley, key, value)
        layers = scenes.render_passes(["Combined", "Debug Sample Count"])
        found[name] = layers["Combined"][..., :3].astype(float), layers["Debug Sample Count"][..., 0]
        for key in values:
            scene.volley.property_unset(key)
        scene.volley.samples = 16
    return found


def test_extra_samples(blender):
    """A quarter more rays, to the edges of a ball and its shadow, leave two thirds of the error."""
    found = blender.run(inside_extra)
    exact, counts = found["exact"][0], {name: layers[1] for name, layers in found.items()}
    error = {name: np.mean((layers[0] - exact) ** 2) for name, layers in found.items()}
    for name in ("none", "limit"):
        assert (counts[name] == 16).all()
    assert counts["threshold"].max() == 16
    assert set(np.unique(counts["default"])) <= {16, 32, 64, 128} and counts["default"].max() > 32
    assert 16.0 * 1.05 < counts["default"].mean() <= 16.0 * 1.4 < counts["all"].mean()
    assert error["default"] < 0.75 * error["none"]


def inside_cancel():
    """Press Esc during a render that would take minutes."""
    import escape
    import scenes
    from volley import abi, native
    scenes.empty(size=(512, 384), samples=CANCELLED_SAMPLES)
    scenes.camera()
    _emission_walls()
    start, watched = native.Scene.start_render, []

    def start_render(self, **fields):
        watched.append(_Watched(start(self, **fields)))
        return watched[-1]

    native.Scene.start_render = start_render
    escape.watch(lambda: bool(watched) and watched[-1].press())
    picture = scenes.render()
    render, = watched
    return (render.calls, render.progress.state == abi.ProgressState.CANCELLED,
            native.ray_count(render.progress), float(picture[..., :3].max()))


def test_escape_stops_at_once_and_keeps_what_is_done(blender):
    calls, is_cancelled, ray_count, brightest = blender.run(inside_cancel)
    assert calls == [("cancel",), ("wait", -1.0), ("poll",), ("read", 0), ("destroy",)]
    assert is_cancelled and 0 < ray_count < 0.01 * CANCELLED_SAMPLES * 512 * 384
    assert brightest > 0.0


def inside_animation(keep):
    import bpy
    import scenes
    scene = scenes.empty()
    scene.render.use_persistent_data = keep
    scenes.camera()
    wall = scenes.wall(size=1.0, material=scenes.emitter((1.0, 1.0, 1.0)))
    strength = wall.active_material.node_tree.nodes["Emission"].inputs["Strength"]
    for frame, x in ((1, 0.0), (2, 0.75), (3, 1.5)):
        wall.location.x = x
        wall.keyframe_insert("location", frame=frame)
        strength.default_value = frame
        strength.keyframe_insert("default_value", frame=frame)
    scene.frame_start, scene.frame_end = 1, 3
    folder = bpy.app.tempdir
    scene.render.filepath = folder + "frame_"
    bpy.ops.render.render(animation=True)
    return [scenes.load(f"{folder}frame_{frame:04d}.exr") for frame in (1, 2, 3)]


def test_animation_with_and_without_persistent_data(blender):
    plain, kept = blender.run(inside_animation, False), blender.run(inside_animation, True)
    for number, (a, b) in enumerate(zip(plain, kept), 1):
        assert a[..., 0].max() == pytest.approx(number, rel=1e-4)
        assert np.array_equal(a, b)
    columns = [np.flatnonzero(picture[24, :, 0] > 0.5).mean() for picture in plain]
    assert columns[1] - columns[0] == pytest.approx(0.75 * 32 / (6 * 0.36), abs=1.0)
    assert columns[2] - columns[1] == pytest.approx(columns[1] - columns[0], abs=1.5)  # one more at either end


def inside_save_file(path):
    import bpy
    import scenes
    scenes.empty()
    scenes.camera()
    scenes.wall(size=20.0, material=scenes.emitter((0.25, 0.5, 0.75)))
    scenes.set_engine('CYCLES', 4)
    bpy.ops.wm.save_as_mainfile(filepath=path)


def inside_load(path):
    import scenes
    return scenes.load(path)


def test_command_line(blender, tmp_path):
    """The command users are given: a file saved for another engine, rendered by this one."""
    path = str(tmp_path / "scene.blend")
    blender.run(inside_save_file, path)
    process = blender.command(path, "-E", "VOLLEY", "-o", str(tmp_path / "out_"), "-F", "OPEN_EXR", "-f", "1")
    assert process.returncode == 0 and os.path.exists(tmp_path / "out_0001.exr"), process.stdout
    picture = blender.run(inside_load, str(tmp_path / "out_0001.exr"))
    assert picture[..., :3].reshape(-1, 3).mean(axis=0) == pytest.approx([0.25, 0.5, 0.75], rel=1e-2)


# Bad input ---------------------------------------------------------------------------------------

def inside_bad_inputs():
    import bpy
    import scenes
    scene = scenes.empty()
    results = {}
    scenes.wall(size=20.0, y=3.0, material=scenes.emitter((0.0, 1.0, 0.0)))
    try:
        scenes.render()
    except RuntimeError as error:
        results["no camera"] = str(error)
    scenes.camera()
    scenes.mesh("Nothing", [], [])
    scenes.mesh("Points", [(0, 0, 0), (1, 0, 0)], [])
    scenes.mesh("NaN", [(float("nan"), 0, 0), (1, 0, 0), (0, 0, 1)], [(0, 1, 2)])
    scenes.mesh("Huge", [(1e30, 0, 0), (1e30, 1, 0), (1e30, 0, 1)], [(0, 1, 2)])
    flat = scenes.wall("Flat", 2.0)
    flat.scale = (0.0, 0.0, 0.0)
    scenes.light('POINT', energy=float("inf"))
    scenes.light('SPOT', energy=0.0, spot_size=0.0175, spot_blend=0.0)
    scenes.wall("No material", 0.1, -1.0, (5.0, 5.0)).data.materials.append(None)
    results["picture"] = scenes.render()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = scenes.empty()
    scenes.camera()
    missing = scenes.material("Missing", "ShaderNodeEmission")
    texture = missing.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.new("Gone", 4, 4)
    texture.image.source, texture.image.filepath = 'FILE', "//gone.png"
    missing.node_tree.links.new(texture.outputs[0], missing.node_tree.nodes["Emission"].inputs["Color"])
    scenes.wall(size=20.0, material=missing)
    results["magenta"] = scenes.channel_means(scenes.render())
    return results, scene.name


def test_bad_inputs_do_not_stop_a_render(blender):
    results, _ = blender.run(inside_bad_inputs)
    assert "camera" in results["no camera"].lower()
    assert results["picture"][..., 1].mean() > 0.5 and np.isfinite(results["picture"]).all()
    assert results["magenta"][:3] == pytest.approx([1.0, 0.0, 1.0], abs=1e-4)
    assert "Gone" in blender.output and "Traceback" not in blender.output


# Images ------------------------------------------------------------------------------------------

def inside_images():
    """The same 2 x 2 picture as a file, packed, generated, and as a float; closest, on a whole wall."""
    import os
    import bpy
    import numpy as np
    import scenes
    scene = scenes.empty(size=(32, 32))
    scenes.camera(location=(0, -6, 0), lens=60.0, sensor_width=20.0)  # sees exactly 2 m at 6 m
    material = scenes.material("Textured", "ShaderNodeEmission")
    tree = material.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.interpolation = 'Closest'
    tree.links.new(texture.outputs[0], tree.nodes["Emission"].inputs["Color"])
    scenes.wall(size=2.0, material=material)
    colors = np.array([[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1], [0.5, 0.5, 0.5, 1]], np.float32)
    path = os.path.join(bpy.app.tempdir, "small.png")
    saved = bpy.data.images.new("Saved", 2, 2)
    saved.pixels.foreach_set(colors.reshape(-1))
    saved.filepath_raw, saved.file_format = path, 'PNG'
    saved.save()
    float_image = bpy.data.images.new("Float", 2, 2, float_buffer=True)
    float_image.pixels.foreach_set(colors.reshape(-1))
    packed = bpy.data.images.load(path, check_existing=False)
    packed.pack()
    generated = bpy.data.images.new("Generated", 2, 2)
    generated.pixels.foreach_set(colors.reshape(-1))
    data = bpy.data.images.load(path, check_existing=False)
    data.colorspace_settings.name = "Non-Color"
    pictures = {}
    for name, image in (("file", bpy.data.images.load(path, check_existing=False)), ("packed", packed),
                        ("generated", generated), ("float", float_image), ("data", data)):
        texture.image = image
        pictures[name] = scenes.render()[[8, 8, 24, 24], [8, 24, 8, 24], :3]
    return pictures, scene.name


def test_images_of_every_source(blender):
    pictures, _ = blender.run(inside_images)
    for name, picture in pictures.items():
        grey = 0.5 if name in ("float", "data") else 0.2140
        expected = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [grey] * 3])
        assert picture == pytest.approx(expected, abs=4e-3), name
