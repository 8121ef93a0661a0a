# SPDX-License-Identifier: GPL-3.0-or-later
"""Creases of meshes that are subdivided adaptively, as Cycles hands them to OpenSubdiv."""

import bpy
import numpy as np

from ..compat import CREASE_LEVELS

_SHARPNESS = np.float32(10.0)  # of a crease of 1: it never ends


def creases_of(mesh):
    """Fields of abi.DicingDesc, arrays: the creases of a Blender mesh. Empty where it has none."""
    of_edges = _read(mesh, "crease_edge", "edge_creases", len(mesh.edges))
    of_vertices = _read(mesh, "crease_vert", "vertex_creases", len(mesh.vertices))
    fields = {}
    if of_edges is not None:
        edges = np.empty((len(mesh.edges), 2), np.uint32)
        mesh.edges.foreach_get("vertices", edges.reshape(-1))
        of_vertices = _with_outer_corners(mesh, edges, of_edges, of_vertices)
        of_edges = np.where(of_edges < _SHARPNESS, np.minimum(of_edges, np.float32(CREASE_LEVELS)), of_edges)
        is_crease = of_edges > 0.0
        fields["crease_edges"], fields["crease_sharpness"] = edges[is_crease], of_edges[is_crease]
    if of_vertices is not None:
        fields["vertex_sharpness"] = of_vertices
    return fields


def _read(mesh, name, layers_name, count):
    """(count,) float32: the sharpness of the edges or vertices of a mesh, by an attribute or, before 4.0, a layer;
    None where all is smooth."""
    layer, layers = mesh.attributes.get(name), getattr(mesh, layers_name, None)
    if layer is None and isinstance(layers, bpy.types.bpy_prop_collection):
        layer = next(iter(layers), None)
    if layer is None or len(layer.data) != count or getattr(layer, "data_type", 'FLOAT') != 'FLOAT':
        return None
    values = np.empty(count, np.float32)
    layer.data.foreach_get("value", values)
    is_crease = values > 0.0
    return np.where(is_crease, np.minimum(values, 1.0) * _SHARPNESS, 0.0) if is_crease.any() else None


def _with_outer_corners(mesh, edges, of_edges, of_vertices):
    """The sharpness of vertices, to which one of just two edges adds that of the smoother edge; None where all is
    smooth."""
    is_loose = np.empty(len(edges), np.bool_)
    mesh.edges.foreach_get("is_loose", is_loose)
    ends = edges[~is_loose].ravel()
    smoother = np.full(len(mesh.vertices), _SHARPNESS)
    np.minimum.at(smoother, ends, np.repeat(of_edges[~is_loose], 2))
    smoother[np.bincount(ends, minlength=len(smoother)) != 2] = 0.0
    if of_vertices is not None:
        return np.minimum(smoother + of_vertices, _SHARPNESS)
    return smoother if smoother.any() else None
