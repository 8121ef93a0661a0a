# SPDX-License-Identifier: GPL-3.0-or-later
"""Where Blender's versions differ, found by looking at what is there.

Per-object ray tracing settings (motion steps, emission sampling and so on) live in the property groups
of Blender's own Cycles add-on; they are read where that add-on is enabled, else its defaults hold.
"""

import math

import bpy
from mathutils import Vector


def _is_buffer(value):
    """Whether its bytes can be read without making objects of its numbers."""
    try:
        memoryview(value)
    except TypeError:
        return False
    return True


# Of float32; seen in 5.2, not in 4.3.
VECTORS_ARE_BUFFERS = _is_buffer(Vector())

# Principled Hair of particle hair takes the Z axis for its normal; seen in 5.2, not in 4.3.
PARTICLE_HAIR_HAS_NORMALS = bpy.app.version >= (5, 0, 0)

# Render passes were renamed in 5.0, which leaves nothing to look at but the version.
HAS_LONG_PASS_NAMES = bpy.app.version >= (5, 0, 0)

# Light Falloff leaves the light of suns as it is, whose way is endless; seen in 5.2, not in 4.3.
LEAVES_SUNS = bpy.app.version >= (5, 0, 0)

# Trees are rendered without their groups, reroutes and muted nodes: where nothing comes through these, what they
# feed has its own value, and values of groups' sockets are as if linked. Before, nothing was 0, but where both it and
# such values fed what has coordinates or normals by default, these stayed. Outputs that are muted still work, which
# they did not, and outputs in groups come after those outside, which they went before. What is no constant takes on
# the kind of the last socket alone. Seen in 5.2, not in 4.3.
INLINES_GROUPS = bpy.app.version >= (5, 0, 0)

# Groups have switches in them, whole numbers till 5.0; before, what they feed has its own value. Seen in 4.3, not in
# 3.4.
HAS_BOOLEAN_SOCKETS = bpy.app.version >= (4, 0, 0)

# Shadow rays meet each of a point cloud's balls once, and balls are lit as round ones where they are stretched; seen
# in 5.2, not in 4.3. (3.4 has neither: no ray meets the backs there.)
HAS_ROUND_BALLS = bpy.app.version >= (5, 0, 0)

# The power of an area light became its radiance times pi and its area in 4.0; before, times 4 (Blender's
# issue 109404).
AREA_LIGHT_POWER = 4.0 / math.pi if bpy.app.version >= (4, 0, 0) else 1.0

# A spot's cone became evenly bright in 4.0, and is scaled as the light; before, it was round and times the cosine to
# its axis.
SPOT_IS_EVEN = bpy.app.version >= (4, 0, 0)

# Rectangles that a parent shears are sampled from their centre, not from their corner; seen in 4.3, not in 3.4.
SHEARS_FROM_CENTER = bpy.app.version >= (4, 0, 0)

# Nodes of a light have UV coordinates, in the light's own space, and a spot's image spans its cone; seen in
# 4.3, not in 3.4.
LIGHT_UV_IS_LOCAL = bpy.app.version >= (4, 0, 0)

# They are objects: with object space and, where they are instanced, the switches of what makes the instances;
# seen in 5.2, not in 4.3.
LIGHT_IS_OBJECT = bpy.app.version >= (5, 0, 0)

# A sun is as bright all over its disc; seen in 4.3, not in 3.4.
SUN_IS_EVEN = bpy.app.version >= (4, 1, 0)

# What IES files have beyond their first and last angles: around they go on where they began, and down as they came;
# nothing; what they end with (seen in 3.4, 4.3 and 5.2).
IES_ENDS = 'MIRRORED' if bpy.app.version < (4, 0, 0) else 'DARK' if bpy.app.version < (5, 0, 0) else 'LEVEL'

# IES files of type B have light all around, not on one half; seen in 3.4, not in 4.3.
CLOSES_IES_TYPE_B = bpy.app.version < (4, 0, 0)

# Cycles of 4.0 has other microfacets: one height for masking and shadowing, glass by the micro-normal.
HAS_CORRELATED_MICROFACETS = bpy.app.version >= (4, 0, 0)

# Roughness below 0 of the Glossy and Glass nodes is 0, else its square counts; Refraction's always does.
CLAMPS_ROUGHNESS = bpy.app.version >= (4, 0, 0)

# Its camera hits no longer choose faint lobes more often than their share.
HAS_DEFENSIVE_SAMPLING = bpy.app.version < (4, 0, 0)

# Thin films lie on metals, too, and thin ones do not fade away; seen in 5.2, not in 4.3.
HAS_FILMED_METAL = bpy.app.version >= (5, 0, 0)

# What has no material is a Principled as it is added, not a diffuse; seen in 5.2, not in 4.3.
DEFAULT_IS_PRINCIPLED = bpy.app.version >= (5, 0, 0)

# The coat of Principled keeps what light loses between its facets; seen in 5.2, not in 4.3.
HAS_WHOLE_COAT = bpy.app.version >= (5, 0, 0)

# Passes for denoisers weigh normals by what transparency and mirrors pass on; seen in 5.2, not in 4.3.
HAS_BLENDED_FEATURES = bpy.app.version >= (5, 0, 0)

# Colours of rough glass's refraction are what micro-normals do not reflect on average; seen in 5.2, not in 4.3.
HAS_MEAN_REFRACTION = bpy.app.version >= (5, 0, 0)

# Paths pass one transparent surface less than the limit says, shadow rays as many; seen in 5.2, not in 4.3.
COUNTS_LAST_PASSED = bpy.app.version >= (5, 0, 0)

# The lens of orthographic cameras is where clipping starts, from where focus is measured; seen in 3.4, not in 4.3.
FOCUSES_FROM_CLIP_START = bpy.app.version < (4, 0, 0)

# The vector pass has the motion of the background; seen in 5.2, not in 4.3.
BACKGROUND_MOVES = bpy.app.version >= (5, 0, 0)

# The Magic texture goes on where its coordinates are more than a turn; seen in 5.2, not in 4.3.
SCALES_MAGIC_FIRST = bpy.app.version >= (5, 1, 0)

# Rough diffuse surfaces keep their energy from 4.3 on.
KEEPS_DIFFUSE_ENERGY = bpy.app.version >= (4, 3, 0)

# The Bump node no longer keeps what its normals reflect above the surface: shaders do.
LEAVES_BUMPS = bpy.app.version >= (4, 0, 0)

# Shaders without microfacets take normals as they are; seen in 4.3, not in 3.4.
KEEPS_NORMALS = bpy.app.version >= (4, 0, 0)

# What lies in the shadow of bumps goes by other means; seen in 5.2, not in 4.3.
HAS_FACET_SHADOWING = bpy.app.version >= (5, 0, 0)

# Shadow rays from rough surfaces spread, so that bumps of what they go through are smooth; seen in 5.2, not in 4.3.
HAS_WIDE_SHADOWS = bpy.app.version >= (5, 0, 0)

# Bumps of Window coordinates have their steps, along the picture's sides, along other directions of the
# surface; seen in 5.2, not in 4.3.
TURNS_WINDOW_BUMPS = bpy.app.version >= (5, 0, 0)

# Bumps of Normal coordinates see smooth surfaces turn; seen in 5.2, not in 4.3.
CURVES_NORMAL_BUMPS = bpy.app.version >= (5, 0, 0)

# Cycles asks for attributes as geometry nodes do: of all types of numbers, vertex groups among them, and those of
# edges by Blender's own means; seen in 4.3, not in 3.4.
HAS_BLENDERS_ATTRIBUTES = bpy.app.version >= (4, 1, 0)

# Fewer names of attributes stand for what Cycles knows of a mesh; seen in 5.2, not in 4.3.
HAS_FEW_STANDARD_ATTRIBUTES = bpy.app.version >= (5, 0, 0)

# Where a mesh has no UV map, tangents are those of longitudes without a seam, and of the deformed mesh; seen in 5.2,
# not in 4.3.
UNWRAPS_LONGITUDES = bpy.app.version >= (5, 0, 0)

# The Color Attribute node makes no bumps, other than the Attribute node; seen in 5.2, not in 4.3.
LEVELS_COLOR_BUMPS = bpy.app.version >= (5, 0, 0)

# The strength of a normal map of tangents scales what the map says; seen in 4.3, not in 3.4.
SCALES_NORMAL_MAPS = bpy.app.version >= (4, 0, 0)

# Such a map turns normals that are of unit length between the corners too; seen in 5.2, not in 4.3.
HAS_UNIT_NORMALS = bpy.app.version >= (5, 0, 0)

# Of heights, in pixels: a whole one till the Bump node got an input for it in 4.4.
BUMP_FILTER_WIDTH = 0.1 if bpy.app.version >= (4, 4, 0) else 1.0

# Bumps of the Wireframe node have slopes over the length of a pixel; seen in 3.4 and 4.3, not in 5.2.
HAS_STEEP_WIRES = bpy.app.version < (4, 4, 0)

# Cycles' tables of colour ramps have 257 entries instead of 256.
RAMP_STEPS = 256 if bpy.app.version >= (4, 0, 0) else 255

# Its table of shutter times starts half an entry later (measured, 4.3).
SHUTTER_DELAY = 0.5 if bpy.app.version >= (4, 0, 0) else 0.0

# The Vector Transform node treats normals as normals; 3.4 made unit vectors of them.
TRANSFORMS_NORMALS = bpy.app.version >= (4, 0, 0)

# STRAIGHT and PREMUL say what the colours of an image are, whatever its file says; seen in 5.2, not in 4.3.
HAS_LITERAL_ALPHA = bpy.app.version >= (5, 0, 0)

# The Glossy Color pass of Principled Hair is its albedo; in 3.4 its weight, whatever it absorbs.
HAS_HAIR_ALBEDO = bpy.app.version >= (4, 0, 0)

# To worlds rays are as long as can be, before they had no length.
HAS_FAR_WORLDS = bpy.app.version >= (5, 0, 0)

# Voronoi's points count however far they are; in 3.4 those nearer than 8.
HAS_FAR_CELLS = bpy.app.version >= (4, 0, 0)

# Voronoi's points in 2 to 4 dimensions come of another hash since 5.0.
HASHES_CELLS_BY_PCG = bpy.app.version >= (5, 0, 0)


LINEAR_REC709 = "Linear Rec.709"


def cycles(data, name, default):
    """``data.cycles.name`` where Cycles' property groups exist, else default."""
    return getattr(getattr(data, "cycles", None), name, default)


_HAS_OWN_TERMINATOR = "shadow_terminator_geometry_offset" in bpy.types.Object.bl_rna.properties


def shadow_terminator_settings(blender_object):
    """What holds the offsets of an object's shadow terminator, and the names of its geometry and its shading
    offset: the object from Blender 5 on, before Cycles' settings of it, None where there are none."""
    if _HAS_OWN_TERMINATOR:
        return blender_object, ("shadow_terminator_geometry_offset", "shadow_terminator_shading_offset")
    return (getattr(blender_object, "cycles", None),
            ("shadow_terminator_geometry_offset", "shadow_terminator_offset"))


def panorama_settings(camera):
    """What holds the settings of a camera's panorama, None without Cycles where they are its own."""
    return camera if hasattr(camera, "panorama_type") else getattr(camera, "cycles", None)


def panorama_setting(camera, name, default):
    """A setting of panoramas: Blender's own where it has them, else Cycles' of the camera."""
    return getattr(panorama_settings(camera), name, default)


def cycles_curves(scene, name, default):
    """A setting of Cycles' curves where they exist, else default."""
    return getattr(getattr(scene, "cycles_curves", None), name, default)


def has_light_tree(scene):
    """Whether Cycles chooses lights by a tree: from 3.5 on, unless the scene says otherwise."""
    return cycles(scene, "use_light_tree", bpy.app.version >= (3, 5, 0))


# From 5.0 on, Cycles subdivides the mesh below the modifier, which has the settings then.
SUBDIVIDES_CAGE = "use_adaptive_subdivision" in bpy.types.SubsurfModifier.bl_rna.properties


# There, creases of less than 1 end after three levels; seen in 5.2, not in 4.3.
CREASE_LEVELS = 3.0 if SUBDIVIDES_CAGE else 10.0


def has_adaptive_subdivision(blender_object, scene, is_final):
    """Whether Cycles would dice an object's subdivision surface by its size in pictures of the scene: a setting of
    its last modifier, or of Cycles' of the object where experimental features are on."""
    last = blender_object.modifiers[-1] if blender_object.modifiers else None
    if last is None or last.type != 'SUBSURF' or not (last.show_render if is_final else last.show_viewport):
        return False
    if SUBDIVIDES_CAGE:
        return last.use_adaptive_subdivision
    is_experimental = cycles(scene, "feature_set", 'SUPPORTED') == 'EXPERIMENTAL'
    return is_experimental and cycles(blender_object, "use_adaptive_subdivision", False)


def working_space():
    """The name of the space that colours of scenes are in: of the file's choice since 5.0."""
    return getattr(getattr(bpy.data, "colorspace", None), "working_space", LINEAR_REC709)


def motion_position(scene):
    """Where the shutter interval lies: 'START', 'CENTER' or 'END'."""
    own = getattr(scene.render, "motion_blur_position", None)
    return own if own is not None else cycles(scene, "motion_blur_position", 'CENTER')


def uses_nodes(data):
    """Whether the node tree of a material, world or light rules (from 5.0 on it always does)."""
    return data.node_tree is not None and getattr(data, "use_nodes", True)


def is_ball(light):
    """Whether a point or spot light is a sphere: without Soft Falloff, which came in 4.1. With it, and
    before, it is a disk that faces what it lights."""
    return not getattr(light, "use_soft_falloff", True)


def casts_shadow(light):
    """A light's shadow switch: Cycles' where it has one, Blender's own from 4.2 on."""
    return cycles(light, "cast_shadow", getattr(light, "use_shadow", True))


def aov_name(node):
    """The AOV that an AOV Output node writes; till 4.1 it is the name of the node."""
    return getattr(node, "aov_name", node.name)
