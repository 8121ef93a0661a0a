# SPDX-License-Identifier: Apache-2.0
"""Passes for denoisers against Cycles'."""

import math

import blender as blender_support
import compare
import pytest

SAMPLES = 64
# Beyond the noise that the seeds show, of pictures' means and of tiles'.
OFF = 5e-4, 0.01
FADING_SINCE = (5, 0), "metals gave all of their features, or passed them on"
FADING_ROUGHNESS = 0.1, 0.17, 0.22, 0.27, 0.34  # from those of mirrors to those that show their own features alone


def _agree(ours, theirs, name):
    ours, theirs = ours[..., :3], theirs[..., :3]
    assert theirs.any(), name
    assert all(a <= b for a, b in zip(compare.unexplained(ours, theirs), OFF)), name


def inside_denoising():
    import bpy
    import pass_scenes
    import scenes
    pass_scenes.gallery()
    # Without the diffuse part, on which Cycles would lose paths.
    bpy.data.objects["Veil"].data.materials[0] = scenes.material(
        "Clear", "ShaderNodeBsdfTransparent", Color=(0.5, 0.9, 0.7))
    layer = bpy.context.view_layer
    layer.volley.denoising_store_passes = layer.cycles.denoising_store_passes = True
    later = ["Denoising Specular Albedo", "Denoising Roughness"] if bpy.app.version >= (5, 2, 0) else []
    return scenes.passes_by_both(["Denoising Albedo", "Denoising Normal", "Denoising Depth", *later], SAMPLES)


def test_denoising_data(blender):
    pairs = blender.run(inside_denoising)
    for name, (ours, theirs) in pairs.items():
        _agree(ours, theirs, name)


def inside_denoising_emission():
    """The albedo of what shines, a surface and the background, seen directly, in a mirror and through a coloured pane,
    not in rough gloss; and on a transparent film."""
    import bpy
    import scenes
    scene = scenes.empty(size=(32, 24))
    scenes.camera()
    scenes.sphere("Mirror", 0.8, (-0.9, 0.0, 0.6), material=scenes.material(
        "Metal", "ShaderNodeBsdfGlossy", Roughness=0.0, Color=(0.8, 0.6, 0.9)))
    scenes.sphere("Shining", 0.7, (0.9, 0.0, 0.6), material=scenes.emitter((0.9, 0.4, 1.5), "Shining"))
    scenes.sphere("Rough", 0.6, (0.0, 0.0, -1.0), material=scenes.material(
        "Rough", "ShaderNodeBsdfGlossy", Roughness=0.6, Color=(0.6, 0.5, 0.2)))
    scenes.wall("Pane", 0.7, -1.5, material=scenes.material(
        "Clear", "ShaderNodeBsdfTransparent", Color=(0.5, 0.9, 0.7)))
    scenes.world_color(bpy.context.scene.world, (0.3, 0.2, 0.5))
    layer = bpy.context.view_layer
    layer.volley.denoising_store_passes = layer.cycles.denoising_store_passes = True
    found = {}
    for case, scene.render.film_transparent, layer.use_pass_environment in (
            ("opaque", False, False), ("clear", True, False), ("clear, environment", True, True)):
        found[case] = scenes.passes_by_both(["Denoising Albedo"], SAMPLES)["Denoising Albedo"]
    return found


def test_denoising_emission(blender):
    found = blender.run(inside_denoising_emission)
    for case, (ours, theirs) in found.items():
        _agree(ours, theirs, case)
    assert found["opaque"][1].mean() > 1.1 * found["clear"][1].mean()


def inside_fading():
    """Metal balls, rougher from left to right, before a wall and above a floor."""
    import bpy
    import pass_scenes
    import scenes
    pass_scenes.gallery()
    for name in ("Mirror", "Metal", "Veil"):
        bpy.data.objects.remove(bpy.data.objects[name])
    floor = scenes.wall("Floor", 14.0, 0.0, material=scenes.material(
        "Floor", "ShaderNodeBsdfDiffuse", Color=(0.2, 0.5, 0.7)))
    floor.rotation_euler, floor.location = (-math.pi / 2, 0.0, 0.0), (0.0, 0.0, -0.7)
    for i, roughness in enumerate(FADING_ROUGHNESS):
        scenes.sphere(f"Ball {i}", 0.5, (-2.2 + 1.1 * i, 0.0, 0.0), material=scenes.material(
            f"Metal {i}", "ShaderNodeBsdfGlossy", Color=(0.9, 0.6, 0.7), Roughness=roughness))
    layer = bpy.context.view_layer
    layer.volley.denoising_store_passes = layer.cycles.denoising_store_passes = True
    return scenes.passes_by_both(["Denoising Albedo", "Denoising Normal", "Denoising Depth"], SAMPLES)


@pytest.mark.since(*FADING_SINCE)
def test_fading(blender):
    if blender_support.version() < FADING_SINCE[0]:
        pytest.skip(FADING_SINCE[1])
    for name, (ours, theirs) in blender.run(inside_fading).items():
        _agree(ours, theirs, name)
