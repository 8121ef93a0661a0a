# SPDX-License-Identifier: Apache-2.0
"""What Volley leaves out of a scene is said once; and worlds of view layers, which it does not leave out."""

import numpy as np
import pytest


def _listen():
    """The list that warnings of renders go to from now on."""
    import volley.session
    told = []
    volley.session.report_warning = lambda _engine, message: told.append(message)
    return told


def inside_override():
    """Pictures by both engines of two view layers, one with a world of its own, and the warnings."""
    import bpy
    import scenes
    scene = scenes.empty(size=(16, 16))
    scenes.camera()
    scenes.wall("Wall", 1.0, 0.0, material=scenes.material("Grey", "ShaderNodeBsdfDiffuse"))
    scenes.world_color(scene.world, (0.1, 0.2, 0.4))
    own = bpy.data.worlds.new("Own")
    scenes.world_color(own, (0.5, 0.3, 0.1))
    told = _listen()
    pairs = {}
    scene.view_layers[0].use = True
    for name, world in (("scene", None), ("own", own), ("scene again", None)):
        scene.view_layers[0].world_override = world
        pairs[name] = scenes.by_both(64)
    return pairs, told


def test_worlds_of_view_layers(blender):
    import blender as blender_support
    if blender_support.version() < (4, 3):
        pytest.skip("view layers have no worlds of their own")
    pairs, told = blender.run(inside_override)
    assert told == []
    assert pairs["own"][1][0, 0, 0] > 0.4  # Cycles shows it
    for name, (ours, theirs) in pairs.items():
        assert np.abs(ours - theirs)[..., :3].max() < 0.05, name
        assert ours[0, 0, :3] == pytest.approx(theirs[0, 0, :3], rel=1e-4), name


def inside_fifth():
    """The warnings of what came with Blender 5 and is not there: a normal map below a displaced surface,
    normals as they are, bumps by Window coordinates; none of another working space."""
    import bpy
    import scenes
    scenes.empty(size=(16, 16))
    scenes.camera()
    material = scenes.material("Wall", "ShaderNodeBsdfPrincipled")
    scenes.wall("Wall", 1.0, 0.0, material=material)
    tree, principled = material.node_tree, scenes.shader_of(material)
    normal_map, path = tree.nodes.new("ShaderNodeNormalMap"), tree.nodes.new("ShaderNodeLightPath")
    tree.links.new(normal_map.outputs[0], principled.inputs["Normal"])
    tree.links.new(path.outputs["Portal Depth"], principled.inputs["Emission Strength"])
    told, found = _listen(), []

    def look():
        told.clear()
        scenes.render()
        found.append(list(told))

    normal_map.base = 'ORIGINAL'  # where nothing is displaced
    look()
    displacement = tree.nodes.new("ShaderNodeDisplacement")
    tree.links.new(displacement.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
    look()
    normal_map.base = 'DISPLACED'
    material.cycles.use_bump_map_correction = False
    look()
    material.cycles.use_bump_map_correction = True
    bpy.ops.wm.set_working_color_space(working_space='ACEScg')
    principled.inputs["Thin Film Thickness"].default_value = 300.0
    look()
    place, noise, bump = [tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "TexNoise", "Bump")]
    tree.links.new(noise.outputs[0], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], principled.inputs["Normal"])
    for kind in ("Object", "Window"):
        tree.links.new(place.outputs[kind], noise.inputs["Vector"])
        look()
    return found


def test_what_came_with_the_fifth_is_named(blender):
    import blender as blender_support
    if blender_support.version() < (5, 0):
        pytest.skip("nothing of it is there")
    assert blender.run(inside_fifth) == [
        [], ["Material 'Wall': Normal Map lies on the displaced surface, not on the original one"],
        ["Material 'Wall': bent normals are corrected nonetheless"], [], [],
        ["Material 'Wall': bumps by Window coordinates are not turned as those of Cycles 5 are"]]


def inside_settings_of_worlds():
    """The warnings of a world as it is, and of one whose light ends after some bounces."""
    import scenes
    scene = scenes.empty(size=(16, 16))
    scenes.camera()
    told, found = _listen(), []
    for name, value in ((None, None), ("max_bounces", 4)):
        if name is not None and hasattr(scene.world.cycles, name):
            setattr(scene.world.cycles, name, value)
        told.clear()
        scenes.render()
        found.append(list(told))
    return found


def test_settings_of_worlds(blender):
    plain, bounces = blender.run(inside_settings_of_worlds)
    assert plain == []
    assert len(bounces) == 1 and "light of the world goes on for all bounces" in bounces[0]


def inside_custom_cameras():
    import scenes
    scenes.empty(size=(16, 16))
    scenes.camera().data.type = 'CUSTOM'
    told = _listen()
    scenes.render()
    return list(told)


@pytest.mark.since((5, 0), "cameras of scripts came with 5.0")
def test_custom_cameras(blender):
    import blender as blender_support
    if blender_support.version() < (5, 0):
        pytest.skip("there are none")
    assert blender.run(inside_custom_cameras) == ["Camera 'Camera': type CUSTOM is not supported, perspective is used"]


def inside_filmed_conductors():
    """The warnings of a conductor, and of one under a film."""
    import scenes
    scenes.empty(size=(16, 16))
    scenes.camera()
    material = scenes.material("Metal", "ShaderNodeBsdfMetallic")
    shader = scenes.shader_of(material)
    shader.fresnel_type = 'PHYSICAL_CONDUCTOR'
    scenes.wall(material=material)
    told, found = _listen(), []
    for thickness in (0.0, 300.0):
        shader.inputs["Thin Film Thickness"].default_value = thickness
        told.clear()
        scenes.render()
        found.append(list(told))
    return found


@pytest.mark.since((5, 0), "metals have films from 5.0 on")
def test_filmed_conductors(blender):
    import blender as blender_support
    if blender_support.version() < (5, 0):
        pytest.skip("metals have none")
    assert blender.run(inside_filmed_conductors) == [
        [], ["Material 'Metal': Metallic BSDF: a physical conductor under a film is approximated by its colours"]]


def inside_shining_strands():
    """The warnings of hair that is matt, that emits, that emits nothing."""
    import bpy
    import scenes
    scenes.empty(size=(16, 16))
    scenes.camera()
    ball = scenes.sphere("Ball", 0.5, material=scenes.material("Hair", "ShaderNodeBsdfDiffuse"))
    ball.modifiers.new("Hair", 'PARTICLE_SYSTEM')
    ball.particle_systems[0].settings.type = 'HAIR'
    told, found = _listen(), []
    for material in (bpy.data.materials["Hair"], scenes.emitter((1.0, 0.5, 0.2), "Lamp"),
                     scenes.emitter((0.0, 0.0, 0.0), "Black")):
        ball.data.materials[0] = material
        told.clear()
        scenes.render()
        found.append(list(told))
    return found


def test_strands_that_emit(blender):
    matt, shining, black = blender.run(inside_shining_strands)
    assert matt == black == []
    assert shining == ["Light of strands and points is not sampled: object 'Ball' lights nothing that is matt"]
