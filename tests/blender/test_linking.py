# SPDX-License-Identifier: Apache-2.0
"""Light linking and shadow linking beside Cycles: every kind of light, receivers and blockers that are included
and excluded, themselves, by collections and by what instances them, seen directly, in mirrors and through rough
gloss. Means and tiles within 1 %, beyond what noise explains. The table goes to results/linking.txt of the
build."""

import blender as blender_support
import compare
import pytest

SIZE = (48, 32)
SEEDS = (41, 42, 43, 44)
SAMPLES = 64
TOLERANCE = 0.01  # relative to the mean of the picture

# name: (kinds of the lights, lobe of the floor, receivers, blockers); the first light is linked to what is
# named: +, include, or -, exclude; brackets: a collection in the collection.
CASES = {
    "point": ("POINT SUN", "diffuse", "+Ball", ""),
    "point left out": ("POINT SUN", "diffuse", "-Ball", ""),
    "spot": ("SPOT AREA", "diffuse", "+Ball +Box", ""),
    "sun": ("SUN POINT", "diffuse", "-Floor", ""),
    "area": ("AREA POINT", "gloss", "+Floor", ""),
    "area left out": ("AREA POINT", "gloss", "-Floor", ""),
    "alone": ("AREA", "gloss", "-Ball", ""),
    "mesh": ("MESH POINT", "diffuse", "+Floor", ""),
    "mesh left out": ("MESH POINT", "gloss", "-Floor", ""),
    "mirror": ("AREA POINT", "mirror", "-Floor", ""),
    "mesh in mirror": ("MESH POINT", "mirror", "-Floor", ""),
    "mixed": ("AREA POINT", "diffuse", "+(Ball Box) -Box +Floor", ""),
    "collection": ("AREA POINT", "diffuse", "-(Ball Box)", "-(Ball)"),
    "empty": ("AREA POINT", "diffuse", "()", "()"),
    "blocker point": ("POINT", "diffuse", "", "-Ball"),
    "blocker sun": ("SUN AREA", "diffuse", "", "+Box"),
    "blocker left out": ("AREA POINT", "gloss", "", "-Ball"),
    "blockers": ("AREA POINT", "gloss", "", "+Ball +Box"),
    "blocker mirror": ("AREA POINT", "mirror", "", "-Box"),
    "no blocker, mirror": ("AREA POINT", "mirror", "", "+Ball"),
    "blocker mesh": ("MESH POINT", "gloss", "", "-Ball"),
    "blockers mesh": ("MESH POINT", "gloss", "", "+Ball +Box +Lamp"),
    "blocker mesh mirror": ("MESH POINT", "mirror", "", "-Box"),
    "transparent blocker": ("AREA POINT", "gloss", "", "+Pane +Box"),
    "blocker and receiver": ("AREA SUN", "gloss", "-Box", "-Ball"),
    "many": ("MANY", "diffuse", "-Ball", "-Box"),
    "maker": ("AREA POINT", "diffuse", "+Maker", "-Maker"),
    "maker of a blocker": ("AREA POINT", "diffuse", "+Made", "-Maker"),
    "maker against object": ("AREA POINT", "diffuse", "-Maker +Made", ""),
    "instanced light": ("INNER POINT", "diffuse", "+Ball", ""),
    "instanced light alone": ("ALONE POINT", "diffuse", "+Ball", "-Ball"),
    "instanced mesh alone": ("ALONE_MESH POINT", "gloss", "-Floor", ""),
    "maker of a light": ("MADE POINT", "diffuse", "+Ball", "-Ball"),
    "world": ("AREA POINT WORLD", "gloss", "-Floor", "-Ball"),  # where rays found the world it crashed
}


# Inside Blender ------------------------------------------------------------------------------------

def _lamp(kind, place):
    import scenes
    if kind == 'MESH':
        lamp = scenes.sphere("Lamp", 0.4, place, scenes.emitter((1.0, 0.8, 0.6), "Lamp", 15.0))
        lamp.scale = (1.5, 1.0, 0.5)
        return lamp
    settings = {'POINT': {"energy": 400.0, "shadow_soft_size": 0.3},
                'SPOT': {"energy": 900.0, "spot_size": 1.2, "shadow_soft_size": 0.2},
                'SUN': {"energy": 1.5, "angle": 0.1},
                'AREA': {"energy": 300.0, "size": 1.5, "shape": 'SQUARE'}}[kind]
    return scenes.light(kind, location=place, rotation=(0.72, 0.0, 0.785 if place[0] > 0 else -0.785),
                        **settings)


def _collection(text):
    """A collection of what a text of CASES names."""
    import bpy
    made = bpy.data.collections.new("Links")
    is_in, inner = True, None
    for word in text.replace("(", " ( ").replace(")", " ) ").replace("+", " + ").replace("-", " - ").split():
        if word in "+-":
            is_in = word == "+"
        elif word == "(":
            inner = bpy.data.collections.new("Inner")
            made.children.link(inner)
            made.collection_children[-1].light_linking.link_state = 'INCLUDE' if is_in else 'EXCLUDE'
        elif word == ")":
            inner = None
        elif inner is not None:
            inner.objects.link(bpy.data.objects[word])
        else:
            made.objects.link(bpy.data.objects[word])
            made.collection_objects[-1].light_linking.link_state = 'INCLUDE' if is_in else 'EXCLUDE'
    return made


def _instance(name, member, offset):
    """An instance of a collection with that object."""
    import bpy
    import scenes
    group = bpy.data.collections.new(name)
    group.objects.link(member)
    maker = scenes.link(name, None)
    maker.instance_type, maker.instance_collection, maker.location = 'COLLECTION', group, offset
    return maker


def _build(lights, lobe, receivers, blockers):
    """The scene of a case."""
    import bpy
    import scenes
    scene = scenes.empty(size=SIZE)
    scenes.camera(location=(0.0, -7.0, 3.0), rotation=(1.25, 0.0, 0.0))
    grey = scenes.material("Grey", "ShaderNodeBsdfDiffuse", Color=(0.6, 0.6, 0.6))
    floor = grey
    if lobe != "diffuse":
        floor = scenes.material("Shiny", "ShaderNodeBsdfGlossy", Color=(0.7, 0.7, 0.7),
                                Roughness=0.0 if lobe == "mirror" else 0.35)
    scenes.mesh("Floor", [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [(0, 1, 2, 3)], floor)
    scenes.sphere("Ball", 0.8, (-0.9, 0.0, 1.0), grey)
    bpy.ops.mesh.primitive_cube_add(size=1.2, location=(1.0, 0.5, 0.9))
    bpy.context.object.name = "Box"
    bpy.context.object.data.materials.append(grey)
    if "Pane" in blockers:
        tint = scenes.material("Tint", "ShaderNodeBsdfTransparent", Color=(0.3, 0.9, 0.3))
        scenes.mesh("Pane", [(0.2, 0.5, 2), (2.2, 0.5, 2), (2.2, 2.5, 2), (0.2, 2.5, 2)], [(0, 1, 2, 3)], tint)
    if "Made" in receivers or "Maker" in receivers:
        made = scenes.sphere("Made", 0.4, (0.0, -1.5, 0.5), grey)
        _instance("Maker", made, (1.2, -0.3, 0.6))
    if lights == "MANY":
        lamps = [_lamp(('POINT', 'AREA', 'MESH', 'SPOT')[i % 4], (3.0 - 0.15 * i, 0.2 * i - 2.0, 3.5))
                 for i in range(40)]
        for lamp in lamps:
            if lamp.type == 'LIGHT':
                lamp.data.energy *= 0.06
        lamps[:] = lamps[::2]
    elif lights.startswith(("MADE", "INNER", "ALONE")):
        inside = _lamp('MESH' if "MESH" in lights else 'AREA', (2.0, -2.0, 4.0))
        maker = _instance("Maker", inside, (-3.0, 0.0, 0.0))
        if lights.startswith("ALONE"):  # what is there by the instance alone
            scene.collection.objects.unlink(inside)
        lamps = [maker if lights.startswith("MADE") else inside]
        _lamp('POINT', (-2.5, -1.5, 3.0))
    else:
        places = [(1.2, 1.5, 2.6) if lobe != "diffuse" else (2.0, -2.0, 4.0), (-2.5, -1.5, 3.0)]
        lamps = [_lamp(kind, place) for kind, place in zip(lights.split(), places)][:1]
    for lamp in lamps:
        if receivers:
            lamp.light_linking.receiver_collection = _collection(receivers)
        if blockers:
            lamp.light_linking.blocker_collection = _collection(blockers)
    if "WORLD" in lights:
        scenes.light_world((0.2, 0.3, 0.4))
        tree = scene.world.node_tree
        gradient = tree.nodes.new("ShaderNodeTexGradient")  # even worlds did not crash
        tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], gradient.inputs["Vector"])
        tree.links.new(gradient.outputs[0], tree.nodes["Background"].inputs["Strength"])
    return scene


def inside_pictures(names):
    """{case: (pictures by Volley, pictures by Cycles)}, one for each seed; None without light linking."""
    import bpy
    import scenes
    if "light_linking" not in bpy.types.Object.bl_rna.properties:
        return None
    pictures = {}
    for name in names:
        _build(*CASES[name])
        pictures[name] = scenes.seeds_by_both(SAMPLES * len(SEEDS), SEEDS)
    return pictures


def inside_edits():
    """Pictures of one engine that follows edits of links, and of new ones; None without light linking."""
    import bpy
    import numpy as np
    import scenes
    if "light_linking" not in bpy.types.Object.bl_rna.properties:
        return None
    scene = _build("AREA POINT", "diffuse", "+Ball", "-Ball")
    scene.render.use_persistent_data = True
    lamp = next(each for each in scene.objects if each.light_linking.receiver_collection)
    receivers, blockers = lamp.light_linking.receiver_collection, lamp.light_linking.blocker_collection

    def include():
        receivers.collection_objects[0].light_linking.link_state = 'EXCLUDE'

    def add():
        blockers.objects.link(bpy.data.objects["Box"])
        blockers.collection_objects[-1].light_linking.link_state = 'EXCLUDE'

    def free():
        lamp.light_linking.receiver_collection = None

    def free_shadows():
        lamp.light_linking.blocker_collection = None

    pairs = []
    for edit in (lambda: None, include, add, free, free_shadows):
        scenes.render()
        edit()
        followed = scenes.render()
        scene.render.use_persistent_data = False
        new = scenes.render()
        scene.render.use_persistent_data = True
        pairs.append((followed, new))
    return [np.abs(a - b).max() for a, b in pairs], [float(a.mean()) for a, _b in pairs]


def inside_with_denoising_data():
    """Pictures without passes for denoisers, and with them; None without light linking."""
    import bpy
    import scenes
    if "light_linking" not in bpy.types.Object.bl_rna.properties:
        return None
    _build(*CASES["blockers"])
    pictures = []
    for bpy.context.view_layer.volley.denoising_store_passes in (False, True):
        pictures.append(scenes.render())
    return pictures


# Comparison ----------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def errors(blender_of_module):
    """The errors of all cases, from one Blender, and their table."""
    pictures = blender_of_module.run(inside_pictures, list(CASES), timeout=600)
    if pictures is None:
        return None
    found, lines = compare.errors_of_cases(pictures)
    blender_support.write_result("linking", lines, compare.largest_errors(found))
    return found


@pytest.mark.parametrize("name", CASES)
def test_against_cycles(errors, name):
    if errors is None:
        pytest.skip("lights have no links")
    _mean, biased, tile = errors[name]
    assert biased < TOLERANCE
    assert tile < TOLERANCE


def test_edits_are_followed(blender):
    found = blender.run(inside_edits)
    if found is None:
        pytest.skip("lights have no links")
    differences, means = found
    assert max(differences) == 0.0
    assert all(abs(a - b) > 1e-3 for a, b in zip(means, means[1:]))  # each edit shows


def test_denoising_data_changes_nothing(blender):
    """What surfaces took of passes and what blocks shadow rays share bits of path words."""
    found = blender.run(inside_with_denoising_data)
    if found is None:
        pytest.skip("lights have no links")
    plain, with_passes = found
    assert (plain == with_passes).all()
