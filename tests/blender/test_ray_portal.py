# SPDX-License-Identifier: Apache-2.0
"""Ray portals beside Cycles with diffuse bounces 0: a window into another room, a panel that bends rays and one
that is half matt, all over a glossy floor that shows them and under a lamp that they shade; one that is half
transparent, and its shadow; and the alpha of the film."""

import blender as blender_support
import compare
import pytest

SINCE = (4, 2), "the Ray Portal shader came with 4.2"
pytestmark = pytest.mark.since(*SINCE)

SEEDS = (11, 12, 13, 14, 15, 16)
SAMPLES = 64       # of each seed
TOLERANCE = 0.01   # of the mean and of tiles beyond noise, over the picture's mean
FILM_TOLERANCE = 1e-6
_ROOM = 40.0       # m to the other room


# Inside Blender ------------------------------------------------------------------------------------

def _portal(name, color, offset=None, direction=None, mixed_with=None):
    """A portal's material: from the point moved by an offset, in a direction; half of another shader."""
    import scenes
    made = scenes.material(name, "ShaderNodeBsdfRayPortal", Color=color)
    tree, shader = made.node_tree, scenes.shader_of(made)
    for key, value in (("Position", offset), ("Direction", direction)):
        if value is None:
            continue
        moved = tree.nodes.new("ShaderNodeVectorMath")
        moved.inputs[1].default_value = value
        if key == "Position":
            tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Position"], moved.inputs[0])
        tree.links.new(moved.outputs[0], shader.inputs[key])
    if mixed_with is not None:
        mix, other = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new(mixed_with)
        other.inputs["Color"].default_value = (0.4, 0.7, 0.9, 1.0)
        for number, node in enumerate((shader, other), 1):
            tree.links.new(node.outputs[0], mix.inputs[number])
        tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return made


def _room(x):
    import scenes
    floor = scenes.wall(f"Floor {x}", size=14.0, material=scenes.material(
        f"Floor {x}", "ShaderNodeBsdfGlossy", Color=(0.7, 0.6, 0.5), Roughness=0.3))
    floor.location, floor.rotation_euler.x = (x, 0.0, -1.2), -1.5707963
    scenes.light('POINT', location=(x - 1.0, -3.0, 4.0), energy=600.0, shadow_soft_size=0.3)


def inside_rooms():
    """Pictures by Volley and by Cycles, one for each seed."""
    import scenes
    scenes.empty(size=(96, 64))
    scenes.light_world((0.3, 0.35, 0.45))
    scenes.camera(location=(0.0, -9.0, 1.0), rotation=(1.47, 0.0, 0.0))
    for x in (0.0, _ROOM):
        _room(x)
    matt = scenes.material("Matt", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.3, 0.2))
    scenes.sphere("Other", 1.0, (_ROOM - 2.4, 1.5, 0.0), matt)
    scenes.wall("Lamp", size=1.0, y=3.0, center=(_ROOM - 1.4, 1.3), material=scenes.emitter((2.0, 1.4, 0.8)))
    scenes.wall("Window", size=2.2, center=(-2.4, 0.2), material=_portal(
        "Window", (0.9, 0.9, 0.9), offset=(_ROOM, 0.0, 0.0)))
    scenes.wall("Bent", size=2.2, center=(0.0, 0.2), material=_portal(
        "Bent", (0.8, 0.9, 0.7), direction=(-0.8, 0.6, -0.1)))
    scenes.wall("Half matt", size=2.2, center=(2.4, 0.2), material=_portal(
        "Half matt", (0.9, 0.9, 0.9), offset=(_ROOM - 4.8, 0.0, 0.0), mixed_with="ShaderNodeBsdfDiffuse"))
    scenes.sphere("Behind", 0.7, (-2.4, 2.0, 0.0), matt)
    scenes.independent_seeds()
    return [scenes.seeds_by(engine, SAMPLES * len(SEEDS), SEEDS)[..., :3] for engine in ('VOLLEY', 'CYCLES')]


def inside_veil():
    """The same of a panel over a floor, by a lamp alone: the light of worlds, which Cycles finds by rays too,
    is dimmer there, as they do not take the panel's part that is a portal for transparent at their end."""
    import scenes
    scenes.empty(size=(48, 32))
    scenes.light_world((0.0, 0.0, 0.0))
    scenes.camera(location=(0.0, -9.0, 1.0), rotation=(1.47, 0.0, 0.0))
    _room(0.0)
    veil = scenes.wall("Veil", size=2.0, material=_portal(
        "Veil", (0.5, 0.5, 0.5), offset=(0.0, 0.0, -0.2), mixed_with="ShaderNodeBsdfTransparent"))
    veil.location, veil.rotation_euler.x = (-0.4, 0.0, 0.6), 1.2
    table = scenes.wall("Table", size=6.0, material=scenes.material(
        "Matt", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.3, 0.2)))
    table.location, table.rotation_euler.x = (0.0, 0.0, -1.0), -1.5707963
    return [scenes.seeds_by(engine, SAMPLES * len(SEEDS), SEEDS)[..., :3] for engine in ('VOLLEY', 'CYCLES')]


def inside_film():
    """A transparent film by Volley, Volley's Whitted and Cycles: a portal to the sky, one to a wall
    that shines by the count of portals."""
    import bpy
    import scenes
    scenes.empty(size=(32, 16))
    bpy.context.scene.render.film_transparent = True
    scenes.camera(type='ORTHO', ortho_scale=4.0)
    scenes.wall("Sky", y=0.0, center=(-1.0, 0.0), material=_portal("Sky", (0.5, 0.5, 0.5),
                                                                   offset=(0.0, 0.0, 9.0)))
    scenes.wall("Door", y=0.0, center=(1.0, 0.0), material=_portal("Door", (0.5, 0.5, 0.5),
                                                                   offset=(0.0, 9.0, 0.0)))
    shining = scenes.emitter((1.0, 0.5, 0.25))
    scenes.wall("Wall", y=10.0, center=(1.0, 0.0), material=shining)
    depth = shining.node_tree.nodes.new("ShaderNodeLightPath").outputs.get("Portal Depth")
    if depth is not None:  # from Blender 5 on; it is 1 there
        shining.node_tree.links.new(depth, scenes.shader_of(shining).inputs["Strength"])
    scenes.sharpen()
    scenes.set_engine('VOLLEY', 1)
    bpy.context.scene.volley.integrator = 'WHITTED'
    whitted = scenes.render()
    bpy.context.scene.volley.integrator = 'DISTRIBUTION'
    ours, theirs = scenes.by_both(1)
    return ours, whitted, theirs


# Comparison ----------------------------------------------------------------------------------------

def _run(blender, inside):
    if blender_support.version() < SINCE[0]:
        pytest.skip(SINCE[1])
    return blender.run(inside, timeout=300)


@pytest.mark.parametrize("inside", [inside_rooms, inside_veil])
def test_pictures(blender, inside):
    ours, theirs = _run(blender, inside)
    mean, biased, tile = compare.agreed_errors(ours, theirs)
    print(f"mean off by {mean:.3%}, biased {biased:.3%}, tile {tile:.3%}")
    assert max(biased, tile) < TOLERANCE


def test_film(blender):
    *ours, theirs = _run(blender, inside_film)
    assert theirs[8, 8, 3] == 0.5 and theirs[8, 24, 3] == 1.0
    for picture in ours:
        worst = abs(picture - theirs).max()
        print(f"off by at most {worst:.2e}")
        assert worst < FILM_TOLERANCE
