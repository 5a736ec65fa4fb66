"""Sums over the points near places, place by place."""

import numpy as np


def sums_near(points, probes, radius):
    """Counts, sums and upper triangles of products of the offsets of points within a radius."""
    rows = []
    for probe in probes:
        offsets = points - probe
        near = offsets[(offsets**2).sum(axis=1) < radius**2]
        products = near.T @ near
        rows.append([len(near), *near.sum(axis=0), *products[np.triu_indices(3)]])
    return np.array(rows).reshape(-1, 10)
