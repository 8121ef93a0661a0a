# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves, ranges, vectors between spaces and other single-purpose nodes in the library's terms.

Functions as in ``textures.py``: of the walker, the node and its ``Sockets``.
"""

import math
import re

import bpy
import numpy as np

from ..abi import (AmbientMode, CurvesExtension, ImageExtension, MathOperation as Math, ModeFlags, NodeType,
                   RaycastMode, RotateFlags, RotateMode, SeparateMode, SpaceId, TableSize, TransformedType,
                   VectorOperation as Vector, VectorTransformMode, WireframeMode)
from ..compat import HAS_STEEP_WIRES, IES_ENDS, LEAVES_SUNS, TRANSFORMS_NORMALS
from . import ies, working_space
from .instance import NO_PARTICLE_RANDOM, VALUES_LOCATION, VALUES_PARTICLE, VALUES_SPIN, VALUES_VELOCITY
from .node_list import named_outputs, output
from .strands import DIRECTION_ATTRIBUTE, HAIR_ATTRIBUTE, NORMAL_ATTRIBUTE
from .values import CONSTANT, DEFAULT, Value


def _transform_mode(space_from, space_to, what):
    """Mode of VECTOR_TRANSFORM."""
    return (space_from | space_to << VectorTransformMode.SPACE_TO_SHIFT
            | what << VectorTransformMode.TRANSFORMED_SHIFT)


_OBJECT_TO_WORLD = _transform_mode(SpaceId.OBJECT, SpaceId.WORLD, TransformedType.VECTOR)
_TRANSFORMS = {'POINT': TransformedType.POINT, 'VECTOR': TransformedType.VECTOR,
               'NORMAL': TransformedType.NORMAL if TRANSFORMS_NORMALS else TransformedType.UNIT_VECTOR}
_ROTATIONS = {'AXIS_ANGLE': RotateMode.AXIS_ANGLE, 'X_AXIS': RotateMode.X, 'Y_AXIS': RotateMode.Y,
              'Z_AXIS': RotateMode.Z, 'EULER_XYZ': RotateMode.EULER}


def _constant(kind, *values):
    return Value(kind, CONSTANT, 0, tuple(values) + (0.0,) * (3 - len(values)))


def _number(walker, operation, *values, clamped=False):
    """The result of a Math node on values and plain numbers."""
    values = [v if isinstance(v, Value) else _constant('f', v) for v in values]
    values += [_constant('f', 0.0)] * (3 - len(values))
    return Value('f', walker.emit(NodeType.MATH, values, operation | (ModeFlags.CLAMP if clamped else 0)), 0)


def _vector(walker, operation, a, b=None, scale=None):
    """The vector of a Vector Math node."""
    values = (a, b or _constant('v', 0.0), _constant('v', 0.0), scale or _constant('f', 1.0))
    return Value('v', walker.emit(NodeType.VECTOR_MATH, values, operation), 0)


# Curves --------------------------------------------------------------------------------------------

def _table(mapping, count):
    """A curve mapping as a table of RGBA, its range, and whether it goes on straight beyond. Of four
    curves the last comes first, and for all channels."""
    mapping.initialize()
    curves = list(mapping.curves)[:count]
    low = min(curve.points[0].location[0] for curve in curves)
    high = max(curve.points[-1].location[0] for curve in curves)
    table = np.zeros((TableSize.ENTRIES, 4), np.float32)
    for i, x in enumerate(np.linspace(low, high, TableSize.ENTRIES)):
        if count == 4:
            x = mapping.evaluate(curves[3], x)
        for channel, curve in enumerate(curves[:3]):
            table[i, channel] = mapping.evaluate(curve, x)
    return table.reshape(-1), (_constant('f', low), _constant('f', high)), \
        CurvesExtension.EXTRAPOLATED if mapping.extend == 'EXTRAPOLATED' else CurvesExtension.CONSTANT


def _color_curves(count, name):
    def translate(walker, node, sockets):
        table, span, mode = _table(node.mapping, count)
        kind = 'c' if count == 4 else 'v'
        values = (sockets.get('f', "Fac"), sockets.get(kind, name), *span)
        return {name: Value(kind, walker.emit(NodeType.CURVES, values, mode, table=table), 0)}
    return translate


def _float_curve(walker, node, sockets):
    table, span, mode = _table(node.mapping, 1)
    values = (sockets.get('f', "Factor"), sockets.get('f', "Value"), *span)
    return {"Value": Value('f', walker.emit(NodeType.FLOAT_CURVE, values, mode, table=table), 0)}


def _blackbody(walker, _node, sockets):
    return {"Color": working_space.spectral(walker, NodeType.BLACKBODY, sockets.get('f', "Temperature"))}


def _rgb_to_bw(walker, _node, sockets):
    return {"Val": working_space.luminance(walker, sockets.get('c', "Color"))}


def _wavelength(walker, _node, sockets):
    return {"Color": working_space.spectral(walker, NodeType.WAVELENGTH, sockets.get('f', "Wavelength"))}


# Ranges --------------------------------------------------------------------------------------------

def _ranged(walker, node, value, source, target, steps):
    """A number from a source range to a target range.

    As in Cycles an empty source gives 0 for numbers, clamped where the node clamps, and the target's
    start for vectors."""
    mode = ModeFlags.CLAMP if node.clamp else 0
    is_number = getattr(node, "data_type", 'FLOAT') == 'FLOAT'
    if node.interpolation_type == 'LINEAR' and is_number:
        return Value('f', walker.emit(NodeType.MAP_RANGE, (value, *source, *target), mode), 0)
    zero, one = _constant('f', 0.0), _constant('f', 1.0)
    t = Value('f', walker.emit(NodeType.MAP_RANGE, (value, *source, zero, one), 0), 0)
    if node.interpolation_type == 'STEPPED':
        count = _number(walker, Math.ADD, steps, 1.0)
        whole = _number(walker, Math.FLOOR, _number(walker, Math.MULTIPLY, t, count))
        t = _number(walker, Math.DIVIDE, whole, steps)
    elif node.interpolation_type != 'LINEAR':
        t = _number(walker, Math.ADD, t, 0.0, clamped=True)
        square = _number(walker, Math.MULTIPLY, t, t)
        if node.interpolation_type == 'SMOOTHSTEP':
            t = _number(walker, Math.MULTIPLY, square, _number(walker, Math.MULTIPLY_ADD, t, -2.0, 3.0))
        else:
            inner = _number(walker, Math.MULTIPLY_ADD, t, 6.0, -15.0)
            inner = _number(walker, Math.MULTIPLY_ADD, t, inner, 10.0)
            t = _number(walker, Math.MULTIPLY, _number(walker, Math.MULTIPLY, square, t), inner)
    length = one
    if is_number:  # 0 where the source is empty, and so is the range that t is in
        length = Value('f', walker.emit(NodeType.MAP_RANGE, (source[1], *source, zero, one), 0), 0)
    return Value('f', walker.emit(NodeType.MAP_RANGE, (t, zero, length, *target), mode), 0)


def _map_range(walker, node, sockets):
    if node.interpolation_type not in {'LINEAR', 'STEPPED', 'SMOOTHSTEP', 'SMOOTHERSTEP'}:
        return None
    if getattr(node, "data_type", 'FLOAT') == 'FLOAT':
        value, *ranges = [sockets.get('f', name) for name in (
            "Value", "From Min", "From Max", "To Min", "To Max")]
        steps = sockets.get('f', "Steps")
        return {"Result": _ranged(walker, node, value, ranges[:2], ranges[2:], steps)}
    names = ("Vector", "From_Min_FLOAT3", "From_Max_FLOAT3", "To_Min_FLOAT3", "To_Max_FLOAT3",
             "Steps_FLOAT3")
    separate = [walker.emit(NodeType.SEPARATE, (sockets.get('v', name),)) for name in names]
    parts = []
    for axis in range(3):
        value, *ranges, steps = [Value('f', index, axis) for index in separate]
        parts.append(_ranged(walker, node, value, ranges[:2], ranges[2:], steps))
    return {"Vector": Value('v', walker.emit(NodeType.COMBINE, parts), 0)}


# Vectors -------------------------------------------------------------------------------------------

def _vector_transform(walker, node, sockets):
    mode = _transform_mode(SpaceId[node.convert_from], SpaceId[node.convert_to], _TRANSFORMS[node.vector_type])
    index = walker.emit(NodeType.VECTOR_TRANSFORM, (sockets.get('v', "Vector"),), mode)
    return {"Vector": Value('v', index, 0)}


def normal_to_world(walker, normal):
    """A normal in object space as one of the world, as long as it was."""
    mode = _transform_mode(SpaceId.OBJECT, SpaceId.WORLD, TransformedType.NORMAL)
    unit = Value('v', walker.emit(NodeType.VECTOR_TRANSFORM, (normal,), mode), 0)
    values = normal, _constant('v', 0.0), _constant('v', 0.0), _constant('f', 1.0)
    length = output(walker.emit(NodeType.VECTOR_MATH, values, Vector.LENGTH), NodeType.VECTOR_MATH, "value")
    return _vector(walker, Vector.SCALE, unit, scale=length)


def point_to_world(walker, point):
    """A place in object space as one of the world."""
    mode = _transform_mode(SpaceId.OBJECT, SpaceId.WORLD, TransformedType.POINT)
    return Value('v', walker.emit(NodeType.VECTOR_TRANSFORM, (point,), mode), 0)


def _vector_rotate(walker, node, sockets):
    values = [sockets.get(kind, name) for kind, name in (
        ('v', "Vector"), ('v', "Center"), ('v', "Axis"), ('f', "Angle"), ('v', "Rotation"))]
    mode = _ROTATIONS[node.rotation_type] | (RotateFlags.INVERSE if node.invert else 0)
    return {"Vector": Value('v', walker.emit(NodeType.VECTOR_ROTATE, values, mode), 0)}


# Inputs --------------------------------------------------------------------------------------------

def _camera_data(walker, _node, _sockets):
    index = walker.emit(NodeType.CAMERA_DATA, ())
    return named_outputs(index, NodeType.CAMERA_DATA, ("View Vector", "View Z Depth", "View Distance"))


def _wireframe(walker, node, sockets):
    mode = WireframeMode.PIXELS * node.use_pixel_size | WireframeMode.STEEP * HAS_STEEP_WIRES
    return {"Fac": Value('f', walker.emit(NodeType.WIREFRAME, (sockets.get('f', "Size"),), mode), 0)}


_ENDLESS = 1e30  # m; less than the length of a sun's ray, whose square is infinite


def _light_falloff(walker, _node, sockets):
    """Strength times powers of the ray's length, since light fades with its square; faint nearby where
    it is smooth."""
    strength, smooth = sockets.get('f', "Strength"), sockets.get('f', "Smooth")
    length = output(walker.emit(NodeType.LIGHT_PATH, ()), NodeType.LIGHT_PATH, "ray_length")
    square = _number(walker, Math.MULTIPLY, length, length)
    if smooth.node != CONSTANT or smooth.constant[0] > 0.0:  # a sun's square is infinite
        loss = _number(walker, Math.ADD, _number(walker, Math.DIVIDE, smooth, square), 1.0)
        strength = _number(walker, Math.DIVIDE, strength, loss)
    if LEAVES_SUNS:  # powers of 1
        is_endless = _number(walker, Math.GREATER_THAN, length, _ENDLESS)
        length = _number(walker, Math.MULTIPLY_ADD, length, _number(walker, Math.SUBTRACT, 1.0, is_endless), is_endless)
        square = _number(walker, Math.MULTIPLY, length, length)
    return {"Quadratic": strength, "Linear": _number(walker, Math.MULTIPLY, strength, length),
            "Constant": _number(walker, Math.MULTIPLY, strength, square)}


_MISSING_WEB = 100.0  # Cycles' value of an IES file that cannot be read


def _ies(walker, node, sockets):
    """A lamp's light in the direction of the vector, by default that of the lamp's own normal."""
    strength = sockets.get('f', "Strength")
    text = _ies_text(node)
    web = ies.web_of(text)
    if web is None:
        walker.warn(f"node '{node.name}': its IES file cannot be read")
        return {"Fac": _number(walker, Math.MULTIPLY, strength, _MISSING_WEB)}
    vector = sockets.get('v', "Vector")
    if vector.node == DEFAULT:
        vector = output(walker.emit(NodeType.TEXTURE_COORDINATE, ()), NodeType.TEXTURE_COORDINATE, "normal")
    parts = walker.emit(NodeType.SEPARATE, (_vector(walker, Vector.NORMALIZE, vector),), SeparateMode.XYZ)
    x, y, z = (Value('f', parts, i) for i in range(3))
    horizontal = _number(walker, Math.ADD, _number(walker, Math.ARCTAN2, x, y), _constant('f', math.pi))
    vertical = _number(walker, Math.ARCCOSINE, _number(walker, Math.MULTIPLY, z, -1.0))
    # The angles' ends are the centres of the picture's outer pixels.
    ends = [(math.radians(angles[0]), math.radians(angles[-1])) for angles in web[:2]]
    u, v = (_number(walker, Math.MULTIPLY_ADD, angle, (count - 1) / (count * (high - low)),
                    0.5 / count - low * (count - 1) / (count * (high - low)))
            for angle, (low, high), count in zip((horizontal, vertical), ends, ies.picture_size(web)))
    place = Value('v', walker.emit(NodeType.COMBINE, (u, v, _constant('f', 0.0)), SeparateMode.XYZ), 0)
    image = walker.table_image("ies", ies.picture_of, text)
    found = walker.emit(NodeType.IMAGE, (place, _constant('f', 0.0)), ImageExtension.EXTEND, image=image)
    value = Value('f', walker.emit(NodeType.SEPARATE, (Value('c', found, 0),)), 0)
    for is_within in _within(walker, horizontal, vertical, ends):
        value = _number(walker, Math.MULTIPLY, value, is_within)
    return {"Fac": _number(walker, Math.MULTIPLY, value, strength)}


_FULL_TURN = 2.0 * math.pi - 1e-6


def _within(walker, horizontal, vertical, ends):
    """Whether angles lie between those of a file: nothing goes beyond, which before Cycles 4 was looked at below
    alone."""
    (left, right), (low, high) = ends
    yield _number(walker, Math.LESS_THAN, vertical, high)
    if low > 0.0 and IES_ENDS != 'MIRRORED':
        yield _number(walker, Math.GREATER_THAN, vertical, low)
    if left > 0.0:
        yield _number(walker, Math.GREATER_THAN, horizontal, left)
    if right < _FULL_TURN:
        yield _number(walker, Math.LESS_THAN, horizontal, right)


def _ies_text(node):
    """What an IES node's file holds, "" if it cannot be read."""
    if node.mode == 'INTERNAL':
        return node.ies.as_string() if node.ies is not None else ""
    path = bpy.path.abspath(node.filepath, library=node.id_data.library)
    try:
        with open(path, encoding="latin-1") as file:
            return file.read()
    except OSError:
        return ""


def _ambient_occlusion(walker, node, sockets):
    distance = sockets.get('f', "Distance")
    mode = min(node.samples, AmbientMode.SAMPLES_MASK)
    mode |= AmbientMode.INSIDE * node.inside | AmbientMode.ONLY_LOCAL * node.only_local
    if distance == _constant('f', 0.0):
        mode |= AmbientMode.OF_WORLD
    index = walker.emit(NodeType.AMBIENT_OCCLUSION, (
        sockets.get('c', "Color"), distance, sockets.get('v', "Normal")), mode)
    return named_outputs(index, NodeType.AMBIENT_OCCLUSION, ("Color", "AO"))


def _bevel(walker, node, sockets):
    index = walker.emit(NodeType.BEVEL, (sockets.get('f', "Radius"), sockets.get('v', "Normal")),
                        min(node.samples, AmbientMode.SAMPLES_MASK))
    return named_outputs(index, NodeType.BEVEL, ("Normal",))


def _raycast(walker, node, sockets):
    ray = sockets.get('v', "Position"), sockets.get('v', "Direction"), sockets.get('f', "Length")
    mode = RaycastMode.ONLY_LOCAL * node.only_local
    outputs = named_outputs(walker.emit(NodeType.RAYCAST, ray, mode), NodeType.RAYCAST,
                            ("Is Hit", "Self Hit", "Hit Distance", "Hit Position", "Hit Normal"))
    sockets_of = [each for each in node.outputs if re.fullmatch(r"Attribute_\d+", each.identifier)]
    linked = {socket.identifier for socket in node.outputs if socket.is_linked}
    names = [each.default_value for each in node.inputs if each.type == 'STRING']
    for name, socket in zip(names, sockets_of):
        named = socket.identifier, socket.identifier + "_Alpha"
        if name and linked.intersection(named):
            outputs.update(zip(named, _met_attribute(walker, name, ray, mode, socket.type)))
    return outputs


def _met_attribute(walker, name, ray, mode, socket_type):
    """An attribute of what a ray meets as a socket of that type shows it, and its alpha."""
    walker.flat.color_names.add(name)
    index = walker.emit(NodeType.RAYCAST_ATTRIBUTE, ray, mode, name=name)
    color, alpha = (output(index, NodeType.RAYCAST_ATTRIBUTE, each) for each in ("color", "alpha"))
    if socket_type == 'VALUE':  # the mean, as of the Attribute node
        color = walker.convert(color._replace(kind='v'), 'f')
    return color, alpha


def _tangent_normal(walker):
    """The normal across a strand that looks at the viewer most; 0 on what is no strand."""
    walker.flat.color_names.add(DIRECTION_ATTRIBUTE)
    strand = walker.emit(NodeType.COLOR_ATTRIBUTE, (), name=DIRECTION_ATTRIBUTE)
    along = Value('v', walker.emit(NodeType.VECTOR_TRANSFORM, (Value('v', strand, 0),), _OBJECT_TO_WORLD), 0)
    incoming = output(walker.emit(NodeType.GEOMETRY, ()), NodeType.GEOMETRY, "incoming")
    across = _vector(walker, Vector.SUBTRACT, incoming, _vector(walker, Vector.PROJECT, incoming, along))
    unit = _vector(walker, Vector.NORMALIZE, across)
    return _vector(walker, Vector.SCALE, unit, scale=output(strand, NodeType.COLOR_ATTRIBUTE, "alpha"))


def _strand_values(walker):
    """Intercept, length, thickness, random number and whether there is any: what the meshes of strands bring as
    attributes; 0 on all others."""
    walker.flat.color_names.add(HAIR_ATTRIBUTE)
    index = walker.emit(NodeType.COLOR_ATTRIBUTE, (), name=HAIR_ATTRIBUTE)
    parts = walker.emit(NodeType.SEPARATE, (Value('c', index, 0),))
    intercept, length, thickness = (Value('f', parts, i) for i in range(3))
    is_strand = _number(walker, Math.GREATER_THAN, length, _constant('f', 0.0))
    random = _number(walker, Math.MULTIPLY, output(index, NodeType.COLOR_ATTRIBUTE, "alpha"), is_strand)
    return intercept, length, thickness, random, is_strand


# Where Cycles' own attributes of strands stand among them.
_STRAND_ATTRIBUTES = {"curve_intercept": 0, "curve_length": 1, "curve_random": 3}


def own_number(walker, name):
    """A number that Cycles itself makes of strands or points, 0 on all others, as the attribute of a name; None for
    other names."""
    if name == "point_random":
        return output(walker.emit(NodeType.POINT_INFO, ()), NodeType.POINT_INFO, "random")
    return _strand_values(walker)[_STRAND_ATTRIBUTES[name]] if name in _STRAND_ATTRIBUTES else None


def strand_random(walker):
    """The number of its own that a strand has."""
    return _strand_values(walker)[3]


def strand_radius(walker):
    """Half the thickness, in object space."""
    return _number(walker, Math.MULTIPLY, _strand_values(walker)[2], _constant('f', 0.5))


def strand_normal(walker):
    """The normals of a Curves object, 0 of hair that has none."""
    walker.flat.color_names.add(NORMAL_ATTRIBUTE)
    return Value('v', walker.emit(NodeType.COLOR_ATTRIBUTE, (), name=NORMAL_ATTRIBUTE), 0)


def _hair_info(walker, node, _sockets):
    intercept, length, thickness, random, is_strand = _strand_values(walker)
    is_read = node.outputs["Tangent Normal"].is_linked
    tangent_normal = _tangent_normal(walker) if is_read else _constant('v', 0.0)
    return {"Is Strand": is_strand, "Intercept": intercept, "Length": length, "Thickness": thickness,
            "Tangent Normal": tangent_normal, "Random": random}


def instance_value(walker, kind, first):
    """One or three of the numbers of instance.instancer_values, which are 0 in an object of its own."""
    walker.flat.needs_instancer = True
    index = walker.emit(NodeType.INSTANCE_VALUES, (), first)
    return Value('v', index, 0) if kind == 'v' else Value(
        'f', walker.emit(NodeType.SEPARATE, (Value('c', index, 0),)), 0)


def _particle_info(walker, node, _sockets):
    outputs = {name: instance_value(walker, 'f', VALUES_PARTICLE + i) for i, name in enumerate(
        ("Index", "Random", "Age", "Lifetime", "Size")) if node.outputs[name].is_linked}
    for name, first in (("Location", VALUES_LOCATION), ("Velocity", VALUES_VELOCITY),
                        ("Angular Velocity", VALUES_SPIN)):
        if node.outputs[name].is_linked:
            outputs[name] = instance_value(walker, 'v', first)
    if "Random" in outputs:
        outputs["Random"] = _number(walker, Math.ADD, outputs["Random"], _constant('f', NO_PARTICLE_RANDOM))
    return outputs


CONVERTERS = {
    "ShaderNodeRGBCurve": _color_curves(4, "Color"), "ShaderNodeVectorCurve": _color_curves(3, "Vector"),
    "ShaderNodeFloatCurve": _float_curve, "ShaderNodeBlackbody": _blackbody,
    "ShaderNodeRGBToBW": _rgb_to_bw, "ShaderNodeWavelength": _wavelength, "ShaderNodeMapRange": _map_range,
    "ShaderNodeVectorTransform": _vector_transform, "ShaderNodeVectorRotate": _vector_rotate,
    "ShaderNodeCameraData": _camera_data, "ShaderNodeWireframe": _wireframe,
    "ShaderNodeLightFalloff": _light_falloff, "ShaderNodeTexIES": _ies,
    "ShaderNodeAmbientOcclusion": _ambient_occlusion, "ShaderNodeBevel": _bevel, "ShaderNodeRaycast": _raycast,
    "ShaderNodeParticleInfo": _particle_info,
    "ShaderNodeHairInfo": _hair_info,
}
