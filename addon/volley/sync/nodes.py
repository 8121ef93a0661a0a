# SPDX-License-Identifier: GPL-3.0-or-later
"""What each node type means in the library's terms.

``translate`` gives the values of a node's outputs. Most nodes are a line in ``_SPECS``: the library's
type, the inputs in the library's order with Blender's socket identifiers (old and new names), and the
outputs. The rest have a function. A node in neither table is not supported.
"""

from collections import namedtuple

import numpy as np

from ..abi import (AttributeMode, BlendMode, BumpMode, ClampType, CoordinateMode, DiffuseModel, DistributionType,
                   EnvironmentProjection, HairComponent, ImageExtension, ImageInterpolation, ImageProjection,
                   MappingType, MathOperation as Math, ModeFlags, NodeType, NormalMapFlags, NormalMapSpace, Pigment,
                   PrincipledHairMode, RampInterpolation, SeparateMode, SpaceId, TableSize, TangentSource,
                   ToonComponent, VectorOperation as Vector)
from ..compat import (CLAMPS_ROUGHNESS, CURVES_NORMAL_BUMPS, HAS_CORRELATED_MICROFACETS, HAS_FAR_WORLDS,
                      HAS_FILMED_METAL, HAS_HAIR_ALBEDO, HAS_UNIT_NORMALS, HAS_WHOLE_COAT, KEEPS_DIFFUSE_ENERGY,
                      LEAVES_BUMPS, LEVELS_COLOR_BUMPS, RAMP_STEPS, SCALES_NORMAL_MAPS, TURNS_WINDOW_BUMPS)
from . import standard_attributes, tangents
from .attribute_values import excess_name, lack_name
from .converters import (CONVERTERS, instance_value, normal_to_world, own_number, point_to_world, strand_normal,
                         strand_radius, strand_random)
from .derived import ISLAND, POINTINESS
from .image import image_color
from .instance import VALUES_GENERATED, VALUES_UV
from .node_list import absent, arranged, input_kinds, input_number, named_outputs, output
from .texture_mapping import mapped
from .textures import TEXTURES
from .values import CONSTANT, DEFAULT, Value
from .working_space import from_rec709_matrix, is_rec709

_TANGENT_AXES = {'X': TangentSource.X, 'Y': TangentSource.Y, 'Z': TangentSource.Z}

_DISTRIBUTIONS = {
    'GGX': DistributionType.GGX, 'MULTI_GGX': DistributionType.MULTI_GGX,
    'BECKMANN': DistributionType.BECKMANN, 'SHARP': DistributionType.SHARP,
    'ASHIKHMIN_SHIRLEY': DistributionType.ASHIKHMIN}
_CORRELATED = DistributionType.CORRELATED if HAS_CORRELATED_MICROFACETS else 0
_LAYERED_MODES = ((DistributionType.FILMED_METAL if HAS_FILMED_METAL else 0) |
                  (DistributionType.WHOLE_COAT if HAS_WHOLE_COAT else 0))

_BLENDS, _MATH_OPERATIONS = BlendMode.__members__, Math.__members__
_BENT_BLENDS = {'BURN', 'DODGE', 'SATURATION', 'VALUE', 'EXCLUSION'}  # whose colours are not linear in the factor
_VECTOR_OPERATIONS = {
    **Vector.__members__, 'CROSS_PRODUCT': Vector.CROSS,
    'DOT_PRODUCT': Vector.DOT, 'FRACTION': Vector.FRACT}

_INTERPOLATIONS = {
    'Linear': ImageInterpolation.LINEAR, 'Closest': ImageInterpolation.CLOSEST,
    'Cubic': ImageInterpolation.CUBIC, 'Smart': ImageInterpolation.CUBIC}
_EXTENSIONS = {'REPEAT': ImageExtension.REPEAT, 'EXTEND': ImageExtension.EXTEND, 'CLIP': ImageExtension.CLIP,
               'MIRROR': ImageExtension.MIRROR}
_PROJECTIONS = ImageProjection.__members__
_ANISOTROPIC = {  # where anisotropy and tangent stand
    kind: (input_number(kind, name), input_number(kind, "tangent"))
    for kind, name in ((NodeType.GLOSSY, "anisotropy"), (NodeType.PRINCIPLED, "anisotropic"),
                       (NodeType.LAYERED_PRINCIPLED, "anisotropic"))}

# inputs, outputs: identifiers of Blender's sockets in the library's order; mode(node): mode bits or None
# where the node is set to something unsupported.
Spec = namedtuple("Spec", "type inputs outputs mode", defaults=(None,))

# Socket names of the Principled shader in the library's order: of 3.4 ...
_PRINCIPLED_INPUTS = (
    "Base Color", "Subsurface", "Subsurface Color", "Metallic",
    "Specular", "Specular Tint", "Roughness", "Anisotropic",
    "Anisotropic Rotation", "Sheen", "Sheen Tint", "Clearcoat",
    "Clearcoat Roughness", "IOR", "Transmission", "Transmission Roughness",
    "Emission", "Emission Strength", "Alpha", "Normal",
    "Clearcoat Normal", "Tangent")

# ... and from 4.0 on.
_LAYERED_INPUTS = (
    "Base Color", "Metallic", "Roughness", "IOR", "Alpha",
    "Normal", "Diffuse Roughness", "Specular IOR Level", "Specular Tint",
    "Anisotropic", "Anisotropic Rotation", "Tangent",
    "Transmission Weight", "Coat Weight", "Coat Roughness", "Coat IOR",
    "Coat Tint", "Coat Normal", "Sheen Weight", "Sheen Roughness",
    "Sheen Tint", "Emission Color", "Emission Strength",
    "Thin Film Thickness", "Thin Film IOR")

_SHADER = ("BSDF",)


_CLAMPED_ROUGHNESS = {NodeType.GLOSSY, NodeType.GLASS}


def _distribution(node):
    return _DISTRIBUTIONS.get(getattr(node, "distribution", 'GGX'))


def _microfacets(node):
    """A distribution with the model of this Blender's Cycles."""
    distribution = _distribution(node)
    return None if distribution is None else distribution | _CORRELATED


def _layered(node):
    """The mode of the layered Principled."""
    is_multiple = _distribution(node) == DistributionType.MULTI_GGX
    return (DistributionType.MULTI_GGX if is_multiple else DistributionType.GGX) | _LAYERED_MODES


def _diffuse_model(_node):
    return DiffuseModel.KEEPS_ENERGY if KEEPS_DIFFUSE_ENERGY else DiffuseModel.LOSES_ENERGY


def _mode(mode):
    """The mode of a node without settings."""
    return lambda _node: mode


def _color_mode(node):
    """RGB, HSV or HSL of the Separate and Combine Color nodes."""
    return SeparateMode[getattr(node, "mode", 'RGB')]


def _math_mode(node):
    operation = 'WRAP' if node.operation == 'FLOORED_MODULO' else node.operation
    if operation not in _MATH_OPERATIONS:
        return None
    return _MATH_OPERATIONS[operation] | (ModeFlags.CLAMP if node.use_clamp else 0)


def _vector_math_mode(node):
    return _VECTOR_OPERATIONS.get(node.operation)


def _mix_rgb_mode(node):
    if node.blend_type not in _BLENDS:
        return None
    return _BLENDS[node.blend_type] | (ModeFlags.CLAMP if node.use_clamp else 0)


_SPECS = {
    "ShaderNodeBsdfDiffuse": Spec(NodeType.DIFFUSE, ("Color", "Roughness", "Normal"), _SHADER, _diffuse_model),
    "ShaderNodeBsdfGlossy": Spec(
        NodeType.GLOSSY, ("Color", "Roughness", "Anisotropy", "Rotation", "Normal", "Tangent"), _SHADER,
        _microfacets),
    "ShaderNodeBsdfGlass": Spec(
        NodeType.GLASS, ("Color", "Roughness", "IOR", "Normal", "Thin Film Thickness", "Thin Film IOR"), _SHADER,
        _microfacets),
    "ShaderNodeBsdfRefraction": Spec(
        NodeType.REFRACTION, ("Color", "Roughness", "IOR", "Normal"), _SHADER, _microfacets),
    "ShaderNodeBsdfTransparent": Spec(NodeType.TRANSPARENT, ("Color",), _SHADER),
    "ShaderNodeBsdfTranslucent": Spec(NodeType.TRANSLUCENT, ("Color", "Normal"), _SHADER),
    "ShaderNodeBsdfVelvet": Spec(NodeType.VELVET, ("Color", "Sigma", "Normal"), _SHADER),
    "ShaderNodeBsdfToon": Spec(
        NodeType.TOON, ("Color", "Size", "Smooth", "Normal"), _SHADER,
        lambda node: ToonComponent[node.component]),
    "ShaderNodeBsdfHair": Spec(
        NodeType.HAIR, ("Color", "Offset", "RoughnessU", "RoughnessV", "Tangent"), _SHADER,
        lambda node: HairComponent[node.component.upper()]),
    # Without a linked direction, which is 0 then, the ray keeps its own.
    "ShaderNodeBsdfRayPortal": Spec(NodeType.RAY_PORTAL, ("Color", "Position", "Direction"), _SHADER),
    "ShaderNodeEmission": Spec(NodeType.EMISSION, ("Color", "Strength"), ("Emission",)),
    "ShaderNodeBackground": Spec(NodeType.BACKGROUND, ("Color", "Strength"), ("Background",)),
    "ShaderNodeMixShader": Spec(NodeType.MIX_SHADER, ("Fac", "Shader", "Shader_001"), ("Shader",)),
    "ShaderNodeAddShader": Spec(NodeType.ADD_SHADER, ("Shader", "Shader_001"), ("Shader",)),
    "ShaderNodeHoldout": Spec(NodeType.HOLDOUT, (), ("Holdout",)),
    "ShaderNodeMapping": Spec(
        NodeType.MAPPING, ("Vector", "Location", "Rotation", "Scale"), ("Vector",),
        lambda node: MappingType[node.vector_type]),
    "ShaderNodeMixRGB": Spec(NodeType.MIX_COLOR, ("Fac", "Color1", "Color2"), ("Color",), _mix_rgb_mode),
    "ShaderNodeVectorMath": Spec(
        NodeType.VECTOR_MATH, ("Vector", "Vector_001", "Vector_002", "Scale"), ("Vector", "Value"),
        _vector_math_mode),
    "ShaderNodeFresnel": Spec(NodeType.FRESNEL, ("IOR", "Normal"), ("Fac",)),
    "ShaderNodeLayerWeight": Spec(NodeType.LAYER_WEIGHT, ("Blend", "Normal"), ("Fresnel", "Facing")),
    "ShaderNodeInvert": Spec(NodeType.INVERT, ("Fac", "Color"), ("Color",)),
    "ShaderNodeGamma": Spec(NodeType.GAMMA, ("Color", "Gamma"), ("Color",)),
    "ShaderNodeHueSaturation": Spec(
        NodeType.HUE_SATURATION, ("Hue", "Saturation", "Value", "Fac", "Color"), ("Color",)),
    "ShaderNodeBrightContrast": Spec(NodeType.BRIGHT_CONTRAST, ("Color", "Bright", "Contrast"), ("Color",)),
    "ShaderNodeSeparateXYZ": Spec(NodeType.SEPARATE, ("Vector",), ("X", "Y", "Z"), _mode(SeparateMode.XYZ)),
    "ShaderNodeSeparateRGB": Spec(NodeType.SEPARATE, ("Image",), ("R", "G", "B")),
    "ShaderNodeSeparateColor": Spec(NodeType.SEPARATE, ("Color",), ("Red", "Green", "Blue"), _color_mode),
    "ShaderNodeSeparateHSV": Spec(NodeType.SEPARATE, ("Color",), ("H", "S", "V"), _mode(SeparateMode.HSV)),
    "ShaderNodeCombineHSV": Spec(NodeType.COMBINE, ("H", "S", "V"), ("Color",), _mode(SeparateMode.HSV)),
    "ShaderNodeCombineXYZ": Spec(NodeType.COMBINE, ("X", "Y", "Z"), ("Vector",), _mode(SeparateMode.XYZ)),
    "ShaderNodeCombineRGB": Spec(NodeType.COMBINE, ("R", "G", "B"), ("Image",)),
    "ShaderNodeCombineColor": Spec(NodeType.COMBINE, ("Red", "Green", "Blue"), ("Color",), _color_mode),
    "ShaderNodeClamp": Spec(
        NodeType.CLAMP, ("Value", "Min", "Max"), ("Result",), lambda node: ClampType[node.clamp_type]),
    "ShaderNodeTexChecker": Spec(
        NodeType.CHECKER, ("Vector", "Color1", "Color2", "Scale"), ("Color", "Fac")),
    "ShaderNodeObjectInfo": Spec(
        NodeType.OBJECT_INFO, (), ("Location", "Color", "Alpha", "Object Index", "Material Index", "Random")),
    "ShaderNodePointInfo": Spec(NodeType.POINT_INFO, (), ("Position", "Radius", "Random")),
}
_SPECS["ShaderNodeBsdfAnisotropic"] = _SPECS["ShaderNodeBsdfGlossy"]


def translate(walker, node, path):
    """The outputs of a node as {socket identifier: Value}; nothing for an unsupported one."""
    sockets = Sockets(walker, node, path)
    _note_film(walker, sockets)
    special = next((table[node.bl_idname] for table in (_SPECIAL, TEXTURES, CONVERTERS)
                    if node.bl_idname in table), None)
    if special is not None:
        outputs = special(walker, node, sockets)
        return _unsupported(walker, node, sockets) if outputs is None else outputs
    spec = _SPECS.get(node.bl_idname)
    mode = None if spec is None else 0 if spec.mode is None else spec.mode(node)
    if mode is None:
        return _unsupported(walker, node, sockets)
    values = sockets.all_of(spec.type, spec.inputs)
    if CLAMPS_ROUGHNESS and spec.type in _CLAMPED_ROUGHNESS:
        roughness = spec.inputs.index("Roughness")
        values[roughness] = _clamped(walker, values[roughness], True)
    _note_generated(walker, node, spec.type, values)
    return named_outputs(walker.emit(spec.type, values, mode), spec.type, spec.outputs, mode)


def _note_film(walker, sockets):
    """Thin films are computed for the wavelengths that channels of Rec.709 see, and converted."""
    if not is_rec709() and sockets.find("Thin Film Thickness") is not None:
        walker.flat.film_colors = from_rec709_matrix()


def _note_generated(walker, node, node_type, values):
    """Ask for Generated coordinates where a node's tangent goes around them."""
    if node_type == NodeType.GEOMETRY:
        is_needed = node.outputs["Tangent"].is_linked
    elif node_type in _ANISOTROPIC:  # around the Z axis of Generated by default
        anisotropy, tangent = (values[i] for i in _ANISOTROPIC[node_type])
        is_isotropic = anisotropy.node == CONSTANT and anisotropy.constant[0] == 0.0
        is_needed = tangent.node == DEFAULT and not is_isotropic
    else:
        is_needed = False
    walker.flat.needs_generated |= is_needed


class Sockets:
    """The inputs of one node by identifier."""

    def __init__(self, walker, node, path):
        self._walker, self._node, self._path = walker, node, path
        self._by_name = {socket.identifier: socket for socket in node.inputs}

    def find(self, *names):
        """The first socket of those names, None without one."""
        return next((self._by_name[name] for name in names if name in self._by_name), None)

    def get(self, kind, *names):
        """The value of the first socket of those names; one that this Blender lacks is absent."""
        socket = self.find(*names)
        if socket is None:
            return absent(kind)
        value = self._walker.convert(self._walker.input_value(socket, self._path), kind)
        return mapped(self._walker, self._node, value) if socket.identifier == "Vector" else value

    def all_of(self, node_type, names):
        """The values of a library type's inputs from the sockets of those names."""
        return [self.get(kind, name) for kind, name in zip(input_kinds(node_type), names, strict=True)]

    def is_linked(self, *names):
        """Whether something is linked to it."""
        socket = self.find(*names)
        return socket is not None and self._walker.is_linked(socket)


def _constant(kind, x, y=None, z=None):
    if kind == 'f':
        return Value('f', CONSTANT, 0, (x, 0.0, 0.0))
    return Value(kind, CONSTANT, 0, (x, x if y is None else y, x if z is None else z))


def _number(walker, operation, *values):
    """A MATH node's result as a Value."""
    values = list(values) + [_constant('f', 0.0)] * (3 - len(values))
    return Value('f', walker.emit(NodeType.MATH, values, operation), 0)


def _vector(walker, operation, *values):
    """A VECTOR_MATH node's vector result as a Value."""
    values = list(values) + [_constant('v', 0.0)] * (3 - len(values)) + [_constant('f', 0.0)]
    return Value('v', walker.emit(NodeType.VECTOR_MATH, values, operation), 0)


def _unsupported(walker, node, sockets):
    """Name the node in the warnings and give the fallback's outputs."""
    shader = next((s for s in node.outputs if s.type == 'SHADER'), None)
    if shader is not None:
        if sockets.find("Color", "Base Color") is None:
            walker.warn(f"{node.bl_label} is not supported and is left out")
            return {}
        walker.warn(f"{node.bl_label} is not supported, a diffuse of its colour is used")
        values = (sockets.get('c', "Color", "Base Color"), _constant('f', 0.0),
                  sockets.get('v', "Normal"))
        return {shader.identifier: Value('s', walker.emit(NodeType.DIFFUSE, values), 0)}
    setting = next((getattr(node, name) for name in ("operation", "mode", "blend_type")
                    if node.bl_idname in _SPECS and hasattr(node, name)), "")
    detail = f" ({setting})" if setting else ""
    walker.warn(f"{node.bl_label}{detail} is not supported, the values of the sockets it feeds are used")
    return {}


# Nodes with a function of their own --------------------------------------------------------------

def _principled(walker, node, sockets):
    """Principled of 3.4, or the layers of 4.0 and later."""
    is_layered = sockets.find("Specular IOR Level") is not None
    kind = NodeType.LAYERED_PRINCIPLED if is_layered else NodeType.PRINCIPLED
    inputs = _LAYERED_INPUTS if is_layered else _PRINCIPLED_INPUTS
    values = sockets.all_of(kind, inputs)
    _name_missing(walker, sockets)
    _note_generated(walker, node, kind, values)
    mode = _layered(node) if is_layered else _distribution(node) or 0
    if _is_thin(sockets):
        mode |= DistributionType.THIN_WALL
    return {"BSDF": Value('s', walker.emit(kind, values, mode), 0)}


def emit_default_principled(walker):
    """Append a layered Principled as it is when it is added; returns its index."""
    one, half = _constant('f', 1.0), _constant('f', 0.5)
    values = arranged(NodeType.LAYERED_PRINCIPLED, {
        "base_color": _constant('c', 0.8, 0.8, 0.8), "roughness": half, "ior": _constant('f', 1.5), "alpha": one,
        "specular_ior_level": half, "specular_tint": _constant('c', 1.0, 1.0, 1.0)})
    return walker.emit(NodeType.LAYERED_PRINCIPLED, values, DistributionType.MULTI_GGX | _LAYERED_MODES)


def _is_thin(sockets):
    """Whether Principled of Blender 5.2 is a thin wall everywhere."""
    if sockets.find("Thin Wall") is None:
        return False
    value = sockets.get('f', "Thin Wall")
    return value.node == CONSTANT and value.constant[0] > 0.0


def _name_missing(walker, sockets):
    """Warn of inputs of Principled that are in use and mean something else here, or nothing."""
    for name in ("Subsurface", "Subsurface Weight"):
        if sockets.find(name) is None:
            continue
        value = sockets.get('f', name)
        if value.node != CONSTANT or value.constant[0] > 0.0:
            walker.warn(f"Principled BSDF: {name} is rendered as diffuse")
    if sockets.find("Thin Wall") is not None and sockets.get('f', "Thin Wall").node != CONSTANT:
        walker.warn("Principled BSDF: a Thin Wall that is linked is rendered as a solid")


def _metallic(walker, node, sockets):
    """The Metallic shader of 4.3: the metal of Principled, by its colours or by its complex index."""
    mode = (DistributionType.BECKMANN if node.distribution == 'BECKMANN' else _layered(node)) | _LAYERED_MODES
    if node.fresnel_type == 'F82':
        base, edge = sockets.get('c', "Base Color"), sockets.get('c', "Edge Tint")
    else:
        base, edge = sockets.get('c', "IOR"), sockets.get('c', "Extinction")
        mode |= DistributionType.CONDUCTOR
        film = sockets.get('f', "Thin Film Thickness")
        if HAS_FILMED_METAL and (film.node != CONSTANT or film.constant[0] > 0.0):
            walker.warn("Metallic BSDF: a physical conductor under a film is approximated by its colours")
    one = _constant('f', 1.0)
    values = arranged(NodeType.LAYERED_PRINCIPLED, {
        "base_color": base, "metallic": one, "roughness": sockets.get('f', "Roughness"), "ior": one,
        "alpha": one, "normal": sockets.get('v', "Normal"), "specular_tint": edge,
        "anisotropic": sockets.get('f', "Anisotropy"), "anisotropic_rotation": sockets.get('f', "Rotation"),
        "tangent": sockets.get('v', "Tangent"), "film_thickness": sockets.get('f', "Thin Film Thickness"),
        "film_ior": sockets.get('f', "Thin Film IOR")})
    _note_generated(walker, node, NodeType.LAYERED_PRINCIPLED, values)
    return {"BSDF": Value('s', walker.emit(NodeType.LAYERED_PRINCIPLED, values, mode), 0)}


def _sheen(walker, node, sockets):
    """The Sheen shader of 4.0 and later; Velvet is one of its distributions."""
    kind = NodeType.VELVET if node.distribution == 'ASHIKHMIN' else NodeType.SHEEN
    values = sockets.all_of(kind, ("Color", "Roughness", "Normal"))
    return {"BSDF": Value('s', walker.emit(kind, values), 0)}


def _principled_hair(walker, node, sockets):
    """Principled Hair by Chiang's model, or by Huang's of Blender 4. Strands that are given no number have their
    own."""
    def numbers(*names):
        return {name.lower().replace(" ", "_"): sockets.get('f', name) for name in names}
    values = numbers("Melanin", "Melanin Redness", "Roughness", "IOR", "Offset", "Random Color", "Random Roughness")
    values.update(color=sockets.get('c', "Color"), tint=sockets.get('c', "Tint"),
                  absorption=sockets.get('v', "Absorption Coefficient"),
                  random=sockets.get('f', "Random") if sockets.is_linked("Random") else strand_random(walker),
                  tangent=absent('v'))
    mode = Pigment[node.parametrization]
    if getattr(node, "model", 'CHIANG') == 'HUANG':
        kind = NodeType.HUANG_HAIR
        values.update(numbers("Aspect Ratio"))
        aspect = values["aspect_ratio"]
        is_round = aspect.node == CONSTANT and aspect.constant[0] == 1.0
        values.update(major=_constant('v', 0.0) if is_round else strand_normal(walker),
                      radius=strand_radius(walker), reflection=sockets.get('f', "R lobe"),
                      transmission=sockets.get('f', "TT lobe"), second_reflection=sockets.get('f', "TRT lobe"))
    else:
        kind = NodeType.PRINCIPLED_HAIR
        values.update(numbers("Radial Roughness", "Coat"))
        if HAS_HAIR_ALBEDO:
            mode |= PrincipledHairMode.ALBEDO
    return {"BSDF": Value('s', walker.emit(kind, arranged(kind, values), mode), 0)}


def _value(walker, node, _sockets):
    return {"Value": _constant('f', float(node.outputs[0].default_value))}


def _rgb(walker, node, _sockets):
    return {"Color": _constant('c', *tuple(node.outputs[0].default_value)[:3])}


def _normal(walker, node, sockets):
    """The Normal node: a direction of its own, and the cosine of its input to it."""
    direction = _constant('v', *node.outputs[0].default_value)
    values = (_vector(walker, Vector.NORMALIZE, sockets.get('v', "Normal")),
              _vector(walker, Vector.NORMALIZE, direction), _constant('v', 0.0), _constant('f', 0.0))
    dot = walker.emit(NodeType.VECTOR_MATH, values, Vector.DOT)
    return {"Normal": direction, "Dot": output(dot, NodeType.VECTOR_MATH, "value")}


def _image(walker, node, sockets):
    vector = sockets.get('v', "Vector")
    if vector.node == DEFAULT:
        walker.flat.uv_names.add("")
    mode = (_INTERPOLATIONS.get(node.interpolation, 0) | _EXTENSIONS.get(node.extension, 0)
            | _PROJECTIONS.get(node.projection, 0))
    if node.image is not None and node.image.source == 'TILED' and node.projection == 'FLAT':
        return _tiles(walker, node.image, walker.tiles_of(node), vector, mode)
    blend = _constant('f', node.projection_blend)
    index = walker.emit(NodeType.IMAGE, (vector, blend), mode, image=walker.image_of(node))
    outputs = named_outputs(index, NodeType.IMAGE, ("Color", "Alpha"))
    return {**outputs, "Color": image_color(walker, node.image, outputs["Color"])}


def _tiles(walker, image, tiles, vector, mode):
    """Each tile of a tiled image in its own unit square, magenta beyond all."""
    if vector.node == DEFAULT:
        vector = Value('v', walker.emit(NodeType.UV_MAP, (), name=""), 0)
    floor = _vector(walker, Vector.FLOOR, vector)
    place = _vector(walker, Vector.SUBTRACT, vector, floor)
    parts = walker.emit(NodeType.SEPARATE, (floor,))
    color, alpha = _constant('c', 1.0, 0.0, 1.0), _constant('f', 1.0)
    half, no_blend = _constant('f', 0.5), _constant('f', 0.0)
    for column, row, tile in tiles:
        is_column, is_row = (_number(walker, Math.COMPARE, Value('f', parts, i), _constant('f', number), half)
                             for i, number in enumerate((float(column), float(row))))
        is_here = _number(walker, Math.MULTIPLY, is_column, is_row)
        index = walker.emit(NodeType.IMAGE, (place, no_blend), mode, image=tile)
        tile_color, tile_alpha = (output(index, NodeType.IMAGE, name) for name in ("color", "alpha"))
        tile_color = image_color(walker, image, tile_color)
        color = Value('c', walker.emit(NodeType.MIX_COLOR, (is_here, color, tile_color)), 0)
        step = _number(walker, Math.SUBTRACT, tile_alpha, alpha)
        alpha = _number(walker, Math.MULTIPLY_ADD, step, is_here, alpha)
    return {"Color": color, "Alpha": alpha}


def _environment(walker, node, sockets):
    mode = (_INTERPOLATIONS.get(node.interpolation, 0)
            | EnvironmentProjection[node.projection])
    index = walker.emit(NodeType.ENVIRONMENT, (sockets.get('v', "Vector"),), mode,
                        image=walker.image_of(node))
    color = output(index, NodeType.ENVIRONMENT, "color")
    return {"Color": image_color(walker, node.image, color)}


def _geometry(walker, node, sockets):
    _note_generated(walker, node, NodeType.GEOMETRY, ())
    outputs = named_outputs(walker.emit(NodeType.GEOMETRY, ()), NodeType.GEOMETRY, (
        "Position", "Normal", "Tangent", "True Normal", "Incoming", "Parametric", "Backfacing"))
    for name, attribute in (("Pointiness", POINTINESS), ("Random Per Island", ISLAND)):
        if node.outputs[name].is_linked:
            walker.flat.color_names.add(attribute)
            index = walker.emit(NodeType.COLOR_ATTRIBUTE, (), name=attribute)
            outputs[name] = Value('f', walker.emit(NodeType.SEPARATE, (Value('c', index, 0),)), 0)
    return outputs


def _uv_map(walker, node, _sockets):
    if node.from_instancer:
        return {"UV": instance_value(walker, 'v', VALUES_UV)}
    walker.flat.uv_names.add(node.uv_map)
    return named_outputs(walker.emit(NodeType.UV_MAP, (), name=node.uv_map), NodeType.UV_MAP, ("UV",))


def _texture_coordinate(walker, node, _sockets):
    linked = {s.identifier for s in node.outputs if s.is_linked}
    if "UV" in linked:
        walker.flat.uv_names.add("")
    walker.flat.needs_generated |= "Generated" in linked
    index = walker.emit(NodeType.TEXTURE_COORDINATE, (), CoordinateMode.CURVED * CURVES_NORMAL_BUMPS)
    outputs = named_outputs(index, NodeType.TEXTURE_COORDINATE, (
        "Generated", "Normal", "UV", "Object", "Camera", "Window", "Reflection"))
    if node.object is not None and "Object" in linked:
        outputs["Object"] = _place_in(walker, node.object)
    if node.from_instancer:
        outputs["Generated"] = instance_value(walker, 'v', VALUES_GENERATED)
        outputs["UV"] = instance_value(walker, 'v', VALUES_UV)
    return outputs


def _place_in(walker, blender_object):
    """The shading point in another object's coordinates."""
    walker.flat.follows_scene = True
    position = output(walker.emit(NodeType.GEOMETRY, ()), NodeType.GEOMETRY, "position")
    zero = _constant('v', 0.0), _constant('f', 0.0)
    parts = []
    for row in blender_object.matrix_world.inverted_safe()[:3]:
        dot = walker.emit(NodeType.VECTOR_MATH, (position, _constant('v', *row[:3])) + zero, Vector.DOT)
        product = output(dot, NodeType.VECTOR_MATH, "value")
        parts.append(_number(walker, Math.ADD, product, _constant('f', row[3])))
    return Value('v', walker.emit(NodeType.COMBINE, parts), 0)


def _color_attribute(walker, node, _sockets):
    name = standard_attributes.source(node.layer_name)
    walker.flat.color_names.add(name)
    mode = AttributeMode.LEVEL * LEVELS_COLOR_BUMPS
    index = walker.emit(NodeType.COLOR_ATTRIBUTE, (), mode, name=name)
    return named_outputs(index, NodeType.COLOR_ATTRIBUTE, ("Color", "Alpha"))


def _attribute(walker, node, _sockets):
    """An attribute of any type as a colour, whose mean is its number: of the mesh, or of the object, what
    made the instance or the view layer. Without a name it is black."""
    is_of_mesh, excess = node.attribute_type == 'GEOMETRY', None
    if is_of_mesh and not node.attribute_name:
        color, alpha = _constant('c', 0.0), _constant('f', 1.0)
    elif is_of_mesh:
        color, alpha, excess = _mesh_attribute(walker, node)
    else:
        values = walker.attributes and walker.attributes.read(walker, node.attribute_type, node.attribute_name)
        if not values:
            return None
        color, alpha = values
    vector = color._replace(kind='v')
    number = walker.convert(vector, 'f')
    if excess is not None:
        number = _number(walker, Math.ADD, number, excess)
    return {"Color": color, "Vector": vector, "Fac": number, "Alpha": alpha}


def _mesh_attribute(walker, node):
    """The colour of a mesh's attribute, its alpha, and how far its number is above the mean of the colour, None
    where nobody asks."""
    name, alpha, excess = standard_attributes.source(node.attribute_name), _constant('f', 1.0), None
    if name == standard_attributes.GENERATED:
        walker.flat.needs_generated = True
        index = walker.emit(NodeType.TEXTURE_COORDINATE, (), CoordinateMode.CURVED * CURVES_NORMAL_BUMPS)
        return output(index, NodeType.TEXTURE_COORDINATE, "generated")._replace(kind='c'), alpha, excess
    number = own_number(walker, node.attribute_name)
    if number is not None:
        return walker.convert(number, 'c'), alpha, excess
    if node.outputs["Alpha"].is_linked:
        alpha = _number(walker, Math.SUBTRACT, alpha, _attribute_number(walker, lack_name(name)))
    if node.outputs["Fac"].is_linked:
        excess = _attribute_number(walker, excess_name(name))
    color = _attribute_color(walker, name)
    if name == standard_attributes.NORMAL and standard_attributes.IS_NORMAL_WORLD:
        color = normal_to_world(walker, color._replace(kind='v'))._replace(kind='c')
    if name == standard_attributes.UNDISPLACED:
        color = point_to_world(walker, color._replace(kind='v'))._replace(kind='c')
    return color, alpha, excess


def _attribute_color(walker, name):
    """The colour of an attribute that meshes have to bring."""
    walker.flat.color_names.add(name)
    return Value('c', walker.emit(NodeType.COLOR_ATTRIBUTE, (), name=name), 0)


def _attribute_number(walker, name):
    """The same of a grey one, as a number."""
    return Value('f', walker.emit(NodeType.SEPARATE, (_attribute_color(walker, name),)), 0)


def _math(walker, node, sockets):
    mode = _math_mode(node)
    if mode is None:
        return None
    values = [sockets.get('f', name) for name in ("Value", "Value_001", "Value_002")]
    if node.operation == 'FLOORED_MODULO':  # the range to wrap into begins at 0
        values[2] = _constant('f', 0.0)
    return named_outputs(walker.emit(NodeType.MATH, values, mode), NodeType.MATH, ("Value",))


_NORMAL_MAP_FLAGS = ((NormalMapFlags.SCALED if SCALES_NORMAL_MAPS else 0)
                     | (NormalMapFlags.UNIT if HAS_UNIT_NORMALS else 0))


_LIGHT_PATH = ("Is Camera Ray", "Is Shadow Ray", "Is Diffuse Ray", "Is Glossy Ray", "Is Singular Ray",
               "Is Reflection Ray", "Is Transmission Ray", "Ray Length", "Ray Depth", "Diffuse Depth",
               "Glossy Depth", "Transparent Depth", "Transmission Depth", "Portal Depth")


def _light_path(walker, _node, _sockets):
    """No ray is scattered by a volume."""
    outputs = named_outputs(walker.emit(NodeType.LIGHT_PATH, ()), NodeType.LIGHT_PATH, _LIGHT_PATH)
    if walker.is_of_world and HAS_FAR_WORLDS:
        outputs["Ray Length"] = _constant('f', float(np.finfo(np.float32).max))
    return {**outputs, "Is Volume Scatter Ray": _constant('f', 0.0)}


def _normal_map(walker, node, sockets):
    space = NormalMapSpace[node.space]
    name = _tangents_of(walker, node) if space == NormalMapSpace.TANGENT else ""
    if walker.is_displaced and getattr(node, "base", 'DISPLACED') == 'ORIGINAL':
        walker.warn("Normal Map lies on the displaced surface, not on the original one")
    is_down = getattr(node, "convention", 'OPENGL') == 'DIRECTX'
    mode = space | _NORMAL_MAP_FLAGS | (NormalMapFlags.DOWN if is_down else 0)
    values = sockets.get('f', "Strength"), sockets.get('c', "Color")
    index = walker.emit(NodeType.NORMAL_MAP, values, mode, name=name)
    return named_outputs(index, NodeType.NORMAL_MAP, ("Normal",))


def _bump(walker, node, sockets):
    """Before it had a filter width, the height was taken a whole pixel apart."""
    has_width = sockets.find("Filter Width") is not None
    width = sockets.get('f', "Filter Width") if has_width else _constant('f', 1.0)
    height = sockets.get('f', "Height")
    if TURNS_WINDOW_BUMPS and walker.depends_on(height, NodeType.TEXTURE_COORDINATE, "window"):
        walker.warn("bumps by Window coordinates are not turned as those of Cycles 5 are")
    values = (sockets.get('f', "Strength"), sockets.get('f', "Distance"), width, height, sockets.get('v', "Normal"))
    mode = (BumpMode.INVERT if node.invert else 0) | (0 if LEAVES_BUMPS else BumpMode.ABOVE)
    return named_outputs(walker.emit(NodeType.BUMP, values, mode), NodeType.BUMP, ("Normal",))


def _displacement(walker, node, sockets):
    values = sockets.all_of(NodeType.DISPLACEMENT, ("Height", "Midlevel", "Scale", "Normal"))
    index = walker.emit(NodeType.DISPLACEMENT, values, SpaceId[node.space])
    return named_outputs(index, NodeType.DISPLACEMENT, ("Displacement",))


def _vector_displacement(walker, node, sockets):
    space = NormalMapSpace[node.space]
    name = tangents.attribute_name("") if space == NormalMapSpace.TANGENT else ""
    if name:
        walker.flat.color_names.add(name)
    values = sockets.all_of(NodeType.VECTOR_DISPLACEMENT, ("Vector", "Midlevel", "Scale"))
    index = walker.emit(NodeType.VECTOR_DISPLACEMENT, values, space, name=name)
    return named_outputs(index, NodeType.VECTOR_DISPLACEMENT, ("Displacement",))


def _tangents_of(walker, node):
    """The attribute with the tangents of a node's UV map."""
    name = tangents.attribute_name(node.uv_map)
    walker.flat.color_names.add(name)
    return name


def _tangent(walker, node, _sockets):
    mode, name = _TANGENT_AXES[node.axis], ""
    if node.direction_type == 'UV_MAP':
        mode, name = TangentSource.UV, _tangents_of(walker, node)
    else:
        walker.flat.needs_generated = True
    return named_outputs(walker.emit(NodeType.TANGENT, (), mode, name=name), NodeType.TANGENT, ("Tangent",))


def _color_ramp(walker, node, sockets):
    ramp, factor, steps = node.color_ramp, sockets.get('f', "Fac"), TableSize.ENTRIES - 1
    mode = RampInterpolation.CONSTANT if ramp.interpolation == 'CONSTANT' else RampInterpolation.LINEAR
    if RAMP_STEPS != steps:  # Cycles' entries at the start of the library's table
        factor = _number(walker, Math.MULTIPLY, factor, _constant('f', RAMP_STEPS / steps))
    table = np.array([ramp.evaluate(min(i / RAMP_STEPS, 1.0)) for i in range(TableSize.ENTRIES)], np.float32)
    index = walker.emit(NodeType.COLOR_RAMP, (factor,), mode, table=table)
    return named_outputs(index, NodeType.COLOR_RAMP, ("Color", "Alpha"))


def _mix(walker, node, sockets):
    """The Mix node of 3.4 and later: numbers, vectors or colours."""
    if node.data_type == 'FLOAT':
        factor = _clamped(walker, sockets.get('f', "Factor_Float"), node.clamp_factor)
        first, second = sockets.get('f', "A_Float"), sockets.get('f', "B_Float")
        difference = _number(walker, Math.SUBTRACT, second, first)
        return {"Result_Float": _number(walker, Math.MULTIPLY_ADD, difference, factor, first)}
    if node.data_type == 'VECTOR':
        return {"Result_Vector": _mix_vectors(walker, node, sockets)}
    if node.data_type != 'RGBA' or node.blend_type not in _BLENDS:
        return None
    factor, first, second = (sockets.get(kind, name) for kind, name in (
        ('f', "Factor_Float"), ('c', "A_Color"), ('c', "B_Color")))
    mix = _blend if node.clamp_factor or _is_fraction(factor) else _blend_beyond
    return {"Result_Color": mix(walker, node, factor, first, second)}


def _is_fraction(value):
    return value.node == CONSTANT and 0.0 <= value.constant[0] <= 1.0


def _blend(walker, node, factor, first, second):
    """Two colours mixed by a factor that is clamped."""
    mode = _BLENDS[node.blend_type] | (ModeFlags.CLAMP if node.clamp_result else 0)
    return Value('c', walker.emit(NodeType.MIX_COLOR, (factor, first, second), mode), 0)


def _blend_beyond(walker, node, factor, first, second):
    """The same by any factor, straight on from where it is 0 and 1."""
    if node.blend_type in _BENT_BLENDS:
        walker.warn(f"node '{node.name}': a factor beyond 0 and 1 is clamped, as its blending is not linear in it")
        return _blend(walker, node, factor, first, second)
    whole = second if node.blend_type == 'MIX' else Value('c', walker.emit(
        NodeType.MIX_COLOR, (_constant('f', 1.0), first, second), _BLENDS[node.blend_type]), 0)
    difference = _vector(walker, Vector.SUBTRACT, whole._replace(kind='v'), first._replace(kind='v'))
    mixed = _vector(walker, Vector.MULTIPLY_ADD, difference, walker.convert(factor, 'v'), first._replace(kind='v'))
    if node.clamp_result:
        mixed = _vector(walker, Vector.MINIMUM, _vector(walker, Vector.MAXIMUM, mixed, _constant('v', 0.0)),
                        _constant('v', 1.0))
    return mixed._replace(kind='c')


def _mix_vectors(walker, node, sockets):
    if node.factor_mode == 'NON_UNIFORM':
        factor = sockets.get('v', "Factor_Vector")
        if node.clamp_factor:
            factor = _vector(walker, Vector.MAXIMUM, factor, _constant('v', 0.0))
            factor = _vector(walker, Vector.MINIMUM, factor, _constant('v', 1.0))
    else:
        number = _clamped(walker, sockets.get('f', "Factor_Float"), node.clamp_factor)
        factor = walker.convert(number, 'v')
    first, second = sockets.get('v', "A_Vector"), sockets.get('v', "B_Vector")
    difference = _vector(walker, Vector.SUBTRACT, second, first)
    return _vector(walker, Vector.MULTIPLY_ADD, difference, factor, first)


def _clamped(walker, value, is_clamped):
    """A number limited to [0, 1] if it is to be; a constant at once."""
    if not is_clamped:
        return value
    if value.node == CONSTANT:
        return _constant('f', min(max(value.constant[0], 0.0), 1.0))
    values = (value, _constant('f', 0.0), _constant('f', 1.0))
    return Value('f', walker.emit(NodeType.CLAMP, values), 0)


_SPECIAL = {
    "ShaderNodeBsdfPrincipled": _principled, "ShaderNodeBsdfSheen": _sheen,
    "ShaderNodeBsdfMetallic": _metallic, "ShaderNodeBsdfHairPrincipled": _principled_hair,
    "ShaderNodeValue": _value, "ShaderNodeRGB": _rgb,
    "ShaderNodeNewGeometry": _geometry, "ShaderNodeNormal": _normal, "ShaderNodeTexImage": _image,
    "ShaderNodeTexEnvironment": _environment, "ShaderNodeUVMap": _uv_map,
    "ShaderNodeTexCoord": _texture_coordinate, "ShaderNodeVertexColor": _color_attribute,
    "ShaderNodeAttribute": _attribute, "ShaderNodeNormalMap": _normal_map, "ShaderNodeLightPath": _light_path,
    "ShaderNodeMath": _math, "ShaderNodeTangent": _tangent, "ShaderNodeBump": _bump,
    "ShaderNodeDisplacement": _displacement, "ShaderNodeVectorDisplacement": _vector_displacement,
    "ShaderNodeValToRGB": _color_ramp, "ShaderNodeMix": _mix,
}
