# SPDX-License-Identifier: GPL-3.0-or-later
"""What the Geometry node tells of a mesh as a whole, as Cycles derives it: one number for each vertex."""

import numpy as np

from .hashing import HASH_MAX, hash_one

# Names of the attributes that carry them.
POINTINESS, ISLAND = ".pointiness", ".island"


def pointiness(positions, normals, edges):
    """(vertices,) float32: the angle between a vertex' normal and the mean direction of its edges over pi,
    0.5 where it is flat, averaged with its neighbours. Vertices in one place count as one.
    positions, normals: (vertices, 3); edges: (edges, 2)."""
    places, welded = np.unique(positions, axis=0, return_inverse=True)
    welded = welded.reshape(-1)
    count = len(places)
    first, second = _distinct(welded[edges])
    direction = _unit(places[second] - places[first])
    around = _sums(first, direction, count) - _sums(second, direction, count)
    degree = np.bincount(first, minlength=count) + np.bincount(second, minlength=count)
    normal = _unit(_sums(welded, normals, count))
    mean = around / np.maximum(degree, 1)[:, None]
    angle = np.arccos(np.clip((normal * mean).sum(axis=1), -1.0, 1.0)) / np.pi
    own = np.where(degree > 0, angle, 0.0)
    near = np.bincount(first, own[second], count) + np.bincount(second, own[first], count)
    return ((own + near) / (degree + 1))[welded].astype(np.float32)


def island_numbers(vertex_count, edges):
    """(vertices,) float32 in [0, 1], one random number for each connected part of the mesh. Which vertex
    stands for a part, and so the number, is as Cycles' sets have it: by rank, in the order of the edges."""
    parents, ranks = list(range(vertex_count)), [0] * vertex_count

    def find(vertex):
        root = vertex
        while parents[root] != root:
            root = parents[root]
        while parents[vertex] != root:
            parents[vertex], vertex = root, parents[vertex]
        return root

    for one, other in edges.tolist():
        one, other = find(one), find(other)
        if one == other:
            continue
        if ranks[one] < ranks[other]:
            one, other = other, one
        parents[other] = one
        ranks[one] += ranks[one] == ranks[other]
    roots = np.array([find(vertex) for vertex in range(vertex_count)], np.int64)
    return (hash_one(roots) / HASH_MAX).astype(np.float32)


def _distinct(edges):
    """Both ends of the edges that differ, without those from a place to itself."""
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    edges = edges[edges[:, 0] != edges[:, 1]]
    return edges[:, 0], edges[:, 1]


def _sums(indices, values, count):
    """(count, 3): the sum of the values of each index."""
    return np.stack([np.bincount(indices, values[:, axis], count) for axis in range(3)], axis=1)


def _unit(vectors):
    lengths = np.linalg.norm(vectors, axis=1)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)[:, None]
