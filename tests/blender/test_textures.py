# SPDX-License-Identifier: Apache-2.0
"""Every procedural texture and value node beside Cycles: wired to Emission on a sloped plane, one
sample in the middle of each pixel. The table of all errors goes to results/textures.txt of the build."""

import os

import numpy as np
import pytest

SIZE = 56
TOLERANCE = 1e-3      # of a pixel, relative where the value is above 1
SHARE_WITHIN = 0.995  # of the pixels; edges of cells may fall on either side

# name: (node, properties, inputs, outputs). An input that is a string is fed: 'vector' by the place on
# the plane, 'number' by the mean of its coordinates, 'mostly' by that in [0, 1].
CASES = {}


def _add(name, node, outputs, properties=None, **inputs):
    CASES[name] = (node, properties or {}, {key.replace("_", " "): value for key, value in inputs.items()},
                   outputs)


for _dimensions in ("1D", "2D", "3D", "4D"):
    _place = {"1D": {"W": 'number'}, "4D": {"Vector": 'vector', "W": 'number'}}.get(
        _dimensions, {"Vector": 'vector'})
    _key = {"noise_dimensions": _dimensions}
    _add(f"noise {_dimensions}", "ShaderNodeTexNoise", ("Fac", "Color"), _key, Scale=3.0, Detail=2.5,
         Roughness=0.6, Distortion=0.0, **_place)
    _add(f"noise {_dimensions}, distorted", "ShaderNodeTexNoise", ("Fac", "Color"), _key, Scale=2.0,
         Detail=0.0, Roughness=0.5, Distortion=0.7, **_place)
    _add(f"white noise {_dimensions}", "ShaderNodeTexWhiteNoise", ("Value", "Color"), _key,
         **{name: {'vector': 'cells', 'number': 'whole'}[value] for name, value in _place.items()})
    for _kind in ("FBM", "MULTIFRACTAL", "HETERO_TERRAIN", "HYBRID_MULTIFRACTAL",
                  "RIDGED_MULTIFRACTAL"):
        _add(f"musgrave {_dimensions} {_kind}", "ShaderNodeTexMusgrave", ("Fac",),
             {"musgrave_dimensions": _dimensions, "musgrave_type": _kind}, Scale=2.0, Detail=3.4,
             Dimension=0.7, Lacunarity=2.2, **_place)
    for _feature, _outputs in (
            ("F1", ("Distance", "Color", "Position")), ("F2", ("Distance", "Color", "Position")),
            ("SMOOTH_F1", ("Distance", "Color", "Position")), ("DISTANCE_TO_EDGE", ("Distance",)),
            ("N_SPHERE_RADIUS", ("Radius",))):
        if "Position" in _outputs:
            _outputs = _outputs[:2] + {"1D": ("W",), "4D": ("Position", "W")}.get(_dimensions, ("Position",))
        _add(f"voronoi {_dimensions} {_feature}", "ShaderNodeTexVoronoi", _outputs,
             {"voronoi_dimensions": _dimensions, "feature": _feature}, Scale=2.5, Smoothness=0.7,
             Randomness=0.9, **_place)
for _metric in ("MANHATTAN", "CHEBYCHEV", "MINKOWSKI"):
    for _feature in ("F1", "F2", "SMOOTH_F1"):
        _add(f"voronoi {_metric} {_feature}", "ShaderNodeTexVoronoi", ("Distance", "Color"),
             {"distance": _metric, "feature": _feature}, Vector='vector', Scale=2.5, Exponent=1.7,
             Smoothness=0.4, Randomness=1.0)
for _profile in ("SIN", "SAW", "TRI"):
    for _direction in ("X", "Y", "Z", "DIAGONAL"):
        _add(f"wave {_profile} bands {_direction}", "ShaderNodeTexWave", ("Color", "Fac"),
             {"wave_profile": _profile, "wave_type": 'BANDS', "bands_direction": _direction},
             Vector='vector', Scale=0.7, Phase_Offset=0.3)
    for _direction in ("X", "Y", "Z", "SPHERICAL"):
        _add(f"wave {_profile} rings {_direction}", "ShaderNodeTexWave", ("Color",),
             {"wave_profile": _profile, "wave_type": 'RINGS', "rings_direction": _direction},
             Vector='vector', Scale=0.4, Distortion=1.5, Detail=1.5, Detail_Scale=1.3,
             Detail_Roughness=0.6)
for _kind in ("LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "RADIAL", "QUADRATIC_SPHERE", "SPHERICAL"):
    _add(f"gradient {_kind}", "ShaderNodeTexGradient", ("Color", "Fac"), {"gradient_type": _kind},
         Vector='vector')
for _depth in range(11):
    _add(f"magic {_depth}", "ShaderNodeTexMagic", ("Color", "Fac") if _depth == 2 else ("Color",),
         {"turbulence_depth": _depth}, Vector='vector', Scale=0.6, Distortion=1.3)
_add("brick", "ShaderNodeTexBrick", ("Color", "Fac"),
     {"offset": 0.4, "offset_frequency": 3, "squash": 0.6, "squash_frequency": 2}, Vector='vector',
     Color1=(0.8, 0.5, 0.2), Color2=(0.1, 0.3, 0.6), Mortar=(0.9, 0.9, 0.8), Scale=2.0, Mortar_Size=0.03,
     Mortar_Smooth=0.4, Bias=-0.2)
_add("brick, hard", "ShaderNodeTexBrick", ("Color",), {"squash": 1.0}, Vector='vector', Scale=1.5,
     Mortar_Size=0.02, Mortar_Smooth=0.0, Bias=0.1, Brick_Width=0.6, Row_Height=0.3)
_add("noise, no detail", "ShaderNodeTexNoise", ("Fac",), Scale=5.0, Detail=0.0)  # by Generated
_add("noise, all detail", "ShaderNodeTexNoise", ("Fac",), Vector='vector', Scale=1.0, Detail=15.0)


# Inside Blender ------------------------------------------------------------------------------------

def _stage():
    """A sloped plane that fills an orthographic picture, and sharp pixels in both engines."""
    import bpy
    import scenes
    scene = scenes.empty(size=(SIZE, SIZE), samples=1)
    scenes.camera(location=(0.3, -6.0, 0.2), type='ORTHO', ortho_scale=4.0)
    corners = [(x, 0.37 * x + 0.21 * z + 0.1, z) for x, z in ((-3, -3), (3, -3), (3, 3), (-3, 3))]
    plane = scenes.mesh("Plane", corners, [(0, 1, 2, 3)])
    material = bpy.data.materials.new("Tried")
    material.use_nodes = True
    plane.data.materials.append(material)
    scene.volley.pixel_filter_type, scene.volley.filter_width = 'BOX', 0.01
    scene.cycles.pixel_filter_type = 'BOX'
    scene.cycles.filter_width = 0.01
    scene.cycles.seed = 1
    return scene, material.node_tree


def _feed(tree, kind):
    """The output that an input of that kind is linked to."""
    made = {}

    def node(name, **settings):
        made[name] = tree.nodes.new(name)
        for key, value in settings.items():
            setattr(made[name], key, value)
        return made[name]

    place = node("ShaderNodeTexCoord").outputs["Object"]
    if kind in {'cells', 'whole'}:
        floor = node("ShaderNodeVectorMath", operation='SNAP')
        floor.inputs[1].default_value = (0.25, 0.25, 0.25)
        tree.links.new(place, floor.inputs[0])
        place = floor.outputs[0]
    if kind in {'vector', 'cells'}:
        return place
    if kind == 'color':
        scaled = node("ShaderNodeMapping", vector_type='POINT')
        scaled.inputs["Scale"].default_value = (0.3, 0.3, 0.3)
        scaled.inputs["Location"].default_value = (0.5, 0.4, 0.6)
        tree.links.new(place, scaled.inputs["Vector"])
        return scaled.outputs[0]
    separate = node("ShaderNodeSeparateXYZ")
    tree.links.new(place, separate.inputs[0])
    if kind in {'number', 'whole'}:
        return separate.outputs["X"]
    low, high = kind
    ramp = node("ShaderNodeMapRange", clamp=False)
    for name, value in (("From Min", -2.0), ("From Max", 2.0), ("To Min", low), ("To Max", high)):
        ramp.inputs[name].default_value = value
    tree.links.new(separate.outputs["X"], ramp.inputs["Value"])
    return ramp.outputs[0]


def _build(tree, case):
    """The node of a case with its inputs, the emission it feeds."""
    node_type, properties, inputs, _ = case
    tree.nodes.clear()
    output, emission = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeEmission")
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    node = tree.nodes.new(node_type)
    for key, value in properties.items():
        if callable(value):
            value(node)
        else:
            setattr(node, key, value)
    for key, value in inputs.items():
        socket = next((s for s in node.inputs if s.name == key and s.enabled), None)
        if socket is None:  # not in this mode
            continue
        if isinstance(value, str) or (isinstance(value, tuple) and len(value) == 2):
            tree.links.new(_feed(tree, value), socket)
        elif isinstance(value, tuple) and len(value) == 3 and socket.type == 'RGBA':
            socket.default_value = (*value, 1.0)
        else:
            socket.default_value = value
    return node, emission


def inside_cases(names):
    """{case: {output: (picture by Volley, picture by Cycles)}}."""
    import bpy
    import scenes
    _, tree = _stage()
    pictures = {}
    for name in names:
        case = CASES[name]
        if not hasattr(bpy.types, case[0]):
            continue
        node, emission = _build(tree, case)
        pictures[name] = {}
        for output in case[3]:
            socket = next(s for s in node.outputs if s.name == output and s.enabled)
            tree.links.new(socket, emission.inputs["Color"])
            pair = []
            for engine in ('VOLLEY', 'CYCLES'):
                scenes.set_engine(engine, 1)
                pair.append(scenes.render()[..., :3])
            pictures[name][output] = pair
    return pictures


# Comparison ----------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def pictures(blender_of_module):
    """All cases from one Blender, and the table of their errors."""
    found = blender_of_module.run(inside_cases, list(CASES), timeout=600)
    lines = [f"{'node':40} {'output':10} {'mean':>9} {'mean error':>10} {'largest':>9} {'beyond':>8}"]
    for name, outputs in found.items():
        for output, (ours, theirs) in outputs.items():
            error = np.abs(ours - theirs)
            lines.append(f"{name:40} {output:10} {theirs.mean():9.4f} {error.mean():10.2e} "
                         f"{error.max():9.2e} {_beyond(ours, theirs):8.3%}")
    folder = os.path.join(os.environ.get("VOLLEY_BUILD", ""), "results")
    if os.path.isdir(folder):
        with open(os.path.join(folder, "textures.txt"), "w", encoding="utf-8") as file:
            file.write("\n".join(lines) + "\n")
    return found


def _beyond(ours, theirs):
    """The share of pixels beyond the tolerance."""
    limit = TOLERANCE * np.maximum(np.abs(theirs), 1.0)
    return (~(np.abs(ours - theirs) <= limit)).any(axis=-1).mean()


@pytest.mark.parametrize("name", CASES)
def test_against_cycles(pictures, name):
    if name not in pictures:
        pytest.skip("this Blender has no such node")
    for output, (ours, theirs) in pictures[name].items():
        assert theirs.std() > 1e-3, f"{output}: the picture shows nothing"
        assert _beyond(ours, theirs) <= 1.0 - SHARE_WITHIN, output
