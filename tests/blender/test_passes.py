# SPDX-License-Identifier: Apache-2.0
"""Data passes against Cycles' passes of the same name."""

import numpy as np
import pytest

SAMPLES = 64


def _scene(size=(96, 64)):
    """Spheres and walls at several distances; one half transparent, one a mirror, one rough metal."""
    import scenes
    scene = scenes.empty(size=size)
    scenes.camera(location=(0.5, -7.0, 1.0), rotation=(np.pi / 2 - 0.15, 0.0, 0.1))
    scenes.wall("Back", 14.0, 4.0, material=scenes.material(
        "Matt", "ShaderNodeBsdfDiffuse", Color=(0.6, 0.4, 0.2)))
    scenes.sphere("Mirror", 1.0, (-1.6, 0.0, 0.0), material=scenes.material(
        "Mirror", "ShaderNodeBsdfGlossy", Color=(0.9, 0.8, 0.7), Roughness=0.0))
    scenes.sphere("Metal", 0.9, (1.8, 1.0, 0.2), material=scenes.material(
        "Metal", "ShaderNodeBsdfGlossy", Color=(0.5, 0.7, 0.9), Roughness=0.6))
    scenes.wall("Veil", 1.5, -2.0, (0.3, 0.4), _veil())
    return scene


def _veil():
    """Diffuse and transparent, 40 to 60."""
    import scenes
    made = scenes.material("Veil", "ShaderNodeBsdfDiffuse", Color=(0.2, 0.8, 0.3))
    tree = made.node_tree
    mix, clear = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfTransparent")
    mix.inputs[0].default_value = 0.6
    tree.links.new(tree.nodes["Diffuse BSDF"].outputs[0], mix.inputs[1])
    tree.links.new(clear.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return made


def _both(names, samples=SAMPLES):
    """Those passes by Volley and by Cycles."""
    import scenes
    pictures = []
    for engine in ('VOLLEY', 'CYCLES'):
        scenes.set_engine(engine, samples)
        pictures.append(scenes.render_passes(names))
    return {name: (pictures[0][name], pictures[1][name]) for name in names}


def _agree(ours, theirs, channels=3, mean=0.01, share=0.05, step=0.05):
    """Equal means, and few pixels (edges fall between other samples) that differ by a share of the
    largest value."""
    ours, theirs = ours[..., :channels], theirs[..., :channels]
    scale = np.abs(theirs).max()
    assert scale > 0.0
    assert np.abs(ours.mean(axis=(0, 1)) - theirs.mean(axis=(0, 1))).max() < mean * scale
    apart = np.abs(ours - theirs).max(axis=-1) > step * scale
    assert apart.mean() < share, f"{apart.mean():.3%} of the pixels differ"


# Mist ---------------------------------------------------------------------------------------------

def inside_mist():
    import bpy
    scene = _scene()
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
    return pairs


def test_mist(blender):
    for name, (ours, theirs) in blender.run(inside_mist).items():
        _agree(ours, theirs, channels=1, mean=2e-3, share=0.01)
        assert 0.0 <= ours.min() and ours.max() <= 1.0, name


# Denoising ------------------------------------------------------------------------------------------

def inside_denoising():
    import bpy
    import scenes
    _scene()
    # Without the diffuse part, on which Cycles would lose paths.
    bpy.data.objects["Veil"].data.materials[0] = scenes.material(
        "Clear", "ShaderNodeBsdfTransparent", Color=(0.5, 0.9, 0.7))
    layer = bpy.context.view_layer
    layer.volley.denoising_store_passes = layer.cycles.denoising_store_passes = True
    return _both(["Denoising Albedo", "Denoising Normal", "Denoising Depth"], 64)


def test_denoising_data(blender):
    pairs = blender.run(inside_denoising)
    for ours, theirs in pairs.values():
        _agree(ours, theirs, mean=5e-3, share=0.05, step=0.1)


# Vector ---------------------------------------------------------------------------------------------

def inside_vector():
    """A camera that moves and turns, objects that move, turn and deform; with misses around."""
    import bpy
    import scenes
    scene = _scene()
    bpy.context.view_layer.use_pass_vector = True
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
    pairs = {"perspective": _both(["Vector"])["Vector"]}
    made.data.type, made.data.ortho_scale = 'ORTHO', 8.0
    if bpy.app.version < (4, 0, 0):  # in 4.3 Cycles gives such a camera ten times the motion
        pairs["orthographic"] = _both(["Vector"])["Vector"]
    scene.render.use_motion_blur = True
    pairs["blurred"] = _both(["Vector"])["Vector"]
    return pairs


def test_vector(blender):
    pairs = blender.run(inside_vector)
    for picture in pairs.pop("blurred"):
        assert not picture[..., :3].any()
    for ours, theirs in pairs.values():  # the file has an alpha of 1 in place of the fourth channel
        assert np.abs(theirs).max(axis=(0, 1)).min() > 0.5
        _agree(ours, theirs, mean=5e-3, share=0.02)
