# SPDX-License-Identifier: Apache-2.0
"""Node trees of lights beside Cycles: what each kind of light tells its nodes, at sharp pixels where both
engines see the same, IES files of every symmetry, and soft lights with patterns. The table goes to
results/light_nodes.txt of the build."""

import blender as blender_support
import compare
import numpy as np
import pytest

SIZE = (16, 16)
SHARP = 2e-3        # relative to the brightest pixel
WEB = 5e-3          # the same, of IES files: at the pole those of type B have every value of the horizon's
SOFT = 0.01         # means and tiles, relative to the mean of the picture
ATTRIBUTE_OFF = 5e-3  # of means up to 3
SEEDS = (31, 32, 33, 34, 35, 36)
SAMPLES = 64

# Without extent, so that a pixel has no noise, but for the area light, which would cost Cycles its digits.
KINDS = {
    'POINT': {"energy": 100.0, "shadow_soft_size": 0.0},
    'SPOT': {"energy": 100.0, "shadow_soft_size": 0.0, "spot_size": 3.1, "spot_blend": 0.1},
    'SUN': {"energy": 3.0, "angle": 0.0},
    'AREA': {"energy": 100.0, "shape": 'SQUARE', "size": 0.05},
}
AREA_SAMPLES, AREA_NOISE = 256, 0.02
COORDINATES = ("Generated", "Normal", "UV", "Object", "Camera", "Window", "Reflection")
GEOMETRY = ("Position", "Normal", "True Normal", "Incoming", "Parametric", "Backfacing")
PATH = ("Is Camera Ray", "Is Shadow Ray", "Is Glossy Ray", "Ray Length", "Ray Depth")
INPUTS = [("ShaderNodeTexCoord", name) for name in COORDINATES] \
    + [("ShaderNodeNewGeometry", name) for name in GEOMETRY] \
    + [("ShaderNodeLightPath", name) for name in PATH] \
    + [("ShaderNodeObjectInfo", name) for name in ("Location", "Color", "Alpha", "Object Index", "Random")] \
    + [("ShaderNodeCameraData", name) for name in ("View Vector", "View Z Depth", "View Distance")] \
    + [("ShaderNodeLightFalloff", name) for name in ("Quadratic", "Linear", "Constant")] \
    + [("ShaderNodeTexNoise", "Fac"), ("ShaderNodeBlackbody", "Color"), ("ShaderNodeTexImage", "Color")]

# Blender 3.4's sun has any number for Parametric; the sun's rays have no length, which Light Falloff knows from
# Blender 5.0 on.
UNLIKE = {('SUN', "Parametric"), ('SUN', "Ray Length")}
if blender_support.version() < (5, 0):
    UNLIKE |= {('SUN', "Linear"), ('SUN', "Constant")}
INPUT_CASES = [(kind, *each) for kind in KINDS for each in INPUTS if (kind, each[1]) not in UNLIKE]


def _web(kind, vertical, horizontal, value):
    rows = [" ".join(f"{value(h, v):.3f}" for v in vertical) for h in horizontal]
    return "\n".join([
        "IESNA:LM-63-1995", "[TEST] made for tests", "TILT=NONE",
        f"1 1000 1 {len(vertical)} {len(horizontal)} {kind} 2 0 0 0", "1 1 100",
        " ".join(map(str, vertical)), " ".join(map(str, horizontal)), *rows]) + "\n"


def _value(h, v):
    return 900.0 + 500.0 * np.cos(np.radians(2.5 * v)) + 300.0 * np.sin(np.radians(h)) * np.sin(np.radians(2 * v))


WEBS = {
    "round": _web(1, range(0, 91, 10), [0], lambda h, v: _value(0, v)),
    "quadrant": _web(1, [0, 10, 25, 45, 60, 75, 90], [0, 30, 60, 90], _value),
    "half": _web(1, range(0, 91, 15), range(0, 181, 45), _value),
    "whole": _web(1, range(0, 181, 15), range(0, 361, 45), _value),
    "open": _web(1, range(0, 91, 15), range(0, 360, 40), _value),
    "type b": _web(2, range(-90, 91, 15), range(-90, 91, 30), _value),
    "damaged": "IESNA:LM-63-1995\nTILT=NONE\n1 1000\n",
}


# Inside Blender ------------------------------------------------------------------------------------

def _floor(scenes, size=SIZE, samples=1):
    scene = scenes.empty(size=size, samples=samples)
    scenes.camera(location=(0.0, 0.0, 5.0), rotation=(0.0, 0.0, 0.0), type='ORTHO', ortho_scale=4.0)
    white = scenes.material("White", "ShaderNodeBsdfDiffuse", Color=(1.0, 1.0, 1.0))
    scenes.mesh("Floor", [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [(0, 1, 2, 3)], white)
    return scene


def _lamp(scenes, kind, settings):
    """A light, turned and stretched, and its Emission."""
    lamp = scenes.light(kind, location=(0.3, -0.2, 2.0), rotation=(0.3, 0.2, 0.7), **settings)
    if kind != 'AREA':
        lamp.scale = (1.0, 1.0, 2.0)
    lamp.color, lamp.pass_index = (0.3, 0.9, 0.5, 0.6), 3
    lamp.data.use_nodes = True
    return lamp, lamp.data.node_tree.nodes["Emission"]


def _gobo():
    import bpy
    image = bpy.data.images.new("Gobo", 8, 8, float_buffer=True)
    image.colorspace_settings.name = 'Non-Color'
    values = np.ones((8, 8, 4), np.float32)
    values[..., 0] = np.linspace(0.2, 1.0, 8)
    values[..., 1] = np.linspace(0.1, 0.9, 8)[:, None]
    values[2:5, 3:7, 2] = 0.1
    image.pixels.foreach_set(values.reshape(-1))
    return image


def _feed(lamp, emission, node_type, output):
    """A tenth of an output, and a constant, for the colour that is emitted."""
    tree = lamp.data.node_tree
    node, scaled = tree.nodes.new(node_type), tree.nodes.new("ShaderNodeVectorMath")
    scaled.operation = 'MULTIPLY_ADD'
    scaled.inputs[1].default_value, scaled.inputs[2].default_value = (0.1,) * 3, (1.0,) * 3
    if node_type == "ShaderNodeLightFalloff":
        node.inputs["Strength"].default_value, node.inputs["Smooth"].default_value = 2.0, 0.5
    elif node_type == "ShaderNodeBlackbody":
        node.inputs["Temperature"].default_value = 3200.0
    elif node_type == "ShaderNodeTexImage":
        node.image = _gobo()
    tree.links.new(node.outputs[output], scaled.inputs[0])
    tree.links.new(scaled.outputs[0], emission.inputs["Color"])


def inside_inputs():
    """{(kind of light, node, output): (picture by Volley, by Cycles)}."""
    import scenes
    pictures = {}
    for kind, node_type, output in INPUT_CASES:
        _floor(scenes)
        scenes.sharpen()
        _feed(*_lamp(scenes, kind, KINDS[kind]), node_type, output)
        samples = AREA_SAMPLES if kind == 'AREA' else 1
        pictures[kind, node_type, output] = [p[..., :3] for p in scenes.by_both(samples)]
    return pictures


def inside_webs():
    """{name: (picture by Volley, by Cycles)} of a point light with an IES file, inside and outside the
    blend file, with and without a vector."""
    import os
    import tempfile

    import bpy
    import scenes
    pictures = {}
    for name, text in WEBS.items():
        for is_inside in (True, False):
            _floor(scenes)
            scenes.sharpen()
            lamp, emission = _lamp(scenes, 'POINT', KINDS['POINT'])
            tree = lamp.data.node_tree
            node = tree.nodes.new("ShaderNodeTexIES")
            if is_inside:
                node.mode, node.ies = 'INTERNAL', bpy.data.texts.new("Web")
                node.ies.write(text)
            else:
                path = os.path.join(tempfile.mkdtemp(), "web.ies")
                with open(path, "w", encoding="latin-1") as file:
                    file.write(text)
                node.mode, node.filepath = 'EXTERNAL', path
                geometry = tree.nodes.new("ShaderNodeNewGeometry")
                tree.links.new(geometry.outputs["Normal"], node.inputs["Vector"])
            node.inputs["Strength"].default_value = 0.01
            tree.links.new(node.outputs["Fac"], emission.inputs["Strength"])
            pictures[f"{name} {'inside' if is_inside else 'by a vector'}"] = \
                [p[..., :3] for p in scenes.by_both(1)]
    return pictures


SOFT_CASES = {
    "area checker": ('AREA', {"energy": 100.0, "shape": 'RECTANGLE', "size": 1.5, "size_y": 0.8}),
    "disk checker": ('AREA', {"energy": 100.0, "shape": 'DISK', "size": 1.2}),
    "ball normal": ('POINT', {"energy": 100.0, "shadow_soft_size": 0.4}),
    "spot noise": ('SPOT', {"energy": 100.0, "shadow_soft_size": 0.3, "spot_size": 2.0}),
    "two lights": ('SPOT', {"energy": 100.0, "shadow_soft_size": 0.1, "spot_size": 2.5}),
}


def _pattern(tree, emission, name):
    """Stripes that the light shows where it is, or in the directions it shines in."""
    source = tree.nodes.new("ShaderNodeNewGeometry")
    output = "Parametric" if "checker" in name else "Normal" if "normal" in name else "Incoming"
    pattern = tree.nodes.new("ShaderNodeTexNoise" if "noise" in name else "ShaderNodeTexChecker")
    pattern.inputs["Scale"].default_value = 3.0
    tree.links.new(source.outputs[output], pattern.inputs["Vector"])
    tree.links.new(pattern.outputs["Color"], emission.inputs["Color"])


def inside_soft():
    """{name: (pictures by Volley, pictures by Cycles)}, one for each seed: over a floor, half of it gloss that
    finds lights by itself."""
    import scenes
    pictures = {}
    for name, (kind, settings) in SOFT_CASES.items():
        _floor(scenes, samples=SAMPLES)
        gloss = scenes.material("Gloss", "ShaderNodeBsdfGlossy", Color=(0.8, 0.8, 0.8), Roughness=0.4)
        scenes.mesh("Gloss", [(0, -2, 0.01), (2, -2, 0.01), (2, 2, 0.01), (0, 2, 0.01)], [(0, 1, 2, 3)], gloss)
        lamp, emission = _lamp(scenes, kind, settings)
        _pattern(lamp.data.node_tree, emission, name)
        if name == "two lights":
            scenes.light('POINT', location=(-1.0, 1.0, 1.5), energy=20.0, shadow_soft_size=0.2)
        pictures[name] = scenes.seeds_by_both(SAMPLES * len(SEEDS), SEEDS)
    return pictures


# Types of attributes, names and outputs that are read of a light, or of what makes an instance of one, and of a world.
OF_OBJECT = [("OBJECT", *each) for each in (
    ("own", "Color"), ("own", "Alpha"), ("own", "Fac"), ("of data", "Color"), ("color", "Alpha"), ("pass_index", "Color"),
    ("nowhere", "Color"), ("nowhere", "Alpha"), ("", "Alpha"))]
OF_MAKER = [("INSTANCER", *each) for each in (
    ("own", "Color"), ("of maker", "Color"), ("of maker", "Alpha"), ("of data", "Fac"), ("", "Alpha"))]
OF_LAYER = [("VIEW_LAYER", *each) for each in (
    ("of scene", "Color"), ("of scene", "Alpha"), ("nowhere", "Alpha"), ("", "Alpha"))]


def _read(tree, shown, kind, name, output):
    """Let an Attribute node feed a colour."""
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_type, node.attribute_name = kind, name
    tree.links.new(node.outputs[output], shown.inputs["Color"])


def _instanced(lamp):
    """Two instances of a light instead of it, whose makers have other properties."""
    import bpy
    import scenes
    collection = bpy.data.collections.new("Lamps")
    collection.objects.link(lamp)
    bpy.context.scene.collection.objects.unlink(lamp)
    for number in range(2):
        maker = scenes.link(f"Maker {number}", None)
        maker.instance_type, maker.instance_collection = 'COLLECTION', collection
        maker["of maker"] = (0.2 + 0.6 * number, 0.5, 0.7 - 0.3 * number, 0.4 + 0.1 * number)


def inside_attributes():
    """{(owner, type, name, output): (mean by Volley, by Cycles)}, and the warnings."""
    import bpy
    import scenes
    import volley.session
    means, told = {}, []
    for owner, cases in (("light", OF_OBJECT + OF_LAYER), ("instances", OF_OBJECT[:1] + OF_MAKER),
                         ("world", OF_OBJECT + OF_MAKER + OF_LAYER)):
        for case in cases:
            scene = _floor(scenes, size=(4, 4))
            volley.session.report_warning = lambda _engine, message: told.append(message)
            scene["of scene"] = (0.3, 0.8, 0.4, 0.6)
            lamp, emission = _lamp(scenes, 'SUN', KINDS['SUN'])
            lamp["own"], lamp.data["of data"] = (0.3, 0.5, 0.7, 0.2), (0.6, 0.1, 0.2, 0.9)
            if owner == "world":
                bpy.data.objects.remove(lamp)
                scene.world.use_nodes = True
                scene.world["own"] = (0.3, 0.5, 0.7, 0.2)
                _read(scene.world.node_tree, scene.world.node_tree.nodes["Background"], *case)
            else:
                _read(lamp.data.node_tree, emission, *case)
            if owner == "instances":
                _instanced(lamp)
            means[owner, *case] = [picture[..., :3].mean(axis=(0, 1)) for picture in scenes.by_both(64)]
    return means, told


# Comparison ----------------------------------------------------------------------------------------

def _difference(ours, theirs):
    """The largest, over the brightest pixel."""
    assert theirs.max() > 0.0, "nothing is lit"
    return float(np.abs(ours - theirs).max() / theirs.max())


@pytest.fixture(scope="module")
def inputs(blender_of_module):
    found = {key: _difference(*pair)
             for key, pair in blender_of_module.run(inside_inputs, timeout=600).items()}
    lines = [f"{'light':6} {'node':24} {'output':16} {'error':>9}"]
    lines += [f"{kind.lower():6} {node[10:]:24} {output:16} {error:9.2e}"
              for (kind, node, output), error in found.items()]
    blender_support.write_result("light_nodes", lines, {" ".join(key): error for key, error in found.items()})
    return found


@pytest.mark.parametrize("kind, node, output", INPUT_CASES)
def test_inputs(inputs, kind, node, output):
    assert inputs[kind, node, output] < (AREA_NOISE if kind == 'AREA' else SHARP)


@pytest.fixture(scope="module")
def webs(blender_of_module):
    found = {name: _difference(*pair)
             for name, pair in blender_of_module.run(inside_webs, timeout=300).items()}
    blender_support.write_result("light_webs", [f"{name:24} {error:9.2e}" for name, error in found.items()], found)
    return found


@pytest.mark.parametrize("name", [f"{web} {way}" for web in WEBS for way in ("inside", "by a vector")])
def test_webs(webs, name):
    assert webs[name] < WEB


@pytest.fixture(scope="module")
def soft(blender_of_module):
    pictures = blender_of_module.run(inside_soft, timeout=600)
    found, lines = compare.errors_of_cases(pictures)
    blender_support.write_result("light_patterns", lines, compare.largest_errors(found))
    return found


@pytest.mark.parametrize("name", SOFT_CASES)
def test_soft_lights(soft, name):
    _mean, biased, tile = soft[name]
    assert biased < SOFT
    assert tile < SOFT


def test_attributes(blender):
    """Lights of Blender 5 have those of objects, others and worlds an alpha of 1."""
    means, told = blender.run(inside_attributes, timeout=300)
    assert told == []
    for case, (ours, theirs) in means.items():
        print(case, ours, theirs)
    for case, (ours, theirs) in means.items():
        assert np.abs(ours - theirs).max() < ATTRIBUTE_OFF, case
    is_object = blender_support.version() >= (5, 0)
    assert (means["light", "OBJECT", "own", "Color"][1].max() > 0.1) == is_object
