# SPDX-License-Identifier: GPL-3.0-or-later
"""Tangents of UV maps at the corners of triangles, as Cycles has them.

M. S. Mikkelsen, "Simulation of Wrinkled Surfaces Revisited" (2008), and the MikkTSpace code that goes with it:
corners of one place, normal, UV and handedness whose triangles are joined by edges share a tangent, the mean
of their triangles' directions of growing U by the angles there.
"""

import zlib

import numpy as np

_PREFIX = ".tangent "
_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)  # odd, from the golden ratio (Knuth, TAOCP 6.4)
_SHIFT = np.uint64(29)
_WITHOUT_DIRECTION = (1.0, 0.0, 0.0)  # where U grows nowhere
_LEVEL = 1e-3  # a normal nearer to the triangle's plane, as a sine, says nothing of directions in it


def attribute_name(uv_map):
    """The library's attribute for the tangents of a UV map, "" for the default one; as short for any."""
    return f"{_PREFIX}{zlib.crc32(uv_map.encode()):08x}"


def names_among(names):
    """Those of a set of attributes' names that are of tangents."""
    return {name for name in names if name.startswith(_PREFIX)}


def of_corners(points, normals, uvs, has_seams=True):
    """(triangles * 3, 4) float32 of triangles' corners, (triangles, 3, ...) each: a and b with the tangent
    along a (p1 - p0) + b (p2 - p0), made perpendicular to the corner's normal; the handedness, 1 or -1; 0.

    Told so, tangents go along with a triangle that is turned and stretched. Without seams corners are alike whatever
    their UVs."""
    return _coordinates(*_shared(points, normals, uvs, has_seams))


def vectors_of_corners(points, normals, uvs, has_seams=True):
    """(triangles * 3, 3) float32 of the same: the tangents themselves, of unit length."""
    return _shared(points, normals, uvs, has_seams)[0].reshape(-1, 3).astype(np.float32)


def _shared(points, normals, uvs, has_seams):
    """What _coordinates takes: the tangents of corners that are alike as one."""
    points, uvs = points.astype(np.float64), uvs.astype(np.float64)
    sides = points[:, 1:] - points[:, :1]
    (u1, v1), (u2, v2) = ((uvs[:, i] - uvs[:, 0]).T for i in (1, 2))
    sign = np.where(u1 * v2 - v1 * u2 > 0.0, 1.0, -1.0)
    along = (sides[:, 0] * v2[:, None] - sides[:, 1] * v1[:, None]) * sign[:, None]
    directions = _unit(_flattened(along[:, None], normals))
    shared = _fans(_welded(points, normals, uvs if has_seams else np.zeros_like(uvs), sign))
    weighted = (directions * _angles(points, normals)[..., None]).reshape(-1, 3)
    tangents = _unit(np.stack([np.bincount(shared, part) for part in weighted.T], axis=1))[shared]
    tangents[~tangents.any(axis=1)] = _WITHOUT_DIRECTION
    return tangents.reshape(points.shape), normals, sides, sign


def face_normals(points):
    """(triangles, 3) unit normals of triangles, 0 without an area."""
    return _unit(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]))


def _unit(vectors):
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros(vectors.shape), where=length > 0.0)


def _dot(a, b):
    return (a * b).sum(axis=-1, keepdims=True)


def _flattened(vectors, normals):
    """Vectors without what is along unit normals."""
    return vectors - normals * _dot(vectors, normals)


def _angles(points, normals):
    """(triangles, 3) of each corner, seen along its normal."""
    to_next = _unit(_flattened(np.roll(points, -1, axis=1) - points, normals))
    to_last = _unit(_flattened(np.roll(points, 1, axis=1) - points, normals))
    return np.arccos(_dot(to_next, to_last)[..., 0].clip(-1.0, 1.0))


def _welded(points, normals, uvs, sign):
    """(triangles * 3,) numbers from 0 on, equal where corners are alike."""
    hashes = np.zeros(points.shape[:2], np.uint64)
    columns = [*np.moveaxis(points, 2, 0), *np.moveaxis(normals, 2, 0), *np.moveaxis(uvs, 2, 0),
               np.repeat(sign[:, None], 3, axis=1)]
    for column in columns:  # + 0: one zero instead of two
        bits = (column + 0.0).astype(np.float32).view(np.uint32)
        hashes = (hashes ^ bits) * _MULTIPLIER
        hashes ^= hashes >> _SHIFT
    return np.unique(hashes.reshape(-1), return_inverse=True)[1].reshape(-1)


def _fans(welded):
    """(triangles * 3,) numbers from 0 on, equal where corners are alike and joined by edges."""
    corners = np.arange(len(welded))
    following = corners - corners % 3 + (corners + 1) % 3
    # Edges that run along each other in opposite directions, by the corners at their starts.
    there, back = (a * len(welded) + b for a, b in ((welded, welded[following]), (welded[following], welded)))
    edges, first = np.unique(there, return_index=True)
    place = np.searchsorted(edges, back).clip(0, len(edges) - 1)
    is_joined = edges[place] == back
    left, right = corners.copy(), corners.copy()
    left[is_joined] = following[first[place[is_joined]]]
    right[left[is_joined]] = corners[is_joined]
    # The lowest of twice as many corners to either side at each step.
    fans = corners
    while True:
        lowest = np.minimum(fans, np.minimum(fans[left], fans[right]))
        if np.array_equal(lowest, fans):
            return np.unique(fans, return_inverse=True)[1].reshape(-1)
        fans, left, right = lowest, left[left], right[right]


def _coordinates(tangents, normals, sides, sign):
    """What of_corners gives of unit tangents (triangles, 3, 3)."""
    flat = _unit(np.cross(sides[:, 0], sides[:, 1]))[:, None]
    slope = _dot(normals, flat)
    slope = np.where(np.abs(slope) > _LEVEL, slope, np.inf)
    in_plane = tangents - normals * _dot(tangents, flat) / slope
    first, second = sides[:, None, 0], sides[:, None, 1]
    a11, a12, a22 = _dot(first, first), _dot(first, second), _dot(second, second)
    b1, b2 = _dot(in_plane, first), _dot(in_plane, second)
    area = a11 * a22 - a12 * a12
    area = np.where(area > 0.0, area, np.inf)
    found = np.zeros(tangents.shape[:2] + (4,), np.float32)
    found[..., 0:1] = (b1 * a22 - b2 * a12) / area
    found[..., 1:2] = (b2 * a11 - b1 * a12) / area
    found[..., 2] = sign[:, None]
    return found.reshape(-1, 4)
