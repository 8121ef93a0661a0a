# SPDX-License-Identifier: Apache-2.0
"""Data passes against Cycles' passes of the same name."""

import itertools

import blender as blender_support
import compare
import numpy as np
import pytest

SAMPLES = 64
# Beyond the noise that the seeds show, of pictures' means and of tiles' (see compare.unexplained); few samples
# that are rare and bright, at edges and in mirrors, tell their noise badly.
OFF = 5e-4, 0.01
LIGHT_OFF = 1e-3, 0.03  # of light seen in mirrors .019, beside 4.3 as beside 3.4; the rest 4e-6
SHADOW_OFF = 3e-3, 0.1  # on rough metal it ends a little before that of Cycles does


def _both(names, samples=SAMPLES):
    """Those passes by Volley and by Cycles, with several seeds."""
    import scenes
    return scenes.passes_by_both(names, samples)


def _agree(ours, theirs, name, channels=3, off=OFF):
    """Means of the picture and of its tiles are as far apart as noise explains, and that much more."""
    ours, theirs = ours[..., :channels], theirs[..., :channels]
    assert theirs.any(), name
    assert all(a <= b for a, b in zip(compare.unexplained(ours, theirs), off)), name


# Data, light and colours ---------------------------------------------------------------------------

# Old and new names of what a pixel's first sample says, of means, and of light with its colour.
_FIRST_PASSES = ("Depth", "Position", ("IndexOB", "Object Index"), ("IndexMA", "Material Index"))
_SURFACE_PASSES = ("Normal", "UV")
_MEAN_PASSES = ("Combined", ("Emit", "Emission"), ("Env", "Environment"))
_LIGHT_PASSES = {
    ("DiffCol", "Diffuse Color"): (("DiffDir", "Diffuse Direct"), ("DiffInd", "Diffuse Indirect")),
    ("GlossCol", "Glossy Color"): (("GlossDir", "Glossy Direct"), ("GlossInd", "Glossy Indirect")),
    ("TransCol", "Transmission Color"): (("TransDir", "Transmission Direct"),
                                         ("TransInd", "Transmission Indirect"))}
# Pixels of one sample in their middle: the share that may differ, by more than that share of the largest.
FIRST_SHARE, FIRST_STEP = 1e-3, 2e-3
LEAST_COLOR = 0.02  # below it, light over colour is one noise over another
SUM_TOLERANCE = 1e-4
BACKGROUND_OFF = 0.005  # pixels; measured: .001


def _name_of(names):
    """What this Blender calls a pass."""
    from volley.compat import HAS_LONG_PASS_NAMES
    return names if isinstance(names, str) else names[HAS_LONG_PASS_NAMES]


def inside_gallery():
    """What every kind of light and surface gives: pairs of pictures of passes by their short names."""
    import bpy
    import pass_scenes
    import scenes
    from volley import passes
    scene = pass_scenes.gallery()
    scenes.world_color(scene.world, (0.4, 0.5, 0.7))
    scenes.light('AREA', location=(2.0, -3.0, 4.0), rotation=(0.8, 0.0, 0.5), energy=300.0, size=1.5)
    scenes.sphere("Glass", 0.7, (-2.4, -1.0, -0.2), scenes.material(
        "Glass", "ShaderNodeBsdfGlass", Color=(0.9, 0.95, 1.0), Roughness=0.1, IOR=1.45))
    scenes.sphere("Plastic", 0.6, (2.3, -1.0, -0.4), scenes.material(
        "Plastic", "ShaderNodeBsdfPrincipled", Base_Color=(0.8, 0.3, 0.2), Roughness=0.3))
    scenes.sphere("Leaf", 0.5, (0.0, -2.0, -1.0), scenes.material(
        "Leaf", "ShaderNodeBsdfTranslucent", Color=(0.3, 0.7, 0.2)))
    scenes.wall("Sign", 0.8, -1.5, (1.4, 1.1), scenes.emitter((2.0, 1.0, 0.5)))
    bpy.data.objects["Back"].scale = (0.3, 1.0, 1.0)  # the world beside it
    for number, thing in enumerate(bpy.data.objects):
        thing.pass_index = number + 1
        for slot in thing.material_slots:
            slot.material.pass_index = 2 * number + 1
    layer = bpy.context.view_layer
    for entry in passes.PASSES:
        if "." not in entry.setting:
            setattr(layer, entry.setting, True)
    scene.volley.clamp_indirect = scene.cycles.sample_clamp_indirect = 0.0
    shown = [*_MEAN_PASSES, *_LIGHT_PASSES, *itertools.chain(*_LIGHT_PASSES.values())]
    names = {_name_of(names): names if isinstance(names, str) else names[0] for names in shown}
    pairs = _both(list(names), 8 * SAMPLES)
    bpy.data.objects["Veil"].hide_render = True  # a sample goes through it or not by chance
    pairs.update(_both(_SURFACE_PASSES))
    scenes.sharpen()
    first = {_name_of(names): names if isinstance(names, str) else names[0] for names in _FIRST_PASSES}
    pairs.update(_both(list(first)))
    names.update(first, **{name: name for name in _SURFACE_PASSES})
    return {names[name]: [picture[..., :3] for picture in pair] for name, pair in pairs.items()}


def test_gallery(blender):
    pairs = blender.run(inside_gallery, timeout=300)
    lines, errors = [f"{'pass':9} {'mean':>9} {'mean off':>10} {'tiles or pixels':>16}"], {}

    def compare_means(name, ours, theirs):
        off = compare.unexplained(ours, theirs)
        lines.append(f"{name:9} {theirs.mean():9.3g} {off[0]:10.2e} {off[1]:16.2e}")
        errors[name] = off[0] / (theirs.mean() or 1.0)
        assert off[0] <= LIGHT_OFF[0] and off[1] <= LIGHT_OFF[1], lines[-1]

    for name in ("Depth", "Position", "IndexOB", "IndexMA"):
        ours, theirs = pairs[name]
        apart = (np.abs(ours - theirs) > FIRST_STEP * np.abs(theirs).max()).any(axis=-1).mean()
        lines.append(f"{name:9} {theirs.mean():9.3g} {'':10} {apart:16.3%}")
        errors[name] = apart
        assert apart <= FIRST_SHARE, lines[-1]
    for name in (*_SURFACE_PASSES, "Combined", "Emit", "Env"):
        compare_means(name, *pairs[name])
    for (color, _), light in _LIGHT_PASSES.items():
        compare_means(color, *pairs[color])
        seen = pairs[color][1].min(axis=-1, keepdims=True) > LEAST_COLOR
        for name, _ in light:
            compare_means(name, *(picture * seen for picture in pairs[name]))
    blender_support.write_result("passes", lines, errors)
    light = compare.light_sum({name: pairs[name][0] for name in compare.LIGHT_PASSES})
    assert pairs["Combined"][0] == pytest.approx(light, abs=SUM_TOLERANCE)
    assert all(pairs[name][1].any() for name in pairs if name != "TransDir")  # all is to be seen


# Velvet and holdouts -----------------------------------------------------------------------------

_VELVET_PASSES = ("GlossDir", "DiffDir", "GlossCol", "DiffCol")


def inside_velvet():
    """Passes of a ball of velvet by both, and its light where a lamp does without glossy or diffuse rays."""
    import bpy
    import scenes
    scenes.empty(size=(32, 24))
    scenes.camera()
    is_own = scenes.has_node("ShaderNodeBsdfVelvet")
    scenes.sphere(material=scenes.material("Velvet", "ShaderNodeBsdfVelvet") if is_own else scenes.material(
        "Velvet", "ShaderNodeBsdfSheen", {"distribution": 'ASHIKHMIN'}))
    lamp = scenes.light(energy=500.0)
    layer = bpy.context.view_layer
    layer.use_pass_glossy_direct = layer.use_pass_diffuse_direct = True
    layer.use_pass_glossy_color = layer.use_pass_diffuse_color = True
    pictures = _both(_VELVET_PASSES)
    unlit = {}
    for rays in ("visible_glossy", "visible_diffuse"):
        setattr(lamp, rays, False)
        unlit[rays] = [picture[..., :3].mean() for picture in scenes.by_both(SAMPLES)]
        setattr(lamp, rays, True)
    return pictures, unlit


def test_velvet(blender):
    pictures, unlit = blender.run(inside_velvet)
    for name in ("GlossDir", "GlossCol"):
        _agree(*pictures[name], name)
    for name in ("DiffDir", "DiffCol"):
        assert not any(picture[..., :3].any() for picture in pictures[name]), name
    assert unlit["visible_glossy"] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert unlit["visible_diffuse"][0] == pytest.approx(unlit["visible_diffuse"][1], rel=0.01)


def inside_holdouts():
    """{kind, pass: both} of a ball that is held out by its object, by its material, or in part."""
    import bpy
    import scenes
    found = {}
    for kind in ("object", "material", "part"):
        scenes.empty(size=(32, 24))
        scenes.camera()
        matt = scenes.material("Matt", "ShaderNodeBsdfDiffuse", Color=(0.5, 0.6, 0.7))
        held = matt
        if kind != "object":
            held = matt.copy()
            nodes, links = held.node_tree.nodes, held.node_tree.links
            mix = nodes.new("ShaderNodeMixShader")
            mix.inputs[0].default_value = 0.4 if kind == "part" else 0.0
            links.new(nodes.new("ShaderNodeHoldout").outputs[0], mix.inputs[1])
            surface = next(link for link in links if link.to_socket.name == "Surface")
            links.new(surface.from_socket, mix.inputs[2])
            links.new(mix.outputs[0], surface.to_socket)
        ball = scenes.sphere(material=held)
        ball.is_holdout, ball.pass_index = kind == "object", 3
        scenes.wall("Back", 6.0, 2.0, material=matt).pass_index = 7
        scenes.light(energy=300.0)
        layer = bpy.context.view_layer
        for name in ("z", "mist", "normal", "uv", "object_index", "diffuse_color", "ambient_occlusion"):
            setattr(layer, f"use_pass_{name}", True)
        layer.volley.denoising_store_passes = layer.cycles.denoising_store_passes = True
        both = _both(["Depth", "Mist", "Normal", "UV", "IndexOB", "DiffCol", "AO", "Denoising Depth"], 64)
        found.update(((kind, name), pair) for name, pair in both.items())
    return found


def test_holdouts(blender):
    """Where all is held out there is nothing, neither depth nor ambient occlusion."""
    for (kind, name), (ours, theirs) in blender.run(inside_holdouts).items():
        ours, theirs = (np.minimum(each[:, 12, 16], 100.0) for each in (ours, theirs))
        assert ours == pytest.approx(theirs, rel=0.02, abs=0.03), f"{kind}, {name}"


METALS = {"smooth": (0.0, 1.0), "half rough": (0.3, 1.0), "tinted": (0.3, 0.1), "rough": (0.8, 0.1)}
TINTED_SINCE = (4, 0), "metal had no tint of its edge"
METAL_OFF = 3e-3, 0.02  # the tables of both are off by that much; the dip of the tint is .1 of the mean


def inside_metals():
    """{kind: glossy colour} of a ball of metal by both, by roughness and red of the edge's tint."""
    import bpy
    import scenes
    found = {}
    for kind, (roughness, red) in METALS.items():
        scenes.empty(size=(32, 24))
        scenes.camera()
        scenes.sphere(material=scenes.material(
            "Metal", "ShaderNodeBsdfPrincipled", Metallic=1.0, Roughness=roughness,
            **{"Base Color": (0.8, 0.5, 0.2), "Specular Tint": (red, 0.6, 0.9)}))
        bpy.context.view_layer.use_pass_glossy_color = True
        found[kind] = _both(("GlossCol",))["GlossCol"]
    return found


# Rough enough for denoisers' albedo: ShaderNodeBsdf... and inputs.
ROUGH = {
    "tinted metal": ("Principled", {
        "Metallic": 1.0, "Roughness": 0.6, "Base Color": (0.5, 0.5, 0.5), "Specular Tint": (0.05, 0.05, 0.9)}),
    "coat": ("Principled", {"Base Color": (0.0,) * 3, "Roughness": 0.8, "Coat Weight": 1.0, "Coat Roughness": 0.7}),
    "dense": ("Principled", {
        "Base Color": (0.0,) * 3, "Roughness": 0.6, "IOR": 2.0, "Specular Tint": (0.2, 0.6, 0.9)}),
    "transmission": ("Principled", {"Base Color": (0.8, 0.5, 0.2), "Roughness": 0.6, "Transmission Weight": 1.0}),
    "glass": ("Glass", {"Color": (0.8, 0.5, 0.2), "Roughness": 0.7})}
ROUGH_PASSES = "GlossCol", "TransCol", "Denoising Albedo"
ROUGH_OFF = 3e-3, 8e-3


def inside_rough():
    """{kind: {pass: pictures by both}} of rough balls in the dark."""
    import bpy
    import scenes
    found = {}
    for kind, (node, inputs) in ROUGH.items():
        scenes.empty(size=(32, 24))
        scenes.camera()
        scenes.sphere(material=scenes.material("Rough", f"ShaderNodeBsdf{node}", **inputs))
        layer = bpy.context.view_layer
        layer.use_pass_glossy_color = layer.use_pass_transmission_color = True
        layer.volley.denoising_store_passes = layer.cycles.denoising_store_passes = True
        found[kind] = _both(ROUGH_PASSES)
    return found


@pytest.mark.since(*TINTED_SINCE)
def test_colours_of_rough_lobes(blender):
    """Light from everywhere that tables say they give back: in colours and for denoisers."""
    if blender_support.version() < TINTED_SINCE[0]:
        pytest.skip(TINTED_SINCE[1])
    for kind, passes in blender.run(inside_rough).items():
        for name, (ours, theirs) in passes.items():
            if theirs[..., :3].any():
                _agree(ours, theirs, f"{kind}, {name}", off=ROUGH_OFF)
            else:
                assert not ours[..., :3].any(), (kind, name)


@pytest.mark.since(*TINTED_SINCE)
def test_colour_of_metals(blender):
    """Cycles' colour leaves the tint of the edge out."""
    if blender_support.version() < TINTED_SINCE[0]:
        pytest.skip(TINTED_SINCE[1])
    for kind, pictures in blender.run(inside_metals).items():
        _agree(*pictures, kind, off=METAL_OFF)


# Transparent film --------------------------------------------------------------------------------

def inside_transparent_film(has_environment):
    """{pass: pictures by both} of a world of a light group and with an AOV, behind a clear ball and a matt one, by a
    transparent film, with an Environment pass or without."""
    import bpy
    import scenes
    scene = scenes.empty(size=(32, 24))
    scene.render.film_transparent = True
    scenes.camera()
    scenes.light_world((0.3, 0.5, 0.7))
    scenes.sphere(material=scenes.material("Clear", "ShaderNodeBsdfTransparent", Color=(0.5, 0.5, 0.5)))
    scenes.sphere("Matt", 0.5, (1.2, 0.0, 0.0), scenes.material("Matt", "ShaderNodeBsdfDiffuse"))
    layer = bpy.context.view_layer
    layer.use_pass_environment = has_environment
    layer.lightgroups.add(name="World")
    scene.world.lightgroup = "World"
    layer.aovs.add().name = "Told"
    told = scene.world.node_tree.nodes.new("ShaderNodeOutputAOV")
    setattr(told, "aov_name" if hasattr(told, "aov_name") else "name", "Told")
    told.inputs["Color"].default_value = (0.2, 0.4, 0.6, 1.0)
    return _both(["Combined", "Combined_World", "Told"] + ["Env"] * has_environment)


@pytest.mark.parametrize("has_environment", (False, True))
def test_transparent_film(blender, has_environment):
    """What it leaves out is in the Environment pass, and with that in those of light groups and AOVs."""
    pictures = blender.run(inside_transparent_film, has_environment)
    told = pictures.pop("Told")
    assert all(picture[..., :3].any() == has_environment for picture in told)
    if has_environment:
        pictures["Told"] = told
    for name, (ours, theirs) in pictures.items():
        _agree(ours, theirs, name)
    assert (pictures["Combined_World"][0][..., :3].mean() > 0.3) == has_environment


# Mist ---------------------------------------------------------------------------------------------

def inside_mist():
    import bpy
    import pass_scenes
    import scenes
    scene = pass_scenes.gallery()
    layer = bpy.context.view_layer
    layer.use_pass_mist = True
    mist = scene.world.mist_settings
    mist.start, mist.depth = 5.0, 8.0
    pairs = {}
    for falloff in ('QUADRATIC', 'LINEAR', 'INVERSE_QUADRATIC'):
        mist.falloff = falloff
        pairs[falloff] = _both(["Mist"])["Mist"]
    scene.camera.data.type, scene.camera.data.ortho_scale = 'ORTHO', 20.0
    pairs["orthographic, with misses"] = _both(["Mist"])["Mist"]
    mist.depth = 0.0
    pairs["no depth"] = _both(["Mist"])["Mist"]
    mist.depth = 12.0
    scene.render.film_transparent = scene.cycles.film_transparent_glass = scene.volley.film_transparent_glass = True
    glass = scenes.material("Clear", "ShaderNodeBsdfGlass", Color=(0.9, 0.8, 0.9), Roughness=0.0, IOR=1.2)
    bpy.data.objects["Metal"].data.materials[0] = glass
    pairs["through clear glass"] = _both(["Mist"])["Mist"]
    return pairs


def test_mist(blender):
    """Glass that a transparent film is seen through counts beside what is behind it, but Mist ends at 0: it was
    down to -1 in a ball."""
    for name, (ours, theirs) in blender.run(inside_mist).items():
        _agree(ours, theirs, name, channels=1)
        assert 0.0 <= ours.min() and ours.max() <= 1.0, name


# Vector ---------------------------------------------------------------------------------------------

def inside_vector():
    """A camera that moves and turns, objects that move, turn and deform; with misses around."""
    import bpy
    import pass_scenes
    scene = pass_scenes.gallery()
    bpy.context.view_layer.use_pass_vector = bpy.context.view_layer.use_pass_z = True
    bpy.data.objects.remove(bpy.data.objects["Back"])
    made, metal, mirror = scene.camera, bpy.data.objects["Metal"], bpy.data.objects["Mirror"]
    mirror.shape_key_add(name="Basis")
    key = mirror.shape_key_add(name="Wide")
    for point in key.data:
        point.co.x *= 1.5
    for frame in (0, 1, 2):
        made.location.x, made.rotation_euler.z = 0.5 + 0.2 * frame, 0.1 + 0.02 * frame * frame
        metal.location.z, metal.rotation_euler.y = 0.1 * frame * frame, 0.2 * frame
        key.value = 0.3 * frame
        for data, path in ((made, "location"), (made, "rotation_euler"), (metal, "location"),
                           (metal, "rotation_euler"), (key, "value")):
            data.keyframe_insert(path, frame=frame)
    scene.frame_set(1)
    found = _both(["Vector", "Depth"])
    pairs = {"perspective": found["Vector"], "depth": found["Depth"]}
    made.data.type, made.data.ortho_scale = 'ORTHO', 8.0
    if bpy.app.version < (4, 0, 0):  # in 4.3 Cycles gives such a camera ten times the motion
        pairs["orthographic"] = _both(["Vector"])["Vector"]
    scene.render.use_motion_blur = True
    pairs["blurred"] = _both(["Vector"])["Vector"]
    return pairs


def _background_motion(height, width):
    """The first three channels of Vector for points far away, as that camera sees them at the middles of pixels;
    the lowest row first."""
    def axes(frame):
        x, z = np.pi / 2 - 0.15, 0.1 + 0.02 * frame * frame
        about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
        about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
        return about_z @ about_x

    tangent = 18.0 / 50.0  # of half the width: sensor and lens in mm
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    here = np.stack([(column / width * 2 - 1) * tangent, (row / height * 2 - 1) * tangent * height / width,
                     -np.ones_like(row)], axis=-1)

    def raster(frame):
        seen = here @ axes(1).T @ axes(frame)
        return seen[..., :2] / -seen[..., 2:] * width / (2 * tangent)

    return np.concatenate([raster(0) - raster(1), (raster(1) - raster(2))[..., :1]], axis=-1)


def _compare_background(ours, theirs, depth):
    """Motion of the background: none before Blender 5; since then as of points far away. That of Cycles 5.2 is
    not divided by the depth of the direction, up to a third of the motion wrong at the sides, and pixels
    that show some of it are set aside."""
    is_far, is_near = (depth[..., 0] > 1e9).all(axis=0), (depth[..., 0] < 1e9).all(axis=0)
    for axis in (0, 1):  # as far as the filter of pixels reaches
        is_far, is_near = (np.all([np.roll(mask, shift, axis) for shift in range(-2, 3)], axis=0)
                           for mask in (is_far, is_near))
    assert is_far.mean() > 0.2
    want = _background_motion(*is_far.shape)
    assert np.abs(ours.mean(axis=0)[..., :3] - want)[is_far].max() < BACKGROUND_OFF
    for side in (ours, theirs):
        side[:, ~is_near] = 0.0


def test_vector(blender):
    pairs = blender.run(inside_vector)
    for picture in pairs.pop("blurred"):
        assert not picture[..., :3].any()
    depth = pairs.pop("depth")[1]
    if blender_support.version() >= (5, 0):
        _compare_background(*pairs["perspective"], depth)
    for name, (ours, theirs) in pairs.items():  # the file has an alpha of 1 in place of the fourth channel
        assert np.abs(theirs).max(axis=(0, 1, 2)).min() > 0.5
        _agree(ours, theirs, name)


# Cryptomatte ----------------------------------------------------------------------------------------

CRYPTOMATTES = ("CryptoObject", "CryptoMaterial", "CryptoAsset")
LEVELS = 5  # three layers
MATTED = "Metal,Veil"


def _crypto_scene():
    """Objects with and without materials, instances, a group, transparency, depth of field."""
    import bpy
    import pass_scenes
    import scenes
    scene = pass_scenes.gallery()
    made = scene.camera
    made.data.dof.use_dof, made.data.dof.focus_distance = True, 5.0
    made.data.dof.aperture_fstop = 0.3
    bare = scenes.sphere("Bare", 0.4, (0.2, -1.5, -1.2))
    bare.parent = bpy.data.objects["Metal"]
    glass = scenes.sphere("Glass", 0.5, (-2.5, -1.0, 1.4), scenes.material(
        "Glass", "ShaderNodeBsdfGlass", Color=(0.9, 0.9, 1.0)))
    collection = bpy.data.collections.new("Source")
    scene.collection.objects.unlink(glass)
    collection.objects.link(glass)
    for number in range(3):
        copy = scenes.link(f"Copy{number}", None)
        copy.instance_type, copy.instance_collection = 'COLLECTION', collection
        copy.location = (1.3 * number, 0.3 * number, -0.5 * number)
    layer = bpy.context.view_layer
    layer.use_pass_cryptomatte_object = layer.use_pass_cryptomatte_material = True
    layer.use_pass_cryptomatte_asset, layer.pass_cryptomatte_depth = True, LEVELS
    return scene


def _matte(names):
    """The matte that the compositor's Cryptomatte node makes of the objects, of a new render."""
    import os
    import tempfile
    import bpy
    import scenes
    scene = bpy.context.scene
    folder = tempfile.mkdtemp(prefix="volley_")
    tree, shown = scenes.compositor()
    node = tree.nodes.new("CompositorNodeCryptomatteV2")
    node.scene, node.layer_name, node.matte_id = scene, "ViewLayer.CryptoObject", names
    tree.links.new(tree.nodes.new("CompositorNodeRLayers").outputs["Image"], node.inputs["Image"])
    tree.links.new(node.outputs["Matte"], scenes.file_output(tree, folder, ["matte"])["matte"])
    tree.links.new(node.outputs["Image"], shown)
    bpy.ops.render.render()
    return scenes.load(os.path.join(folder, os.listdir(folder)[0]))


def inside_cryptomatte():
    import scenes
    _crypto_scene()
    names = [f"{kind}{layer:02d}" for kind in CRYPTOMATTES for layer in range((LEVELS + 1) // 2)]
    pairs, mattes = _both(names, 256), []
    for engine in ('VOLLEY', 'CYCLES'):
        mattes.append(np.array([_matte(MATTED) for _ in scenes.each_seed(engine, 256)]))
    return pairs, mattes


def _ranks(pairs, kind, engine):
    """All channels of one kind of mattes by one engine: id and coverage in turn."""
    layers = [pairs[name][engine] for name in sorted(pairs) if name.startswith(kind)]
    return np.concatenate(layers, axis=-1)


def _coverages(ranks):
    """Coverage by each id."""
    ids, parts = ranks[..., 0::2], ranks[..., 1::2]
    return {float(number): np.where(ids == number, parts, 0.0).sum(axis=-1)
            for number in np.unique(ids) if number != 0.0}


def test_cryptomatte(blender):
    pairs, mattes = blender.run(inside_cryptomatte, timeout=300)
    for kind, count in zip(CRYPTOMATTES, (6, 6, 5)):
        parts = _ranks(pairs, kind, 0)[..., 1::2]
        assert (parts[..., :-1] >= parts[..., 1:]).all()  # Cycles sorts only the first kind
        ours, theirs = (_coverages(_ranks(pairs, kind, engine)) for engine in (0, 1))
        assert ours.keys() == theirs.keys() and len(ours) == count
        for number, expected in theirs.items():
            _agree(ours[number][..., None], expected[..., None], f"{kind} {number}")
    assert 0.1 < mattes[1][..., 0].mean() < 0.9
    _agree(*mattes, "matte", channels=1)


def inside_manifests(path):
    import bpy
    import scenes
    scene = _crypto_scene()
    bpy.data.objects["Veil"].name = "Veil é"
    scenes.set_file_format(scene.render.image_settings, 'OPEN_EXR_MULTILAYER')
    for engine in ('VOLLEY', 'CYCLES'):
        scenes.set_engine(engine, 1)
        scene.render.filepath = f"{path}/{engine}.exr"
        bpy.ops.render.render(write_still=True)


def _id_digits(digits):
    """A hash as the bits of its id: Cycles writes the hash itself, which readers take as well."""
    bits = int(digits, 16)
    return f"{bits ^ 1 << 23 if bits >> 23 & 255 in (0, 255) else bits:08x}"


def _manifests(path):
    """{key: value} of the Cryptomatte metadata of an OpenEXR file, manifests as dictionaries."""
    import json
    import re
    with open(path, "rb") as file:
        header = file.read(1 << 16)
    found = {}
    for match in re.finditer(rb"(cryptomatte/[0-9a-f]{7}/\w+)\0string\0(.{4})", header, re.DOTALL):
        size = int.from_bytes(match.group(2), "little")
        value = header[match.end():match.end() + size].decode("utf-8")
        is_manifest = match.group(1).endswith(b"manifest")
        found[match.group(1).decode()] = json.loads(value) if is_manifest else value
    return found


def test_cryptomatte_manifests(blender, tmp_path):
    blender.run(inside_manifests, str(tmp_path))
    ours, theirs = _manifests(tmp_path / "VOLLEY.exr"), _manifests(tmp_path / "CYCLES.exr")
    assert len(ours) == 12 and ours.keys() == theirs.keys()
    for key, value in ours.items():
        if key.endswith("manifest"):  # Cycles also names what nothing shows
            named = {name: _id_digits(digits) for name, digits in theirs[key].items()}
            assert value.items() <= named.items()
            assert len(value) >= 5
        else:
            assert value == theirs[key]


# Files of several layers -----------------------------------------------------------------------------

def inside_layers(folder):
    """Write a file by each engine of a layer with passes and of one with a pass of its own."""
    import bpy
    import scenes
    scene = scenes.empty(size=(8, 8), samples=1)
    scenes.camera()
    scenes.wall()
    first, second = scene.view_layers[0], scene.view_layers.new("Second")
    for name in ("z", "mist", "position", "normal", "vector", "uv", "object_index", "diffuse_direct", "glossy_color",
                 "emit", "environment", "ambient_occlusion", "cryptomatte_object"):
        setattr(first, f"use_pass_{name}", True)
    first.volley.denoising_store_passes = first.cycles.denoising_store_passes = True
    second.use_pass_z = False
    second.use_pass_mist = True
    for layer, name, kind in ((first, "tint", 'COLOR'), (second, "wear", 'VALUE')):
        aov = layer.aovs.add()
        aov.name, aov.type = name, kind
    first.lightgroups.add(name="key")
    scenes.set_file_format(scene.render.image_settings, 'OPEN_EXR_MULTILAYER')
    for engine in ('VOLLEY', 'CYCLES'):
        scenes.set_engine(engine, 1)
        scene.render.filepath = f"{folder}/{engine}"
        bpy.ops.render.render(write_still=True)


def _channels(path):
    """Names of all channels of an OpenEXR file."""
    with open(path, "rb") as file:
        header = file.read(1 << 16)
    found = set()
    for part in header.split(b"channels\0chlist\0")[1:]:
        size, start = int.from_bytes(part[:4], "little"), 4
        while start < 3 + size:
            end = part.index(b"\0", start)
            found.add(part[start:end].decode())
            start = end + 17  # behind its type, and how it is sampled
    return found


def test_layers_have_their_own_passes_in_files(blender, tmp_path):
    """Each layer had the passes of all, black: two layers, of which one has passes, were twice as large."""
    blender.run(inside_layers, str(tmp_path))
    ours, theirs = _channels(tmp_path / "VOLLEY.exr"), _channels(tmp_path / "CYCLES.exr")
    assert len(theirs) > 50 and theirs <= ours
    # Cycles 3.4 and 4.3 have not all of the denoising data, and none has the noisy picture without a denoiser.
    assert {name.split(".")[1] for name in ours - theirs} <= {
        "Noisy Image", "Denoising Roughness", "Denoising Specular Albedo"}
    assert all(name.startswith("ViewLayer.") for name in ours - theirs)


# AOVs -----------------------------------------------------------------------------------------------

def _aov(tree, name, source, path="Value"):
    """An AOV Output node whose input is linked to an output."""
    node = tree.nodes.new("ShaderNodeOutputAOV")
    setattr(node, "aov_name" if hasattr(node, "aov_name") else "name", name)
    tree.links.new(source, node.inputs[path])


def _aov_scene():
    """Values and colours of nodes that the surface needs, and of others, in a group too; seen through
    a tinted veil with an AOV of its own, and in the world."""
    import bpy
    import pass_scenes
    import scenes
    scene = pass_scenes.gallery()
    scene.world.use_nodes = True
    layer = bpy.context.view_layer
    for name, kind in (("height", 'VALUE'), ("tint", 'COLOR'), ("facing", 'VALUE'), ("unused", 'COLOR')):
        aov = layer.aovs.add()
        aov.name, aov.type = name, kind
    bpy.data.objects["Back"].scale = (0.5, 1.0, 0.5)
    tree = bpy.data.materials["Matt"].node_tree
    coordinate = tree.nodes.new("ShaderNodeTexCoord")
    checker = tree.nodes.new("ShaderNodeTexChecker")
    checker.inputs["Scale"].default_value = 4.0
    tree.links.new(coordinate.outputs["Generated"], checker.inputs["Vector"])
    tree.links.new(checker.outputs["Color"], tree.nodes["Diffuse BSDF"].inputs["Color"])
    _aov(tree, "tint", checker.outputs["Color"], "Color")
    tree = bpy.data.materials["Metal"].node_tree
    _aov(tree, "height", tree.nodes.new("ShaderNodeTexCoord").outputs["Object"])
    group = bpy.data.node_groups.new("Inner", 'ShaderNodeTree')
    weight = group.nodes.new("ShaderNodeLayerWeight")
    _aov(group, "facing", weight.outputs["Facing"])
    tree.nodes.new("ShaderNodeGroup").node_tree = group
    bpy.data.objects["Veil"].data.materials[0] = clear = scenes.material(
        "Clear", "ShaderNodeBsdfTransparent", Color=(0.9, 0.8, 0.7))
    blue = clear.node_tree.nodes.new("ShaderNodeRGB")
    blue.outputs[0].default_value = (0.0, 0.2, 0.7, 1.0)
    _aov(clear.node_tree, "tint", blue.outputs[0], "Color")
    tree = scene.world.node_tree
    tree.nodes["Background"].inputs["Color"].default_value = (0.1, 0.2, 0.3, 1.0)
    _aov(tree, "tint", tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], "Color")


def inside_aovs():
    """The AOVs by both engines, and Combined before and after one of that name, which Blender refuses."""
    import bpy
    import scenes
    _aov_scene()
    pairs = _both(["height", "tint", "facing", "unused"])
    scenes.set_engine('VOLLEY', 1)
    combined = [scenes.render()]
    aov = bpy.context.view_layer.aovs.add()
    aov.name, aov.type = "Combined", 'COLOR'
    bpy.context.view_layer.use_pass_mist = True  # it looks at the names when the passes change
    is_valid = aov.is_valid
    return pairs, is_valid, combined + [scenes.render()]


def test_aovs(blender):
    pairs, is_valid, combined = blender.run(inside_aovs)
    assert not is_valid and combined[0][..., :3].std() > 0.02
    assert np.array_equal(*combined)
    for picture in pairs.pop("unused"):
        assert not picture.any()
    for name, (ours, theirs) in pairs.items():
        channels = 4 if name == "tint" else 1
        assert (theirs[..., :channels].std(axis=(0, 1, 2)) > 0.02).all()
        _agree(ours, theirs, name, channels)


# Ambient occlusion and shadow -----------------------------------------------------------------------

def _occluded_scene():
    """The objects stand on a floor under lamps of several kinds, with shadows of transparent ones."""
    import bpy
    import pass_scenes
    import scenes
    scene = pass_scenes.gallery()
    floor = scenes.wall("Floor", 20.0, 1.2, (0.0, 0.0), scenes.material(
        "Floor", "ShaderNodeBsdfDiffuse", Color=(0.7, 0.7, 0.7)))
    floor.rotation_euler.x = -np.pi / 2
    bpy.data.objects["Veil"].data.materials[0] = scenes.material(
        "Clear", "ShaderNodeBsdfTransparent", Color=(0.5, 0.9, 0.7))
    scene.world.light_settings.distance = 1.5
    scenes.light('AREA', (0.0, -4.0, 4.0), size=1.0, energy=300.0)
    scenes.light('POINT', (-3.0, -2.0, 3.0), shadow_soft_size=0.3, energy=900.0)
    scenes.light('SUN', rotation=(0.6, 0.4, 0.0), angle=0.1, energy=0.2)
    return scene


def inside_occlusion():
    import bpy
    _occluded_scene()
    layer = bpy.context.view_layer
    layer.use_pass_ambient_occlusion = True
    names = ["AO"]
    if bpy.app.version < (4, 0, 0):
        layer.use_pass_shadow = True
        names.append("Shadow")
    return _both(names, 256)


def test_occlusion(blender):
    for name, (ours, theirs) in blender.run(inside_occlusion, timeout=300).items():
        assert theirs[..., 0].std() > 0.1
        _agree(ours, theirs, name, off=SHADOW_OFF if name == "Shadow" else OFF)


# Light groups ---------------------------------------------------------------------------------------

LIGHT_GROUPS = {"key": ("Light", "Light.002"), "rim": ("Light.001",), "glow": ("Glow",), "sky": ()}


def _grouped_scene():
    """Lamps, a glowing ball and the world in groups, one lamp in none; mirrored and seen through."""
    import bpy
    import scenes
    scene = _occluded_scene()
    scenes.light('SPOT', (2.0, -5.0, 3.0), (0.9, 0.0, 0.3), energy=500.0, shadow_soft_size=0.2)
    glow = scenes.sphere("Glow", 0.3, (0.3, -1.0, 1.6), scenes.emitter((4.0, 2.0, 1.0)))
    assert len(bpy.data.lights) == 4 and glow.name == "Glow"
    scenes.world_color(scene.world, (0.1, 0.15, 0.2))
    layer = bpy.context.view_layer
    for group, members in LIGHT_GROUPS.items():
        layer.lightgroups.add(name=group) if hasattr(layer.lightgroups, "add") \
            else bpy.ops.scene.view_layer_add_lightgroup(name=group)
        for name in members:
            bpy.data.objects[name].lightgroup = group
    scene.world.lightgroup = "sky"
    for name in ("Mirror", "Metal"):  # their caustics would be noise
        bpy.data.materials[name].node_tree.nodes["Glossy BSDF"].inputs["Roughness"].default_value = 0.3
    return scene


def inside_light_groups():
    import bpy
    import scenes
    _grouped_scene()
    pairs = _both([f"Combined_{group}" for group in LIGHT_GROUPS], 256)
    bpy.data.objects["Light.003"].hide_render = True  # in no group
    scenes.set_engine('VOLLEY', 256)
    return pairs, scenes.render_passes(["Combined"])["Combined"]


def inside_too_many():
    import bpy
    import scenes
    from volley import passes
    scenes.empty(samples=1)
    scenes.camera()
    layer = bpy.context.view_layer
    for number in range(17):
        aov = layer.aovs.add()
        aov.name, aov.type = f"v{number}", 'VALUE'
    for number in range(33):
        bpy.ops.scene.view_layer_add_lightgroup(name=f"g{number:02d}")
    entries = passes.enabled(layer)
    bpy.ops.render.render()
    return [entry.names[0] for entry in entries], passes.left_out(layer)


def test_what_is_too_much_is_told(blender):
    names, messages = blender.run(inside_too_many)
    assert len(names) == 1 + 16 + 32 and "v16" not in names
    assert [message.split("'")[1] for message in messages] == ["v16", "g32"]
    for message in messages:
        assert message in blender.output


def test_light_groups(blender):
    pairs, grouped = blender.run(inside_light_groups, timeout=300)
    for name, (ours, theirs) in pairs.items():
        assert theirs[..., :3].mean() > 1e-3
        limit = np.quantile(theirs, 0.995)  # Cycles counts mirrored suns to the group of the world
        _agree(np.minimum(ours, limit), np.minimum(theirs, limit), name)
    total = sum(ours[..., :3] for ours, _ in pairs.values())
    assert total.mean() == pytest.approx(grouped[..., :3].mean(), rel=5e-3)
