# SPDX-License-Identifier: Apache-2.0
"""What nodes say of the ray that asks and of the surface it met, beside Cycles."""

import compare
import numpy as np
import pytest

SIZE = 64
LIGHT_PATH = ("Is Camera Ray", "Is Diffuse Ray", "Is Glossy Ray", "Is Singular Ray", "Is Reflection Ray",
              "Is Transmission Ray", "Ray Length", "Ray Depth", "Diffuse Depth", "Glossy Depth",
              "Transparent Depth", "Transmission Depth")
# What light samples say, too, who are no ray of any kind: others' share depends on how light is sampled.
TRANSLUCENT = ("Is Glossy Ray", "Is Singular Ray", "Glossy Depth")
GEOMETRY = ("Position", "Normal", "True Normal", "Incoming", "Parametric", "Backfacing")


# Inside Blender ------------------------------------------------------------------------------------

def _shines(material, node_type):
    """Give a material an emission alone, of outputs of a new node: the node, a way to choose one."""
    tree = material.node_tree
    tree.nodes.clear()
    node, shown = tree.nodes.new(node_type), tree.nodes.new("ShaderNodeVectorMath")
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    shown.operation = 'MULTIPLY_ADD'
    shown.inputs[1].default_value, shown.inputs[2].default_value = (0.25,) * 3, (1.0,) * 3  # above 0
    tree.links.new(shown.outputs[0], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    return lambda name: tree.links.new(node.outputs[name], shown.inputs[0])


def _pictures(choose, names):
    import scenes
    found = {}
    for name in names:
        choose(name)
        found[name] = [(picture[..., :3] - 1.0) * 4.0 for picture in scenes.by_both(1)]
    return found


def inside_light_path():
    """Walls that shine with what they are told of a ray, seen past a mirror, a panel that refracts, one
    that is transparent, a mirror behind that one, and directly."""
    import bpy
    import scenes
    scenes.empty(size=(5 * SIZE, SIZE), samples=1)
    scenes.camera(type='ORTHO', ortho_scale=10.0)
    scenes.sharpen()
    material = scenes.emitter((1.0, 1.0, 1.0))
    for name, y in (("Behind", 3.0), ("Before", -9.0)):
        scenes.wall(name, size=60.0, y=y, material=material)
    kinds = {"mirror": ("ShaderNodeBsdfGlossy", {"Roughness": 0.0}),
             "refraction": ("ShaderNodeBsdfRefraction", {"Roughness": 0.0, "IOR": 1.3}),
             "transparent": ("ShaderNodeBsdfTransparent", {})}
    for i, (kind, y) in enumerate((("mirror", 0.0), ("refraction", 0.0), ("transparent", 0.0),
                                   ("mirror", 1.0))):
        node_type, inputs = kinds[kind]
        made = scenes.wall(f"Panel{i}", y=y, center=(2.0 * min(i, 3) - 4.0, 0.0),
                           material=scenes.material(f"{kind}{i}", node_type, Color=(1.0, 1.0, 1.0, 1.0),
                                                    **inputs))
        made.rotation_euler.z = 0.2
    veil = scenes.wall("Veil", y=-1.0, center=(2.0, 0.0), material=bpy.data.materials["transparent2"])
    veil.rotation_euler.x = 0.3
    return _pictures(_shines(material, "ShaderNodeLightPath"), LIGHT_PATH)


def inside_translucent():
    """A wall that shines with what it is told of a ray and lights a translucent panel before it."""
    import scenes
    scenes.empty(size=(SIZE // 2, SIZE // 2))
    scenes.camera(type='ORTHO', ortho_scale=2.0)
    scenes.wall("Panel", size=3.0, material=scenes.material("Panel", "ShaderNodeBsdfTranslucent"))
    material = scenes.emitter((1.0, 1.0, 1.0))
    choose = _shines(material, "ShaderNodeLightPath")
    scenes.wall("Behind", size=60.0, y=3.0, material=material)
    found = {}
    for name in TRANSLUCENT:
        choose(name)
        found[name] = [picture[..., :3] for picture in scenes.seeds_by_both(64)]
    return found


def inside_shadows():
    """A floor under a panel that only shadow rays do not see, and under one that only they see."""
    import scenes
    pictures = []
    for first in ("ShaderNodeBsdfTransparent", "ShaderNodeBsdfDiffuse"):
        scenes.empty(size=(SIZE, SIZE), samples=16)
        scenes.camera(type='ORTHO', ortho_scale=4.0)
        scenes.sharpen()
        scenes.light('POINT', location=(0.0, -4.0, 0.0), energy=300.0, shadow_soft_size=0.0)
        scenes.wall(size=5.0, y=1.0, material=scenes.material("Floor", "ShaderNodeBsdfDiffuse"))
        material = scenes.material("Panel", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.3, 0.2, 1.0))
        tree = material.node_tree
        diffuse = next(n for n in tree.nodes if n.type == 'BSDF_DIFFUSE')
        clear, mix = tree.nodes.new("ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeMixShader")
        path = tree.nodes.new("ShaderNodeLightPath")
        output = next(n for n in tree.nodes if n.type == 'OUTPUT_MATERIAL')
        order = (diffuse, clear) if first == "ShaderNodeBsdfDiffuse" else (clear, diffuse)
        tree.links.new(path.outputs["Is Shadow Ray"], mix.inputs[0])
        for socket, node in zip((mix.inputs[1], mix.inputs[2]), order):
            tree.links.new(node.outputs[0], socket)
        tree.links.new(mix.outputs[0], output.inputs["Surface"])
        scenes.wall("Panel", size=1.0, y=-1.0, material=material)
        pictures.append([picture[..., :3] for picture in scenes.by_both(16)])
    return pictures


def inside_geometry():
    """A smooth bowl, turned, moved and scaled, from both sides, shining with what it is told of itself."""
    import scenes
    scenes.empty(size=(2 * SIZE, SIZE), samples=1)
    scenes.camera(type='ORTHO', ortho_scale=5.0)
    scenes.sharpen()
    material = scenes.emitter((1.0, 1.0, 1.0))
    for name, x, turn in (("Inner", -1.25, 0.3), ("Outer", 1.25, 2.8)):
        made = scenes.sphere(name, location=(x, 0.0, 0.0), material=material)
        bowl = made.data
        import bmesh
        mesh = bmesh.new()
        mesh.from_mesh(bowl)
        bmesh.ops.delete(mesh, geom=[v for v in mesh.verts if v.co.y < -0.1], context='VERTS')
        mesh.to_mesh(bowl)
        mesh.free()
        made.rotation_euler = (0.2, 0.1, turn)
        made.scale = (1.1, 1.1, 1.1)
    return _pictures(_shines(material, "ShaderNodeNewGeometry"), GEOMETRY)


# Comparison ----------------------------------------------------------------------------------------

def _beyond(ours, theirs, tolerance=1e-3):
    """The share of pixels that are off by more; edges of what moves a pixel may fall on either side."""
    limit = tolerance * np.maximum(np.abs(theirs), 1.0)
    return (np.abs(ours - theirs) > limit).any(axis=-1).mean()


# Parametric changes most from pixel to pixel, and Cycles samples all of one.
TOLERANCES = {"Parametric": 5e-3}
# Nothing bounces off what is matt: no ray knows of it.
ALIKE = {"Is Diffuse Ray", "Diffuse Depth"}


@pytest.fixture(scope="module")
def pictures(blender_of_module):
    return {**blender_of_module.run(inside_light_path), **blender_of_module.run(inside_geometry)}


@pytest.mark.parametrize("name", LIGHT_PATH + GEOMETRY)
def test_outputs(pictures, name):
    ours, theirs = pictures[name]
    assert _beyond(ours, theirs, TOLERANCES.get(name, 1e-3)) <= (0.005 if name in LIGHT_PATH else 0.02)
    assert name in ALIKE or np.ptp(theirs) > 0.5, "the picture shows nothing"


def test_translucent(blender):
    for name, (ours, theirs) in blender.run(inside_translucent).items():
        assert abs(ours.mean() / theirs.mean() - 1.0) < 2e-3, name


def test_shadow_rays(blender):
    for ours, theirs in blender.run(inside_shadows):
        assert _beyond(ours, theirs, 5e-3) <= 0.04  # pixels at the shadow's edge, as wide as Cycles' box
        assert np.ptp(theirs) > 0.05


# Emissive meshes -------------------------------------------------------------------------------------

# Of the mean and of a tile's. Both engines have densities of their own for light samples, and Cycles' samples are told
# of no ray: where it has some, the picture is what these leave.
MATT_OFF = {False: (0.01, 0.03), True: (0.2, 1.5)}


def inside_matt(is_sampled):
    """A floor and a ball, matt, and a large panel that shines for diffuse rays, by both. Cycles samples it or not."""
    import math

    import scenes
    scenes.empty(size=(32, 24))
    scenes.camera((0.0, -8.0, 2.5), (1.3, 0.0, 0.0))
    matt, material = scenes.material("Matt", "ShaderNodeBsdfDiffuse"), scenes.emitter((1.0, 0.6, 0.3))
    floor = scenes.wall("Floor", 8.0, material=matt)
    floor.location.z, floor.rotation_euler.x = -1.0, math.pi / 2
    scenes.sphere("Ball", 0.7, (1.5, -1.0, 0.0), matt)
    panel = scenes.wall("Panel", 5.0, material=material)
    panel.location, panel.rotation_euler = (-0.5, 1.0, 1.0), (0.5, 0.2, 0.3)
    tree = material.node_tree
    tree.links.new(tree.nodes.new("ShaderNodeLightPath").outputs["Is Diffuse Ray"],
                   scenes.shader_of(material).inputs["Strength"])
    if hasattr(material.cycles, "emission_sampling"):  # since 3.5
        material.cycles.emission_sampling = 'AUTO' if is_sampled else 'NONE'
    else:
        material.cycles.sample_as_light = is_sampled
    return scenes.seeds_by_both(512)


@pytest.mark.parametrize("is_sampled", [False, True])
def test_emission_for_diffuse_rays(blender, is_sampled):
    """All of it was missing: 1 of the mean."""
    ours, theirs = (seeds[..., :3] for seeds in blender.run(inside_matt, is_sampled))
    errors = compare.unexplained(ours, theirs)
    assert all(error <= limit * theirs.mean() for error, limit in zip(errors, MATT_OFF[is_sampled])), errors


# Worlds ----------------------------------------------------------------------------------------------

WORLD_KINDS = ("Is Camera Ray", "Is Diffuse Ray", "Is Glossy Ray", "Is Reflection Ray", "Is Transmission Ray",
               "Is Singular Ray")
LIT = {"diffuse": ("ShaderNodeBsdfDiffuse", {}), "glossy": ("ShaderNodeBsdfGlossy", {"Roughness": 0.4}),
       "translucent": ("ShaderNodeBsdfTranslucent", {}), "refraction": ("ShaderNodeBsdfRefraction", {"Roughness": 0.3})}
WORLD_OFF = 0.003, 0.01  # of the mean
VARIED_OFF = 0.05, 0.2   # both engines have densities of their own for light samples


def inside_world(kind, is_varied=False):
    """{output: pictures by both} of a ball in an even world, or one that is brighter on one side, that is another to
    rays for which an output of Light Path is 1."""
    import bpy
    import scenes
    scene = scenes.empty(size=(32, 24))
    scenes.camera()
    node_type, inputs = LIT[kind]
    scenes.sphere(material=scenes.material("Lit", node_type, Color=(0.8, 0.8, 0.8, 1.0), **inputs))
    scenes.light_world((0.3, 0.3, 0.3))
    tree = scene.world.node_tree
    nodes = {node.bl_idname: node for node in tree.nodes}
    other, asked, mix = (tree.nodes.new(f"ShaderNode{name}") for name in ("Background", "LightPath", "MixShader"))
    other.inputs["Color"].default_value = (1.0, 0.2, 0.1, 1.0)
    if is_varied:
        place, gradient = (tree.nodes.new(f"ShaderNode{name}") for name in ("TexCoord", "TexGradient"))
        tree.links.new(place.outputs["Generated"], gradient.inputs["Vector"])
        tree.links.new(gradient.outputs["Color"], nodes["ShaderNodeBackground"].inputs["Color"])
    tree.links.new(nodes["ShaderNodeBackground"].outputs[0], mix.inputs[1])
    tree.links.new(other.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], nodes["ShaderNodeOutputWorld"].inputs["Surface"])
    found = {}
    for output in WORLD_KINDS:
        tree.links.new(asked.outputs[output], mix.inputs[0])
        found[output] = scenes.seeds_by_both(64)
    return found


@pytest.mark.parametrize("kind", LIT)
def test_even_world(blender, kind):
    """Cycles has no light samples of it: what rays find is what they are told."""
    _expect_worlds(blender.run(inside_world, kind), WORLD_OFF)


@pytest.mark.parametrize("kind", ("diffuse", "translucent"))
def test_varied_world(blender, kind):
    """Cycles' light samples are told of no ray, and matt surfaces have the rest by rays."""
    _expect_worlds(blender.run(inside_world, kind, True), VARIED_OFF)


def _expect_worlds(found, off):
    for output, pictures in found.items():
        ours, theirs = (seeds[..., :3] for seeds in pictures)
        errors = compare.unexplained(ours, theirs)
        assert all(error <= limit * theirs.mean() for error, limit in zip(errors, off)), output
