"""Nearest neighbours by a walk over the edges of a Delaunay tessellation.

If a vertex is not the nearest to a query, one of its neighbours is nearer: the segment to the query
leaves the vertex's Voronoi cell through a facet, and beyond the facet lies a neighbour. So the walk
ends at the nearest vertex, wherever it begins and wherever the query lies.
"""

import math

import numpy as np

from scanlock.arrays import Labels, Points, Vector
from scanlock.kernels._compile import kernel


@kernel
def nearest_vertices(
    points: Points, starts: Labels, neighbours: Labels, queries: Points, entry: int
) -> tuple[Labels, Vector]:
    """Return the row of the point nearest to each query, and the distance [m].

    Parameters
    ----------
    points : (n, 3) [m]
    starts, neighbours
        Vertex i has the neighbours ``neighbours[starts[i]:starts[i + 1]]``.
    queries : (m, 3) [m]
        Each walk begins where the last one ended, so it is short if consecutive queries are close.
    entry : int
        Vertex at which the first walk begins.
    """
    rows, distances = np.empty(queries.shape[0], np.int64), np.empty(queries.shape[0])
    vertex = entry
    for i in range(queries.shape[0]):
        x0, x1, x2 = queries[i, 0], queries[i, 1], queries[i, 2]
        d0, d1, d2 = x0 - points[vertex, 0], x1 - points[vertex, 1], x2 - points[vertex, 2]
        smallest = d0 * d0 + d1 * d1 + d2 * d2
        last = -1
        while vertex != last:
            last = vertex
            for n in range(starts[last], starts[last + 1]):
                p = neighbours[n]
                d0, d1, d2 = x0 - points[p, 0], x1 - points[p, 1], x2 - points[p, 2]
                squared = d0 * d0 + d1 * d1 + d2 * d2
                if squared < smallest:
                    smallest, vertex = squared, p
        rows[i] = vertex
        distances[i] = math.sqrt(smallest)
    return rows, distances
