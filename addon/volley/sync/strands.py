# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair and points: particle hair, Curves and Point Cloud objects as meshes.

Strands become tubes along the Catmull-Rom splines that Cycles draws, points become balls, both with the
normals of round ones. Fewer sides make a thinner shadow, so a tube or a ball is widened until it looks as
large as a round one on the average over all directions (A. Cauchy, 1832: a convex body's mean projection
is a quarter of its surface).
"""

import math

import bpy
import numpy as np

from .. import native
from ..compat import cycles_curves
from .hashing import HASH_MAX, hash_numbers
from .mesh import MeshData, active_color_name, wanted_uv_layers

HAIR_ATTRIBUTE = ".hair"  # (intercept, length, thickness, random) of the Hair Info node

_MOST_TRIANGLES = 2_000_000  # of one object's strands or points; above the fewest sides
_SIDES = (8, 6, 4, 3)
_DEFAULT_RADIUS = 0.005      # m; Cycles' of curves without the attribute
_DEFAULT_POINT_RADIUS = 0.01
_SHORTEST = 1e-12            # m; keys of a strand that are closer are one


def hair_systems(blender_object, is_final):
    """The (number, modifier) pairs of an evaluated object's particle systems that show hair as paths."""
    modifiers = [m for m in blender_object.modifiers if m.type == 'PARTICLE_SYSTEM']
    for number, modifier in enumerate(modifiers):
        system = modifier.particle_system
        settings = system.settings if system is not None else None
        is_on = modifier.show_render if is_final else modifier.show_viewport
        if settings is not None and is_on and settings.type == 'HAIR' and settings.render_type == 'PATH':
            yield number, modifier


def has_strands(instance):
    """Whether the instance shows a Curves or Point Cloud object."""
    return isinstance(instance.object.data, _DATA_TYPES)


_DATA_TYPES = tuple(getattr(bpy.types, name) for name in ("Curves", "PointCloud") if hasattr(bpy.types, name))


def extract_hair(blender_object, modifier, to_local, is_final, uv_names, color_names):
    """The hair of an evaluated object's modifier as MeshData, None without a strand; to_local: the inverse
    of the object's matrix, as particles are in the world. A strand has the UVs and the colours of its
    root."""
    system = modifier.particle_system
    settings = system.settings
    steps = (1 << (settings.render_step if is_final else settings.display_step)) + 1
    if settings.kink == 'SPIRAL':
        steps += settings.kink_extra_steps
    parent_count, child_count = len(system.particles), len(system.child_particles)
    first = parent_count if child_count and not settings.use_parent_particles else 0
    place, strands = system.co_hair, range(first, parent_count + child_count)
    keys = np.array([place(blender_object, particle_no=number, step=step)
                     for number in strands for step in range(steps)], np.float64).reshape(-1, steps, 3)
    if len(keys) == 0:
        return None
    matrix = np.array(to_local)
    keys = keys @ matrix[:3, :3].T + matrix[:3, 3]
    groups = []
    for strand_keys, numbers in _of_distinct_keys(keys, np.arange(len(keys))):
        groups.append(_Group(strand_keys, _hair_radii(settings, strand_keys), numbers))
    roots = _root_values(blender_object.data, modifier, strands, uv_names, color_names)
    return _tubes(groups, HAIR_ATTRIBUTE in color_names, roots)


def _root_values(mesh, modifier, strands, uv_names, color_names):
    """(name, (strands, 2 or 4)) of each UV map and colour attribute that is asked for, as meshes have
    them: the default map first."""
    found = []
    for number, layer in wanted_uv_layers(mesh, uv_names):
        values = _at_roots(modifier.particle_system.uv_on_emitter, modifier, strands, uv_no=number)
        found.append((layer.name, values))
    colors = mesh.vertex_colors
    for name in sorted(color_names):
        source = name or active_color_name(mesh)
        number = colors.find(source)
        if number >= 0:
            values = np.ones((len(strands), 4), np.float32)
            values[:, :3] = _linear(_at_roots(modifier.particle_system.mcol_on_emitter, modifier, strands,
                                              vcol_no=number))
            found.append((name, values))
    return found


def _linear(values):
    """sRGB-encoded colours, which is how Blender tells those of roots, as scene-linear ones."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def _at_roots(read, modifier, strands, **layer):
    """What read says of each strand's root. Of children it is told any particle, and their number."""
    particles = modifier.particle_system.particles
    return np.array([read(modifier, particle=particles[number if number < len(particles) else 0],
                          particle_no=number, **layer) for number in strands], np.float32)


def extract_object(data, wants_info):
    """Evaluated Curves or a Point Cloud as MeshData, None without anything in it."""
    if len(data.points) == 0:
        return None
    if not isinstance(data, bpy.types.Curves):
        return _balls(_values(data, "position", "vector", 3),
                      _values(data, "radius", "value", 1, _DEFAULT_POINT_RADIUS)[:, 0])
    positions = _values(data, "position", "vector", 3)
    radii = _values(data, "radius", "value", 1, _DEFAULT_RADIUS)[:, 0]
    count = len(data.curves)
    starts, lengths = np.empty(count, np.int32), np.empty(count, np.int32)
    data.curves.foreach_get("first_point_index", starts)
    data.curves.foreach_get("points_length", lengths)
    groups = []
    for length in np.unique(lengths[lengths > 1]):
        numbers = np.flatnonzero(lengths == length)
        index = starts[numbers, None] + np.arange(length)
        groups.append(_Group(positions[index], radii[index], numbers))
    return _tubes(groups, wants_info)


def _values(data, name, field, width, default=0.0):
    """(points, width) of an attribute of points."""
    attribute = data.attributes.get(name)
    values = np.full((len(data.points), width), default, np.float32)
    if attribute is not None and len(attribute.data) == len(values):
        attribute.data.foreach_get(field, values.reshape(-1))
    return values


class _Group:
    """Strands of one number of keys: keys (strands, keys, 3), radii (strands, keys), their numbers."""

    def __init__(self, keys, radii, numbers):
        self.keys, self.radii, self.numbers = keys, radii, numbers

    def segment_count(self):
        """Of all strands."""
        return self.keys.shape[0] * (self.keys.shape[1] - 1)


def _of_distinct_keys(keys, numbers):
    """Strands without keys that repeat the one before, as (keys, numbers) by how many are left."""
    step = np.linalg.norm(np.diff(keys, axis=1), axis=2)
    is_kept = np.concatenate((np.ones((len(keys), 1), bool), step > _SHORTEST), axis=1)
    counts = is_kept.sum(axis=1)
    for count in np.unique(counts[counts > 1]):
        chosen = counts == count
        yield keys[chosen][is_kept[chosen]].reshape(-1, count, 3), numbers[chosen]


def _fractions(keys):
    """How far along its strand each key is, 0 to 1, and the strands' lengths."""
    step = np.linalg.norm(np.diff(keys, axis=1), axis=2)
    along = np.concatenate((np.zeros((len(keys), 1)), np.cumsum(step, axis=1)), axis=1)
    return along / np.maximum(along[:, -1:], _SHORTEST), along[:, -1]


def _hair_radii(settings, keys):
    """Radii of hair, from root to tip by the settings' shape."""
    left = 1.0 - _fractions(keys)[0].clip(0.0, 1.0)
    shape = settings.shape
    if shape < 0.0:
        left = left ** (1.0 + shape)
    elif shape > 0.0:
        left = left ** (1.0 / max(1.0 - shape, 1e-6))
    root, tip = (radius * settings.radius_scale * 0.5 for radius in (settings.root_radius, settings.tip_radius))
    radii = left * (root - tip) + tip
    if settings.use_close_tip:
        radii[:, -1] = 0.0
    return radii


def _resolution(segment_count):
    """Pieces of a segment and sides of a tube, as many as there is room for."""
    for sides in _SIDES:
        for level in range(cycles_curves(bpy.context.scene, "subdivisions", 2), -1, -1):
            if 2 * sides * segment_count << level <= _MOST_TRIANGLES:
                return 1 << level, sides
    return 1, _SIDES[-1]


def _subdivided(values, pieces):
    """Catmull-Rom splines (strands, keys, n) with that many pieces between two keys."""
    if pieces == 1:
        return values
    # As in Cycles, the first and the last key stand for those beyond the ends too.
    ends = values[:, [0, -1]]
    p = np.concatenate((ends[:, :1], values, ends[:, 1:]), axis=1)
    p0, p1, p2, p3 = p[:, :-3], p[:, 1:-2], p[:, 2:-1], p[:, 3:]
    shape = values.shape
    out = np.empty((shape[0], shape[1] - 1, pieces, shape[2]))
    for i in range(pieces):
        t = i / pieces
        out[:, :, i] = 0.5 * (2.0 * p1 + t * (p2 - p0 + t * (
            2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3 + t * (3.0 * (p1 - p2) + p3 - p0))))
    return np.concatenate((out.reshape(shape[0], -1, shape[2]), values[:, -1:]), axis=1)


def _tubes(groups, wants_info, roots=()):
    """Strands as MeshData. roots: (name, (all strands, n)) attributes that each strand has one value of."""
    segment_count = sum(group.segment_count() for group in groups)
    if segment_count == 0:
        return None
    pieces, sides = _resolution(segment_count)
    positions, normals, indices, info, along = [], [], [], [], [[] for _ in roots]
    base = 0
    for group in groups:
        places = _subdivided(group.keys, pieces)
        radii = _subdivided(group.radii[..., None], pieces)[..., 0].clip(0.0, None)
        ring_positions, ring_normals = _rings(places, radii, sides)
        strands, rings = radii.shape
        faces = _tube_faces(strands, rings, sides)
        positions.append(ring_positions.reshape(-1, 3))
        normals.append(ring_normals.reshape(-1, 3))
        indices.append(faces + base)
        if wants_info:
            info.append(np.repeat(_hair_info(places, radii, group.numbers), sides, axis=0)[faces.reshape(-1)])
        for parts, (_, values) in zip(along, roots):
            parts.append(np.repeat(values[group.numbers], rings * sides, axis=0)[faces.reshape(-1)])
        base += strands * rings * sides
    attributes = [(HAIR_ATTRIBUTE, np.concatenate(info).astype(np.float32))] if wants_info else []
    found = [(name, np.concatenate(parts)) for parts, (name, _) in zip(along, roots)]
    attributes = found[:native.MAX_ATTRIBUTES - len(attributes)] + attributes
    return _smooth(np.concatenate(positions), np.concatenate(normals), np.concatenate(indices), attributes)


def _smooth(positions, normals, indices, attributes=()):
    """MeshData with a normal at each vertex."""
    return MeshData(positions.astype(np.float32), indices.astype(np.uint32), normals.astype(np.float32),
                    native.NORMALS_VERTEX, np.ones(len(indices), np.uint8), attributes=list(attributes))


def _hair_info(places, radii, numbers):
    """(strands * rings, 4): what HAIR_ATTRIBUTE holds."""
    fractions, lengths = _fractions(places)
    info = np.empty(radii.shape + (4,))
    info[..., 0], info[..., 2] = fractions, 2.0 * radii
    info[..., 1] = lengths[:, None]
    info[..., 3] = (hash_numbers(numbers) / HASH_MAX)[:, None]
    return info.reshape(-1, 4)


def _unit(vectors, fallback):
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > _SHORTEST, vectors / np.maximum(length, _SHORTEST), fallback)


def _rings(places, radii, sides):
    """Vertices and normals of tubes, (strands, rings, sides, 3)."""
    tangents = _unit(np.gradient(places, axis=1), np.array((0.0, 0.0, 1.0)))
    across = np.empty_like(tangents)
    # From ring to ring with as little turn as possible.
    smallest = np.eye(3)[np.abs(tangents[:, 0]).argmin(axis=1)]
    last = _unit(np.cross(tangents[:, 0], smallest), np.array((1.0, 0.0, 0.0)))
    for i in range(places.shape[1]):
        tangent = tangents[:, i]
        last = _unit(last - tangent * (last * tangent).sum(axis=1, keepdims=True), last)
        across[:, i] = last
    other = np.cross(tangents, across)
    angles = 2.0 * math.pi * np.arange(sides) / sides
    normals = (np.cos(angles)[:, None] * across[:, :, None] + np.sin(angles)[:, None] * other[:, :, None])
    widened = radii * (math.pi / (sides * math.sin(math.pi / sides)))
    return places[:, :, None] + normals * widened[..., None, None], normals


def _tube_faces(strands, rings, sides):
    """(triangles, 3) of tubes whose vertices run around rings, along strands."""
    side = np.arange(sides)
    a, b = side, (side + 1) % sides
    quads = np.stack((np.stack((a, b, b + sides), axis=1), np.stack((a, b + sides, a + sides), axis=1)), axis=1)
    starts = (np.arange(strands)[:, None] * rings + np.arange(rings - 1)) * sides
    return (starts.reshape(-1, 1, 1) + quads.reshape(1, -1, 3)).reshape(-1, 3)


def _balls(centers, radii):
    """Points as MeshData."""
    level = next((level for level in (2, 1) if 20 * 4 ** level * len(centers) <= _MOST_TRIANGLES), 0)
    normals, faces = _icosphere(level)
    corners = normals[faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]),
                                axis=1).sum()
    widened = radii * math.sqrt(4.0 * math.pi / area)
    positions = centers[:, None] + normals * widened[:, None, None]
    indices = (np.arange(len(centers)) * len(normals))[:, None, None] + faces
    return _smooth(positions.reshape(-1, 3), np.tile(normals, (len(centers), 1)), indices.reshape(-1, 3))


def _icosphere(level):
    """Unit vertices (n, 3) and faces (m, 3) of an icosahedron cut finer level times."""
    g = 0.5 * (1.0 + math.sqrt(5.0))
    vertices = np.array([(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g), (0, -1, -g),
                         (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)], np.float64)
    faces = np.array([(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4),
                      (11, 10, 2), (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8),
                      (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)])
    for _ in range(level):
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        unique, middle = np.unique(edges, axis=0, return_inverse=True)
        middle = middle.reshape(-1, 3) + len(vertices)
        vertices = np.concatenate((vertices, vertices[unique].sum(axis=1)))
        a, b, c = middle.T
        faces = np.concatenate([np.stack(corners, axis=1) for corners in (
            (faces[:, 0], a, c), (faces[:, 1], b, a), (faces[:, 2], c, b), (a, b, c))])
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces
