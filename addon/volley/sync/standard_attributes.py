# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of attributes that Cycles keeps for what it knows of a mesh itself, whatever attributes Blender has."""

from ..compat import HAS_FEW_STANDARD_ATTRIBUTES
from .derived import ISLAND, POINTINESS

NOTHING = ".nothing"  # an attribute that no mesh brings
NORMAL, UV, GENERATED, TANGENT = "N", "uv", "generated", "tangent"
# Cycles 5 keeps neither. It makes the second of the vertices after they are where objects stand that are still and
# alone, which are most, and all are taken for such.
FACE_NORMAL, UNDISPLACED = (None, None) if HAS_FEW_STANDARD_ATTRIBUTES else ("Ng", "undisplaced")
SIGN = TANGENT + "_sign"  # how the tangents of a UV map are handed, from Cycles 5 on
IS_NORMAL_WORLD = HAS_FEW_STANDARD_ATTRIBUTES  # in Cycles of objects that stand still and alone, which are most

# Of volumes, strands, points or of Cycles' own: attributes of Blender under such a name cannot be read.
_FOREIGN = {"color", "velocity", "density", "temperature", "heat", "flame", "particle", "undeformed", "curve_length",
            "curve_intercept", "curve_random", "point_random", "vertex_color", "shadow_transparency"}
_FOREIGN |= {"undisplaced"} if HAS_FEW_STANDARD_ATTRIBUTES else {"tangent_sign", "motion_P"}
_DERIVED = {"pointiness": POINTINESS, "random_per_island": ISLAND}


def source(name):
    """The library's attribute for an attribute that a node names."""
    return NOTHING if name in _FOREIGN else _DERIVED.get(name, name)


def shown_by_uv_nodes(names):
    """Those of the names in UV Map nodes that may be of attributes which are no UV maps."""
    return {name for name in names if name and source(name) == name}


def map_of_tangents(mesh, name, kind=TANGENT):
    """The UV map of a mesh whose tangents an attribute of that name is, None for none; kind: or SIGN. From Cycles 5 on
    attributes of Blender go before tangents."""
    if name == kind:
        return next((layer for layer in mesh.uv_layers if layer.active_render), None)
    is_own = HAS_FEW_STANDARD_ATTRIBUTES and kind == TANGENT and name in mesh.attributes
    if is_own or not name.endswith("." + kind):
        return None
    return mesh.uv_layers.get(name[:-len("." + kind)])
