# SPDX-License-Identifier: Apache-2.0
"""Shadow catchers: pictures and passes against those of Cycles without diffuse bounces."""

import compare
import numpy as np
import pytest

SAMPLES = 512
OFF = 1e-3  # beyond the noise that the seeds show


def _floor(node_type="ShaderNodeBsdfDiffuse", **inputs):
    """A transparent film, a floor that catches shadows, a red ball on it."""
    import math

    import scenes
    scene = scenes.empty(size=(72, 54))
    scene.render.film_transparent = True
    scenes.camera((0.0, -6.0, 2.5), (math.radians(68.0), 0.0, 0.0))
    made = scenes.wall("Floor", 12.0, material=scenes.material("Floor", node_type, **inputs))
    made.rotation_euler = (-math.pi / 2, 0.0, 0.0)
    made.is_shadow_catcher = True
    red = scenes.material("Red", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.1, 0.1))
    scenes.sphere("Ball", 0.8, (0.0, 0.0, 0.8), red)
    return scene


def _sun():
    import scenes
    return scenes.light('SUN', (0.0, 0.0, 4.0), (0.7, 0.35, 0.0), energy=2.0, angle=0.3)


def _agree(ours, theirs, name, off=OFF):
    """Means of the picture and of its tiles are as far apart as noise explains, and that much more."""
    assert max(compare.unexplained(ours, theirs)) <= off, name


# Kinds of light and of surfaces -------------------------------------------------------------------

def inside_lights():
    import bpy
    import scenes
    pairs = {}
    _floor(Color=(0.8, 0.6, 0.4))
    sun = _sun()
    pairs["sun"] = scenes.seeds_by_both(SAMPLES)
    sun.hide_render = True
    area = scenes.light('AREA', (1.5, -1.0, 3.5), (0.25, 0.35, 0.0), energy=200.0, size=1.0)
    pairs["area"] = scenes.seeds_by_both(SAMPLES)
    area.hide_render = True
    scenes.world_color(bpy.context.scene.world, (0.1, 0.2, 0.4))
    pairs["world"] = scenes.seeds_by_both(SAMPLES)
    sun.hide_render = area.hide_render = False
    sun.is_shadow_catcher = False  # not a light of the footage
    pairs["synthetic"] = scenes.seeds_by_both(SAMPLES)
    return pairs


def test_lights(blender):
    pairs = blender.run(inside_lights, timeout=300)
    assert len(pairs) == 4
    for name, (ours, theirs) in pairs.items():
        shadow = theirs[..., 3] * (theirs[..., :3].max(axis=-1) == 0.0)
        assert 0.3 < shadow.max() <= 1.0 and (theirs[..., 3] < 0.01).mean() > 0.1
        _agree(ours, theirs, name)


def inside_surfaces():
    """A mirror and a gloss that show the ball; behind a coloured pane and beside a lamp and a second
    catcher; one with holes, above another ball; what is instanced by a catcher is one."""
    import bpy
    import scenes
    pairs = {}
    for name, node_type, inputs in (
            ("mirror", "ShaderNodeBsdfGlossy", {"Color": (0.8, 0.8, 0.8), "Roughness": 0.0}),
            ("gloss", "ShaderNodeBsdfPrincipled", {"Base_Color": (0.5, 0.4, 0.3), "Roughness": 0.3})):
        scene = _floor(node_type, **inputs)
        scenes.world_color(scene.world, (0.4, 0.5, 0.6))
        _sun()
        pairs[name] = scenes.seeds_by_both(SAMPLES)
    scene = _floor(Color=(0.8, 0.6, 0.4))
    scenes.world_color(scene.world, (0.1, 0.15, 0.3))
    _sun()
    scenes.wall("Pane", 2.0, -2.0, (0.6, 1.2),
                scenes.material("Pane", "ShaderNodeBsdfTransparent", Color=(0.5, 0.8, 0.9)))
    scenes.sphere("Lamp", 0.3, (-1.5, -1.0, 0.5), scenes.emitter((3.0, 2.0, 1.0)))
    crate = bpy.data.collections.new("Crate")
    crate.objects.link(scenes.sphere("Second", 0.4, (1.5, 0.0, 0.4), bpy.data.materials["Floor"]))
    scene.collection.objects.unlink(bpy.data.objects["Second"])
    instancer = scenes.link("Crates", None)
    instancer.instance_type, instancer.instance_collection = 'COLLECTION', crate
    instancer.is_shadow_catcher = True
    pairs["company"] = scenes.seeds_by_both(SAMPLES)
    return pairs


def test_surfaces(blender):
    pairs = blender.run(inside_surfaces, timeout=300)
    assert len(pairs) == 3
    for name, (ours, theirs) in pairs.items():
        _agree(ours, theirs, name)


# What else the picture holds ----------------------------------------------------------------------

WORLD = (0.1, 0.15, 0.3)


def inside_films():
    """The picture over the world by itself, and Cycles' transparent one to lay over it."""
    import scenes
    scene = _floor(Color=(0.8, 0.6, 0.4))
    scenes.world_color(scene.world, WORLD)
    _sun()
    transparent = scenes.seeds_by('CYCLES', SAMPLES)
    scene.render.film_transparent = False
    return transparent, scenes.seeds_by_both(SAMPLES)


def test_background(blender):
    """Cycles counts the world behind catchers that objects cover in part once too often, so only its
    transparent picture is right at edges."""
    transparent, (ours, theirs) = blender.run(inside_films, timeout=300)
    laid = transparent[..., :3] + np.array(WORLD) * (1.0 - transparent[..., 3:])
    _agree(ours[..., :3], laid, "laid over the world")
    assert (ours[..., 3] == 1.0).mean() > 0.9 and np.abs(ours[..., 3] - 1.0).max() < 1e-5
    alone = (transparent[..., :3].max(axis=-1) == 0.0).all(axis=0)
    _agree(ours * alone[..., None], theirs * alone[..., None], "catchers alone")


PASSES = ["Combined", "Shadow Catcher", "DiffDir", "Combined_sky", "Depth"]


def inside_passes():
    import bpy
    import scenes
    from volley import passes
    scene = _floor(Color=(0.8, 0.6, 0.4))
    _sun().data.color = (1.0, 0.7, 0.4)
    scenes.world_color(scene.world, (0.1, 0.15, 0.3))
    layer = bpy.context.view_layer
    bpy.ops.scene.view_layer_add_lightgroup(name="sky")
    scene.world.lightgroup = "sky"
    layer.use_pass_diffuse_direct = layer.use_pass_z = True
    layer.volley.use_pass_shadow_catcher = True
    assert "Shadow Catcher" in [entry.names[0] for entry in passes.enabled(layer)]
    layer.cycles.use_pass_shadow_catcher = True
    pairs = scenes.passes_by_both(PASSES, SAMPLES)
    bpy.data.objects["Floor"].is_shadow_catcher = False
    scenes.set_engine('VOLLEY', 1)
    return pairs, scenes.render_passes(["Shadow Catcher"])["Shadow Catcher"]


def test_passes(blender):
    pairs, without = blender.run(inside_passes, timeout=300)
    _agree(*pairs["Combined"], "Combined")
    ours, theirs = ({name: pair[side] for name, pair in pairs.items()} for side in (0, 1))
    # Footage is multiplied by the pass, then the picture goes over it.
    shown = 1.0 - theirs["Combined"][..., 3:]
    caught, expected = (each["Shadow Catcher"][..., :3] * shown for each in (ours, theirs))
    _agree(caught, expected, "Shadow Catcher")
    ours, theirs = ({name: pictures.mean(axis=0) for name, pictures in each.items()} for each in (ours, theirs))
    caught, shown = caught.mean(axis=0), shown.mean(axis=0)
    floor = caught[shown[..., 0] == 1.0]
    darkest = floor[floor[:, 0].argmin()]
    assert darkest[0] < 0.2 and darkest[2] > 1.5 * darkest[0]  # the world fills the shadow with blue
    assert (without[..., :3] == 1.0).all()
    covers = np.stack([each["Combined"][..., 3] for each in (ours, theirs)])
    inner, outer = covers.min(axis=0) == 1.0, covers.max(axis=0) == 0.0
    assert (theirs["DiffDir"][outer][..., :3] == 0.0).all()
    for name in ("Combined_sky", "DiffDir"):  # not of catchers; groups were till 3.4 (T103403)
        assert (ours[name][outer][..., :3] == 0.0).all()
        assert ours[name][inner].mean() == pytest.approx(theirs[name][inner].mean(), rel=5e-3)
    depths = np.stack([each["Depth"][..., 0] for each in (ours, theirs)])
    near = depths.max(axis=0) < 20.0
    assert near.mean() > 0.5
    assert depths[0][near].mean() == pytest.approx(depths[1][near].mean(), rel=1e-2)


def inside_regions():
    """The whole picture, and what a border and other integrators make of it."""
    import scenes
    scene = _floor(Color=(0.8, 0.6, 0.4))
    scenes.world_color(scene.world, WORLD)
    _sun()
    kinds = {}
    for integrator in ('RAYCAST', 'WHITTED', 'DISTRIBUTION'):
        scene.volley.integrator = integrator
        kinds[integrator] = scenes.seeds_by('VOLLEY', SAMPLES)
    scenes.set_engine('VOLLEY', 256)
    whole = scenes.render()
    render = scene.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = .25, .75, .5, 1
    return whole, kinds, scenes.render()


def test_regions_and_integrators(blender):
    whole, kinds, part = blender.run(inside_regions, timeout=300)
    assert part.shape[:2] == (27, 36)
    assert np.array_equal(part, whole[27:54, 18:54])
    expected = kinds.pop('DISTRIBUTION')
    for integrator, pictures in kinds.items():  # a floor and a ball without gloss: one bounce shows all
        _agree(pictures, expected, integrator)
