"""Sums over the neighbours of query points by definition, one query point at a time."""

import numpy as np


def sums_within_radius(points, query_points, radius):
    """Counts, sums and upper triangles of products of the offsets of points within a radius."""
    rows = []
    for query in query_points:
        offsets = points - query
        near = offsets[(offsets**2).sum(axis=1) < radius**2]
        products = near.T @ near
        rows.append([len(near), *near.sum(axis=0), *products[np.triu_indices(3)]])
    return np.array(rows).reshape(-1, 10)
