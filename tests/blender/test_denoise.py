# SPDX-License-Identifier: Apache-2.0
"""Denoise through F12: what is filtered still adds up, views and layers are as they are alone, and many samples
give the plain picture."""

import numpy as np
import pytest

SUM_OFF = 2e-5  # of a picture's largest value, of float passes
LIGHT_PASSES = {"DiffCol": ("DiffDir", "DiffInd"), "GlossCol": ("GlossDir", "GlossInd"),
                "TransCol": ("TransDir", "TransInd")}
GROUPS = {"key": "Light", "glow": "Glow", "sky": None}


def _scene(size=(72, 48), samples=16):
    """Balls of gloss and glass and a glowing one on a textured floor, under a large lamp and a dim world."""
    import math

    import scenes
    scene = scenes.empty(size=size, samples=samples)
    scene.volley.use_denoising = True
    scenes.camera((0.0, -6.0, 2.5), (math.radians(68.0), 0.0, 0.0))
    floor = scenes.material("Floor", "ShaderNodeBsdfDiffuse")
    tree = floor.node_tree
    checker = tree.nodes.new("ShaderNodeTexChecker")
    checker.inputs["Scale"].default_value = 9.0
    tree.links.new(checker.outputs[0], scenes.shader_of(floor).inputs["Color"])
    scenes.wall("Floor", 12.0, material=floor).rotation_euler = (-math.pi / 2, 0.0, 0.0)
    scenes.sphere("Gloss", 0.7, (-1.2, 0.0, 0.7),
                  scenes.material("Gloss", "ShaderNodeBsdfGlossy", Color=(0.8, 0.6, 0.3), Roughness=0.3))
    scenes.sphere("Glass", 0.6, (1.2, -0.4, 0.6), scenes.material("Glass", "ShaderNodeBsdfGlass"))
    scenes.sphere("Glow", 0.3, (0.1, 0.5, 0.3), scenes.emitter((4.0, 2.0, 1.0)))
    scenes.light('AREA', (1.5, -1.0, 3.5), (0.25, 0.35, 0.0), energy=200.0, size=1.0)
    scenes.world_color(scene.world, (0.1, 0.15, 0.2))
    return scene


def _with_and_without(names, samples=16, exact_samples=256):
    """Passes with Denoise, without, and of many samples by another seed."""
    import bpy
    import scenes
    settings, made = bpy.context.scene.volley, []
    for settings.use_denoising, settings.samples, settings.seed in (
            (True, samples, 0), (False, samples, 0), (False, exact_samples, 7)):
        made.append(scenes.render_passes(names))
    return made


def _gain(made, name, channels=slice(0, 3)):
    """The mean relative error with Denoise over that without; squares would be those of few pixels."""
    clean, plain, exact = (passes[name][..., channels] for passes in made)
    return np.abs((clean - exact) / (exact + 0.01)).mean() / np.abs((plain - exact) / (exact + 0.01)).mean()


# Passes ---------------------------------------------------------------------------------------------

def inside_passes():
    import bpy
    import scenes
    _scene()
    layer = bpy.context.view_layer
    for kind in ("diffuse", "glossy", "transmission"):
        for part in ("direct", "indirect", "color"):
            setattr(layer, f"use_pass_{kind}_{part}", True)
    layer.use_pass_emit = layer.use_pass_environment = True
    for group, member in GROUPS.items():
        bpy.ops.scene.view_layer_add_lightgroup(name=group)
        (bpy.data.objects[member] if member else bpy.context.scene.world).lightgroup = group
    light = [name for color, parts in LIGHT_PASSES.items() for name in (color, *parts)]
    return _with_and_without(["Combined", *light, "Emit", "Env", *(f"Combined_{group}" for group in GROUPS)])


def test_passes_and_light_groups_add_up(blender):
    made = [{name: picture[..., :3].astype(np.float64) for name, picture in passes.items()}
            for passes in blender.run(inside_passes)]
    for passes in made:
        combined, limit = passes["Combined"], SUM_OFF * passes["Combined"].max()
        for color, names in LIGHT_PASSES.items():  # light is over its colour, which may be next to 0
            passes[color] = passes[color] * sum(passes[name] for name in names)
        parts = sum(passes[color] for color in LIGHT_PASSES) + passes["Emit"] + passes["Env"]
        assert np.abs(parts - combined).max() < limit
        assert np.abs(sum(passes[f"Combined_{group}"] for group in GROUPS) - combined).max() < limit
    gains = {name: _gain(made, name) for name in ("Combined", "GlossCol", "Combined_key", "Combined_sky")}
    print("errors with Denoise over those without:", gains)
    assert max(gains.values()) < 1.0


# Shadow catchers and transparent films --------------------------------------------------------------

def inside_catcher():
    """Passes of a floor that catches shadows on a transparent film; Combined without that pass, too."""
    import bpy
    import scenes
    scene = _scene()
    scene.render.film_transparent = True
    bpy.data.objects["Floor"].is_shadow_catcher = True
    bpy.data.objects["Glow"].hide_render = True  # which would brighten the floor
    scenes.world_color(scene.world, (0.0, 0.0, 0.0))  # shadows are grey, as alpha is
    layer = bpy.context.view_layer
    whole = _with_and_without(["Combined"])
    layer.volley.use_pass_shadow_catcher = True
    return whole, _with_and_without(["Combined", "Shadow Catcher"])


def test_shadow_catcher_and_alpha(blender):
    whole, parts = blender.run(inside_catcher)
    for picture, passes in zip(whole, parts):
        over_white = picture["Combined"][..., :3] + 1.0 - picture["Combined"][..., 3:]
        shadow = np.minimum(passes["Shadow Catcher"][..., :3], 1.0)  # the picture can but darken
        assert shadow.min() >= 0.0
        laid = passes["Combined"][..., :3] + shadow * (1.0 - passes["Combined"][..., 3:])
        assert np.abs((laid - over_white).mean(axis=-1)).max() < SUM_OFF * over_white.max()
        alpha = picture["Combined"][..., 3]
        assert alpha.min() >= 0.0 and alpha.max() <= 1.0 + 1e-6 and (alpha < 0.01).any() and (alpha == 1.0).any()
    gains = {"alpha": _gain(whole, "Combined", slice(3, 4)), "light": _gain(whole, "Combined"),
             "cover": _gain(parts, "Combined", slice(3, 4)), "shadow": _gain(parts, "Shadow Catcher")}
    print("errors with Denoise over those without:", gains)
    assert max(gains.values()) < 1.0


# Views and layers -----------------------------------------------------------------------------------

def inside_views():
    """Views of stereo and pictures of their cameras alone; two layers together and each one alone."""
    import os
    import tempfile

    import bpy
    import compare
    import scenes
    scene = _scene((64, 48), 4)
    render, camera = scene.render, scene.camera
    camera.data.stereo.convergence_mode, camera.data.stereo.interocular_distance = 'PARALLEL', 0.5
    camera.data.stereo.pivot = 'CENTER'
    alone = []
    for camera.location.x in (-0.25, 0.25):
        alone.append(scenes.render()[..., :3])
    camera.location.x = 0.0
    render.use_multiview, render.views_format = True, 'STEREO_3D'
    render.image_settings.views_format = 'INDIVIDUAL'
    folder = tempfile.mkdtemp(prefix="volley_")
    render.filepath = os.path.join(folder, "picture.exr")
    bpy.ops.render.render(write_still=True)
    views = [compare.read_rgb(os.path.join(folder, file)) for file in sorted(os.listdir(folder))]
    render.use_multiview = False

    scene.view_layers.new("Second").material_override = bpy.data.materials["Gloss"]
    tree, shown = scenes.compositor()
    node = tree.nodes.new("CompositorNodeRLayers")
    tree.links.new(node.outputs["Image"], shown)
    layers = []
    for render.use_single_layer in (False, True):
        for layer in scene.view_layers:
            node.layer = layer.name
            bpy.context.window.view_layer = layer  # what a single layer is
            layers.append(scenes.render())
    return views, alone, layers


def test_views_and_layers_are_as_alone(blender):
    views, alone, layers = blender.run(inside_views)
    assert len(views) == 2
    for view, picture in zip(views, np.array(alone)[:, ::-1]):
        off = np.abs(view - picture).max(axis=-1) > 1e-3
        assert view.any() and off.mean() < 0.01
    assert np.abs(views[0] - views[1]).mean() > 0.01
    assert np.array_equal(layers[0], layers[2]) and np.array_equal(layers[1], layers[3])
    assert np.abs(layers[0] - layers[1]).mean() > 0.01


# Passes that it goes by ------------------------------------------------------------------------------

def inside_guides():
    """Without them, with some and with all: final pictures, and what the viewport would ask for."""
    import scenes
    from volley import session
    from volley.sync import camera
    scene, found = _scene((64, 48)), {}
    for kind in ('RGB', 'RGB_ALBEDO', 'RGB_ALBEDO_NORMAL'):
        scene.volley.denoising_input_passes = scene.volley.preview_denoising_input_passes = kind
        found[kind] = scenes.render()
        found[f"viewport {kind}"] = session.render_fields(scene, camera.Frame(64, 48), (0, 0, 64, 48), [], True)["guides"]
    return found


def test_passes_that_it_goes_by(blender):
    found = blender.run(inside_guides)
    assert [found[f"viewport {kind}"] for kind in ('RGB_ALBEDO_NORMAL', 'RGB_ALBEDO', 'RGB')] == [0, 1, 2]
    pictures = [found[kind] for kind in ('RGB', 'RGB_ALBEDO', 'RGB_ALBEDO_NORMAL')]
    for before, after in zip(pictures, pictures[1:]):
        assert (np.abs(before - after).max(axis=-1) > 1e-4).mean() > 0.02


# The limit ------------------------------------------------------------------------------------------

def inside_limit():
    """At 4,096 samples: with Denoise, without, and without by another seed."""
    import bpy
    import scenes
    scene = _scene((24, 18), 4096)
    bpy.data.objects["Glass"].hide_render = True  # slow
    made = []
    for scene.volley.use_denoising, scene.volley.seed in ((True, 0), (False, 0), (False, 7)):
        made.append(scenes.render())
    return made


def test_many_samples_give_the_plain_picture(blender):
    clean, plain, other = (picture[..., :3].astype(np.float64) for picture in blender.run(inside_limit))
    weights = (plain + 0.01) ** -2.0
    noise = (weights * (plain - other) ** 2).mean() / 2.0
    moved, off = ((weights * (clean - picture) ** 2).mean() for picture in (plain, other))
    bias = (clean - plain).mean() / plain.mean()
    print(f"moved by {moved / noise:.2f} of the noise, error {off / (2.0 * noise):.2f}, means off by {bias:.1e}")
    assert moved < noise and off < 2.2 * noise and bias == pytest.approx(0.0, abs=1e-3)
