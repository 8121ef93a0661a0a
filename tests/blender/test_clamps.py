# SPDX-License-Identifier: Apache-2.0
"""Clamped light in all passes against Cycles'."""

import blender as blender_support
import compare
import numpy as np
import pytest

SAMPLES = 256
# (direct, indirect): off, either, both; below 1 the pass of ambient occlusion is clamped, too.
CLAMPS = ((0.0, 0.0), (0.3, 0.0), (0.0, 0.1), (1.0, 0.2), (0.5, 0.5))
# Old and new names of passes with the settings that ask for them.
PASSES = {("Combined", "Combined"): None, ("AO", "Ambient Occlusion"): "ambient_occlusion",
          ("Shadow", None): "shadow", ("Emit", "Emission"): "emit", ("Env", "Environment"): "environment",
          ("DiffDir", "Diffuse Direct"): "diffuse_direct",
          ("DiffInd", "Diffuse Indirect"): "diffuse_indirect",
          ("DiffCol", "Diffuse Color"): "diffuse_color",
          ("GlossDir", "Glossy Direct"): "glossy_direct",
          ("GlossInd", "Glossy Indirect"): "glossy_indirect",
          ("GlossCol", "Glossy Color"): "glossy_color"}
GROUPS = {"Combined_key": "key", "Combined_sky": "sky", "Combined_sign": "sign"}
# Beyond the noise that the seeds show, of pictures' means and of tiles' (see compare.unexplained). The pass of
# shadows ends on rough metal a little before that of Cycles does.
OFF = {"Shadow": (2e-3, 0.05)}
USUAL_OFF = 1e-3, 0.015
SUM_TOLERANCE = 1e-4


def _scene():
    """A floor, a ball that mirrors it, a rough one, a coloured veil that throws a shadow, under a sun; a sky
    and a sign that only the camera sees, so that no choice between lights is in the contributions."""
    import bpy
    import scenes
    scene = scenes.empty(size=(96, 64))
    scenes.camera(location=(0.5, -7.0, 1.0), rotation=(np.pi / 2 - 0.15, 0.0, 0.1))
    floor = scenes.wall("Floor", 12.0, material=scenes.material(
        "Floor", "ShaderNodeBsdfDiffuse", Color=(0.7, 0.5, 0.3)))
    floor.rotation_euler.x, floor.location.z = -np.pi / 2, -1.0
    scenes.sphere("Mirror", 1.0, (-1.6, 0.0, 0.0), material=scenes.material(
        "Mirror", "ShaderNodeBsdfGlossy", Color=(0.9, 0.8, 0.7), Roughness=0.0))
    scenes.sphere("Metal", 0.9, (1.8, 1.0, 0.2), material=scenes.material(
        "Metal", "ShaderNodeBsdfGlossy", Color=(0.5, 0.7, 0.9), Roughness=0.4))
    scenes.wall("Veil", 1.5, -2.0, (0.3, 0.4), scenes.material(
        "Veil", "ShaderNodeBsdfTransparent", Color=(0.3, 0.9, 0.5)))
    paint = scenes.emitter((2.0, 1.0, 0.5))
    if bpy.app.version >= (3, 5, 0):  # before, a light that no surface sees was not chosen
        paint.cycles.emission_sampling = 'NONE'
    glow = scenes.wall("Sign", 0.8, -1.5, (1.2, 1.0), paint)
    sun = scenes.light('SUN', rotation=(0.7, 0.2, 0.0), angle=0.0, energy=6.0)
    scenes.world_color(scene.world, (0.4, 0.6, 0.9))
    scene.world.cycles.sampling_method = 'NONE'
    for owner in (scene.world.cycles_visibility, glow):
        prefix = "visible_" if owner == glow else ""
        for kind in ("diffuse", "glossy", "transmission"):
            setattr(owner, prefix + kind, False)
    glow.visible_shadow = False
    for owner, group in ((sun, "key"), (scene.world, "sky"), (glow, "sign")):
        bpy.ops.scene.view_layer_add_lightgroup(name=group)
        owner.lightgroup = group
    return scene


def inside_clamps():
    """Pairs of pictures of passes by their short names, for each pair of limits."""
    import bpy
    import scenes
    from volley.compat import HAS_LONG_PASS_NAMES
    scene, layer = _scene(), bpy.context.view_layer
    names = {group: group for group in GROUPS}
    for (short, long), setting in PASSES.items():
        if setting is not None and hasattr(layer, f"use_pass_{setting}"):
            setattr(layer, f"use_pass_{setting}", True)
        name = long if HAS_LONG_PASS_NAMES else short
        if short == "Shadow" and bpy.app.version >= (4, 0, 0):  # Cycles has none any more
            continue
        if name is not None:
            names[name] = short
    clamped = {}
    for direct, indirect in CLAMPS:
        scene.volley.clamp_direct = scene.cycles.sample_clamp_direct = direct
        scene.volley.clamp_indirect = scene.cycles.sample_clamp_indirect = indirect
        pairs = scenes.passes_by_both(list(names), SAMPLES)
        clamped[direct, indirect] = {short: [seeds[..., :3] for seeds in pairs[name]]
                                     for name, short in names.items()}
    return clamped


def _with_color(pairs):
    """The same with light as it is in Combined, not over the colour, which may be next to nothing."""
    return {name: [light * color for light, color in zip(pair, pairs[name[:-3] + "Col"])]
            if name.endswith(("Dir", "Ind")) else pair for name, pair in pairs.items()}


def test_clamps(blender):
    clamped = {clamp: _with_color(pairs)
               for clamp, pairs in blender.run(inside_clamps, timeout=300).items()}
    lines = [f"{'direct':>6} {'indirect':>8} {'pass':13} {'mean':>9} {'mean off':>10} {'of tiles':>10}"]
    errors = {}
    for (direct, indirect), pairs in clamped.items():
        for name, (ours, theirs) in pairs.items():
            whole, tiles = compare.unexplained(ours, theirs)
            lines.append(f"{direct:6g} {indirect:8g} {name:13} {theirs.mean():9.3g} {whole:10.2e} {tiles:10.2e}")
            errors[f"{name}, direct {direct:g}, indirect {indirect:g}"] = whole / (theirs.mean() or 1.0)
    blender_support.write_result("clamps", lines, errors)
    for pairs in clamped.values():
        for name, pair in pairs.items():
            off = compare.unexplained(*pair)
            assert all(a <= b for a, b in zip(off, OFF.get(name, USUAL_OFF))), name
        ours = {name: pair[0] for name, pair in pairs.items()}
        by_kind = ours["Emit"] + ours["Env"] + sum(
            ours[f"{kind}{way}"] for kind in ("Diff", "Gloss") for way in ("Dir", "Ind"))
        assert ours["Combined"] == pytest.approx(by_kind, abs=SUM_TOLERANCE)
        assert ours["Combined"] == pytest.approx(sum(ours[group] for group in GROUPS), abs=SUM_TOLERANCE)
    free = clamped[0.0, 0.0]
    for clamp in CLAMPS[1:]:  # each takes light
        assert clamped[clamp]["Combined"][1].mean() < 0.95 * free["Combined"][1].mean()


def inside_glass(shows_wall):
    """Glass that reflects much, of which the camera's rays follow both ways, by both: a ball before a lamp, whose light
    rays find, or a pane before a lit wall, whose light is of samples."""
    import bpy
    import scenes
    scene = scenes.empty(size=(32, 32))
    scenes.camera()
    glass = scenes.material("Glass", "ShaderNodeBsdfGlass", Color=(1.0, 1.0, 1.0), IOR=3.0 if shows_wall else 10.0,
                            Roughness=0.0)
    if shows_wall:
        scenes.wall("Pane", 9.0, -1.0, material=glass)
        scenes.wall("Wall", 9.0, 2.0, material=scenes.material("Matt", "ShaderNodeBsdfDiffuse")).visible_shadow = False
        scenes.light('SUN', rotation=(1.0, 0.0, 0.0), energy=3.0)
        bpy.data.objects["Pane"].visible_shadow = False
    else:
        scenes.sphere(material=glass)
        scenes.light('AREA', energy=300.0, size=2.0)
    limit = 0.1 if shows_wall else 10.0
    scene.volley.clamp_indirect = scene.cycles.sample_clamp_indirect = limit
    return scenes.seeds_by_both(1024)


@pytest.mark.parametrize("shows_wall", [False, True])
def test_both_ways_of_glass(blender, shows_wall):
    """Each was clamped by itself, with a weight below that of the only way: 4 % too bright, the wall a third."""
    ours, theirs = (seeds[..., :3] for seeds in blender.run(inside_glass, shows_wall))
    assert theirs.mean() > 0.02
    assert compare.unexplained(ours, theirs)[0] < 0.01 * theirs.mean()


def inside_catcher():
    """A floor that catches the shadow of a ball, by both engines under each limit."""
    import scenes
    scene = scenes.empty(size=(72, 54))
    scene.render.film_transparent = True
    scenes.camera((0.0, -6.0, 2.5), (1.187, 0.0, 0.0))
    floor = scenes.wall("Floor", 12.0, material=scenes.material(
        "Floor", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.6, 0.4)))
    floor.rotation_euler.x, floor.is_shadow_catcher = -np.pi / 2, True
    scenes.sphere("Ball", 0.8, (0.0, 0.0, 0.8), scenes.material(
        "Red", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.1, 0.1)))
    scenes.light('SUN', (0.0, 0.0, 4.0), (0.7, 0.35, 0.0), energy=4.0, angle=0.3)
    pairs = {}
    for direct in (0.0, 0.3):
        scene.volley.clamp_direct = scene.cycles.sample_clamp_direct = direct
        pairs[direct] = scenes.by_both(SAMPLES)
    return pairs


def test_catcher(blender):
    pairs = blender.run(inside_catcher)
    for ours, theirs in pairs.values():
        assert theirs[..., 3].max() > 0.9
        assert np.abs(ours.mean(axis=(0, 1)) - theirs.mean(axis=(0, 1))).max() < 2e-3
        assert (np.abs(ours - theirs).max(axis=-1) > 0.05).mean() < 0.01
    assert pairs[0.3][1][..., 0].max() < 0.8 * pairs[0.0][1][..., 0].max()
