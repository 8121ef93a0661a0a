# SPDX-License-Identifier: Apache-2.0
"""Every procedural texture and value node beside Cycles: each wired to Emission on a panel of
its own, one sample for each pixel. The table of all errors goes to results/textures.txt of the build."""

import blender as blender_support
import numpy as np
import pytest

GRID = 6             # panels along each side of a picture
SIZE = 40            # pixels along each side of a panel
PIXEL = 1.0 / 16.0   # m
CELL = SIZE * PIXEL  # m
TOLERANCE = 1e-3      # of a pixel, relative where the value is above 1
SHARE_WITHIN = 0.995  # of the pixels; edges of cells may fall on either side

# name: (node, properties, inputs, outputs). Inputs that are names or pairs are fed: 'vector' by the place
# on the plane, 'number' by its X; 'cells' and 'whole' by the same in steps; 'color' by the place with
# values about 0 to 1, a pair of numbers by X from the first to the second.
CASES = {}
_SINCE = {}  # of those that not all Blenders have: version and why


def _add(name, node, outputs, properties=None, since=None, **inputs):
    if since is not None:
        _SINCE[name] = since
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
        _add(f"noise {_dimensions} type {_kind}", "ShaderNodeTexNoise", ("Fac", "Color"),
             {**_key, "noise_type": _kind, "normalize": False}, Scale=2.0, Detail=3.4, Roughness=0.6,
             Lacunarity=2.2, Offset=0.3, Gain=1.4, Distortion=0.2, **_place)
    for _feature, _outputs in (
            ("F1", ("Distance", "Color", "Position")), ("F2", ("Distance", "Color", "Position")),
            ("SMOOTH_F1", ("Distance", "Color", "Position")), ("DISTANCE_TO_EDGE", ("Distance",)),
            ("N_SPHERE_RADIUS", ("Radius",))):
        if "Position" in _outputs:
            _outputs = _outputs[:2] + {"1D": ("W",), "4D": ("Position", "W")}.get(_dimensions, ("Position",))
        _add(f"voronoi {_dimensions} {_feature}", "ShaderNodeTexVoronoi", _outputs,
             {"voronoi_dimensions": _dimensions, "feature": _feature}, Scale=2.5, Smoothness=0.7,
             Randomness=0.9, **_place)
        if _feature != "N_SPHERE_RADIUS":
            for _unit in (False, True):
                _add(f"voronoi {_dimensions} {_feature}, octaves{' to 1' * _unit}", "ShaderNodeTexVoronoi",
                     _outputs, {"voronoi_dimensions": _dimensions, "feature": _feature, "normalize": _unit},
                     Scale=1.5, Detail=2.4, Roughness=0.6, Lacunarity=2.3, Smoothness=0.7, Randomness=0.9,
                     **_place)
for _metric in ("MANHATTAN", "CHEBYCHEV", "MINKOWSKI"):
    for _feature in ("F1", "F2", "SMOOTH_F1"):
        _add(f"voronoi {_metric} {_feature}", "ShaderNodeTexVoronoi", ("Distance", "Color"),
             {"distance": _metric, "feature": _feature}, Vector='vector', Scale=2.5, Exponent=1.7,
             Smoothness=0.4, Randomness=1.0)
        _add(f"voronoi {_metric} {_feature} to 1", "ShaderNodeTexVoronoi", ("Distance", "Color"),
             {"distance": _metric, "feature": _feature, "normalize": True}, Vector='vector', Scale=2.5,
             Detail=1.0, Exponent=1.7, Smoothness=0.4, Randomness=0.8)
        _add(f"voronoi {_metric} {_feature}, far", "ShaderNodeTexVoronoi", ("Distance", "Color"),
             {"distance": _metric, "feature": _feature}, Vector='vector', Scale=2.5, Exponent=0.3,
             Smoothness=0.4, Randomness=0.5)
for _feature in ("F1", "DISTANCE_TO_EDGE"):
    for _name, _range in (("Detail", (-1.0, 3.0)), ("Roughness", (-0.2, 1.2)), ("Lacunarity", (0.2, 2.5))):
        _add(f"voronoi {_feature}, {_name} varies", "ShaderNodeTexVoronoi", ("Distance",),
             {"feature": _feature, "normalize": True}, Vector='vector', Scale=1.5,
             **{"Detail": 3.0, "Roughness": 0.5, "Lacunarity": 2.0, _name: _range})
_add("voronoi F1, no lacunarity", "ShaderNodeTexVoronoi", ("Distance",), {"normalize": False},
     Vector='vector', Scale=1.5, Detail=2.0, Lacunarity=0.0)
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
_add("magic, far", "ShaderNodeTexMagic", ("Color",), {"turbulence_depth": 2}, Vector=(-30.0, 30.0), Scale=0.3,
     Distortion=1.3)
for _dimensions in ("2D", "3D"):
    for _anisotropy in (0.0, 0.6, 1.0):
        _add(f"gabor {_dimensions}, anisotropy {_anisotropy}", "ShaderNodeTexGabor",
             ("Value", "Phase", "Intensity"), {"gabor_type": _dimensions}, ((4, 3), "Gabor came with 4.3"),
             Vector='vector', Scale=1.3, Frequency=2.2, Anisotropy=_anisotropy, Orientation_2D=0.6,
             Orientation_3D=(0.4, -0.7, 0.9))
_TILING = ("Segment Coordinates", "Segment ID", "Segment Rotation", "Segment Width")
_TILING_CAME = ((5, 0), "Radial Tiling came with 5.0")
for _sides in (2.0, 2.3, 3.0, 4.6, 5.0, 7.95, 12.0):
    for _roundness in (0.0, 0.35, 0.9, 1.0):
        if _sides == 2.0 and 0.0 < _roundness < 1.0:
            continue  # Cycles has no numbers there
        for _unit in (False, True):
            # Sectors of whole numbers of sides are as wide as each other.
            _add(f"radial tiling {_sides}, round {_roundness}{' to 1' * _unit}", "ShaderNodeRadialTiling",
                 _TILING[:1] if _unit else _TILING[:3] if _sides % 1.0 == 0.0 else _TILING,
                 {"normalize": _unit}, _TILING_CAME, Vector='vector', Sides=_sides, Roundness=_roundness)
_add("radial tiling, sides vary", "ShaderNodeRadialTiling", _TILING, {"normalize": False}, _TILING_CAME,
     Vector='color', Sides=(2.05, 9.0), Roundness=0.4)
_add("radial tiling, roundness varies", "ShaderNodeRadialTiling", _TILING, {"normalize": True}, _TILING_CAME,
     Vector='vector', Sides=3.7, Roundness=(-0.2, 1.2))
_add("radial tiling, empty", "ShaderNodeRadialTiling", _TILING, {"normalize": True}, _TILING_CAME)
_add("brick", "ShaderNodeTexBrick", ("Color", "Fac"),
     {"offset": 0.4, "offset_frequency": 3, "squash": 0.6, "squash_frequency": 2}, Vector='vector',
     Color1=(0.8, 0.5, 0.2), Color2=(0.1, 0.3, 0.6), Mortar=(0.9, 0.9, 0.8), Scale=2.0, Mortar_Size=0.03,
     Mortar_Smooth=0.4, Bias=-0.2)
_add("brick, hard", "ShaderNodeTexBrick", ("Color",), {"squash": 1.0}, Vector='vector', Scale=1.5,
     Mortar_Size=0.02, Mortar_Smooth=0.0, Bias=0.1, Brick_Width=0.6, Row_Height=0.3)
_add("noise, no detail", "ShaderNodeTexNoise", ("Fac",), Scale=5.0, Detail=0.0)  # by Generated
_add("noise, all detail", "ShaderNodeTexNoise", ("Fac",), Vector='vector', Scale=1.0, Detail=15.0)


def _bend(node):
    """Give a curve node a shape of its own in each channel."""
    for number, curve in enumerate(node.mapping.curves):
        curve.points[0].location = (0.1, 0.05 * number)
        curve.points[-1].location = (0.9, 1.0 - 0.1 * number)
        curve.points.new(0.4, 0.7 - 0.1 * number)
    node.mapping.update()


def _goes_on(node):
    node.mapping.extend = 'EXTRAPOLATED'


for _node_type, _name, _input in (("ShaderNodeRGBCurve", "Color", "Fac"),
                                  ("ShaderNodeVectorCurve", "Vector", "Fac"),
                                  ("ShaderNodeFloatCurve", "Value", "Factor")):
    _source = (-0.2, 1.2) if _name == "Value" else 'color'
    _add(f"{_name} curve", _node_type, (_name,), {"bend": _bend}, **{_name: _source, _input: 0.7})
    _add(f"{_name} curve, going on", _node_type, (_name,), {"on": _goes_on, "bend": _bend},
         **{_name: _source, _input: 1.0})
_add("blackbody", "ShaderNodeBlackbody", ("Color",), Temperature=(500.0, 13000.0))
_add("blackbody, low", "ShaderNodeBlackbody", ("Color",), Temperature=(750.0, 2500.0))
_add("wavelength", "ShaderNodeWavelength", ("Color",), Wavelength=(370.0, 790.0))
for _interpolation in ("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP"):
    for _clamp in (False, True):
        _add(f"map range {_interpolation}{' clamped' * _clamp}", "ShaderNodeMapRange", ("Result",),
             {"interpolation_type": _interpolation, "clamp": _clamp}, Value=(-0.5, 1.7), From_Min=0.1,
             From_Max=1.2, To_Min=0.8, To_Max=-0.3, Steps=3.0)
    _add(f"map range {_interpolation} vector", "ShaderNodeMapRange", ("Vector",),
         {"data_type": 'FLOAT_VECTOR', "interpolation_type": _interpolation, "clamp": True},
         Vector='vector', From_Min=(-1.0, 0.0, 0.5), From_Max=(1.0, 0.5, -0.5), To_Min=(0.2, 0.3, 1.0),
         To_Max=(1.0, 0.6, 0.1), Steps=(2.0, 3.0, 4.0))
    for _clamp in (False, True):
        _add(f"map empty range {_interpolation}{' clamped' * _clamp}", "ShaderNodeMapRange", ("Result",),
             {"interpolation_type": _interpolation, "clamp": _clamp}, Value=(-0.5, 1.7), From_Min=0.6,
             From_Max=0.6, To_Min=0.8, To_Max=0.3, Steps=3.0)
        _add(f"map empty range {_interpolation} vector{' clamped' * _clamp}", "ShaderNodeMapRange",
             ("Vector",), {"data_type": 'FLOAT_VECTOR', "interpolation_type": _interpolation,
                           "clamp": _clamp}, Vector='vector', From_Min=(0.6, 0.0, 0.5),
             From_Max=(0.6, 0.5, 0.5), To_Min=(0.8, 0.3, 0.9), To_Max=(0.3, 0.6, 0.1), Steps=(2.0, 3.0, 4.0))
for _from in ("WORLD", "OBJECT", "CAMERA"):
    for _to in ("WORLD", "OBJECT", "CAMERA"):
        for _kind in ("POINT", "VECTOR", "NORMAL"):
            _add(f"vector transform {_kind} {_from} to {_to}", "ShaderNodeVectorTransform", ("Vector",),
                 {"vector_type": _kind, "convert_from": _from, "convert_to": _to}, Vector='vector')
for _kind in ("AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ"):
    for _invert in (False, True):
        _add(f"vector rotate {_kind}{' inverted' * _invert}", "ShaderNodeVectorRotate", ("Vector",),
             {"rotation_type": _kind, "invert": _invert}, Vector='vector', Center=(0.3, 0.2, -0.1),
             Axis=(0.2, -1.0, 0.7), Angle=0.8, Rotation=(0.3, -0.5, 1.1))
for _operation in ("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "MULTIPLY_ADD", "CROSS_PRODUCT", "PROJECT",
                   "REFLECT", "REFRACT", "FACEFORWARD", "DOT_PRODUCT", "DISTANCE", "LENGTH", "SCALE",
                   "NORMALIZE", "ABSOLUTE", "MINIMUM", "MAXIMUM", "FLOOR", "CEIL", "FRACTION", "MODULO",
                   "WRAP", "SNAP", "SINE", "COSINE", "TANGENT", "ROUND", "SIGN", "POWER"):
    _add(f"vector math {_operation}", "ShaderNodeVectorMath",
         ("Value",) if _operation in ("DOT_PRODUCT", "DISTANCE", "LENGTH") else ("Vector",),
         {"operation": _operation}, Vector='vector')
for _operation in ("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "MULTIPLY_ADD", "POWER", "LOGARITHM", "SQRT",
                   "INVERSE_SQRT", "ABSOLUTE", "EXPONENT", "MINIMUM", "MAXIMUM", "LESS_THAN", "GREATER_THAN",
                   "SIGN", "COMPARE", "SMOOTH_MIN", "SMOOTH_MAX", "ROUND", "FLOOR", "CEIL", "TRUNC", "FRACT",
                   "MODULO", "FLOORED_MODULO", "WRAP", "SNAP", "PINGPONG", "SINE", "COSINE", "TANGENT",
                   "ARCSINE", "ARCCOSINE", "ARCTANGENT", "ARCTAN2", "SINH", "COSH", "TANH", "RADIANS",
                   "DEGREES"):
    # Values that are neither ties nor poles nor below the emission's reach.
    _add(f"math {_operation}", "ShaderNodeMath", ("Value",), {"operation": _operation},
         Value=(-0.03, 0.05) if _operation == "DEGREES" else (-1.31, 1.43))
_add("math POWER clamped", "ShaderNodeMath", ("Value",), {"operation": 'POWER', "use_clamp": True},
     Value=(-0.3, 2.7))
_BLENDS = ("MIX", "DARKEN", "MULTIPLY", "BURN", "LIGHTEN", "SCREEN", "DODGE", "ADD", "OVERLAY", "SOFT_LIGHT",
           "LINEAR_LIGHT", "DIFFERENCE", "EXCLUSION", "SUBTRACT", "DIVIDE", "HUE", "SATURATION", "COLOR",
           "VALUE")
for _blend in _BLENDS:
    _add(f"mix {_blend}", "ShaderNodeMix", ("Result",), {"data_type": 'RGBA', "blend_type": _blend},
         Factor=0.6, A='color', B=(0.7, 0.3, 0.5))
    _add(f"mix {_blend}, the second varies", "ShaderNodeMixRGB", ("Color",),
         {"blend_type": _blend, "use_clamp": True}, Fac=0.8, Color1=(0.7, 0.3, 0.5), Color2='color')
    if _blend not in {"BURN", "DODGE", "SATURATION", "VALUE", "EXCLUSION"}:  # those are named in a warning
        # Factors below 0 and above 1 were clamped: off by up to half of them.
        _add(f"mix {_blend}, factor beyond", "ShaderNodeMix", ("Result",),
             {"data_type": 'RGBA', "blend_type": _blend, "clamp_factor": False}, Factor=(-0.5, 1.5), A='color',
             B=(0.7, 0.3, 0.5))
_add("mix MULTIPLY, factor beyond, clamped", "ShaderNodeMix", ("Result",),
     {"data_type": 'RGBA', "blend_type": 'MULTIPLY', "clamp_factor": False, "clamp_result": True},
     Factor=(-0.5, 1.5), A='color', B=(0.7, 0.3, 0.5))
_add("mix ADD, clamped", "ShaderNodeMix", ("Result",),
     {"data_type": 'RGBA', "blend_type": 'ADD', "clamp_result": True}, Factor=0.9, A='color',
     B=(0.7, 0.3, 0.5))
for _clamp in (False, True):
    _end = ", factor clamped" * _clamp
    _add(f"mix numbers{_end}", "ShaderNodeMix", ("Result",), {"data_type": 'FLOAT', "clamp_factor": _clamp},
         Factor=(-0.5, 1.5), A=0.2, B=0.9)
    _add(f"mix vectors{_end}", "ShaderNodeMix", ("Result",), {"data_type": 'VECTOR', "clamp_factor": _clamp},
         Factor=(-0.5, 1.5), A=(0.1, 0.5, 0.9), B='vector')
_add("mix vectors by vectors", "ShaderNodeMix", ("Result",),
     {"data_type": 'VECTOR', "factor_mode": 'NON_UNIFORM'}, Factor='color', A=(0.1, 0.5, 0.9), B='vector')
_add("invert", "ShaderNodeInvert", ("Color",), Fac=0.7, Color='color')
_add("gamma", "ShaderNodeGamma", ("Color",), Gamma=1.7, Color='color')
_add("hue, saturation, value", "ShaderNodeHueSaturation", ("Color",), Hue=0.3, Saturation=1.4, Value=0.8, Fac=0.9,
     Color='color')
_add("bright, contrast", "ShaderNodeBrightContrast", ("Color",), Bright=0.1, Contrast=0.4, Color='color')
_add("RGB to BW", "ShaderNodeRGBToBW", ("Val",), Color='color')
_add("clamp", "ShaderNodeClamp", ("Result",), {"clamp_type": 'MINMAX'}, Value=(-0.5, 1.5), Min=0.1, Max=0.8)
_add("clamp, ends exchanged", "ShaderNodeClamp", ("Result",), {"clamp_type": 'RANGE'}, Value=(-0.5, 1.5),
     Min=0.8, Max=0.1)
for _kind in ("POINT", "TEXTURE", "VECTOR", "NORMAL"):
    _add(f"mapping {_kind}", "ShaderNodeMapping", ("Vector",), {"vector_type": _kind}, Vector='vector',
         Location=(0.2, -0.3, 0.4), Rotation=(0.5, 0.6, 0.7), Scale=(1.5, 0.5, -2.0))
_add("checker", "ShaderNodeTexChecker", ("Color", "Fac"), Vector='vector', Scale=1.7, Color1=(0.8, 0.5, 0.2),
     Color2=(0.1, 0.3, 0.6))
_add("normal", "ShaderNodeNormal", ("Normal", "Dot"), Normal='vector')
_add("separate XYZ", "ShaderNodeSeparateXYZ", ("X", "Y", "Z"), Vector='vector')
_add("combine XYZ", "ShaderNodeCombineXYZ", ("Vector",), X=(0.0, 1.0), Y=0.3, Z=(1.0, 0.0))


def _ramp(interpolation, mode='RGB', hue='NEAR'):
    """Give a Color Ramp four colours, and how it goes from one to the next."""
    def set_up(node):
        ramp = node.color_ramp
        ramp.color_mode, ramp.hue_interpolation = mode, hue
        if mode == 'RGB':
            ramp.interpolation = interpolation
        ramp.elements[0].color, ramp.elements[1].color = (0.9, 0.2, 0.1, 1.0), (0.2, 0.3, 0.9, 0.5)
        ramp.elements.new(0.3).color = (0.1, 0.8, 0.3, 0.2)
        ramp.elements.new(0.6).color = (0.7, 0.7, 0.1, 0.9)
    return set_up


for _interpolation in ("EASE", "CARDINAL", "LINEAR", "B_SPLINE", "CONSTANT"):
    _add(f"ramp {_interpolation}", "ShaderNodeValToRGB", ("Color", "Alpha"), {"ramp": _ramp(_interpolation)},
         Fac=(-0.2, 1.2))
for _mode, _hue in (("HSV", "NEAR"), ("HSV", "CW"), ("HSL", "FAR"), ("HSL", "CCW")):
    _add(f"ramp {_mode} {_hue}", "ShaderNodeValToRGB", ("Color",), {"ramp": _ramp("", _mode, _hue)},
         Fac=(0.0, 1.0))
_add("fresnel", "ShaderNodeFresnel", ("Fac",), IOR=(1.1, 2.5))
_add("layer weight", "ShaderNodeLayerWeight", ("Fresnel",), Blend=(0.1, 0.9))


def _other_object(node):
    """Point a Texture Coordinate node at an object that is moved, turned and scaled."""
    import bpy
    import scenes
    node.object = bpy.data.objects.get("Other") or scenes.link("Other", None)
    node.object.location, node.object.rotation_euler = (0.3, 0.2, -0.5), (0.4, 0.7, -0.2)
    node.object.scale = (3.0, 5.0, 4.0)


_add("coordinates of another object", "ShaderNodeTexCoord", ("Object",), {"object": _other_object})
_add("camera data", "ShaderNodeCameraData", ("View Vector", "View Z Depth", "View Distance"))
_add("wireframe", "ShaderNodeWireframe", ("Fac",), Size=0.3)
_add("wireframe, pixels", "ShaderNodeWireframe", ("Fac",), {"use_pixel_size": True}, Size=6.0)
_add("light falloff", "ShaderNodeLightFalloff", ("Quadratic", "Linear", "Constant"), Strength=0.1,
     Smooth=(0.0, 4.0))
for _mode in ("RGB", "HSV", "HSL"):
    _add(f"separate {_mode}", "ShaderNodeSeparateColor", ("Red", "Green", "Blue"), {"mode": _mode},
         Color='color')
    _add(f"combine {_mode}", "ShaderNodeCombineColor", ("Color",), {"mode": _mode}, Red=(0.0, 1.0),
         Green=(0.2, 0.7), Blue=0.6)


# Inside Blender ------------------------------------------------------------------------------------

def _stage():
    """A scene before an orthographic camera, with sharp pixels in both engines."""
    import scenes
    scene = scenes.empty(size=(GRID * SIZE, GRID * SIZE), samples=1)
    scenes.camera(location=(0.0, -6.0, 0.0), type='ORTHO', ortho_scale=GRID * CELL, clip_start=1e-4)
    scene.volley.pixel_filter_type, scene.volley.filter_width = 'BOX', 0.01
    scene.cycles.pixel_filter_type = 'BOX'
    scene.cycles.filter_width = 0.01


def _panel(number):
    """A plane that fills one cell of the picture, as an object that is moved, turned and scaled: its
    material's tree, its middle."""
    import bpy
    import scenes
    center = tuple((i - 0.5 * (GRID - 1)) * CELL for i in (number % GRID, number // GRID))
    corners = [(-1, 0, -0.5), (-1, 0, 0.5), (1, 0, 0.5), (1, 0, -0.5)]
    made = scenes.mesh(f"Panel{number}", corners, [(3, 2, 1, 0)])
    made.location, made.rotation_euler = (center[0], 0.0, center[1]), (0.0, 0.5 * np.pi, 0.0)
    made.scale = (0.5 * CELL, 1.0, CELL)
    material = bpy.data.materials.new(f"Panel{number}")
    material.use_nodes = True
    made.data.materials.append(material)
    return material.node_tree, (center[0], 0.0, center[1])


def _node(tree, kind, *links, **settings):
    """A new node, its inputs linked to these outputs in order or set to these values."""
    made = tree.nodes.new(kind)
    for key, value in settings.items():
        setattr(made, key, value)
    for socket, source in zip(made.inputs, links):
        if isinstance(source, tuple):
            socket.default_value = source
        elif source is not None:
            tree.links.new(source, socket)
    return made


def _feed(tree, kind, center):
    """The output that an input of that kind is linked to. Places are those of the pixels' corners from
    the panel's middle, the same in both engines wherever in a pixel they sample, turned to vary along
    all axes."""
    place = _node(tree, "ShaderNodeNewGeometry").outputs["Position"]
    step = (0.25, 0.0, 0.25) if kind in {'cells', 'whole'} else (PIXEL, 0.0, PIXEL)
    place = _node(tree, "ShaderNodeVectorMath", place, step, operation='SNAP').outputs[0]
    place = _node(tree, "ShaderNodeVectorMath", place, center, operation='SUBTRACT').outputs[0]
    if kind == 'cells':
        parts = _node(tree, "ShaderNodeSeparateXYZ", place).outputs
        return _node(tree, "ShaderNodeCombineXYZ", parts["X"], parts["Z"], parts["X"]).outputs[0]
    if kind == 'vector':
        return _node(tree, "ShaderNodeMapping", place, (0.1, 0.2, 0.3), (0.3, 0.5, 0.7)).outputs[0]
    if kind == 'color':
        return _node(tree, "ShaderNodeMapping", place, (0.5, 0.4, 0.6), (0.3, 0.5, 0.7),
                     (0.2, 0.2, 0.2)).outputs[0]
    x = _node(tree, "ShaderNodeSeparateXYZ", place).outputs["X"]
    if kind in {'number', 'whole'}:
        return x
    low, high = kind
    ramp = _node(tree, "ShaderNodeMapRange", x, clamp=False)
    for name, value in (("From Min", -0.5 * CELL), ("From Max", 0.5 * CELL), ("To Min", low), ("To Max", high)):
        ramp.inputs[name].default_value = value
    return ramp.outputs[0]


_OTHER_INPUTS = {"ShaderNodeVectorMath": ((0.3, -0.4, 0.5), (0.1, 0.9, -0.2), 0.7),
                 "ShaderNodeMath": (0.7, 0.3)}


def _build(tree, center, case, output):
    """The node of a case, shown by an emission of its output, halved and raised by 2 for neither
    engine's clamping to matter."""
    node_type, properties, inputs, _ = case
    tree.nodes.clear()
    shown = _node(tree, "ShaderNodeVectorMath", None, (0.5,) * 3, (2.0,) * 3, operation='MULTIPLY_ADD')
    emission = _node(tree, "ShaderNodeEmission", shown.outputs[0])
    _node(tree, "ShaderNodeOutputMaterial", emission.outputs[0])
    node = tree.nodes.new(node_type)
    for key, value in properties.items():
        if callable(value):
            value(node)
        else:
            setattr(node, key, value)
    # Inputs of one name:
    for socket, value in zip(node.inputs[1:], _OTHER_INPUTS.get(node_type, ())):
        socket.default_value = value
    for key, value in inputs.items():
        socket = next((s for s in node.inputs if key in (s.name, s.identifier) and s.enabled), None)
        if socket is None:  # not in this mode
            continue
        if isinstance(value, str) or (isinstance(value, tuple) and len(value) == 2):
            tree.links.new(_feed(tree, value, center), socket)
        elif isinstance(value, tuple) and len(value) == 3 and socket.type == 'RGBA':
            socket.default_value = (*value, 1.0)
        else:
            socket.default_value = value
    tree.links.new(next(s for s in node.outputs if output in (s.name, s.identifier) and s.enabled), shown.inputs[0])


def _is_known(node_type, properties):
    """Whether this Blender has the node and its properties; what is called is none."""
    import scenes
    return scenes.has_node(node_type, settings={key: value for key, value in properties.items()
                                                if not callable(value)})


def inside_cases(names):
    """{(case, output): (picture by Volley, picture by Cycles)}."""
    import scenes
    known = [name for name in names if _is_known(*CASES[name][:2])]
    shown = [(name, output) for name in known for output in CASES[name][3]]
    pictures = {}
    for start in range(0, len(shown), GRID * GRID):
        _stage()
        part = shown[start:start + GRID * GRID]
        for number, (name, output) in enumerate(part):
            _build(*_panel(number), CASES[name], output)
        pair = []
        for engine in ('VOLLEY', 'CYCLES'):
            scenes.set_engine(engine, 1)
            pair.append((scenes.render()[..., :3] - 2.0) * 2.0)
        for number, key in enumerate(part):
            x, y = number % GRID * SIZE, number // GRID * SIZE
            pictures[key] = [picture[y:y + SIZE, x:x + SIZE] for picture in pair]
    return pictures


# Of a plane before an orthographic camera.
_CONSTANT = {"View Z Depth", "Quadratic", "Linear", "Constant"}


# Comparison ----------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def pictures(blender_of_module):
    """All cases from one Blender, and the table of their errors."""
    found = blender_of_module.run(inside_cases, list(CASES), timeout=600)
    lines = [f"{'node':40} {'output':10} {'mean':>9} {'mean error':>10} {'largest':>9} {'beyond':>8}"]
    errors = {}
    for (name, output), (ours, theirs) in found.items():
        error = np.abs(ours - theirs)
        errors[f"{name} {output}"] = error.mean() / max(1.0, np.abs(theirs).mean())
        lines.append(f"{name:40} {output:10} {theirs.mean():9.4f} {error.mean():10.2e} "
                     f"{error.max():9.2e} {_beyond(ours, theirs):8.3%}")
    blender_support.write_result("textures", lines, errors)
    return found


def _beyond(ours, theirs):
    """The share of pixels beyond the tolerance."""
    limit = TOLERANCE * np.maximum(np.abs(theirs), 1.0)
    return (~(np.abs(ours - theirs) <= limit)).any(axis=-1).mean()


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=[pytest.mark.since(*_SINCE[name])] if name in _SINCE else []) for name in CASES])
def test_against_cycles(pictures, name):
    shown = {output: pair for (case, output), pair in pictures.items() if case == name}
    if not shown:
        pytest.skip("this Blender has no such node")
    for output, (ours, theirs) in shown.items():
        is_even = output in _CONSTANT or "empty" in name
        assert theirs.std() > 1e-3 or is_even, f"{output}: the picture shows nothing"
        assert _beyond(ours, theirs) <= 1.0 - SHARE_WITHIN, output


# The mapping inside a texture: (node, settings of the mapping, whether its vector is linked).
MAPPINGS = {
    "moved noise": ("ShaderNodeTexNoise", {"translation": (0.3, 0.1, 0.2), "scale": (2.0, 0.5, 1.5)}, True),
    "turned wave": ("ShaderNodeTexWave", {"rotation": (0.3, 0.5, 0.7), "vector_type": 'TEXTURE'}, True),
    "swapped axes": ("ShaderNodeTexGradient", {"mapping_x": 'Z', "mapping_z": 'NONE'}, True),
    "vector": ("ShaderNodeTexMagic", {"scale": (0.5, 2.0, 1.0), "vector_type": 'VECTOR'}, True),
    "normal": ("ShaderNodeTexGradient", {"scale": (0.5, 2.0, 1.0), "vector_type": 'NORMAL'}, True),
    "generated": ("ShaderNodeTexChecker", {"scale": (2.0, 3.0, 1.5)}, False),
    "uv": ("ShaderNodeTexImage", {"scale": (2.0, 3.0, 1.0), "translation": (0.2, 0.1, 0.0)}, False),
    "position": ("ShaderNodeTexEnvironment", {"rotation": (0.4, 0.2, 0.6)}, False)}


def inside_own_mappings():
    """{case: pair of pictures}."""
    import bpy
    import scenes
    pixels = np.ones((64, 64, 4), np.float32)
    pixels[..., 0], pixels[..., 1] = np.mgrid[:64, :64] / 64.0
    pictures = {}
    _stage()
    image = bpy.data.images.new("Grid", 64, 64)
    image.pixels.foreach_set(pixels.ravel())
    for number, (kind, settings, is_linked) in enumerate(MAPPINGS.values()):
        tree, center = _panel(number)
        tree.nodes.clear()
        node = tree.nodes.new(kind)
        if hasattr(node, "image"):
            node.image = image
        for name, value in settings.items():
            setattr(node.texture_mapping, name, value)
        if is_linked:
            tree.links.new(_feed(tree, 'vector', center), node.inputs["Vector"])
        emission = _node(tree, "ShaderNodeEmission", node.outputs["Color"])
        _node(tree, "ShaderNodeOutputMaterial", emission.outputs[0])
    pair = []
    for engine in ('VOLLEY', 'CYCLES'):
        scenes.set_engine(engine, 1)
        pair.append(scenes.render()[..., :3])
    for number, name in enumerate(MAPPINGS):
        x, y = number % GRID * SIZE, number // GRID * SIZE
        pictures[name] = [picture[y:y + SIZE, x:x + SIZE] for picture in pair]
    return pictures


def test_own_mappings(blender):
    """What texture nodes keep inside, without a panel: files of old Blenders have it."""
    for name, (ours, theirs) in blender.run(inside_own_mappings).items():
        assert theirs.std() > 1e-2, name
        assert (np.abs(ours - theirs) > 0.01).any(axis=-1).mean() <= 0.02, name
