# SPDX-License-Identifier: GPL-3.0-or-later
"""Tangents of UV maps at the corners of triangles, as attributes of the library; it finds them itself, as Cycles
has them."""

import zlib

import numpy as np

from .. import abi, native

_PREFIX = ".tangent "


def attribute_name(uv_map):
    """The library's attribute for the tangents of a UV map, "" for the default one; as short for any."""
    return f"{_PREFIX}{zlib.crc32(uv_map.encode()):08x}"


def names_among(names):
    """Those of a set of attributes' names that are of tangents."""
    return {name for name in names if name.startswith(_PREFIX)}


def of_corners(points, normals, uvs, has_seams=True):
    """(triangles * 3, 4) float32 of triangles' corners, (triangles, 3, ...) each: places in the triangle's plane, which
    go along with it where it is turned and stretched, and the handedness. Without seams corners are alike whatever
    their UVs."""
    return native.find_tangents(points, normals, uvs, abi.TangentsForm.COORDINATES, has_seams)


def vectors_of_corners(points, normals, uvs, has_seams=True):
    """(triangles * 3, 3) float32 of the same: the tangents themselves, of unit length."""
    return native.find_tangents(points, normals, uvs, abi.TangentsForm.VECTORS, has_seams)


def face_normals(points):
    """(triangles, 3) unit normals of triangles, 0 without an area."""
    across = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    return np.divide(across, length, out=np.zeros(across.shape), where=length > 0.0)
