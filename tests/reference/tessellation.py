"""Nearest neighbours by a walk along edges, by its definition."""

import numpy as np


def nearest_vertex(points, edges, query, entry):
    """Vertex without a nearer neighbour, and its distance; `edges` are lists of neighbours."""
    vertex = entry
    while True:
        ring = [vertex, *edges[vertex]]
        best = min(ring, key=lambda p: np.linalg.norm(points[p] - query))
        if np.linalg.norm(points[best] - query) >= np.linalg.norm(points[vertex] - query):
            return vertex, np.linalg.norm(points[vertex] - query)
        vertex = best
