"""Nearest points by a walk over edges, as the words say it."""

import numpy as np


def nearest_vertex(points, edges, query, entry):
    """The vertex where no neighbour is nearer; `edges` maps a vertex to its neighbours."""
    vertex = entry
    while True:
        ring = [vertex, *edges[vertex]]
        best = min(ring, key=lambda p: np.linalg.norm(points[p] - query))
        if np.linalg.norm(points[best] - query) >= np.linalg.norm(points[vertex] - query):
            return vertex, np.linalg.norm(points[vertex] - query)
        vertex = best
