# SPDX-License-Identifier: GPL-3.0-or-later
"""The binary interface of libtracer: constants, enumerations, structures, functions.

Written by libtracer/tools/generate_abi.py from libtracer/include/tracer; meanings are there. native.py
compares all values, sizes and offsets with those of the library that it loads.
"""

from ctypes import (POINTER, Structure, c_char_p, c_double, c_float, c_int32, c_int64, c_uint32, c_uint64,
                    c_void_p)
from enum import IntEnum, IntFlag

MAX_LIGHT_GROUPS = 32
MAX_CURVE_PIECES = 32
MAX_KEYS = 33
MAX_ATTRIBUTES = 64
MAX_INSTANCE_VALUES = 256
MAX_SHADOW_CLASSES = 15
MAX_NODES = 65536
MAX_NODE_INPUTS = 32
RAYS_REORDER = 1
NO_HIT = 4294967295
MAX_AOVS = 16
CRYPTOMATTE_KINDS = 3
CRYPTOMATTE_LAYER_RANKS = 2
MAX_CRYPTOMATTE_LAYERS = 8
MAX_CRYPTOMATTE_DEPTH = 16
SUMS_END = 194
VERSION_MAJOR = 0
VERSION_MINOR = 1
VERSION_PATCH = 0
ABI_VERSION = 10


class StatusCode(IntEnum):
    OK = 0
    ERROR_INVALID_ARGUMENT = 1
    ERROR_INVALID_HANDLE = 2
    ERROR_STRUCT_SIZE = 3
    ERROR_TOO_LARGE = 4
    ERROR_OUT_OF_MEMORY = 5
    ERROR_NO_THREAD = 6
    ERROR_NOT_COMMITTED = 7
    ERROR_CANCELLED = 8
    ERROR_UNSUPPORTED = 9
    ERROR_IMAGE = 10
    ERROR_FORMAT = 11


class IsaId(IntEnum):
    AUTO = 0
    SCALAR = 1
    SSE42 = 2
    AVX2 = 3
    AVX512 = 4
    NEON = 5


class CameraType(IntEnum):
    PERSPECTIVE = 0
    ORTHOGRAPHIC = 1
    EQUIRECTANGULAR = 2
    CUBE_MAP_FACE = 3
    MIRROR_BALL = 4
    FISHEYE_EQUIDISTANT = 5
    FISHEYE_EQUISOLID = 6
    FISHEYE_POLYNOMIAL = 7
    CYLINDRICAL = 8


class CurveShape(IntEnum):
    RIBBON = 0
    ROUND = 1
    BALL = 2
    HOLLOW_BALL = 3


class NormalsLayout(IntEnum):
    NONE = 0
    VERTEX = 1
    CORNER = 2


class DicingSurface(IntEnum):
    LINEAR = 0
    CURVED = 1
    CATMULL_CLARK = 2


class DicingSpace(IntEnum):
    OBJECT = 0
    PARALLEL = 1
    CENTRAL = 2


class VisibleRays(IntFlag):
    CAMERA = 1
    DIFFUSE = 2
    GLOSSY = 4
    TRANSMISSION = 8
    SHADOW = 16
    ALL = 31


class InstanceFlags(IntFlag):
    SHADOW_CATCHER = 1
    KEEPS_SHAPE = 2
    WORLD_NORMALS = 4


class LightType(IntEnum):
    POINT = 0
    SPOT = 1
    SUN = 2
    AREA = 3


class AreaShape(IntEnum):
    RECTANGLE = 0
    ELLIPSE = 1


class LightFlags(IntFlag):
    SPHERE = 1
    EVEN_CONE = 2
    SYNTHETIC = 4
    LOCAL_UV = 8
    OBJECT = 16
    CENTERED = 32


class AoMethod(IntEnum):
    ADD = 0
    REPLACE = 1


class NodeType(IntEnum):
    DIFFUSE = 1
    GLOSSY = 2
    GLASS = 3
    REFRACTION = 4
    TRANSPARENT = 5
    TRANSLUCENT = 6
    EMISSION = 7
    BACKGROUND = 8
    MIX_SHADER = 9
    ADD_SHADER = 10
    HOLDOUT = 11
    PRINCIPLED = 12
    VELVET = 13
    TOON = 14
    LAYERED_PRINCIPLED = 15
    SHEEN = 16
    RAY_PORTAL = 17
    HAIR = 18
    PRINCIPLED_HAIR = 19
    HUANG_HAIR = 20
    IMAGE = 64
    ENVIRONMENT = 65
    UV_MAP = 66
    COLOR_ATTRIBUTE = 67
    TEXTURE_COORDINATE = 68
    MAPPING = 69
    MIX_COLOR = 70
    MATH = 71
    FRESNEL = 72
    LAYER_WEIGHT = 73
    LIGHT_PATH = 74
    GEOMETRY = 75
    NORMAL_MAP = 76
    INVERT = 77
    GAMMA = 78
    HUE_SATURATION = 79
    BRIGHT_CONTRAST = 80
    COLOR_RAMP = 81
    SEPARATE = 82
    COMBINE = 83
    MAP_RANGE = 84
    CLAMP = 85
    CHECKER = 86
    OBJECT_INFO = 87
    VECTOR_MATH = 88
    RGB_TO_BW = 89
    INSTANCE_VALUES = 90
    NOISE = 96
    MUSGRAVE = 97
    VORONOI = 98
    WAVE = 99
    GRADIENT = 100
    WHITE_NOISE = 101
    GABOR = 119
    RADIAL_TILING = 128
    MAGIC = 102
    BRICK = 103
    CURVES = 104
    FLOAT_CURVE = 105
    BLACKBODY = 106
    WAVELENGTH = 107
    VECTOR_TRANSFORM = 108
    VECTOR_ROTATE = 109
    CAMERA_DATA = 110
    WIREFRAME = 111
    BUMP = 115
    DISPLACEMENT = 116
    VECTOR_DISPLACEMENT = 117
    AMBIENT_OCCLUSION = 124
    BEVEL = 125
    RAYCAST = 126
    RAYCAST_ATTRIBUTE = 129
    POINT_INFO = 127
    TANGENT = 114
    AOV_VALUE = 112
    AOV_COLOR = 113
    DISPLACEMENT_OUTPUT = 118


class ModeFlags(IntFlag):
    CLAMP = 256


class TableSize(IntEnum):
    ENTRIES = 257


class DiffuseModel(IntEnum):
    LOSES_ENERGY = 0
    KEEPS_ENERGY = 1


class ToonComponent(IntEnum):
    DIFFUSE = 0
    GLOSSY = 1


class HairComponent(IntEnum):
    REFLECTION = 0
    TRANSMISSION = 1


class Pigment(IntEnum):
    COLOR = 0
    MELANIN = 1
    ABSORPTION = 2


class PrincipledHairMode(IntEnum):
    PIGMENT_MASK = 3
    ALBEDO = 4


class MappingType(IntEnum):
    POINT = 0
    TEXTURE = 1
    VECTOR = 2
    NORMAL = 3


class NormalMapSpace(IntEnum):
    TANGENT = 0
    OBJECT = 1
    WORLD = 2
    BLENDER_OBJECT = 3
    BLENDER_WORLD = 4


class NormalMapFlags(IntFlag):
    SCALED = 8
    UNIT = 16
    DOWN = 32
    SPACE_MASK = 7


class BumpMode(IntEnum):
    INVERT = 1
    ABOVE = 2


class WireframeMode(IntEnum):
    PIXELS = 1
    STEEP = 2
    MASK = 3


class AttributeMode(IntEnum):
    LEVEL = 1


class CoordinateMode(IntEnum):
    CURVED = 1


class AmbientMode(IntEnum):
    SAMPLES_MASK = 255
    INSIDE = 256
    ONLY_LOCAL = 512
    OF_WORLD = 1024


class RaycastMode(IntEnum):
    ONLY_LOCAL = 1


class DisplacementMethod(IntEnum):
    BUMP = 0
    TRUE = 1
    BOTH = 2
    ABOVE = 4


class RampInterpolation(IntEnum):
    LINEAR = 0
    CONSTANT = 1


class Gamut(IntEnum):
    CLIPPED = 0
    OPEN = 1


class CurvesExtension(IntEnum):
    CONSTANT = 0
    EXTRAPOLATED = 1


class SeparateMode(IntEnum):
    RGB = 0
    HSV = 1
    HSL = 2
    XYZ = 3


class ClampType(IntEnum):
    MINMAX = 0
    RANGE = 1


class TangentSource(IntEnum):
    Z = 0
    X = 1
    Y = 2
    UV = 3


class SpaceId(IntEnum):
    WORLD = 0
    OBJECT = 1
    CAMERA = 2


class TransformedType(IntEnum):
    POINT = 0
    VECTOR = 1
    UNIT_VECTOR = 2
    NORMAL = 3


class VectorTransformMode(IntEnum):
    SPACE_MASK = 3
    SPACE_TO_SHIFT = 2
    TRANSFORMED_SHIFT = 4


class RotateMode(IntEnum):
    AXIS_ANGLE = 0
    X = 1
    Y = 2
    Z = 3
    EULER = 4


class RotateFlags(IntFlag):
    INVERSE = 8


class TextureMode(IntEnum):
    DIMENSIONS_MASK = 3


class FractalType(IntEnum):
    FBM_UNIT = 0
    FBM = 1
    MULTIFRACTAL = 2
    HETERO_TERRAIN = 3
    HYBRID_MULTIFRACTAL = 4
    RIDGED_MULTIFRACTAL = 5


class NoiseMode(IntEnum):
    TYPE_SHIFT = 2


class VoronoiMetric(IntEnum):
    EUCLIDEAN = 0
    MANHATTAN = 1
    CHEBYCHEV = 2
    MINKOWSKI = 3


class VoronoiFeature(IntEnum):
    F1 = 0
    F2 = 1
    SMOOTH_F1 = 2
    DISTANCE_TO_EDGE = 3
    N_SPHERE_RADIUS = 4


class VoronoiMode(IntEnum):
    METRIC_MASK = 3
    METRIC_SHIFT = 2
    FEATURE_MASK = 7
    FEATURE_SHIFT = 4
    NORMALIZE = 128
    PCG = 256
    UNLIMITED = 512


class WaveProfile(IntEnum):
    SINE = 0
    SAW = 1
    TRIANGLE = 2


class WaveDirection(IntEnum):
    X = 0
    Y = 1
    Z = 2
    DIAGONAL = 3


class WaveMode(IntEnum):
    PROFILE_MASK = 3
    RINGS = 4
    DIRECTION_MASK = 3
    DIRECTION_SHIFT = 3


class GradientType(IntEnum):
    LINEAR = 0
    QUADRATIC = 1
    EASING = 2
    DIAGONAL = 3
    RADIAL = 4
    QUADRATIC_SPHERE = 5
    SPHERICAL = 6


class RadialTilingMode(IntEnum):
    NORMALIZE = 1


class MagicMode(IntEnum):
    MAX_DEPTH = 10
    DEPTH_MASK = 15
    SCALED_FIRST = 16


class BrickMode(IntEnum):
    ROWS_MASK = 127
    SQUASH_SHIFT = 7


class DistributionType(IntEnum):
    GGX = 0
    MULTI_GGX = 1
    BECKMANN = 2
    SHARP = 3
    ASHIKHMIN = 4
    CORRELATED = 16
    FILMED_METAL = 32
    WHOLE_COAT = 64
    THIN_WALL = 128
    CONDUCTOR = 256


class BlendMode(IntEnum):
    MIX = 0
    DARKEN = 1
    MULTIPLY = 2
    BURN = 3
    LIGHTEN = 4
    SCREEN = 5
    DODGE = 6
    ADD = 7
    OVERLAY = 8
    SOFT_LIGHT = 9
    LINEAR_LIGHT = 10
    DIFFERENCE = 11
    SUBTRACT = 12
    DIVIDE = 13
    HUE = 14
    SATURATION = 15
    COLOR = 16
    VALUE = 17
    EXCLUSION = 18


class MathOperation(IntEnum):
    ADD = 0
    SUBTRACT = 1
    MULTIPLY = 2
    DIVIDE = 3
    MULTIPLY_ADD = 4
    POWER = 5
    LOGARITHM = 6
    SQRT = 7
    INVERSE_SQRT = 8
    ABSOLUTE = 9
    EXPONENT = 10
    MINIMUM = 11
    MAXIMUM = 12
    LESS_THAN = 13
    GREATER_THAN = 14
    SIGN = 15
    COMPARE = 16
    SMOOTH_MIN = 17
    SMOOTH_MAX = 18
    ROUND = 19
    FLOOR = 20
    CEIL = 21
    TRUNC = 22
    FRACT = 23
    MODULO = 24
    WRAP = 25
    SNAP = 26
    PINGPONG = 27
    SINE = 28
    COSINE = 29
    TANGENT = 30
    ARCSINE = 31
    ARCCOSINE = 32
    ARCTANGENT = 33
    ARCTAN2 = 34
    SINH = 35
    COSH = 36
    TANH = 37
    RADIANS = 38
    DEGREES = 39


class VectorOperation(IntEnum):
    ADD = 0
    SUBTRACT = 1
    MULTIPLY = 2
    DIVIDE = 3
    MULTIPLY_ADD = 4
    CROSS = 5
    PROJECT = 6
    REFLECT = 7
    DOT = 8
    DISTANCE = 9
    LENGTH = 10
    SCALE = 11
    NORMALIZE = 12
    ABSOLUTE = 13
    MINIMUM = 14
    MAXIMUM = 15
    FLOOR = 16
    CEIL = 17
    FRACT = 18
    SINE = 19
    COSINE = 20
    TANGENT = 21
    SNAP = 22
    MODULO = 23
    WRAP = 24
    FACEFORWARD = 25
    REFRACT = 26
    ROUND = 27
    SIGN = 28
    POWER = 29


class ImageInterpolation(IntEnum):
    LINEAR = 0
    CLOSEST = 1
    CUBIC = 2


class ImageExtension(IntEnum):
    REPEAT = 0
    EXTEND = 4
    CLIP = 8
    MIRROR = 12


class ImageProjection(IntEnum):
    FLAT = 0
    BOX = 16
    SPHERE = 32
    TUBE = 48


class ImageMode(IntEnum):
    INTERPOLATION_MASK = 3
    EXTENSION_MASK = 12
    PROJECTION_MASK = 48


class EnvironmentProjection(IntEnum):
    EQUIRECTANGULAR = 0
    MIRROR_BALL = 16


class InputSource(IntEnum):
    CONSTANT = -1
    DEFAULT = -2


class MaterialFlags(IntFlag):
    SAMPLE_EMISSION = 1
    TRANSPARENT_SHADOW = 2
    DEFENSIVE_SAMPLING = 4
    FACET_SHADOWING = 8
    LIGHT_TREE = 16
    KEEPS_NORMALS = 32
    CUTS_OUT = 64
    WIDE_SHADOWS = 128


class AlphaMode(IntEnum):
    STRAIGHT = 0
    PREMULTIPLIED = 1
    CHANNEL_PACKED = 2
    NONE = 3


class IntegratorType(IntEnum):
    RAYCAST = 0
    WHITTED = 1
    DISTRIBUTION = 2


class SamplerType(IntEnum):
    SOBOL = 0
    SUDOKU = 1
    JITTER = 2
    INDEPENDENT = 3
    BLUE_NOISE = 4


class AssemblyType(IntEnum):
    AUTO = 0
    TYPES = 1
    RUNS = 2
    GROUPS = 3
    OCTANTS = 4
    BLIND = 5
    NONE = 6


class FilterType(IntEnum):
    BOX = 0
    GAUSSIAN = 1
    BLACKMAN_HARRIS = 2


class PassId(IntEnum):
    COMBINED = 0
    DEPTH = 1
    NORMAL = 2
    POSITION = 3
    UV = 4
    OBJECT_INDEX = 5
    MATERIAL_INDEX = 6
    EMISSION = 7
    ENVIRONMENT = 8
    DIFFUSE_DIRECT = 9
    DIFFUSE_INDIRECT = 10
    DIFFUSE_COLOR = 11
    GLOSSY_DIRECT = 12
    GLOSSY_INDIRECT = 13
    GLOSSY_COLOR = 14
    TRANSMISSION_DIRECT = 15
    TRANSMISSION_INDIRECT = 16
    TRANSMISSION_COLOR = 17
    SAMPLE_COUNT = 18
    MIST = 19
    DENOISING_ALBEDO = 20
    DENOISING_NORMAL = 21
    DENOISING_DEPTH = 22
    VECTOR = 23
    AMBIENT_OCCLUSION = 24
    SHADOW = 25
    SHADOW_CATCHER = 26
    DENOISING_ROUGHNESS = 27
    DENOISING_SPECULAR_ALBEDO = 28
    NOISY_COMBINED = 29
    DENOISING_EMISSION = 30
    COUNT = 31


class PassRange(IntEnum):
    FIRST_AOV_VALUE = 64
    FIRST_AOV_COLOR = 80
    FIRST_LIGHT_GROUP = 96
    FIRST_CRYPTOMATTE = 128


class CryptomatteKind(IntEnum):
    OBJECT = 0
    MATERIAL = 1
    ASSET = 2


class DenoiseType(IntEnum):
    NONE = 0
    FINAL = 1
    PREVIEW = 2


class GuidesType(IntEnum):
    ALBEDO_NORMAL = 0
    ALBEDO = 1
    NONE = 2


class PassesFlags(IntFlag):
    BLENDED_FEATURES = 1
    BACKGROUND_MOTION = 2
    MEAN_REFRACTION = 4


class ProgressState(IntEnum):
    RUNNING = 0
    DONE = 1
    CANCELLED = 2


class SumsId(IntEnum):
    CATCHERS = 192
    HALVES = 193


class FeatureFlags(IntFlag):
    LENS = 1
    CAMERA_MOTION = 2
    OBJECT_MOTION = 4
    DEFORMATION = 8
    INSTANCES = 16
    SPECULAR = 32
    GLOSSY = 64
    REFRACTION = 128
    TRANSPARENCY = 256
    TEXTURES = 512
    PROGRAMS = 1024
    LIGHTS = 2048
    AREA_LIGHTS = 4096
    EMISSIVE_MESHES = 8192
    ENVIRONMENT = 16384
    ENVIRONMENT_IMAGE = 32768
    VISIBILITY = 65536
    AMBIENT_OCCLUSION = 131072
    SHADOW_CATCHERS = 262144
    SLOPES = 524288
    LINKS = 1048576
    PORTALS = 2097152
    CURVES = 4194304
    SHADOW_TERMINATORS = 8388608
    SHADOW_SLOPES = 16777216
    RAY_KINDS = 33554432


class TangentsForm(IntEnum):
    VECTORS = 0
    COORDINATES = 1


class CameraDesc(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("type", c_uint32), ("key_count", c_uint32),
                ("blade_count", c_uint32), ("transforms", c_void_p), ("windows", c_void_p),
                ("window_key_count", c_uint32), ("clip_start", c_float), ("clip_end", c_float),
                ("aperture_radius", c_float), ("focus_distance", c_float), ("blade_rotation", c_float),
                ("aperture_ratio", c_float), ("shutter_time", c_float), ("shutter_curve_count", c_uint32),
                ("shutter_curve", c_void_p), ("longitude_min", c_float), ("longitude_max", c_float),
                ("latitude_min", c_float), ("latitude_max", c_float), ("height_min", c_float),
                ("height_max", c_float), ("fisheye_angle", c_float), ("fisheye_lens", c_float),
                ("sensor_width", c_float), ("sensor_height", c_float), ("fisheye_polynomial", c_float * 5),
                ("eye_offset", c_float), ("convergence_distance", c_float), ("pole_merge_from", c_float),
                ("pole_merge_to", c_float), ("row_delay", c_float))


class CurveAttribute(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("width", c_uint32), ("name", c_char_p), ("values", c_void_p),
                ("value_count", c_uint64), ("per_strand", c_uint32), ("reserved", c_uint32))


class CurvesDesc(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("key_count", c_uint32), ("shape", c_uint32),
                ("piece_count", c_uint32), ("point_count", c_uint64), ("points", c_void_p),
                ("point_value_count", c_uint64), ("lengths", c_void_p), ("strand_count", c_uint64),
                ("generated", c_void_p), ("generated_count", c_uint64),
                ("attributes", POINTER(CurveAttribute)), ("attribute_count", c_uint32),
                ("tolerance", c_float))


class CornerAttribute(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("width", c_uint32), ("name", c_char_p), ("values", c_void_p),
                ("value_count", c_uint64))


class DicingDesc(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("surface", c_uint32), ("space", c_uint32),
                ("max_subdivisions", c_uint32), ("sharp_corners", c_uint32), ("side", c_float),
                ("object_to_camera", c_float * 12), ("window", c_float * 4), ("offscreen_scale", c_float),
                ("triangle_max", c_uint64), ("faces", c_void_p), ("face_count", c_uint64),
                ("crease_edges", c_void_p), ("crease_edge_count", c_uint64), ("crease_sharpness", c_void_p),
                ("crease_count", c_uint64), ("vertex_sharpness", c_void_p),
                ("vertex_sharpness_count", c_uint64))


class MeshDesc(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("key_count", c_uint32), ("vertex_count", c_uint64),
                ("triangle_count", c_uint64), ("positions", c_void_p), ("position_count", c_uint64),
                ("indices", c_void_p), ("index_count", c_uint64), ("normals", c_void_p),
                ("normal_count", c_uint64), ("normal_kind", c_uint32), ("attribute_count", c_uint32),
                ("smooth", c_void_p), ("material_index", c_void_p), ("attributes", POINTER(CornerAttribute)),
                ("generated", c_void_p), ("generated_count", c_uint64), ("dicing", POINTER(DicingDesc)))


class InstanceDesc(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("key_count", c_uint32), ("mesh", c_uint64),
                ("transforms", c_void_p), ("materials", c_void_p), ("material_count", c_uint32),
                ("visibility", c_uint32), ("pass_index", c_int32), ("random", c_float),
                ("color", c_float * 4), ("cryptomatte_object", c_float), ("cryptomatte_asset", c_float),
                ("light_group", c_uint32), ("flags", c_uint32), ("ao_distance", c_float),
                ("value_count", c_uint32), ("values", c_void_p), ("light_set", c_uint32),
                ("shadow_set", c_uint32), ("light_exclude", c_uint64), ("shadow_exclude", c_uint64),
                ("shadow_terminator_geometry", c_float), ("shadow_terminator_shading", c_float))


class LightDesc(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("type", c_uint32), ("transform", c_float * 12),
                ("color", c_float * 3), ("strength", c_float), ("radius", c_float), ("angle", c_float),
                ("size_x", c_float), ("size_y", c_float), ("area_shape", c_uint32), ("spread", c_float),
                ("spot_angle", c_float), ("spot_blend", c_float), ("visibility", c_uint32),
                ("cast_shadow", c_uint32), ("use_mis", c_uint32), ("light_group", c_uint32),
                ("flags", c_uint32), ("random", c_float), ("bounce_limit", c_uint32),
                ("pass_index", c_int32), ("object_color", c_float * 4), ("material", c_uint64),
                ("light_exclude", c_uint64), ("shadow_exclude", c_uint64))


class WorldDesc(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("use_sampling", c_uint32), ("material", c_uint64),
                ("visibility", c_uint32), ("map_resolution", c_uint32), ("ao_distance", c_float),
                ("ao_factor", c_float), ("ao_method", c_uint32), ("light_group", c_uint32),
                ("sun_direction", c_float * 3), ("sun_angle", c_float), ("cast_shadow", c_uint32))


class NodeInput(Structure):
    __slots__ = ()
    _fields_ = (("node", c_int32), ("output", c_uint32), ("value", c_float * 3))


class Node(Structure):
    __slots__ = ()
    _fields_ = (("type", c_uint32), ("mode", c_uint32), ("first_input", c_uint32), ("input_count", c_uint32),
                ("image", c_uint64), ("name", c_char_p), ("table", c_void_p), ("table_count", c_uint64))


class MaterialDesc(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("node_count", c_uint32), ("nodes", POINTER(Node)),
                ("inputs", POINTER(NodeInput)), ("input_count", c_uint32), ("surface", c_int32),
                ("pass_index", c_int32), ("flags", c_uint32), ("cryptomatte", c_float),
                ("reserved", c_uint32), ("film_colors", c_void_p))


class ImageDesc(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("width", c_uint32), ("height", c_uint32),
                ("alpha_mode", c_uint32), ("is_srgb", c_uint32), ("is_float", c_uint32),
                ("pixels", c_void_p), ("pixel_bytes", c_uint64), ("path", c_char_p),
                ("color_config", c_char_p), ("color_space", c_char_p), ("max_side", c_uint32),
                ("is_mip_mapped", c_uint32), ("is_alpha_literal", c_uint32))


class Rays(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("visibility", c_uint32), ("count", c_uint64),
                ("origin_x", c_void_p), ("origin_y", c_void_p), ("origin_z", c_void_p),
                ("direction_x", c_void_p), ("direction_y", c_void_p), ("direction_z", c_void_p),
                ("tmin", c_void_p), ("tmax", c_void_p), ("time", c_void_p), ("flags", c_uint32),
                ("reserved", c_uint32))


class Hits(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("reserved", c_uint32), ("instance", c_void_p),
                ("triangle", c_void_p), ("distance", c_void_p), ("u", c_void_p), ("v", c_void_p),
                ("normal_x", c_void_p), ("normal_y", c_void_p), ("normal_z", c_void_p))


class ReaderDesc(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("reserved", c_uint32), ("program", c_char_p),
                ("script", c_char_p))


class RenderDesc(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("width", c_uint32), ("height", c_uint32), ("crop_x", c_uint32),
                ("crop_y", c_uint32), ("crop_width", c_uint32), ("crop_height", c_uint32),
                ("integrator", c_uint32), ("sample_count", c_uint32), ("light_samples", c_uint32),
                ("max_depth", c_uint32), ("max_transparent_depth", c_uint32), ("max_shadow_depth", c_uint32),
                ("max_glossy_depth", c_uint32), ("max_transmission_depth", c_uint32),
                ("attenuation_cutoff", c_float), ("filter_glossy", c_float), ("clamp_direct", c_float),
                ("clamp_indirect", c_float), ("assembly", c_uint32), ("packet_size", c_uint32),
                ("sampler", c_uint32), ("seed", c_uint32), ("filter", c_uint32), ("filter_width", c_float),
                ("film_transparent", c_uint32), ("film_transparent_glass", c_uint32),
                ("film_transparent_roughness", c_float), ("film_exposure", c_float), ("passes", c_uint64),
                ("thread_count", c_uint32), ("progressive", c_uint32), ("noise_threshold", c_float),
                ("min_samples", c_uint32), ("mist_start", c_float), ("mist_depth", c_float),
                ("mist_falloff", c_float), ("cryptomattes", c_uint32), ("cryptomatte_depth", c_uint32),
                ("aov_value_count", c_uint32), ("aov_color_count", c_uint32),
                ("light_group_count", c_uint32), ("denoise", c_uint32), ("sample_offset", c_uint32),
                ("sample_subset", c_uint32), ("pass_flags", c_uint32), ("guides", c_uint32),
                ("extra_samples", c_float))


class RenderProgress(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("state", c_uint32), ("fraction", c_float),
                ("samples_done", c_uint32), ("seconds", c_double), ("rays_camera", c_uint64),
                ("rays_shadow", c_uint64), ("rays_reflection", c_uint64), ("rays_refraction", c_uint64),
                ("dropped_samples", c_uint64), ("memory_bytes", c_uint64), ("peak_memory_bytes", c_uint64),
                ("tiles_done", c_uint32), ("tile_count", c_uint32), ("version", c_uint32),
                ("reserved", c_uint32), ("seconds_trace", c_double), ("seconds_shade", c_double),
                ("seconds_other", c_double))


class Sums(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("number", c_uint32), ("values", c_void_p),
                ("value_count", c_uint64))


class PartDesc(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("sample_offset", c_uint32), ("sample_subset", c_uint32),
                ("sums_count", c_uint32), ("sums", POINTER(Sums)))


class SceneDesc(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("thread_count", c_uint32), ("is_final", c_uint32),
                ("image_megabytes", c_uint32), ("reader", c_uint64))


class SceneStats(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("features", c_uint32), ("triangle_count", c_uint64),
                ("instanced_triangle_count", c_uint64), ("skipped_triangle_count", c_uint64),
                ("mesh_count", c_uint64), ("instance_count", c_uint64), ("skipped_instance_count", c_uint64),
                ("light_count", c_uint64), ("material_count", c_uint64),
                ("emissive_triangle_count", c_uint64), ("bvh_bytes", c_uint64), ("geometry_bytes", c_uint64),
                ("image_bytes", c_uint64), ("build_seconds", c_double), ("commit_seconds", c_double),
                ("built_count", c_uint32), ("refitted_count", c_uint32), ("bounds_lower", c_float * 3),
                ("bounds_upper", c_float * 3))


class TangentsDesc(Structure):
    __slots__ = ()
    _fields_ = (("struct_size", c_uint32), ("has_seams", c_uint32), ("triangle_count", c_uint64),
                ("positions", c_void_p), ("normals", c_void_p), ("uvs", c_void_p))


# By their names in C.
CONSTANTS = {"TRC_MAX_LIGHT_GROUPS": MAX_LIGHT_GROUPS, "TRC_MAX_CURVE_PIECES": MAX_CURVE_PIECES,
             "TRC_MAX_KEYS": MAX_KEYS, "TRC_MAX_ATTRIBUTES": MAX_ATTRIBUTES,
             "TRC_MAX_INSTANCE_VALUES": MAX_INSTANCE_VALUES, "TRC_MAX_SHADOW_CLASSES": MAX_SHADOW_CLASSES,
             "TRC_MAX_NODES": MAX_NODES, "TRC_MAX_NODE_INPUTS": MAX_NODE_INPUTS,
             "TRC_RAYS_REORDER": RAYS_REORDER, "TRC_NO_HIT": NO_HIT, "TRC_MAX_AOVS": MAX_AOVS,
             "TRC_CRYPTOMATTE_KINDS": CRYPTOMATTE_KINDS,
             "TRC_CRYPTOMATTE_LAYER_RANKS": CRYPTOMATTE_LAYER_RANKS,
             "TRC_MAX_CRYPTOMATTE_LAYERS": MAX_CRYPTOMATTE_LAYERS,
             "TRC_MAX_CRYPTOMATTE_DEPTH": MAX_CRYPTOMATTE_DEPTH, "TRC_SUMS_END": SUMS_END,
             "TRC_VERSION_MAJOR": VERSION_MAJOR, "TRC_VERSION_MINOR": VERSION_MINOR,
             "TRC_VERSION_PATCH": VERSION_PATCH, "TRC_ABI_VERSION": ABI_VERSION}

# Enumerations, with what their members' names begin with in C.
ENUMERATIONS = {StatusCode: "TRC_", IsaId: "TRC_ISA_", CameraType: "TRC_CAMERA_", CurveShape: "TRC_CURVE_",
                NormalsLayout: "TRC_NORMALS_", DicingSurface: "TRC_DICING_", DicingSpace: "TRC_DICING_",
                VisibleRays: "TRC_VISIBLE_", InstanceFlags: "TRC_INSTANCE_", LightType: "TRC_LIGHT_",
                AreaShape: "TRC_AREA_", LightFlags: "TRC_LIGHT_", AoMethod: "TRC_AO_", NodeType: "TRC_NODE_",
                ModeFlags: "TRC_MODE_", TableSize: "TRC_TABLE_", DiffuseModel: "TRC_DIFFUSE_",
                ToonComponent: "TRC_TOON_", HairComponent: "TRC_HAIR_", Pigment: "TRC_PIGMENT_",
                PrincipledHairMode: "TRC_PRINCIPLED_HAIR_", MappingType: "TRC_MAPPING_",
                NormalMapSpace: "TRC_NORMAL_MAP_", NormalMapFlags: "TRC_NORMAL_MAP_", BumpMode: "TRC_BUMP_",
                WireframeMode: "TRC_WIREFRAME_", AttributeMode: "TRC_ATTRIBUTE_",
                CoordinateMode: "TRC_COORDINATE_", AmbientMode: "TRC_AMBIENT_", RaycastMode: "TRC_RAYCAST_",
                DisplacementMethod: "TRC_DISPLACEMENT_", RampInterpolation: "TRC_RAMP_", Gamut: "TRC_GAMUT_",
                CurvesExtension: "TRC_CURVES_", SeparateMode: "TRC_SEPARATE_", ClampType: "TRC_CLAMP_",
                TangentSource: "TRC_TANGENT_", SpaceId: "TRC_SPACE_", TransformedType: "TRC_TRANSFORMED_",
                VectorTransformMode: "TRC_", RotateMode: "TRC_ROTATE_", RotateFlags: "TRC_ROTATE_",
                TextureMode: "TRC_", FractalType: "TRC_FRACTAL_", NoiseMode: "TRC_NOISE_",
                VoronoiMetric: "TRC_VORONOI_", VoronoiFeature: "TRC_VORONOI_", VoronoiMode: "TRC_VORONOI_",
                WaveProfile: "TRC_WAVE_", WaveDirection: "TRC_WAVE_", WaveMode: "TRC_WAVE_",
                GradientType: "TRC_GRADIENT_", RadialTilingMode: "TRC_RADIAL_TILING_",
                MagicMode: "TRC_MAGIC_", BrickMode: "TRC_BRICK_", DistributionType: "TRC_DISTRIBUTION_",
                BlendMode: "TRC_BLEND_", MathOperation: "TRC_MATH_", VectorOperation: "TRC_VECTOR_",
                ImageInterpolation: "TRC_IMAGE_", ImageExtension: "TRC_IMAGE_",
                ImageProjection: "TRC_IMAGE_", ImageMode: "TRC_IMAGE_",
                EnvironmentProjection: "TRC_ENVIRONMENT_", InputSource: "TRC_INPUT_",
                MaterialFlags: "TRC_MATERIAL_", AlphaMode: "TRC_ALPHA_", IntegratorType: "TRC_INTEGRATOR_",
                SamplerType: "TRC_SAMPLER_", AssemblyType: "TRC_ASSEMBLY_", FilterType: "TRC_FILTER_",
                PassId: "TRC_PASS_", PassRange: "TRC_PASS_", CryptomatteKind: "TRC_CRYPTOMATTE_",
                DenoiseType: "TRC_DENOISE_", GuidesType: "TRC_GUIDES_", PassesFlags: "TRC_PASSES_",
                ProgressState: "TRC_PROGRESS_", SumsId: "TRC_SUMS_", FeatureFlags: "TRC_FEATURE_",
                TangentsForm: "TRC_TANGENTS_"}

STRUCTURES = {"trc_camera_desc": CameraDesc, "trc_curve_attribute": CurveAttribute,
              "trc_curves_desc": CurvesDesc, "trc_corner_attribute": CornerAttribute,
              "trc_dicing_desc": DicingDesc, "trc_mesh_desc": MeshDesc, "trc_instance_desc": InstanceDesc,
              "trc_light_desc": LightDesc, "trc_world_desc": WorldDesc, "trc_node_input": NodeInput,
              "trc_node": Node, "trc_material_desc": MaterialDesc, "trc_image_desc": ImageDesc,
              "trc_rays": Rays, "trc_hits": Hits, "trc_reader_desc": ReaderDesc,
              "trc_render_desc": RenderDesc, "trc_render_progress": RenderProgress, "trc_sums": Sums,
              "trc_part_desc": PartDesc, "trc_scene_desc": SceneDesc, "trc_scene_stats": SceneStats,
              "trc_tangents_desc": TangentsDesc}

# Result and arguments.
FUNCTIONS = {
    "trc_abi_version": (c_uint32, ()),
    "trc_version_string": (c_char_p, ()),
    "trc_last_message": (c_char_p, ()),
    "trc_abi_value": (c_int32, (c_char_p, POINTER(c_int64))),
    "trc_isa": (c_uint32, ()),
    "trc_set_isa": (c_int32, (c_uint32,)),
    "trc_isa_name": (c_char_p, (c_uint32,)),
    "trc_camera_desc_default": (CameraDesc, ()),
    "trc_scene_set_camera": (c_int32, (c_uint64, POINTER(CameraDesc))),
    "trc_curve_attribute_default": (CurveAttribute, ()),
    "trc_curves_desc_default": (CurvesDesc, ()),
    "trc_curves_create": (c_int32, (c_uint64, POINTER(CurvesDesc), POINTER(c_uint64))),
    "trc_curves_update": (c_int32, (c_uint64, c_uint64, c_uint32, c_void_p, c_uint64)),
    "trc_corner_attribute_default": (CornerAttribute, ()),
    "trc_dicing_desc_default": (DicingDesc, ()),
    "trc_mesh_desc_default": (MeshDesc, ()),
    "trc_mesh_create": (c_int32, (c_uint64, POINTER(MeshDesc), POINTER(c_uint64))),
    "trc_mesh_update": (c_int32, (c_uint64, c_uint64, c_uint32, c_void_p, c_uint64, c_void_p, c_uint64)),
    "trc_mesh_destroy": (c_int32, (c_uint64, c_uint64)),
    "trc_instance_desc_default": (InstanceDesc, ()),
    "trc_instance_create": (c_int32, (c_uint64, POINTER(InstanceDesc), POINTER(c_uint64))),
    "trc_instance_update": (c_int32, (c_uint64, c_uint64, POINTER(InstanceDesc))),
    "trc_instances_move": (c_int32, (c_uint64, c_void_p, c_uint64, c_uint32, c_void_p, c_uint64)),
    "trc_instance_destroy": (c_int32, (c_uint64, c_uint64)),
    "trc_light_desc_default": (LightDesc, ()),
    "trc_light_create": (c_int32, (c_uint64, POINTER(LightDesc), POINTER(c_uint64))),
    "trc_light_update": (c_int32, (c_uint64, c_uint64, POINTER(LightDesc))),
    "trc_light_destroy": (c_int32, (c_uint64, c_uint64)),
    "trc_world_desc_default": (WorldDesc, ()),
    "trc_scene_set_world": (c_int32, (c_uint64, POINTER(WorldDesc))),
    "trc_node_input_default": (NodeInput, ()),
    "trc_node_default": (Node, ()),
    "trc_material_desc_default": (MaterialDesc, ()),
    "trc_material_create": (c_int32, (c_uint64, POINTER(MaterialDesc), POINTER(c_uint64))),
    "trc_material_update": (c_int32, (c_uint64, c_uint64, POINTER(MaterialDesc))),
    "trc_material_destroy": (c_int32, (c_uint64, c_uint64)),
    "trc_image_desc_default": (ImageDesc, ()),
    "trc_image_create": (c_int32, (c_uint64, POINTER(ImageDesc), POINTER(c_uint64))),
    "trc_image_update": (c_int32, (c_uint64, c_uint64, POINTER(ImageDesc))),
    "trc_image_expect": (c_int32, (c_uint64, POINTER(ImageDesc))),
    "trc_image_destroy": (c_int32, (c_uint64, c_uint64)),
    "trc_rays_default": (Rays, ()),
    "trc_hits_default": (Hits, ()),
    "trc_query_closest": (c_int32, (c_uint64, POINTER(Rays), c_uint32, POINTER(Hits))),
    "trc_query_occluded": (c_int32, (c_uint64, POINTER(Rays), c_uint32, c_void_p, c_uint64)),
    "trc_reader_desc_default": (ReaderDesc, ()),
    "trc_reader_create": (c_int32, (POINTER(ReaderDesc), POINTER(c_uint64))),
    "trc_reader_start": (c_int32, (c_uint64,)),
    "trc_reader_destroy": (c_int32, (c_uint64,)),
    "trc_cryptomatte_id": (c_float, (c_char_p,)),
    "trc_render_desc_default": (RenderDesc, ()),
    "trc_render_start": (c_int32, (c_uint64, POINTER(RenderDesc), POINTER(c_uint64))),
    "trc_render_progress_default": (RenderProgress, ()),
    "trc_render_poll": (c_int32, (c_uint64, POINTER(RenderProgress))),
    "trc_render_wait": (c_int32, (c_uint64, c_double)),
    "trc_render_cancel": (c_int32, (c_uint64,)),
    "trc_render_read": (c_int32, (c_uint64, c_uint32, c_void_p, c_uint64)),
    "trc_render_read_preview": (c_int32, (c_uint64, c_void_p, c_uint64)),
    "trc_pass_channels": (c_uint32, (c_uint32,)),
    "trc_sums_channels": (c_uint32, (c_uint64, c_uint32)),
    "trc_sums_read": (c_int32, (c_uint64, c_uint32, c_void_p, c_uint64)),
    "trc_sums_default": (Sums, ()),
    "trc_part_desc_default": (PartDesc, ()),
    "trc_merge_start": (c_int32, (POINTER(RenderDesc), c_uint32, POINTER(c_uint64))),
    "trc_merge_add": (c_int32, (c_uint64, POINTER(PartDesc))),
    "trc_merge_finish": (c_int32, (c_uint64,)),
    "trc_render_destroy": (c_int32, (c_uint64,)),
    "trc_scene_desc_default": (SceneDesc, ()),
    "trc_scene_create": (c_int32, (POINTER(SceneDesc), POINTER(c_uint64))),
    "trc_scene_destroy": (c_int32, (c_uint64,)),
    "trc_scene_commit": (c_int32, (c_uint64,)),
    "trc_scene_cancel": (c_int32, (c_uint64,)),
    "trc_scene_stats_default": (SceneStats, ()),
    "trc_scene_get_stats": (c_int32, (c_uint64, POINTER(SceneStats))),
    "trc_scene_get_warnings": (c_int32, (c_uint64, c_char_p, c_uint64, POINTER(c_uint64))),
    "trc_tangents_desc_default": (TangentsDesc, ()),
    "trc_tangents_find": (c_int32, (POINTER(TangentsDesc), c_uint32, c_void_p, c_uint64)),
}

# Label, inputs and outputs of the node types: kind and name of each.
NODES = {
    NodeType.DIFFUSE: ("Diffuse",
        (("COLOR", "color"), ("FLOAT", "roughness"), ("NORMAL", "normal")),
        (("SHADER", "closure"),)),
    NodeType.GLOSSY: ("Glossy",
        (("COLOR", "color"), ("FLOAT", "roughness"), ("FLOAT", "anisotropy"), ("FLOAT", "rotation"),
         ("NORMAL", "normal"), ("TANGENT", "tangent")),
        (("SHADER", "closure"),)),
    NodeType.GLASS: ("Glass",
        (("COLOR", "color"), ("FLOAT", "roughness"), ("FLOAT", "ior"), ("NORMAL", "normal"),
         ("FLOAT", "film_thickness"), ("FLOAT", "film_ior")),
        (("SHADER", "closure"),)),
    NodeType.REFRACTION: ("Refraction",
        (("COLOR", "color"), ("FLOAT", "roughness"), ("FLOAT", "ior"), ("NORMAL", "normal")),
        (("SHADER", "closure"),)),
    NodeType.TRANSPARENT: ("Transparent",
        (("COLOR", "color"),),
        (("SHADER", "closure"),)),
    NodeType.TRANSLUCENT: ("Translucent",
        (("COLOR", "color"), ("NORMAL", "normal")),
        (("SHADER", "closure"),)),
    NodeType.EMISSION: ("Emission",
        (("COLOR", "color"), ("FLOAT", "strength")),
        (("SHADER", "closure"),)),
    NodeType.BACKGROUND: ("Background",
        (("COLOR", "color"), ("FLOAT", "strength")),
        (("SHADER", "closure"),)),
    NodeType.MIX_SHADER: ("Mix Shader",
        (("FLOAT", "factor"), ("SHADER", "first"), ("SHADER", "second")),
        (("SHADER", "closure"),)),
    NodeType.ADD_SHADER: ("Add Shader",
        (("SHADER", "first"), ("SHADER", "second")),
        (("SHADER", "closure"),)),
    NodeType.HOLDOUT: ("Holdout",
        (),
        (("SHADER", "closure"),)),
    NodeType.PRINCIPLED: ("Principled",
        (("COLOR", "base_color"), ("FLOAT", "subsurface"), ("COLOR", "subsurface_color"),
         ("FLOAT", "metallic"), ("FLOAT", "specular"), ("FLOAT", "specular_tint"), ("FLOAT", "roughness"),
         ("FLOAT", "anisotropic"), ("FLOAT", "anisotropic_rotation"), ("FLOAT", "sheen"),
         ("FLOAT", "sheen_tint"), ("FLOAT", "clearcoat"), ("FLOAT", "clearcoat_roughness"), ("FLOAT", "ior"),
         ("FLOAT", "transmission"), ("FLOAT", "transmission_roughness"), ("COLOR", "emission"),
         ("FLOAT", "emission_strength"), ("FLOAT", "alpha"), ("NORMAL", "normal"),
         ("NORMAL", "clearcoat_normal"), ("TANGENT", "tangent")),
        (("SHADER", "closure"),)),
    NodeType.VELVET: ("Velvet",
        (("COLOR", "color"), ("FLOAT", "sigma"), ("NORMAL", "normal")),
        (("SHADER", "closure"),)),
    NodeType.TOON: ("Toon",
        (("COLOR", "color"), ("FLOAT", "size"), ("FLOAT", "smooth"), ("NORMAL", "normal")),
        (("SHADER", "closure"),)),
    NodeType.LAYERED_PRINCIPLED: ("Principled",
        (("COLOR", "base_color"), ("FLOAT", "metallic"), ("FLOAT", "roughness"), ("FLOAT", "ior"),
         ("FLOAT", "alpha"), ("NORMAL", "normal"), ("FLOAT", "diffuse_roughness"),
         ("FLOAT", "specular_ior_level"), ("COLOR", "specular_tint"), ("FLOAT", "anisotropic"),
         ("FLOAT", "anisotropic_rotation"), ("TANGENT", "tangent"), ("FLOAT", "transmission_weight"),
         ("FLOAT", "coat_weight"), ("FLOAT", "coat_roughness"), ("FLOAT", "coat_ior"),
         ("COLOR", "coat_tint"), ("NORMAL", "coat_normal"), ("FLOAT", "sheen_weight"),
         ("FLOAT", "sheen_roughness"), ("COLOR", "sheen_tint"), ("COLOR", "emission_color"),
         ("FLOAT", "emission_strength"), ("FLOAT", "film_thickness"), ("FLOAT", "film_ior")),
        (("SHADER", "closure"),)),
    NodeType.SHEEN: ("Sheen",
        (("COLOR", "color"), ("FLOAT", "roughness"), ("NORMAL", "normal")),
        (("SHADER", "closure"),)),
    NodeType.RAY_PORTAL: ("Ray Portal",
        (("COLOR", "color"), ("POSITION", "position"), ("VECTOR", "direction")),
        (("SHADER", "closure"),)),
    NodeType.HAIR: ("Hair",
        (("COLOR", "color"), ("FLOAT", "offset"), ("FLOAT", "roughness_u"), ("FLOAT", "roughness_v"),
         ("TANGENT", "tangent")),
        (("SHADER", "closure"),)),
    NodeType.PRINCIPLED_HAIR: ("Principled Hair",
        (("COLOR", "color"), ("VECTOR", "absorption"), ("COLOR", "tint"), ("FLOAT", "melanin"),
         ("FLOAT", "melanin_redness"), ("FLOAT", "roughness"), ("FLOAT", "radial_roughness"),
         ("FLOAT", "coat"), ("FLOAT", "ior"), ("FLOAT", "offset"), ("FLOAT", "random_color"),
         ("FLOAT", "random_roughness"), ("FLOAT", "random"), ("TANGENT", "tangent")),
        (("SHADER", "closure"),)),
    NodeType.HUANG_HAIR: ("Principled Hair (Huang)",
        (("COLOR", "color"), ("VECTOR", "absorption"), ("COLOR", "tint"), ("FLOAT", "melanin"),
         ("FLOAT", "melanin_redness"), ("FLOAT", "roughness"), ("FLOAT", "aspect_ratio"), ("FLOAT", "ior"),
         ("FLOAT", "offset"), ("FLOAT", "random_color"), ("FLOAT", "random_roughness"), ("FLOAT", "random"),
         ("VECTOR", "major"), ("FLOAT", "reflection"), ("FLOAT", "transmission"),
         ("FLOAT", "second_reflection"), ("FLOAT", "radius"), ("TANGENT", "tangent")),
        (("SHADER", "closure"),)),
    NodeType.IMAGE: ("Image",
        (("UV", "vector"), ("FLOAT", "blend")),
        (("COLOR", "color"), ("FLOAT", "alpha"))),
    NodeType.ENVIRONMENT: ("Environment",
        (("POSITION", "vector"),),
        (("COLOR", "color"),)),
    NodeType.UV_MAP: ("UV Map",
        (),
        (("VECTOR", "uv"),)),
    NodeType.COLOR_ATTRIBUTE: ("Color Attribute",
        (),
        (("COLOR", "color"), ("FLOAT", "alpha"))),
    NodeType.TEXTURE_COORDINATE: ("Texture Coordinate",
        (),
        (("VECTOR", "generated"), ("VECTOR", "normal"), ("VECTOR", "uv"), ("VECTOR", "object"),
         ("VECTOR", "camera"), ("VECTOR", "window"), ("VECTOR", "reflection"))),
    NodeType.MAPPING: ("Mapping",
        (("VECTOR", "vector"), ("VECTOR", "location"), ("VECTOR", "rotation"), ("VECTOR", "scale")),
        (("VECTOR", "vector"),)),
    NodeType.MIX_COLOR: ("Mix Color",
        (("FLOAT", "factor"), ("COLOR", "a"), ("COLOR", "b")),
        (("COLOR", "color"),)),
    NodeType.MATH: ("Math",
        (("FLOAT", "a"), ("FLOAT", "b"), ("FLOAT", "c")),
        (("FLOAT", "value"),)),
    NodeType.FRESNEL: ("Fresnel",
        (("FLOAT", "ior"), ("NORMAL", "normal")),
        (("FLOAT", "factor"),)),
    NodeType.LAYER_WEIGHT: ("Layer Weight",
        (("FLOAT", "blend"), ("NORMAL", "normal")),
        (("FLOAT", "fresnel"), ("FLOAT", "facing"))),
    NodeType.LIGHT_PATH: ("Light Path",
        (),
        (("FLOAT", "is_camera"), ("FLOAT", "is_shadow"), ("FLOAT", "is_diffuse"), ("FLOAT", "is_glossy"),
         ("FLOAT", "is_singular"), ("FLOAT", "is_reflection"), ("FLOAT", "is_transmission"),
         ("FLOAT", "ray_length"), ("FLOAT", "ray_depth"), ("FLOAT", "diffuse_depth"),
         ("FLOAT", "glossy_depth"), ("FLOAT", "transparent_depth"), ("FLOAT", "transmission_depth"),
         ("FLOAT", "portal_depth"))),
    NodeType.GEOMETRY: ("Geometry",
        (),
        (("VECTOR", "position"), ("VECTOR", "normal"), ("VECTOR", "tangent"), ("VECTOR", "true_normal"),
         ("VECTOR", "incoming"), ("VECTOR", "parametric"), ("FLOAT", "backfacing"), ("FLOAT", "pointiness"),
         ("FLOAT", "random_per_island"))),
    NodeType.NORMAL_MAP: ("Normal Map",
        (("FLOAT", "strength"), ("COLOR", "color")),
        (("VECTOR", "normal"),)),
    NodeType.INVERT: ("Invert",
        (("FLOAT", "factor"), ("COLOR", "color")),
        (("COLOR", "color"),)),
    NodeType.GAMMA: ("Gamma",
        (("COLOR", "color"), ("FLOAT", "gamma")),
        (("COLOR", "color"),)),
    NodeType.HUE_SATURATION: ("Hue Saturation Value",
        (("FLOAT", "hue"), ("FLOAT", "saturation"), ("FLOAT", "value"), ("FLOAT", "factor"),
         ("COLOR", "color")),
        (("COLOR", "color"),)),
    NodeType.BRIGHT_CONTRAST: ("Bright/Contrast",
        (("COLOR", "color"), ("FLOAT", "bright"), ("FLOAT", "contrast")),
        (("COLOR", "color"),)),
    NodeType.COLOR_RAMP: ("Color Ramp",
        (("FLOAT", "factor"),),
        (("COLOR", "color"), ("FLOAT", "alpha"))),
    NodeType.SEPARATE: ("Separate",
        (("COLOR", "color"),),
        (("FLOAT", "x"), ("FLOAT", "y"), ("FLOAT", "z"))),
    NodeType.COMBINE: ("Combine",
        (("FLOAT", "x"), ("FLOAT", "y"), ("FLOAT", "z")),
        (("COLOR", "color"),)),
    NodeType.MAP_RANGE: ("Map Range",
        (("FLOAT", "value"), ("FLOAT", "from_min"), ("FLOAT", "from_max"), ("FLOAT", "to_min"),
         ("FLOAT", "to_max")),
        (("FLOAT", "value"),)),
    NodeType.CLAMP: ("Clamp",
        (("FLOAT", "value"), ("FLOAT", "min"), ("FLOAT", "max")),
        (("FLOAT", "value"),)),
    NodeType.CHECKER: ("Checker",
        (("GENERATED", "vector"), ("COLOR", "color1"), ("COLOR", "color2"), ("FLOAT", "scale")),
        (("COLOR", "color"), ("FLOAT", "factor"))),
    NodeType.OBJECT_INFO: ("Object Info",
        (),
        (("VECTOR", "location"), ("COLOR", "color"), ("FLOAT", "alpha"), ("FLOAT", "object_index"),
         ("FLOAT", "material_index"), ("FLOAT", "random"))),
    NodeType.VECTOR_MATH: ("Vector Math",
        (("VECTOR", "a"), ("VECTOR", "b"), ("VECTOR", "c"), ("FLOAT", "scale")),
        (("VECTOR", "vector"), ("FLOAT", "value"))),
    NodeType.RGB_TO_BW: ("RGB to BW",
        (("COLOR", "color"),),
        (("FLOAT", "value"),)),
    NodeType.INSTANCE_VALUES: ("Instance Values",
        (),
        (("COLOR", "values"),)),
    NodeType.NOISE: ("Noise",
        (("GENERATED", "vector"), ("FLOAT", "w"), ("FLOAT", "scale"), ("FLOAT", "detail"),
         ("FLOAT", "roughness"), ("FLOAT", "lacunarity"), ("FLOAT", "offset"), ("FLOAT", "gain"),
         ("FLOAT", "distortion")),
        (("FLOAT", "value"), ("COLOR", "color"))),
    NodeType.MUSGRAVE: ("Musgrave",
        (("GENERATED", "vector"), ("FLOAT", "w"), ("FLOAT", "scale"), ("FLOAT", "detail"),
         ("FLOAT", "dimension"), ("FLOAT", "lacunarity"), ("FLOAT", "offset"), ("FLOAT", "gain")),
        (("FLOAT", "value"),)),
    NodeType.VORONOI: ("Voronoi",
        (("GENERATED", "vector"), ("FLOAT", "w"), ("FLOAT", "scale"), ("FLOAT", "smoothness"),
         ("FLOAT", "exponent"), ("FLOAT", "randomness"), ("FLOAT", "detail"), ("FLOAT", "roughness"),
         ("FLOAT", "lacunarity")),
        (("FLOAT", "distance"), ("COLOR", "color"), ("VECTOR", "position"), ("FLOAT", "w"),
         ("FLOAT", "radius"))),
    NodeType.WAVE: ("Wave",
        (("GENERATED", "vector"), ("FLOAT", "scale"), ("FLOAT", "distortion"), ("FLOAT", "detail"),
         ("FLOAT", "detail_scale"), ("FLOAT", "detail_roughness"), ("FLOAT", "phase")),
        (("FLOAT", "value"),)),
    NodeType.GRADIENT: ("Gradient",
        (("GENERATED", "vector"),),
        (("FLOAT", "value"),)),
    NodeType.WHITE_NOISE: ("White Noise",
        (("GENERATED", "vector"), ("FLOAT", "w")),
        (("FLOAT", "value"), ("COLOR", "color"))),
    NodeType.GABOR: ("Gabor",
        (("GENERATED", "vector"), ("FLOAT", "scale"), ("FLOAT", "frequency"), ("FLOAT", "anisotropy"),
         ("FLOAT", "angle"), ("VECTOR", "direction")),
        (("FLOAT", "value"), ("FLOAT", "phase"), ("FLOAT", "intensity"))),
    NodeType.RADIAL_TILING: ("Radial Tiling",
        (("VECTOR", "vector"), ("FLOAT", "sides"), ("FLOAT", "roundness")),
        (("VECTOR", "coordinates"), ("FLOAT", "id"), ("FLOAT", "width"), ("FLOAT", "rotation"))),
    NodeType.MAGIC: ("Magic",
        (("GENERATED", "vector"), ("FLOAT", "scale"), ("FLOAT", "distortion")),
        (("COLOR", "color"), ("FLOAT", "factor"))),
    NodeType.BRICK: ("Brick",
        (("GENERATED", "vector"), ("COLOR", "color1"), ("COLOR", "color2"), ("COLOR", "mortar"),
         ("FLOAT", "scale"), ("FLOAT", "mortar_size"), ("FLOAT", "mortar_smooth"), ("FLOAT", "bias"),
         ("FLOAT", "brick_width"), ("FLOAT", "row_height"), ("FLOAT", "offset"), ("FLOAT", "squash")),
        (("COLOR", "color"), ("FLOAT", "factor"))),
    NodeType.CURVES: ("Curves",
        (("FLOAT", "factor"), ("COLOR", "color"), ("FLOAT", "low"), ("FLOAT", "high")),
        (("COLOR", "color"),)),
    NodeType.FLOAT_CURVE: ("Float Curve",
        (("FLOAT", "factor"), ("FLOAT", "value"), ("FLOAT", "low"), ("FLOAT", "high")),
        (("FLOAT", "value"),)),
    NodeType.BLACKBODY: ("Blackbody",
        (("FLOAT", "temperature"),),
        (("COLOR", "color"),)),
    NodeType.WAVELENGTH: ("Wavelength",
        (("FLOAT", "wavelength"),),
        (("COLOR", "color"),)),
    NodeType.VECTOR_TRANSFORM: ("Vector Transform",
        (("VECTOR", "vector"),),
        (("VECTOR", "vector"),)),
    NodeType.VECTOR_ROTATE: ("Vector Rotate",
        (("VECTOR", "vector"), ("VECTOR", "center"), ("VECTOR", "axis"), ("FLOAT", "angle"),
         ("VECTOR", "rotation")),
        (("VECTOR", "vector"),)),
    NodeType.CAMERA_DATA: ("Camera Data",
        (),
        (("VECTOR", "view_vector"), ("FLOAT", "view_z_depth"), ("FLOAT", "view_distance"))),
    NodeType.WIREFRAME: ("Wireframe",
        (("FLOAT", "size"),),
        (("FLOAT", "factor"),)),
    NodeType.BUMP: ("Bump",
        (("FLOAT", "strength"), ("FLOAT", "distance"), ("FLOAT", "filter_width"), ("FLOAT", "height"),
         ("NORMAL", "normal")),
        (("VECTOR", "normal"),)),
    NodeType.DISPLACEMENT: ("Displacement",
        (("FLOAT", "height"), ("FLOAT", "midlevel"), ("FLOAT", "scale"), ("NORMAL", "normal")),
        (("VECTOR", "displacement"),)),
    NodeType.VECTOR_DISPLACEMENT: ("Vector Displacement",
        (("VECTOR", "vector"), ("FLOAT", "midlevel"), ("FLOAT", "scale")),
        (("VECTOR", "displacement"),)),
    NodeType.AMBIENT_OCCLUSION: ("Ambient Occlusion",
        (("COLOR", "color"), ("FLOAT", "distance"), ("NORMAL", "normal")),
        (("COLOR", "color"), ("FLOAT", "open"))),
    NodeType.BEVEL: ("Bevel",
        (("FLOAT", "radius"), ("NORMAL", "normal")),
        (("VECTOR", "normal"),)),
    NodeType.RAYCAST: ("Raycast",
        (("POSITION", "position"), ("NORMAL", "direction"), ("FLOAT", "distance")),
        (("FLOAT", "is_hit"), ("FLOAT", "self_hit"), ("FLOAT", "hit_distance"), ("VECTOR", "hit_position"),
         ("VECTOR", "hit_normal"))),
    NodeType.RAYCAST_ATTRIBUTE: ("Raycast Attribute",
        (("POSITION", "position"), ("NORMAL", "direction"), ("FLOAT", "distance")),
        (("COLOR", "color"), ("FLOAT", "alpha"))),
    NodeType.POINT_INFO: ("Point Info",
        (),
        (("VECTOR", "position"), ("FLOAT", "radius"), ("FLOAT", "random"))),
    NodeType.TANGENT: ("Tangent",
        (),
        (("VECTOR", "tangent"),)),
    NodeType.AOV_VALUE: ("AOV Value",
        (("FLOAT", "value"),),
        ()),
    NodeType.AOV_COLOR: ("AOV Color",
        (("COLOR", "color"),),
        ()),
    NodeType.DISPLACEMENT_OUTPUT: ("Displacement Output",
        (("VECTOR", "displacement"), ("FLOAT", "filter_width")),
        ()),
}

# Channels of the passes, a letter each.
PASS_CHANNELS = {
    PassId.COMBINED: "RGBA",
    PassId.DEPTH: "Z",
    PassId.NORMAL: "XYZ",
    PassId.POSITION: "XYZ",
    PassId.UV: "UVA",
    PassId.OBJECT_INDEX: "X",
    PassId.MATERIAL_INDEX: "X",
    PassId.EMISSION: "RGB",
    PassId.ENVIRONMENT: "RGB",
    PassId.DIFFUSE_DIRECT: "RGB",
    PassId.DIFFUSE_INDIRECT: "RGB",
    PassId.DIFFUSE_COLOR: "RGB",
    PassId.GLOSSY_DIRECT: "RGB",
    PassId.GLOSSY_INDIRECT: "RGB",
    PassId.GLOSSY_COLOR: "RGB",
    PassId.TRANSMISSION_DIRECT: "RGB",
    PassId.TRANSMISSION_INDIRECT: "RGB",
    PassId.TRANSMISSION_COLOR: "RGB",
    PassId.SAMPLE_COUNT: "X",
    PassId.MIST: "Z",
    PassId.DENOISING_ALBEDO: "RGB",
    PassId.DENOISING_NORMAL: "XYZ",
    PassId.DENOISING_DEPTH: "Z",
    PassId.VECTOR: "XYZW",
    PassId.AMBIENT_OCCLUSION: "RGB",
    PassId.SHADOW: "RGB",
    PassId.SHADOW_CATCHER: "RGB",
    PassId.DENOISING_ROUGHNESS: "X",
    PassId.DENOISING_SPECULAR_ALBEDO: "RGB",
    PassId.NOISY_COMBINED: "RGBA",
    PassId.DENOISING_EMISSION: "RGB",
}

# Passes of each range, and their channels.
PASS_RANGES = {
    PassRange.FIRST_AOV_VALUE: (16, "X"),
    PassRange.FIRST_AOV_COLOR: (16, "RGBA"),
    PassRange.FIRST_LIGHT_GROUP: (32, "RGB"),
    PassRange.FIRST_CRYPTOMATTE: (24, "rgba"),
}
