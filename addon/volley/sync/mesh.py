# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes: Blender's evaluated meshes as flat arrays.

Arrays are read with ``foreach_get`` into the property's own type: another type is some twenty times
slower. Where even that calls a function for each item (vertex normals, and corners before 3.6), Blender's
memory is looked at instead, if it proves to be laid out as expected. Curves, text, surfaces and metaballs
reach this module as the meshes they evaluate to.
"""

import contextlib
from dataclasses import dataclass, field

import bpy
import numpy as np

from .. import abi, native
from ..compat import HAS_FEW_STANDARD_ATTRIBUTES, UNWRAPS_LONGITUDES
from . import derived, standard_attributes, tangents
from .attribute_values import colors_at_vertices, colors_of, group_colors, is_pair, named_colors, widen

_HAS_UNDEFORMED = "undeformed_co" in bpy.types.MeshVertex.bl_rna.properties
# Blender's interface holds corners' vertices and triangles for unsigned; reading them as signed takes some
# twenty times as long (3.4 and 4.3 alike).
_INDEX_TYPE = np.uint32


@dataclass
class MeshData:
    """One mesh at one time. See native.Scene.create_mesh for shapes; normals here are of one key."""

    positions: np.ndarray             # (vertices, 3) float32
    indices: np.ndarray               # (triangles, 3) uint32
    normals: np.ndarray = None        # (vertices | triangles * 3, 3) float32
    normal_kind: int = abi.NormalsLayout.NONE
    smooth: np.ndarray = None         # (triangles,) uint8
    material_index: np.ndarray = None  # (triangles,) uint16
    attributes: list = field(default_factory=list)  # (name, (triangles * 3, 2 | 4) float32)
    left_out: list = field(default_factory=list)  # names of attributes that there is no room for
    generated: np.ndarray = None      # (vertices, 3) float32
    corners: np.ndarray = None        # (triangles * 3,) integers: Blender's corners, for corner normals
    dicing: dict = None               # fields of abi.DicingDesc, those of faces and creases as arrays
    diced_by: tuple = None            # dicing.Dicing.settings and fields (None: not diced) where there is one
    poses: object = None              # Topology where later shapes are awaited

    def topology(self):
        """All but positions and normals: what can be compared, and arrays, some of them None."""
        return (len(self.positions), len(self.indices), self.normal_kind, self.normals is None,
                *(name for name, _ in self.attributes)), [
                    self.indices, self.smooth, self.material_index, self.generated,
                    *(values for _, values in self.attributes)]

    def create(self, scene, positions, normals):
        """A mesh of the library's scene, of those keys; its id."""
        return scene.create_mesh(positions, self.indices, normals, self.normal_kind, self.smooth,
                                 self.material_index, self.attributes, self.generated, self.dicing)

    @staticmethod
    def update(scene, mesh_id, positions, normals):
        """Give it other positions and normals."""
        scene.update_mesh(mesh_id, positions, normals)


@contextlib.contextmanager
def shown_mesh(blender_object):
    """The mesh that an evaluated object shows, as long as the context lasts. In Edit Mode its own has no
    attributes and often no vertices, as edits are kept elsewhere: a copy has all. While its
    multiresolution is sculpted, there is nothing but the mesh below it."""
    data = blender_object.data
    if data.is_editmode:
        try:
            yield blender_object.to_mesh()
        finally:
            blender_object.to_mesh_clear()
    elif is_sculpted_multires(blender_object):
        yield blender_object.original.data
    else:
        yield data


def is_sculpted_multires(blender_object):
    """Whether Blender keeps the shape of an evaluated mesh object to itself: it gives an empty mesh, from 5.0
    on the one below."""
    if blender_object.mode != 'SCULPT':
        return False
    shown, below = len(blender_object.data.vertices), len(blender_object.original.data.vertices)
    return any(not shown or shown == below and modifier.show_viewport and modifier.total_levels > 0
               for modifier in blender_object.modifiers if modifier.type == 'MULTIRES')


def extract(mesh, uv_names=(), color_names=(), material_count=1, group_names=()):
    """A Blender mesh as MeshData, None when it has no triangle. Only the named attributes are taken, vertex groups
    of group_names among them; with one material, slots are left out."""
    mesh.calc_loop_triangles()
    triangle_count = len(mesh.loop_triangles)
    if triangle_count == 0:
        return None
    indices = _read(mesh.loop_triangles, "vertices", (triangle_count, 3), _INDEX_TYPE)
    loops = LazyLoops(mesh, triangle_count)
    data = MeshData(read_positions(mesh), indices.view(np.uint32))
    if material_count > 1:
        data.material_index = _material_index(mesh, loops)
    read_normals(mesh, data, loops)
    no_maps = {name for name in standard_attributes.shown_by_uv_nodes(uv_names) if name not in mesh.uv_layers}
    data.attributes = _uv_maps(mesh, uv_names, loops) + _colors(mesh, data, no_maps.union(color_names), loops,
                                                                group_names)
    data.left_out = [name for name, _ in data.attributes[abi.MAX_ATTRIBUTES:]]
    del data.attributes[abi.MAX_ATTRIBUTES:]
    return data


def dice(data, mesh, fields, needs_generated):
    """Have the library refine the MeshData of a mesh. Its normals are made anew, but for those that a linear
    surface is shaded with."""
    loops = LazyLoops(mesh, len(data.indices))
    smooth = _read(mesh.polygons, "use_smooth", (len(mesh.polygons),), np.bool_)
    data.smooth = smooth.view(np.uint8)[loops.polygons] if smooth.any() else None
    data.normals, data.normal_kind, data.corners = None, abi.NormalsLayout.NONE, None
    if data.smooth is not None and fields["surface"] == abi.DicingSurface.LINEAR:
        data.normals, data.normal_kind = np.array(vertex_normals(mesh)), abi.NormalsLayout.VERTEX
    if needs_generated and data.generated is None:  # the box is that of the mesh before
        lower, upper = data.positions.min(axis=0), data.positions.max(axis=0)
        size = np.where(upper > lower, upper - lower, np.float32(2.0))
        data.generated = (data.positions - 0.5 * (lower + upper)) / size + np.float32(0.5)
    data.dicing = {**fields, "faces": loops.polygons}


def read_positions(mesh):
    """(vertices, 3) float32; through the attribute where there is one (3.5 on), ten times faster."""
    count = len(mesh.vertices)
    attribute = mesh.attributes.get("position")
    if attribute is not None and attribute.data_type == 'FLOAT_VECTOR':
        return _read(attribute.data, "vector", (count, 3), np.float32)
    return _read(mesh.vertices, "co", (count, 3), np.float32)


def generated_coordinates(blender_object, mesh, positions):
    """(vertices, 3) float32 of an evaluated object and the mesh that it shows: its undeformed mesh in the
    mesh's texture space, as Cycles has it. None where that is the bounding box of positions, the library's
    default."""
    undeformed = _undeformed(mesh, positions)
    is_deformed = not np.array_equal(undeformed, positions)
    if not is_deformed:
        # A viewport's meshes do not keep it; the original has it if modifiers left its vertices.
        rest = blender_object.original.data
        if isinstance(rest, bpy.types.Mesh) and len(rest.vertices) == len(positions):
            undeformed = read_positions(rest)
            is_deformed = not np.array_equal(undeformed, positions)
    location = np.array(mesh.texspace_location, np.float32)
    size = np.array(mesh.texspace_size, np.float32)
    if not is_deformed and _is_bounding_box(positions, location, size):
        return None
    offset, scale = _texture_space(mesh)
    return undeformed * scale - offset


def _undeformed(mesh, positions):
    """(vertices, 3) float32 of the mesh before modifiers and shape keys, where it keeps that."""
    if not _HAS_UNDEFORMED:
        return positions
    return _read(mesh.vertices, "undeformed_co", positions.shape, np.float32)


def _texture_space(mesh):
    """What positions are scaled by for Generated coordinates, and what is taken off them then."""
    location = np.array(mesh.texspace_location, np.float32)
    size = np.array(mesh.texspace_size, np.float32)
    scale = np.divide(0.5, size, out=np.zeros_like(size), where=size != 0.0)
    return location * scale - np.float32(0.5), scale


def _is_bounding_box(positions, location, size):
    """Whether a texture space is the box around positions; Blender makes flat sides 1."""
    lower, upper = positions.min(axis=0), positions.max(axis=0)
    half = 0.5 * (upper - lower)
    half[half == 0.0] = 1.0
    return np.allclose(size, half, rtol=1e-5) and np.allclose(location, 0.5 * (lower + upper),
                                                              atol=1e-5 * float(half.max()))


class Topology:
    """Which vertices the faces of a mesh join, to tell whether a later shape only moves them, and what its normals
    belong to."""

    def __init__(self, mesh):
        self.normals_domain = normals_domain(mesh)
        self._counts = len(mesh.vertices), len(mesh.polygons)
        self._corners = np.array(_corner_items(mesh))

    def has_counts_of(self, mesh):
        """Whether a mesh has as many vertices and faces: of itself that proves nothing."""
        return self._counts == (len(mesh.vertices), len(mesh.polygons))

    def is_of(self, mesh):
        """Whether a mesh has the same."""
        return self.has_counts_of(mesh) and np.array_equal(self._corners, _corner_items(mesh))


def _corner_vertices(mesh):
    """(corners,) integers: the vertex of each. They may be Blender's own: copy what is kept."""
    return _corner_items(mesh)[:, 0]


def _corner_items(mesh):
    """(corners, 1 or more) integers, the first of which is the vertex; through the attribute where there
    is one (3.6 on)."""
    attribute = mesh.attributes.get(".corner_vert")
    if attribute is not None and attribute.data_type == 'INT':
        return _read(attribute.data, "value", (len(attribute.data), 1), np.int32)
    memory = memory_of(mesh.loops, "vertex_index", 1, _INDEX_TYPE)
    if memory is not None:
        return memory
    return _read(mesh.loops, "vertex_index", (len(mesh.loops), 1), _INDEX_TYPE)


def memory_of(collection, name, width, dtype):
    """Items as they lie in Blender's memory, (count, width or more), where each begins with the values of
    a property; None where that is unknown: side by side, with the values that Blender gives for
    some."""
    count, size = len(collection), np.dtype(dtype).itemsize
    if count < 2:
        return None
    places = 0, 1, count - 1
    items = [collection[place] for place in places]
    address, second, last = (item.as_pointer() for item in items)
    stride = second - address
    if stride < width * size or stride % size or last - address != (count - 1) * stride:
        return None
    values = native.view(address, (count, stride // size), dtype)
    for place, item in zip(places, items):
        expected = getattr(item, name)
        if values[place, :width].tolist() != ([expected] if width == 1 else list(expected)):
            return None
    return values


def read_normals(mesh, data, loops=None):
    """Fill normals, their kind and the smooth flags, by what Blender would shade with."""
    loops = loops or LazyLoops(mesh, len(data.indices))
    domain = normals_domain(mesh)
    if domain == 'FACE':
        return
    if domain == 'CORNER':
        data.corners = loops.of_triangles
        data.normals, data.normal_kind = corner_normals(mesh)[data.corners], abi.NormalsLayout.CORNER
        return
    smooth = _read(mesh.polygons, "use_smooth", (len(mesh.polygons),), np.bool_)
    if not smooth.any():
        return
    data.normals = np.array(vertex_normals(mesh))
    data.normal_kind = abi.NormalsLayout.VERTEX
    if smooth.all():
        data.smooth = np.ones(len(data.indices), np.uint8)
    else:
        data.smooth = smooth.view(np.uint8)[loops.polygons]


class LazyLoops:
    """Corner and polygon of each triangle, read when first asked for."""

    def __init__(self, mesh, triangle_count):
        self._mesh, self._count = mesh, triangle_count
        self._of_triangles = self._polygons = None

    @property
    def of_triangles(self):
        """(triangles * 3,) integers: the mesh's corner of each triangle corner."""
        if self._of_triangles is None:
            self._of_triangles = _read(self._mesh.loop_triangles, "loops", (self._count * 3,), _INDEX_TYPE)
        return self._of_triangles

    @property
    def polygons(self):
        """(triangles,) integers: the polygon of each triangle."""
        if self._polygons is None:
            self._polygons = _read(self._mesh.loop_triangles, "polygon_index", (self._count,),
                                   _INDEX_TYPE)
        return self._polygons


def _read(collection, name, shape, dtype):
    values = np.empty(shape, dtype)
    collection.foreach_get(name, values.reshape(-1))
    return values


def _material_index(mesh, loops):
    """(triangles,) uint16, None when all are 0."""
    count = len(mesh.polygons)
    attribute = mesh.attributes.get("material_index")
    if attribute is not None and attribute.data_type == 'INT' and attribute.domain == 'FACE':
        slots = _read(attribute.data, "value", (count,), np.int32)  # one copy, not a call per face
    else:
        slots = _read(mesh.polygons, "material_index", (count,), np.int32)
    if not slots.any():
        return None
    return slots.clip(0, 0xFFFF).astype(np.uint16)[loops.polygons]


def normals_domain(mesh):
    """What the normals belong to by which Blender shades: 'CORNER', 'POINT' or 'FACE'. Sharp edges alone make faces
    flat, too, so from 4.1 on their flags do not say all; before it they tell 'POINT' from 'FACE', and the former
    stands for both."""
    if hasattr(mesh, "normals_domain"):
        return mesh.normals_domain
    return 'CORNER' if mesh.use_auto_smooth else 'POINT'


def corner_normals(mesh):
    """(corners, 3) float32, unit."""
    if hasattr(mesh, "corner_normals"):
        return _read(mesh.corner_normals, "vector", (len(mesh.loops), 3), np.float32)
    mesh.calc_normals_split()
    normals = _read(mesh.loops, "normal", (len(mesh.loops), 3), np.float32)
    mesh.free_normals_split()
    return normals


def vertex_normals(mesh):
    """(vertices, 3) float32, unit. They may be Blender's own: copy what is kept."""
    memory = memory_of(mesh.vertex_normals, "vector", 3, np.float32)
    if memory is not None:
        return memory[:, :3]
    return _read(mesh.vertex_normals, "vector", (len(mesh.vertices), 3), np.float32)


def _uv_maps(mesh, names, loops):
    """The named UV maps, the default one first and under its own name."""
    return [(layer.name, _uv_values(layer, len(mesh.loops))[loops.of_triangles])
            for _, layer in wanted_uv_layers(mesh, names)]


def wanted_uv_layers(mesh, names):
    """(number, layer) of the named UV maps, the default one first: the library's default is the first of
    its width, so it goes along whenever any map does."""
    layers = list(enumerate(mesh.uv_layers)) if names else []
    layers.sort(key=lambda pair: not pair[1].active_render)
    return layers[:1] + [pair for pair in layers[1:] if pair[1].name in names]


def _uv_values(layer, corner_count):
    if hasattr(layer, "uv"):
        return _read(layer.uv, "vector", (corner_count, 2), np.float32)
    return _read(layer.data, "uv", (corner_count, 2), np.float32)


def _tangent_layers(mesh, names):
    """The UV maps whose tangents are among the names, by those; None stands for _angles_around."""
    if not tangents.names_among(names):
        return {}
    if not mesh.uv_layers:
        return {tangents.attribute_name(""): None}
    layers = [(layer.name, layer) for layer in mesh.uv_layers]
    layers += [("", layer) for layer in mesh.uv_layers if layer.active_render]
    return {tangents.attribute_name(name): layer for name, layer in layers}


def _tangents(mesh, data, layer, loops, tell=tangents.of_corners):
    """What tell, a function of tangents, says of a UV map; None: of _angles_around."""
    if layer is None:
        uvs = _angles_around(mesh, data)
    else:
        uvs = _uv_values(layer, len(mesh.loops))[loops.of_triangles].reshape(-1, 3, 2)
    return tell(data.positions[data.indices], _normals_of_corners(data), uvs, layer is not None)


def _angles_around(mesh, data):
    """(triangles, 3, 2) float32: what Cycles takes for UVs where a mesh has none, longitudes and latitudes around its
    origin; before Blender 5 of the undeformed mesh, with a seam. They are found by way of Generated coordinates, as
    there: their rounding says on which side of the seam a vertex is."""
    offset, scale = _texture_space(mesh)
    positions = data.positions if UNWRAPS_LONGITUDES else _undeformed(mesh, data.positions)
    x, y, z = ((positions * scale - offset + offset) / np.where(scale != 0.0, scale, np.float32(1.0))).T
    length = np.sqrt(x * x + y * y + z * z)
    up = np.divide(z, length, out=np.full_like(z, -1.0), where=length > 0.0).clip(-1.0, 1.0)
    around = np.where((x != 0.0) | (y != 0.0), np.float32(0.5) - np.arctan2(x, y) / np.float32(2.0 * np.pi), 0.0)
    uvs = np.stack([around, 1.0 - np.arccos(up) / np.float32(np.pi)], axis=1).astype(np.float32)[data.indices]
    if UNWRAPS_LONGITUDES:
        u = uvs[..., 0]
        u += (u < 0.5) & (np.ptp(u, axis=1) > 0.5)[:, None]
    return uvs


def _normals_of_corners(data):
    """(triangles, 3, 3) normals that a mesh is shaded with."""
    if data.normal_kind == abi.NormalsLayout.CORNER:
        return data.normals.reshape(-1, 3, 3)
    if data.normals is None:
        return np.repeat(tangents.face_normals(data.positions[data.indices])[:, None], 3, axis=1)
    normals, is_flat = data.normals[data.indices], ~data.smooth.astype(bool)
    normals[is_flat] = tangents.face_normals(data.positions[data.indices[is_flat]])[:, None]
    return normals


def _colors(mesh, data, names, loops, group_names):
    """The named attributes as colours per triangle corner; "" is the active colour attribute. It comes
    first, black where there is none, as the first is the library's default."""
    found, layers = [], _tangent_layers(mesh, names)
    for name in sorted(names):
        source = name or active_color_name(mesh)
        values = None
        if not source and len(names) > 1:
            values = np.zeros((3 * len(data.indices), 4), np.float32)
        elif name in layers:
            values = _tangents(mesh, data, layers[name], loops)
        elif source in _DERIVED:
            values = widen(_DERIVED[source](mesh)[:, None])[_corner_vertices(mesh)[loops.of_triangles]]
        elif source:
            values = named_colors(source, names, lambda each: _named_values(mesh, data, each, loops, group_names),
                                  lambda each: each == standard_attributes.UV or each in mesh.uv_layers
                                  or is_pair(mesh.attributes, each))
        if values is not None:
            found.append((name, values))
    return found


def active_color_name(mesh):
    """The colour attribute that renders, "" without one."""
    colors = mesh.color_attributes
    index = colors.render_color_index
    return colors[index].name if 0 <= index < len(colors) else ""


def _edges(mesh):
    return _read(mesh.edges, "vertices", (len(mesh.edges), 2), _INDEX_TYPE)


_DERIVED = {  # attributes that Blender does not have: (vertices,) float32 of a mesh
    derived.POINTINESS: lambda mesh: derived.pointiness(
        read_positions(mesh), vertex_normals(mesh), _edges(mesh)),
    derived.ISLAND: lambda mesh: derived.island_numbers(len(mesh.vertices), _edges(mesh))}


def _named_values(mesh, data, name, loops, group_names):
    """The same as below, or what a standard attribute of that name holds."""
    if name == standard_attributes.NORMAL:
        return widen(np.array(vertex_normals(mesh)))[_corner_vertices(mesh)[loops.of_triangles]]
    if name == standard_attributes.UNDISPLACED:
        return widen(read_positions(mesh)[_corner_vertices(mesh)[loops.of_triangles]])
    if name == standard_attributes.FACE_NORMAL:
        return widen(_triangle_normals(read_positions(mesh)[_corner_vertices(mesh)[loops.of_triangles]]))
    if name == standard_attributes.UV:
        layer = next((each for each in mesh.uv_layers if each.active_render), None)
        return None if layer is None else widen(_uv_values(layer, len(mesh.loops))[loops.of_triangles])
    layer = standard_attributes.map_of_tangents(mesh, name)
    if layer is not None or name == standard_attributes.TANGENT and not mesh.uv_layers:
        return widen(_tangents(mesh, data, layer, loops, tangents.vectors_of_corners))
    if HAS_FEW_STANDARD_ATTRIBUTES:
        layer = standard_attributes.map_of_tangents(mesh, name, standard_attributes.SIGN)
        if layer is not None or name == standard_attributes.SIGN and not mesh.uv_layers:
            return widen(_tangents(mesh, data, layer, loops)[:, 2:3])
    return _attribute_values(mesh, name, loops, group_names)


def _triangle_normals(corners):
    """(triangles * 3, 3): the unit normal of each corner's triangle; 0 of those without an area."""
    a, b, c = corners.reshape(-1, 3, 3).transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    lengths = np.linalg.norm(across, axis=1, keepdims=True)
    return np.repeat(across / np.where(lengths > 0.0, lengths, 1.0), 3, axis=0)


def _attribute_values(mesh, name, loops, group_names):
    """Any attribute or vertex group as (triangles * 3, 4) float32, None if it is missing or of an odd type."""
    domain, values = _items_of(mesh, name, group_names)
    if values is None:
        return None
    if domain == 'CORNER':
        return values[loops.of_triangles]
    if domain == 'POINT':
        return values[_corner_vertices(mesh)[loops.of_triangles]]
    return values[np.repeat(loops.polygons, 3)]


def colors_of_vertices(mesh, name, group_names):
    """The same as (vertices, 4), None as above: the mean of what a vertex' corners or faces have."""
    domain, values = _items_of(mesh, name, group_names)
    if values is None or domain == 'POINT':
        return values
    if domain == 'FACE':
        values = np.repeat(values, _read(mesh.polygons, "loop_total", (len(mesh.polygons),), np.int32), axis=0)
    vertices, count = _corner_vertices(mesh), len(mesh.vertices)
    sums = np.stack([np.bincount(vertices, part, count) for part in values.T], axis=1)
    return (sums / np.maximum(np.bincount(vertices, minlength=count), 1)[:, None]).astype(np.float32)


def _items_of(mesh, name, group_names):
    """The same as its domain, 'CORNER', 'POINT' or 'FACE', and (items, 4) float32, None as above."""
    if name in mesh.uv_layers:
        return 'CORNER', widen(_uv_values(mesh.uv_layers[name], len(mesh.loops)))
    attribute = mesh.attributes.get(name)
    if attribute is None:
        return 'POINT', group_colors(mesh, group_names.index(name)) if name in group_names else None
    if attribute.domain == 'EDGE':
        return 'POINT', colors_at_vertices(attribute, _edges(mesh), len(mesh.vertices))
    return attribute.domain, colors_of(attribute)
